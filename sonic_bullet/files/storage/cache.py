"""Cache of computed arrays on disk, under a hash of their inputs, and how much of it is kept.

    KIND-sha256(numbers, options, source text that computes it) -> KEY.npz in SONIC_BULLET_CACHE, or the user's cache
        folder; its time of modification is set at every use
    over the limit? least recently used files go first; models that logs refer to go last, for nothing computes them
        anew

Files are written atomically. A cut, foreign or damaged file is a miss: it is computed anew and replaced. Nothing is
pickled. Another process may remove any entry at any time: a file that has gone is no error. The user's cache folder is
private (`sonic_bullet.files.storage.user_folder`). Where it cannot be had or written, a temporary folder takes its
place while bodies are solved, so that two processes share what they compute; then nothing is kept.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec

from sonic_bullet.files.storage.container import read_container, write_container
from sonic_bullet.files.storage.user_folder import add_note, cache_folder, start_folder
from sonic_bullet.machine.leftovers import temporary_folder
from sonic_bullet.records import Array
from sonic_bullet.records.errors import FileError, LogError

Place = Path | Literal["default"] | None
CACHE_FORMAT = "sonic-bullet-cache/2"


LIMIT_VARIABLE = "SONIC_BULLET_CACHE_LIMIT"
OF_LOGS = "models of logs"
ENTRY_KINDS = {"radiation": "radiation", "model": OF_LOGS}
"""Kind of an entry by the first word of its name; all others are modes, and what they are made of."""


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
    return start_folder / given if given else cache_folder("modal")


_meanwhile: list[Path] = []
"""The temporary folder in the place of the default one, where there is one."""


@contextmanager
def kept_meanwhile() -> Iterator[None]:
    """Keep entries in a temporary folder within the block, where the default one cannot be had or written."""
    with ExitStack() as stack:
        if not _is_writable(folder("default")):
            with suppress(OSError):  # no temporary folder either: one process after the other
                _meanwhile.append(stack.enter_context(temporary_folder()))
                stack.callback(_meanwhile.clear)
        yield


def _is_writable(where: Path | None) -> bool:
    """Tell whether a folder is there, or could be made, and can be written; note why not."""
    if where is None:
        return False
    try:
        where.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        add_note(f"{where}: {error.strerror or error}")
        return False
    if not os.access(where, os.W_OK | os.X_OK):
        add_note(f"{where} cannot be written")
        return False
    return True


def folders(place: Place) -> list[Path]:
    """List where entries may lie: the folder, then what takes its place."""
    own = folder(place)
    return [*([] if own is None else [own]), *(_meanwhile if place == "default" else [])]


def holds(place: Place, name: str) -> bool:
    """Tell whether there is an entry of that name, valid or not."""
    return any((at / f"{name}.npz").is_file() for at in folders(place))


def load(place: Place, name: str) -> tuple[dict[str, Array], str] | None:
    """Return arrays and note of the entry ``name``, or None where no entry can be read."""
    for where in folders(place):
        path = where / f"{name}.npz"
        try:
            header, arrays = read_container(path, _Header, CACHE_FORMAT, "cached model")
        except (FileError, LogError):
            continue
        touch(path)
        return arrays, header.note
    return None


def save(place: Place, name: str, arrays: dict[str, Array], note: str) -> None:
    """Store arrays and note under ``name``; where that fails, it is noted (`user_folder.notes`).

    Raises
    ------
    FileError
        SONIC_BULLET_CACHE_LIMIT is not a size.
    """
    for where in folders(place):
        try:
            where.mkdir(mode=0o700, parents=True, exist_ok=True)
            write_container(where / f"{name}.npz", _Header(CACHE_FORMAT, note), arrays)
        except (OSError, FileError) as error:
            add_note(f"{where}: {getattr(error, 'strerror', None) or error}")
            continue
        bound(where)
        return


def bound(where: Path) -> None:
    """Remove the entries unused for longest, where the cache is over its limit.

    Raises
    ------
    FileError
        SONIC_BULLET_CACHE_LIMIT is not a size.
    """
    evict_files(list_models(where), limit_bytes())


class KeptFile(NamedTuple):
    """A cached file. used_s: when it was last used, in s since 1970."""

    path: Path
    kind: str
    size_bytes: int
    used_s: float


def as_bytes(size: str, name: str) -> int:
    """Parse a size, such as 500MB, 1.5GiB or 0. Raises FileError."""
    size_pattern = re.compile(r"(\d+(?:\.\d+)?) *([kMGT]?)(i?)B?", re.IGNORECASE)
    found = size_pattern.fullmatch(size.strip())
    if found is None:
        raise FileError(f"{name} is '{size}', which is no size", "give one such as 500MB, 2GB or 0")
    number, letter, binary = found.groups()
    return int(float(number) * (1024 if binary else 1000) ** " kmgt".index(letter.lower() or " "))


def limit_bytes() -> int:
    """Return how much may be cached: SONIC_BULLET_CACHE_LIMIT, else 2 GB. Raises FileError."""
    default_limit_bytes = 2 * 10**9  # of modes: 5 to 10 MB for a body; hundreds of bodies
    given = os.environ.get(LIMIT_VARIABLE)
    return as_bytes(given, LIMIT_VARIABLE) if given else default_limit_bytes


def list_models(folder: Path) -> list[KeptFile]:
    """List the computed models in a folder."""
    entry_name = re.compile(r"([a-z]+)-[0-9a-f]{64}\.npz")
    return [
        KeptFile(path, ENTRY_KINDS.get(found[1], "modes"), size, used)
        for path, size, used in _files(folder)
        if (found := entry_name.fullmatch(path.name))
    ]


def touch(path: Path) -> None:
    """Record that a file was used now, where possible."""
    with suppress(OSError):
        os.utime(path)


def evict_files(files: Iterable[KeptFile], most_bytes: int) -> list[KeptFile]:
    """Remove files until the rest has ``most_bytes`` at most. Returns those removed."""
    listed = sorted(files, key=lambda one: (one.kind == OF_LOGS, one.used_s, one.path.name))
    excess, removed = sum(one.size_bytes for one in listed) - most_bytes, []
    for one in listed:
        if excess <= 0:
            break
        with suppress(OSError):
            one.path.unlink(missing_ok=True)
            removed.append(one)
            excess -= one.size_bytes
    return removed


def _files(folder: Path) -> Iterator[tuple[Path, int, float]]:
    """Yield path, size and time of modification of each regular file."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            with suppress(OSError):
                if entry.is_file(follow_symlinks=False):
                    status = entry.stat(follow_symlinks=False)
                    yield Path(entry.path), status.st_size, status.st_mtime
