"""The boundary of every reader: what a foreign file makes a parser throw leaves as one error of ours.

    first bytes -> those of a Git LFS pointer, which stands where a large file should -> kind("PATH …", "git lfs pull")
    open, zip, npy, JSON, libsndfile, trimesh -> any exception -> kind("PATH …", remedy), at most 200 characters of it
        the file's own

A lie about a size is no matter for this boundary: MemoryError passes, and readers compare claims with a file's true
length first.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from sonic_bullet.files.atomic import cannot
from sonic_bullet.records.errors import FileError, SonicBulletError, excerpt

# characters that may be a file's own: in all; of what is wrong and of the remedy, where it would be more
QUOTED, WHAT, REMEDY = 200, 120, 80
LFS_POINTER = b"version https://git-lfs.github.com/spec/"  # how every pointer begins, by Git LFS's specification


@contextmanager
def reading(path: str | os.PathLike[str], thing: str, kind: type[SonicBulletError], remedy: str) -> Iterator[None]:
    """Raises FileError where the system cannot read ``path``, else ``kind``, naming the path.

    thing: what should be there, in words.
    """
    try:
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
        raise kind(f"{path} is cut or no {thing} ({excerpt(reason, WHAT)})", remedy) from error


def refuse_lfs_pointer(path: str | os.PathLike[str], kind: type[SonicBulletError] = FileError) -> None:
    """Raises ``kind`` where a file is the pointer that Git LFS leaves in place of a large one."""
    try:
        if not os.path.isfile(path):  # a pipe would be read empty
            return
        with open(path, "rb") as file:
            first = file.read(len(LFS_POINTER))
    except (OSError, ValueError):  # whoever reads it says what is wrong
        return
    if first == LFS_POINTER:
        raise kind(f"{path} is a Git LFS pointer, not the file itself", "run git lfs pull where it came from")


def _with_path(error: SonicBulletError, path: str, kind: type[SonicBulletError]) -> SonicBulletError | None:
    """The error as ``kind``, with the path and no more of the file than is allowed; None where it is all that
    already.
    """
    # every text has the empty name in it
    before, named, after = error.what.partition(path) if path else (error.what, " ", "")
    if named and type(error) is kind and len(before) + len(after) + len(error.remedy) <= QUOTED:
        return None
    if not named:
        before, after = "", f": {error.what}"
    short = len(before) + len(after) <= WHAT or len(before) + len(after) + len(error.remedy) <= QUOTED
    what = (
        f"{before}{path}{after}"
        if short
        else f"{excerpt(before, WHAT // 2)}{path}{excerpt(after, WHAT // 2 if before else WHAT)}"
    )
    return kind(
        what,
        error.remedy
        if len(error.remedy) <= max(REMEDY, QUOTED - len(before) - len(after))
        else excerpt(error.remedy, REMEDY),
    )
