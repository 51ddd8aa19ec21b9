"""Write to a partial file, then replace: the final name holds either the old file or the whole new one.

    check_output: tries, before anything is computed, whether a file of that name can be made
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


def check_output(path: str | os.PathLike[str]) -> Path:
    """Return the real, absolute path (links followed) of an output file, after a trial file in its folder.

    Raises
    ------
    FileError
        The file cannot be written: the folder is missing or takes no file, the name is too long or not Unicode, or it
        is that of a folder, a device or, in a folder like /tmp, another user's file.
    """
    target = _target(path)
    try:
        PartialFile(target.parent).close()
    except OSError as error:
        raise cannot("write", path, error) from error
    return target


def _target(path: str | os.PathLike[str]) -> Path:
    """Return the real path of ``path``; FileError where it cannot be that of a file."""
    name = os.fspath(path)
    if not name or "\0" in name:
        raise FileError(f"{name!r} is no file name", "name a file")
    # not UTF-8: neither JSON nor a report could name the file
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
    """Return the status of ``path``, None where nothing is there; OSError, where a name is too long."""
    try:
        return path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return None


def cannot(verb: str, path: object, error: OSError) -> FileError:
    """Make the FileError of an operating system's error about ``path``."""
    remedies = {
        "FileNotFoundError": "check the path",
        "PermissionError": "choose a place you may use",
        "IsADirectoryError": "name a file, not a folder",
    }
    reason = "disk full" if error.errno == errno.ENOSPC else error.strerror or error
    remedy = "give a shorter name" if error.errno == errno.ENAMETOOLONG else "free space or choose another place"
    return FileError(f"cannot {verb} {path}: {reason}", remedies.get(type(error).__name__, remedy))


def kept_name(target: Path) -> Path:
    """Return NAME.partial.EXT for NAME.EXT, the file of an interrupted run; a stem that is too long is cut."""
    name_bytes_max = 255  # NAME_MAX of POSIX file systems
    ending = f".partial{target.suffix}"
    stem = os.fsencode(target.stem)[: name_bytes_max - len(os.fsencode(ending))]
    return target.with_name(stem.decode("utf-8", "ignore") + ending)


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a binary file that replaces ``path`` when the block ends without an error, and is removed with one.

    Where a library hides why its writes failed, the disk is tested again for the reason.

    Raises
    ------
    FileError
        The path cannot be written.
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
