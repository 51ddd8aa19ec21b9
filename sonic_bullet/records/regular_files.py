"""Paths that lead to regular files: no pipe, which would be waited for, no device, no folder."""

from __future__ import annotations

import os
import stat

from sonic_bullet.records.errors import FileError


def check_regular(path: str | os.PathLike[str], remedy: str = "") -> None:
    """Raise FileError where a path leads to something that is no regular file, which could be waited for for ever.

    Nothing at all there is left to whoever opens it, except where a remedy is given.
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        if remedy:
            raise FileError(f"cannot read {os.fspath(path)}: no such file", remedy) from None
        return
    if stat.S_ISDIR(mode):
        raise FileError(f"cannot read {os.fspath(path)}: it is a folder", remedy or "name a file inside it")
    if not stat.S_ISREG(mode):
        raise FileError(f"cannot read {os.fspath(path)}: it is not a regular file", remedy or "name a regular file")
