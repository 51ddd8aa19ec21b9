"""Write beside, then replace: under the final name there is either the old file or the whole new one.

    check_output: can a file of that name be made there? tried, before anything is computed
    replacing:
        partial file (locked, `sonic_bullet.machine.partial_file`) -> write -> flush -> fsync -> os.replace -> NAME

Two writers of one name never mix: each has its own partial file and the last to finish wins (POSIX rename(2)).
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from sonic_bullet.machine.partial_file import PartialFile
from sonic_bullet.records.errors import FileError, SonicBulletError

NAME_BYTES_MAX = 255  # NAME_MAX of POSIX file systems


def check_output(path: str | os.PathLike[str]) -> Path:
    """The real, absolute path (links followed) that a file called ``path`` would be written to; a file is made beside
    it and removed.

    Raises FileError where it could not be written: the folder is missing or takes no file, the name is too long or no
    Unicode, or it belongs to a folder, a device or, in a folder like /tmp, to somebody else.
    """
    target = _target(path)
    try:
        PartialFile(target.parent).close()
    except OSError as error:
        raise cannot("write", path, error) from error
    return target


def _target(path: str | os.PathLike[str]) -> Path:
    """The real path of ``path``, where its name can be one of a file. Raises FileError."""
    name = os.fspath(path)
    if not name or "\0" in name:
        raise FileError(f"{name!r} is no file name", "name a file")
    # no UTF-8: neither JSON nor a report could say where the file is
    if any("\ud800" <= letter <= "\udfff" for letter in name):
        raise FileError(f"{name!r} is no file name: it is not valid Unicode", "name a file in UTF-8")
    try:
        target = Path(os.path.realpath(name))
        folder, found = _status(target.parent), _status(target)
    except OSError as error:
        raise cannot("write", name, error) from error
    if folder is None or not stat.S_ISDIR(folder.st_mode):
        raise FileError(
            f"cannot write {name}: there is no folder {target.parent}", f"make it first: mkdir -p {target.parent}"
        )
    if found is not None and stat.S_ISDIR(found.st_mode):
        raise FileError(f"cannot write {name}: it is a folder", "name a file inside it")
    if found is not None and not stat.S_ISREG(found.st_mode):
        raise FileError(f"cannot write {name}: it is not a regular file", "name a regular file")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise FileError(f"cannot write {name}: no permission in {target.parent}", "choose a folder you may write to")
    if found is not None and folder.st_mode & stat.S_ISVTX and os.geteuid() not in (0, found.st_uid, folder.st_uid):
        raise FileError(f"cannot write {name}: it belongs to another user", "choose another name")
    return target


def _status(path: Path) -> os.stat_result | None:
    """What stands at ``path``, None for nothing. Raises OSError, where a name is too long for one."""
    try:
        return path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return None


def cannot(verb: str, path: object, error: OSError) -> FileError:
    """FileError for what the operating system said about ``path``."""
    remedies = {
        "FileNotFoundError": "check the path",
        "PermissionError": "choose a place you may use",
        "IsADirectoryError": "name a file, not a folder",
    }
    reason = "disk full" if error.errno == errno.ENOSPC else error.strerror or error
    remedy = "give a shorter name" if error.errno == errno.ENAMETOOLONG else "free space or choose another place"
    return FileError(f"cannot {verb} {path}: {reason}", remedies.get(type(error).__name__, remedy))


def kept_name(target: Path) -> Path:
    """NAME.partial.EXT beside NAME.EXT, for what an interrupted run leaves to be used; the stem is cut where the whole
    would be too long.
    """
    ending = f".partial{target.suffix}"
    stem = os.fsencode(target.stem)[: NAME_BYTES_MAX - len(os.fsencode(ending))]
    return target.with_name(stem.decode("utf-8", "ignore") + ending)


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """A binary file that takes the place of ``path`` when the block ends without an error, and vanishes with one.

    Raises FileError where the path cannot be written. A library that hides why its writes failed is asked again: the
    disk says.
    """
    target = _target(path)
    try:
        partial = PartialFile(target.parent)
    except OSError as error:
        raise cannot("write", path, error) from error
    try:
        with os.fdopen(partial.fd, "wb", closefd=False) as file:
            yield file
        partial.replace(target)
    except SonicBulletError:
        raise
    except Exception as error:
        reason = error if isinstance(error, OSError) and error.errno else partial.refusal() or error
        if isinstance(reason, OSError):
            raise cannot("write", path, reason) from error
        raise
    finally:
        partial.close()
