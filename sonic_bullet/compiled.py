"""numba's njit for every kernel of this package, its machine code kept between processes where nobody else can put any.

    @njit(...) -> kernel -> first call: kept? -> machine code
                                      no      -> compiled, kept

numba's own cache=True keeps code beside the source or in a shared folder, believes what it reads there, and ends the import where neither can
be written. Here it lies in a folder of mode 0700 that belongs to this user (NUMBA_CACHE_DIR, else the user's cache folder), each file is a
regular one, belongs to this user, and ends in the sha256 of what stands before it; anything else is a miss, and so is any error while it is
loaded. Where no such folder can be had kernels are compiled in every process.
"""

from __future__ import annotations

import hashlib
import io
import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, UserProvidedCacheLocator

from sonic_bullet.partial_file import PartialFile
from sonic_bullet.user_folder import START, cache_folder, private_folder

DIGEST_BYTES = hashlib.sha256().digest_size


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """numba.njit with these options; the machine code is kept as the module's head says."""

    def compiled(function: Callable[..., Any]) -> Any:
        kernel = numba.njit(**options)(function)
        if folder() is not None:
            with suppress(Exception):  # numba's inner parts, moved: the kernel is compiled in every process
                kernel._cache = _Cache(function)
        return kernel

    return compiled


@cache
def folder() -> Path | None:
    """Where machine code is kept; None for nowhere."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return private_folder(START / given / "sonic_bullet")
    return cache_folder("compiled")


def _checked(path: str) -> bool:
    """The file is whole, a regular file and this user's. Raises OSError."""
    fd = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(fd, "rb") as file:
        found = os.fstat(fd)
        if not stat.S_ISREG(found.st_mode) or (hasattr(os, "geteuid") and found.st_uid != os.geteuid()):
            return False
        content = file.read()
    return hashlib.sha256(content[:-DIGEST_BYTES]).digest() == content[-DIGEST_BYTES:]


class _Files(IndexDataCacheFile):  # type: ignore[misc]
    """numba's files, each with its digest behind it, where numba's reader, which stops at the end of its data, does not look."""

    def _load_index(self) -> Any:
        try:
            return super()._load_index() if _checked(self._index_path) else {}
        except Exception:
            return {}

    def _load_data(self, name: str) -> Any:
        if not _checked(self._data_path(name)):
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


class _Locator(UserProvidedCacheLocator):  # type: ignore[misc]
    """A folder of `folder` for each folder of sources."""

    def __init__(self, function: Any, source: str) -> None:
        self._py_file, self._lineno = source, function.__code__.co_firstlineno
        self._cache_path = str((folder() or Path()) / self.get_suitable_cache_subpath(source))

    @classmethod
    def from_function(cls, function: Any, source: str) -> _Locator:
        return cls(function, source)

    def ensure_cache_path(self) -> None:
        os.makedirs(self._cache_path, mode=0o700, exist_ok=True)


class _Implementation(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes: ClassVar[list[type]] = [_Locator]


class _Cache(FunctionCache):  # type: ignore[misc]
    """numba's cache of one kernel: whatever goes wrong with it costs time, never the result."""

    _impl_class = _Implementation

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        if not isinstance(self._impl.locator, _Locator):  # NUMBA_CACHE_LOCATOR_CLASSES names another
            raise TypeError("another locator")
        self._cache_file: Any = _Files(self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception:
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        with suppress(Exception):
            super().save_overload(sig, data)
