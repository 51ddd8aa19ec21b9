"""Cache of one numba kernel in a private folder.

    index (signature -> file) | machine code, each: numba's bytes, written to a temporary file and renamed

It uses inner parts of numba, and `sonic_bullet.machine.compiled` does without where they moved. numba unpickles what it
finds, so the folder must be this user's alone (`sonic_bullet.storage.user_folder`). An error while code is loaded is a
miss, one while it is kept costs the next run time. Code is of the sources it was compiled from, and those are several
files: `source_stamp`.
"""

from __future__ import annotations

import hashlib
import re
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.core.runtime import rtsys


class KeptFiles(IndexDataCacheFile):  # type: ignore[misc]
    """numba's files; an index that cannot be read is an empty one."""

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except Exception:
            return {}


@cache
def source_stamp(source: Path) -> str:
    """Digest a module and all modules of its own tree that it imports, directly or not.

    What it calls, and the numbers that it reads, are in its machine code too.
    """
    digest, seen, todo = hashlib.sha256(), {source}, [source]
    while todo:
        content, others = _read(todo.pop())
        digest.update(hashlib.sha256(content).digest())
        todo += sorted(others - seen)
        seen |= others
    return digest.hexdigest()


@cache
def _read(source: Path) -> tuple[bytes, frozenset[Path]]:
    """Return a module's text, and the files of its top-level imports from the tree it stands in."""
    root, content = source.parent, source.read_bytes()
    while (root / "__init__.py").exists():
        root = root.parent
    found = set()
    import_line = re.compile(rb"^(?:from|import) +([\w.]+)(?: +import +(\([^)]*\)|[^\n]*))?", re.MULTILINE)
    word_pattern = re.compile(rb"\w+")
    for name, names in import_line.findall(content):
        place = root.joinpath(*name.decode().split("."))
        ends = [place, *(place / one.decode() for one in word_pattern.findall(names))]
        found |= {path for end in ends for path in (end.with_suffix(".py"), end / "__init__.py") if path.exists()}
    return content, frozenset(found)


class _Locator:
    """Locator for numba: where a kernel's files lie, and what they were compiled from."""

    def __init__(self, place: Path, function: Any) -> None:
        source = Path(function.__code__.co_filename).resolve()
        self._py_file, self._line = str(source), function.__code__.co_firstlineno
        self._path = place / f"{source.parent.name}_{hashlib.sha256(bytes(source.parent)).hexdigest()[:32]}"

    def get_cache_path(self) -> str:
        """Return the folder of the kernel's files."""
        return str(self._path)

    def get_source_stamp(self) -> str:
        """Return the digest of the sources."""
        return source_stamp(Path(self._py_file))

    def get_disambiguator(self) -> str:
        """Return the kernel's line number."""
        return str(self._line)

    def ensure_cache_path(self) -> None:
        """Make the folder."""
        self._path.mkdir(mode=0o700, exist_ok=True)


class _Place:
    """Replacement of numba's list of locators."""

    def __init__(self, place: Path) -> None:
        self._place = place

    def from_function(self, function: Any, source: str) -> _Locator:
        """Return the locator of a function."""
        return _Locator(self._place, function)


class _Implementation(CompileResultCacheImpl):  # type: ignore[misc]
    def __init__(self, place: Path, function: Any) -> None:
        self._locator_classes = [_Place(place)]
        super().__init__(function)


class KernelCache(FunctionCache):  # type: ignore[misc]
    """numba's cache of one kernel, below ``place``: its failures cost time, never the result.

    Raises whatever numba's inner parts raise where they have changed.
    """

    def __init__(self, function: Any, place: Path) -> None:
        self._impl_class = lambda kernel: _Implementation(place, kernel)
        super().__init__(function)
        locator = self._impl.locator
        if not isinstance(locator, _Locator):  # NUMBA_CACHE_LOCATOR_CLASSES names another, that is not private
            raise TypeError("another locator")
        self._cache_file: Any = KeptFiles(
            locator.get_cache_path(), self._impl.filename_base, locator.get_source_stamp()
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load the kept code for a signature, None for a miss."""
        try:
            return self._loaded(sig, target_context)
        except Exception:
            return None

    def _loaded(self, sig: Any, target_context: Any) -> Any:
        # enough to run code; what is needed to write it takes 0.3 s to import, and is imported then
        rtsys.initialize(target_context)
        return self._load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code for a signature, where possible."""
        with suppress(Exception):
            super().save_overload(sig, data)
