"""Unfinished files: under a temporary name, locked, and removed by the next writer where their own writer was killed.

    sweep the folder -> create (O_EXCL) -> flock -> still linked? -> write -> fsync -> os.replace -> NAME

The name is the same length whatever it will become, so a NAME as long as the file system takes is written too. The lock
is the file's own (flock(2)): it ends with the process, however that ends. A writer first removes what is left of killed
runs in its folder: regular files of exactly this pattern, of this user, whose lock is free. Creating and sweeping do
not race: the sweeper removes a file only while it holds its lock, and a writer that then finds its file locked or
without a name takes another. Where a file system has no locks nothing is swept.
"""

from __future__ import annotations

import os
import re
import secrets
import stat
from contextlib import suppress
from pathlib import Path

from sonic_bullet.machine.worker import note_leftover

try:
    import fcntl
except ImportError:  # Windows: nothing is locked there, and nothing swept
    fcntl = None  # type: ignore[assignment]

PARTIAL_NAME = re.compile(r"sonic-bullet-[0-9a-f]{16}\.partial")
OPEN_FLAGS = os.O_RDWR | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)


class PartialFile:
    """A new, empty, locked file in ``folder``.

    `replace` gives it its name, `close` removes it where it has none. fd: open for reading and writing, as long as this
    object is. Raises OSError.
    """

    def __init__(self, folder: Path) -> None:
        sweep(folder)
        while True:
            self.path = folder / f"sonic-bullet-{secrets.token_hex(8)}.partial"
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
    """Remove unfinished files of this user's killed runs in ``folder``; locked files and all others stay."""
    if fcntl is None:
        return
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if PARTIAL_NAME.fullmatch(entry.name) and entry.is_file(follow_symlinks=False):
                _remove_if_free(Path(entry.path))


def _remove_if_free(path: Path) -> None:
    with suppress(OSError):
        fd = os.open(path, OPEN_FLAGS | os.O_NONBLOCK)
        try:
            found = os.fstat(fd)
            ours = stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid()
            if ours and _lock(fd) and os.path.samestat(found, os.lstat(path)):
                os.unlink(path)
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
