"""Files that are written whole: under a name stands either the old file or the whole new one.

    check_output: tries, before anything is computed, whether a file of that name can be made
    replacing: sweep the folder -> create (O_EXCL) -> flock -> still linked? -> write -> fsync -> os.replace -> NAME
    replacing_folder: the same of a folder, which is never seen half

The last of two writers of one name wins, and they never mix (POSIX rename(2)). An unfinished file is hidden, by a name
of the same length whatever it will become, so a NAME as long as the file system takes is written too. Its lock is the
file's own (flock(2)): it ends with the process, however that ends. A writer first removes what is left of killed runs
in its folder: regular files of exactly this pattern whose lock is free. Creating and sweeping do not race: the sweeper
removes a file only while it holds its lock, and a writer that then finds its file locked or without a name takes
another. Where a file system has no locks nothing is swept.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from sonic_bullet.machine.leftovers import note_leftover
from sonic_bullet.records.errors import FileError, SonicBulletError

try:
    import fcntl
except ImportError:  # Windows: nothing is locked there, and nothing swept
    fcntl = None  # type: ignore[assignment]

PARTIAL_NAME = re.compile(r"\.?sonic-bullet-[0-9a-f]{16}\.partial")
OPEN_FLAGS = os.O_RDWR | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)


class PartialFile:
    """A new, empty, locked file in ``folder``.

    `replace` gives it its name, `close` removes it where it has none. fd: open for reading and writing, as long as this
    object is. Raises OSError.
    """

    def __init__(self, folder: Path) -> None:
        sweep(folder)
        while True:
            self.path = folder / f".sonic-bullet-{secrets.token_hex(8)}.partial"
            note_leftover(self.path.absolute())
            self.fd = os.open(self.path, OPEN_FLAGS | os.O_CREAT | os.O_EXCL, 0o666)
            if _lock(self.fd) is not False and os.fstat(self.fd).st_nlink:
                return
            self.close()  # a sweeper was quicker: between creation and lock the file looks like a killed run's

    def replace(self, target: Path) -> None:
        """Write all bytes to the disk, then put the file in the place of ``target``. Raises OSError."""
        os.fsync(self.fd)
        if os.name == "nt":  # Windows renames no open file
            self._shut()
        os.replace(self.path, target)

    def refusal(self) -> OSError | None:
        """Return why the disk takes no more, None where it does.

        It writes more at the end and removes it again.
        """
        probe_bytes = 1 << 20  # more than any writer here writes at once
        size = os.lseek(self.fd, 0, os.SEEK_END)
        try:
            left = bytes(probe_bytes)
            while left:
                left = left[os.write(self.fd, left) :]
            os.fsync(self.fd)
        except OSError as error:
            return error
        finally:
            with suppress(OSError):
                os.ftruncate(self.fd, size)
        return None

    def close(self) -> None:
        """Remove the file, if it has not got its name, and release the lock. A second call does nothing."""
        self._shut()
        with suppress(OSError):
            self.path.unlink(missing_ok=True)

    def _shut(self) -> None:
        if self.fd >= 0:
            fd, self.fd = self.fd, -1
            os.close(fd)


def sweep(folder: Path) -> None:
    """Remove unfinished files of killed runs in ``folder``; locked files and all others stay."""
    if fcntl is None:
        return
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if PARTIAL_NAME.fullmatch(entry.name) and entry.is_file(follow_symlinks=False):
                _remove_if_free(Path(entry.path))


def _remove_if_free(path: Path) -> None:
    with suppress(OSError):
        fd = os.open(path, OPEN_FLAGS)
        try:
            if _lock(fd):
                path.unlink()
        finally:
            os.close(fd)


def _lock(fd: int) -> bool | None:
    """Try to lock. True: locked. False: another holds the lock. None: there are no locks here."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


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
def replace_file(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
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


@contextmanager
def replacing_folder(to: Path) -> Iterator[Path]:
    """Make a folder that replaces ``to`` when the block ends without an error, and is removed with one.

    Raises
    ------
    FileError
        The folder cannot be written.
    """
    partial = to.with_name(f".{to.name}.partial")
    try:
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir()
        yield partial
        if to.is_dir():
            shutil.rmtree(to)
        partial.replace(to)
    except OSError as error:
        raise cannot("write", to, error) from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


@contextmanager
def write_errors(path: Path) -> Iterator[None]:
    """Convert errors of writing to a path, or of making a folder there, to a FileError."""
    try:
        yield
    except OSError as error:
        raise cannot("write", path, error) from error
