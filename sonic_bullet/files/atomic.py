"""Write beside, then replace: under the final name there is either the old file or the whole new one.

    NAME.<random>.partial -> write -> flush -> fsync -> os.replace -> NAME

Two writers of one name never mix: each has its own temporary file and the last to finish wins (POSIX rename(2)).
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from sonic_bullet.records.errors import FileError


def check_output(path: str | os.PathLike[str]) -> Path:
    """The real path (links followed) that a file called ``path`` would be written to.

    Raises FileError where it could not: the folder is missing or not writable, or the name belongs to a folder or a device.
    """
    name = os.fspath(path)
    if not name or "\0" in name:
        raise FileError(f"{name!r} is no file name", "name a file")
    target = Path(os.path.realpath(name))
    try:
        if target.is_dir():
            raise FileError(f"cannot write {name}: it is a folder", "name a file inside it")
        if target.exists() and not target.is_file():
            raise FileError(f"cannot write {name}: it is not a regular file", "name a regular file")
        if not target.parent.is_dir():
            raise FileError(f"cannot write {name}: there is no folder {target.parent}", f"make it first: mkdir -p {target.parent}")
        if not os.access(target.parent, os.W_OK | os.X_OK):
            raise FileError(f"cannot write {name}: no permission in {target.parent}", "choose a folder you may write to")
    except OSError as error:
        raise cannot("write", name, error) from error
    return target


def cannot(verb: str, path: object, error: OSError) -> FileError:
    """FileError for what the operating system said about ``path``."""
    remedies = {
        "FileNotFoundError": "check the path",
        "PermissionError": "choose a place you may use",
        "IsADirectoryError": "name a file, not a folder",
    }
    return FileError(f"cannot {verb} {path}: {error.strerror or error}", remedies.get(type(error).__name__, "free space or choose another place"))


def sync(path: Path) -> None:
    """Bring a closed file's bytes to the disk. Raises OSError."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """A binary file that takes the place of ``path`` when the block ends without an error, and vanishes with one.

    Raises FileError where the path cannot be written.
    """
    target = check_output(path)
    partial = target.with_name(f"{target.name}.{secrets.token_hex(4)}.partial")
    try:
        try:
            with partial.open("xb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            os.replace(partial, target)
        except OSError as error:
            raise cannot("write", path, error) from error
    except BaseException:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise
