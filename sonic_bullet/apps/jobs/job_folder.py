"""The folder of many jobs' results: of one run at a time, and of one way of making them.

    ABOUT.json         what made it: whoever goes on with it asks for the same
    failures.jsonl     the jobs without a result, each with its reason

Nothing in them depends on time, order or machine.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec

from sonic_bullet.files.storage.atomic import replace_file, write_errors
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.records.errors import FileError

try:
    import fcntl
except ImportError:  # Windows has no such locks: two runs there share a folder unnoticed
    fcntl = None  # type: ignore[assignment]


@contextmanager
def open_job_folder(
    root: str | os.PathLike[str], about: str, made_by: Mapping[str, Any], *, kind: str, own: Iterable[str] = ()
) -> Iterator[Path]:
    """Open a folder for a run, a new one or one that the same settings began.

    Parameters
    ----------
    about
        Name of the file that holds the settings.
    made_by
        The settings: values of JSON.
    kind
        What the folder is, in words: "data set".
    own
        Names of files and folders that may be there without that file, of a run that was ended early.

    Raises
    ------
    FileError
        Other settings made it, another run writes it, it holds other files, or it cannot be written.
    """
    place = Path(root).absolute()
    with write_errors(place):
        place.mkdir(parents=True, exist_ok=True)
        lock = os.open(place, os.O_RDONLY) if fcntl is not None else None
    try:
        if lock is not None:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise FileError(f"another run writes {root}", "wait for its end, or give another folder") from None
        known = {about, *own}
        if (place / about).is_file():
            _check_same(root, place / about, made_by, kind)
        elif any(one.name not in known and not one.name.endswith(".partial") for one in place.iterdir()):
            raise FileError(f"{root} holds other files", "give an empty folder, or a new one")
        with replace_file(place / about) as file:
            file.write(json_bytes(dict(made_by), indent=2))
        yield place
    finally:
        if lock is not None:
            os.close(lock)


def _check_same(root: object, about: Path, made_by: Mapping[str, Any], kind: str) -> None:
    """Raise FileError where a folder was made by other settings."""
    try:
        before = msgspec.json.decode(about.read_bytes())
    except (OSError, msgspec.DecodeError):
        before = {}
    wanted = msgspec.json.decode(json_bytes(dict(made_by)))
    other = [name for name in wanted if not isinstance(before, dict) or before.get(name) != wanted[name]]
    if other:
        what = f"{root} is a {kind} of another {' and '.join(other).replace('_', ' ')}"
        raise FileError(what, "give another folder, or what it was begun with")


def append_json_line(place: Path, value: Any) -> None:
    """Append a value of JSON, a whole line or nothing; FileError where that fails.

    It is one call of the system, so a process that is killed leaves whole lines, too.
    """
    line = json_bytes(value) + b"\n"
    with write_errors(place):
        file = os.open(place, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        try:
            before = os.fstat(file).st_size
            if os.write(file, line) < len(line):
                os.ftruncate(file, before)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        finally:
            os.close(file)


def write_json_lines(place: Path, values: Iterable[Any]) -> None:
    """Write values of JSON, a line each; FileError where that fails."""
    with replace_file(place) as file:
        file.writelines(json_bytes(value) + b"\n" for value in values)
