"""A cache for one numba kernel in a folder of this user's own; it stands on inner parts of numba, and
`sonic_bullet.machine.compiled` does without where they moved.

    index (signature -> file) | machine code, each: numba's bytes + their sha256, written beside and replaced

numba's own reader believes what it finds, and unpickles it. Here a file is opened only where it is a regular one of
this user, and read only where the digest behind it is right; anything else is a miss, and so is any error while it is
loaded or kept.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.core.runtime import rtsys

from sonic_bullet.machine.partial_file import PartialFile

DIGEST_BYTES = hashlib.sha256().digest_size
OPEN_FLAGS = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)

IMPORT = re.compile(r"^from ([\w.]+) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


def _as_written(path: str) -> bool:
    """The file is a regular one, this user's, and whole. Raises OSError."""
    fd = os.open(path, OPEN_FLAGS)
    with os.fdopen(fd, "rb") as file:
        found = os.fstat(fd)
        if not stat.S_ISREG(found.st_mode) or (hasattr(os, "geteuid") and found.st_uid != os.geteuid()):
            return False
        content = file.read()
    return hashlib.sha256(content[:-DIGEST_BYTES]).digest() == content[-DIGEST_BYTES:]


class KeptFiles(IndexDataCacheFile):  # type: ignore[misc]
    """numba's files, each with its digest behind it, where numba's reader, which stops at the end of its data, does not
    look.
    """

    def _load_index(self) -> Any:
        try:
            return super()._load_index() if _as_written(self._index_path) else {}
        except Exception:
            return {}

    def _load_data(self, name: str) -> Any:
        if not _as_written(self._data_path(name)):
            raise OSError("not as it was written")  # which numba takes for a miss
        return super()._load_data(name)

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[io.BytesIO]:
        content = io.BytesIO()
        yield content
        whole = content.getvalue()
        partial = PartialFile(Path(filepath).parent)
        try:
            with os.fdopen(partial.fd, "wb", closefd=False) as file:
                file.write(whole + hashlib.sha256(whole).digest())
            partial.replace(Path(filepath))
        finally:
            partial.close()


@cache
def _digest(path: Path) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()


@cache
def _imported(path: Path) -> frozenset[Path]:
    """Files of its own package that a module imports as it is imported itself."""
    top = path.parent
    while (top / "__init__.py").exists():
        top = top.parent
    root = path.relative_to(top).parts[0]
    found = set()
    for module, names in IMPORT.findall(path.read_text(encoding="utf-8")) if path.parent != top else ():
        if module.partition(".")[0] == root:
            place = top.joinpath(*module.split("."))
            found |= {place.with_suffix(".py"), place / "__init__.py"}
            found |= {place / f"{name.split()[0]}.py" for name in re.split(r"[\s(),]+", names) if name}
    return frozenset(file for file in found if file.is_file())


def _sources(path: Path) -> set[Path]:
    """The file, and all that it imports of its own package, and so on."""
    known, new = {path}, {path}
    while new:
        new = set().union(*(_imported(one) for one in new)) - known
        known |= new
    return known


class _Locator:
    """What numba asks: where a kernel's files lie, and what they were compiled from."""

    def __init__(self, place: Path, function: Any) -> None:
        source = Path(function.__code__.co_filename).resolve()
        self._py_file, self._line = str(source), function.__code__.co_firstlineno
        self._path = place / f"{source.parent.name}_{hashlib.sha256(bytes(source.parent)).hexdigest()[:32]}"

    def get_cache_path(self) -> str:
        return str(self._path)

    def get_source_stamp(self) -> str:
        """Of the kernel's file and of all of its package that it imports: other kernels, constants, layouts."""
        return hashlib.sha256(b"".join(_digest(path) for path in sorted(_sources(Path(self._py_file))))).hexdigest()

    def get_disambiguator(self) -> str:
        return str(self._line)

    def ensure_cache_path(self) -> None:
        self._path.mkdir(mode=0o700, exist_ok=True)


class _Place:
    """Stands where numba keeps its list of locators."""

    def __init__(self, place: Path) -> None:
        self._place = place

    def from_function(self, function: Any, source: str) -> _Locator:
        return _Locator(self._place, function)


class _Implementation(CompileResultCacheImpl):  # type: ignore[misc]
    def __init__(self, place: Path, function: Any) -> None:
        self._locator_classes = [_Place(place)]
        super().__init__(function)


class KernelCache(FunctionCache):  # type: ignore[misc]
    """numba's cache of one kernel, below ``place``: whatever goes wrong with it costs time, never the result.

    Raises whatever numba's inner parts raise where they are not what they were.
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
        """The kept code for a signature, None for a miss."""
        try:
            return self._loaded(sig, target_context)
        except Exception:
            return None

    def _loaded(self, sig: Any, target_context: Any) -> Any:
        # all that is needed to run code; what is needed to write it takes 0.3 s to import, and is when some is written
        rtsys.initialize(target_context)
        return self._load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code for a signature, if that can be done."""
        with suppress(Exception):
            super().save_overload(sig, data)
