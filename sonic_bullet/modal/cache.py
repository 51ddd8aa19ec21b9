"""What was computed once, kept on disk under the name of what it was computed from.

    sha256(numbers, options, source text that computes it) -> KEY.npz in SONIC_BULLET_CACHE, or the user's cache folder

A file is written beside its name and moved there whole; a cut, foreign or unreadable file is a miss, and so is what is
no file, one whose content is not what its SHA-256 says, or not what was asked for: names, dtypes, shapes, finite
numbers, indices. A miss is computed anew and takes its place. Nothing is pickled. The user's cache folder is private
(`sonic_bullet.machine.user_folder`); without a home nothing is kept. Against an owner of the folder who forges the
digest too there is no defence, and none is meant.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec
import numpy as np

from sonic_bullet.machine.user_folder import START, cache_folder
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError, LogError

Place = Path | Literal["default"] | None
FORMAT = "sonic-bullet-cache/2"  # 1 had no digest: a miss
SOLVERS = ("numpy", "scipy", "scikit-fem", "netgen-mesher", "manifold3d")


class _Header(msgspec.Struct):
    format: str
    note: str
    sha256: str


class Kept(NamedTuple):
    """What an array of an entry must be. kind: "f8", "f4", "b1", or "i" for whole numbers; shape: lengths, a name for
    one that arrays share, None for any.

    below: the name of a length; the numbers are indices into it.
    """

    kind: str
    shape: tuple[int | str | None, ...]
    below: str = ""


Layout = Mapping[str, Kept]


def folder(place: Place) -> Path | None:
    """The cache's folder: ``place``, or for "default" SONIC_BULLET_CACHE or the user's cache folder; None for no
    cache.
    """
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
    """Digest of all that turns a surface into modes: this room's source, the geometry below it, the solvers'
    versions.
    """
    here = Path(__file__).resolve().parent
    return code_digest((*sorted(here.rglob("*.py")), *sorted((here.parent / "geometry").glob("*.py"))), SOLVERS)


def key(kind: str, *parts: Array | str | float | int | None, code: bytes | None = None) -> str:
    """Name of a result: ``kind`` and a digest of the parts (arrays by dtype, shape and bytes) and of the code, by
    default this room's.
    """
    digest = hashlib.sha256(_code() if code is None else code)
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype.str}{part.shape}".encode() + np.ascontiguousarray(part).tobytes())
        else:
            digest.update(repr(part).encode())
        digest.update(b"\0")
    return f"{kind}-{digest.hexdigest()}"


def holds(place: Place, name: str) -> bool:
    """Whether there is an entry of that name, sound or not."""
    at = folder(place)
    return at is not None and (at / f"{name}.npz").is_file()


def load(place: Place, name: str, layout: Layout) -> tuple[dict[str, Array], str] | None:
    """Arrays and note kept under ``name``, or None where there is no such entry, or not the one that was kept, or none
    of that layout.
    """
    from sonic_bullet.files.container import read_container

    where = folder(place)
    if where is None:
        return None
    try:
        header, arrays = read_container(where / f"{name}.npz", _Header, FORMAT, "cached model")
    except (FileError, LogError):
        return None
    if header.sha256 != _digest(name, arrays, header.note) or not _fits(arrays, layout):
        return None
    return arrays, header.note


def _digest(name: str, arrays: Mapping[str, Array], note: str) -> str:
    """SHA-256 of an entry's name and of all that it holds."""
    digest = hashlib.sha256(repr((name, note)).encode("utf-8", "replace"))
    for key in sorted(arrays):
        array = np.ascontiguousarray(arrays[key])
        digest.update(f"{key} {array.dtype.str} {arrays[key].shape}".encode("utf-8", "replace") + array.tobytes())
    return digest.hexdigest()


def _fits(arrays: Mapping[str, Array], layout: Layout) -> bool:
    if set(arrays) != set(layout):
        return False
    length: dict[str, int] = {}
    for name, kept in layout.items():
        array = arrays[name]
        if array.ndim != len(kept.shape) or (
            array.dtype.kind != "i" if kept.kind == "i" else array.dtype != np.dtype(kept.kind)
        ):
            return False
        for want, have in zip(kept.shape, array.shape, strict=True):
            if (length.setdefault(want, have) if isinstance(want, str) else want) not in (have, None):
                return False
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            return False
    indices = [(arrays[name], length[kept.below]) for name, kept in layout.items() if kept.below]
    return all(array.min(initial=0) >= 0 and array.max(initial=-1) < most for array, most in indices)


def save(place: Place, name: str, arrays: dict[str, Array], note: str) -> None:
    """Keep arrays and note under ``name``; a full or read-only disk costs the next run time, not this one its
    result.
    """
    from sonic_bullet.files.container import write_container

    where = folder(place)
    if where is None:
        return
    with suppress(OSError, FileError):
        where.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_container(where / f"{name}.npz", _Header(FORMAT, note, _digest(name, arrays, note)), arrays)
