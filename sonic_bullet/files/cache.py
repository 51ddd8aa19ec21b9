"""Cache of computed arrays on disk, under a hash of their inputs.

    KIND-sha256(numbers, options, source text that computes it) -> KEY.npz in SONIC_BULLET_CACHE, or the user's cache
        folder

Files are written atomically. A cut, foreign or damaged file is a miss: it is computed anew and replaced. Nothing is
pickled. When a save passes the limit, the entries unused for longest are removed (`sonic_bullet.machine.kept_files`),
and another process may remove any entry at any time. The user's cache folder is private
(`sonic_bullet.machine.user_folder`); without a home directory nothing is cached.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Literal

import msgspec

from sonic_bullet.files.container import read_container, write_container
from sonic_bullet.machine.kept_files import bounded, computed, limit_bytes, touch
from sonic_bullet.machine.user_folder import START_FOLDER, cache_folder
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError, LogError

Place = Path | Literal["default"] | None
CACHE_FORMAT = "sonic-bullet-cache/2"


class _Header(msgspec.Struct):
    format: str
    note: str


def folder(place: Place) -> Path | None:
    """Return the cache's folder: ``place``, or for "default" SONIC_BULLET_CACHE or the user's; None: no cache."""
    if place is None:
        return None
    if place != "default":
        return Path(place)
    given = os.environ.get("SONIC_BULLET_CACHE")
    return START_FOLDER / given if given else cache_folder("modal")


def holds(place: Place, name: str) -> bool:
    """Tell whether there is an entry of that name, valid or not."""
    at = folder(place)
    return at is not None and (at / f"{name}.npz").is_file()


def load(place: Place, name: str) -> tuple[dict[str, Array], str] | None:
    """Return arrays and note of the entry ``name``, or None where no entry can be read."""
    where = folder(place)
    if where is None:
        return None
    path = where / f"{name}.npz"
    try:
        header, arrays = read_container(path, _Header, CACHE_FORMAT, "cached model")
    except (FileError, LogError):
        return None
    touch(path)
    return arrays, header.note


def save(place: Place, name: str, arrays: dict[str, Array], note: str) -> None:
    """Store arrays and note under ``name``; a full or read-only disk is ignored.

    Raises
    ------
    FileError
        SONIC_BULLET_CACHE_LIMIT is not a size.
    """
    where = folder(place)
    if where is None:
        return
    with suppress(OSError, FileError):
        where.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_container(where / f"{name}.npz", _Header(CACHE_FORMAT, note), arrays)
    bound(where)


def bound(where: Path) -> None:
    """Remove the entries unused for longest, where the cache is over its limit.

    Raises
    ------
    FileError
        SONIC_BULLET_CACHE_LIMIT is not a size.
    """
    bounded(computed(where), limit_bytes())
