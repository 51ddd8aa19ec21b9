"""What was computed once, kept on disk under the name of what it was computed from.

    sha256(numbers, options, source text that computes it) -> KEY.npz in SONIC_BULLET_CACHE, or the user's cache folder

A file is written beside its name and moved there whole; a cut, foreign or unreadable file is a miss, and so is what is no file. Nothing is pickled.
The user's cache folder is private (`sonic_bullet.machine.user_folder`); without a home nothing is kept.
"""

from __future__ import annotations

import hashlib
import os
import stat
from contextlib import suppress
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from sonic_bullet.machine.user_folder import START, cache_folder
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError, LogError

Place = Path | Literal["default"] | None
FORMAT = "sonic-bullet-cache/1"
SOLVERS = ("numpy", "scipy", "scikit-fem", "pytetwild", "manifold3d")


class _Header(msgspec.Struct):
    format: str
    note: str


def folder(place: Place) -> Path | None:
    """The cache's folder: ``place``, or for "default" SONIC_BULLET_CACHE or the user's cache folder; None for no cache."""
    if place is None:
        return None
    if place != "default":
        return Path(place)
    given = os.environ.get("SONIC_BULLET_CACHE")
    return START / given if given else cache_folder("modal")


@lru_cache(maxsize=4)
def code_digest(files: tuple[Path, ...], packages: tuple[str, ...]) -> bytes:
    """Digest of what computes a result: source files and the versions of packages."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    for name in packages:
        with suppress(PackageNotFoundError):
            digest.update(f"{name} {version(name)}".encode())
    return digest.digest()


def _code() -> bytes:
    """Digest of all that turns a surface into modes: this room's source, the geometry below it, the solvers' versions."""
    here = Path(__file__).resolve().parent
    return code_digest((*sorted(here.rglob("*.py")), *sorted((here.parent / "geometry").glob("*.py"))), SOLVERS)


def key(kind: str, *parts: Array | str | float | int | None, code: bytes | None = None) -> str:
    """Name of a result: ``kind`` and a digest of the parts (arrays by dtype, shape and bytes) and of the code, by default this room's."""
    digest = hashlib.sha256(_code() if code is None else code)
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype.str}{part.shape}".encode() + np.ascontiguousarray(part).tobytes())
        else:
            digest.update(repr(part).encode())
        digest.update(b"\0")
    return f"{kind}-{digest.hexdigest()}"


def load(place: Place, name: str) -> tuple[dict[str, Array], str] | None:
    """Arrays and note kept under ``name``, or None."""
    from sonic_bullet.files.container import read_container

    where = folder(place)
    if where is None or not _is_file(where / f"{name}.npz"):
        return None
    try:
        header, arrays = read_container(where / f"{name}.npz", _Header, FORMAT, "cached model")
    except (FileError, LogError):
        return None
    return arrays, header.note


def _is_file(path: Path) -> bool:
    """A regular file stands there: a pipe would be waited for, for ever."""
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except (OSError, ValueError):
        return False


def save(place: Place, name: str, arrays: dict[str, Array], note: str) -> None:
    """Keep arrays and note under ``name``; a full or read-only disk costs the next run time, not this one its result."""
    from sonic_bullet.files.container import write_container

    where = folder(place)
    if where is None:
        return
    with suppress(OSError, FileError):
        where.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_container(where / f"{name}.npz", _Header(FORMAT, note), arrays)
