"""Boundary of every reader: any exception of a parser becomes one error of this package.

    no regular file: a pipe, which would be waited for, a device, a folder -> FileError
    first bytes -> those of a Git LFS pointer, in place of a large file -> kind("PATH …", "git lfs pull")
    open, zip, npy, JSON, libsndfile, trimesh -> any exception -> kind("PATH …", remedy), at most 200 characters of it
        the file's own

False sizes are not handled here: MemoryError passes, and readers compare claims with a file's true length first.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from sonic_bullet.files.storage.atomic import cannot
from sonic_bullet.records.errors import FileError, SonicBulletError, excerpt
from sonic_bullet.records.regular_files import check_regular

# most characters from a file
MOST_LETTERS = 200
FAULT_LETTERS = 120  # of this and the remedy, where the whole would be more
REMEDY_LETTERS = 80


@contextmanager
def reading_file(path: str | os.PathLike[str], thing: str, kind: type[SonicBulletError], remedy: str) -> Iterator[None]:
    """Convert exceptions of the block, with the path: FileError where the system cannot read it, else ``kind``.

    thing: expected content, in words.
    """
    try:
        check_regular(path)
        refuse_lfs_pointer(path, kind)
        yield
    except SonicBulletError as error:
        renamed = _with_path(error, os.fspath(path), type(error) if isinstance(error, (kind, FileError)) else kind)
        raise (error if renamed is None else renamed) from error.__cause__
    except OSError as error:
        raise cannot("read", path, error) from error
    except MemoryError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise kind(f"{path} is cut or no {thing} ({excerpt(reason, FAULT_LETTERS)})", remedy) from error


def refuse_lfs_pointer(path: str | os.PathLike[str], kind: type[SonicBulletError] = FileError) -> None:
    """Raise ``kind`` where a file is the pointer that Git LFS leaves in place of a large one."""
    lfs_pointer = b"version https://git-lfs.github.com/spec/"  # how every pointer begins, by Git LFS's specification
    try:
        if not os.path.isfile(path):  # a pipe would be read empty
            return
        with open(path, "rb") as file:
            first = file.read(len(lfs_pointer))
    except (OSError, ValueError):  # the reader reports it
        return
    if first == lfs_pointer:
        raise kind(f"{path} is a Git LFS pointer, not the file itself", "run git lfs pull where it came from")


def _with_path(error: SonicBulletError, path: str, kind: type[SonicBulletError]) -> SonicBulletError | None:
    """Return the error as ``kind``, with the path and a limited part of the file's text; None where it already is."""
    # every text has the empty name in it
    before, named, after = error.what.partition(path) if path else (error.what, " ", "")
    if named and type(error) is kind and len(before) + len(after) + len(error.remedy) <= MOST_LETTERS:
        return None
    if not named:
        before, after = "", f": {error.what}"
    short = len(before) + len(after) <= FAULT_LETTERS or len(before) + len(after) + len(error.remedy) <= MOST_LETTERS
    what = (
        f"{before}{path}{after}"
        if short
        else f"{excerpt(before, FAULT_LETTERS // 2)}{path}"
        f"{excerpt(after, FAULT_LETTERS // 2 if before else FAULT_LETTERS)}"
    )
    return kind(
        what,
        error.remedy
        if len(error.remedy) <= max(REMEDY_LETTERS, MOST_LETTERS - len(before) - len(after))
        else excerpt(error.remedy, REMEDY_LETTERS),
    )
