"""Private cache folder of the user: no other user can write into it.

    platformdirs' cache folder / sonic_bullet, mode 0700, owner checked -> "modal" (computed models)

A computed model is trusted: it comes from a folder of this user that no other may write to. Folders above it that are
missing are made. On a disk that cannot be written, or where the folder belongs to another user, there is none: `notes`
says why, and everything is computed anew.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

notes: list[str] = []
"""Why something cannot be cached; empty where all is well."""
_reported: set[str] = set()


def unreported_note() -> str | None:
    """Return why something cannot be cached, once each; None where all is well or has been told."""
    why = next((one for one in notes if one not in _reported), None)
    if why is not None:
        _reported.update(notes)
    return why


def _start() -> Path:
    try:
        return Path.cwd()
    except OSError:  # removed meanwhile
        return Path("/")


start_folder = _start()
"""Working folder when this module was imported: a scene may change it, and relative paths of the environment mean this
one."""


def cache_folder(name: str) -> Path | None:
    """Return the folder ``name`` in the user's cache folder, made where it is missing; None where there can be none."""
    root = _root()
    return None if root is None else private_folder(root / name)


def private_folder(path: Path) -> Path | None:
    """Return ``path`` as a folder of mode 0700 that belongs to this user, None where that is impossible.

    It is made, with the folders above it, or made private.
    """
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        path.mkdir(mode=0o700, exist_ok=True)
        found = path.lstat()
        if hasattr(os, "geteuid"):
            if stat.S_ISLNK(found.st_mode) and found.st_uid == os.geteuid():  # this user's own link to another disk
                found = path.stat()
            if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid():
                add_note(f"{path} is not a folder of this user")
                return None
            if stat.S_IMODE(found.st_mode) & 0o077:
                path.chmod(0o700)
        if not os.access(path, os.W_OK | os.X_OK):
            add_note(f"{path} cannot be written")  # what it holds can be read
    except (OSError, RuntimeError) as error:
        add_note(f"{path}: {getattr(error, 'strerror', None) or error}")
        return None
    return path


def cache_folders() -> list[Path]:
    """List where computed models may lie."""
    named, root = os.environ.get("SONIC_BULLET_CACHE"), _root()
    return [*([Path(named).absolute()] if named else []), *([] if root is None else [root])]


def _root() -> Path | None:
    from platformdirs import user_cache_path

    try:
        path = user_cache_path("sonic_bullet")
    except (OSError, RuntimeError, KeyError) as error:  # a user without a name or a home
        add_note(f"this user has no home ({error})")
        return None
    if not path.is_absolute():  # "~" stays "~" for an unknown user
        add_note("this user has no home")
        return None
    return private_folder(path)


def add_note(why: str) -> None:
    """Note why something cannot be cached."""
    if why not in notes:
        notes.append(why)
