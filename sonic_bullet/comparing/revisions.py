"""A scene's files at a git revision: a worktree beside the repository's own, gone afterwards.

The package that is installed renders both, so what differs is what the revision's files say.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sonic_bullet.records.coerce import shown
from sonic_bullet.records.errors import CompareError


@contextmanager
def at_revision(path: str, revision: str) -> Iterator[str]:
    """The same file or folder as it was at that revision, while this lasts. Raises CompareError: no git, no such
    revision, not in it.
    """
    place = Path(path).resolve()
    folder = place if place.is_dir() else place.parent
    if not folder.is_dir():
        raise CompareError(f"no file {shown(path)}", "give a scene that is there")
    top = _git(folder, "rev-parse", "--show-toplevel", error=f"{shown(path)} lies in no git repository")
    commit = _git(
        folder, "rev-parse", "--verify", "--quiet", "--end-of-options", f"{revision}^{{commit}}",
        error=f"there is no revision {shown(revision)} in {top}",
    )  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="sonic-bullet-") as made:
        tree = Path(made) / "tree"
        _git(folder, "worktree", "add", "--quiet", "--detach", str(tree), commit, error="git makes no worktree")
        try:
            there = tree / place.relative_to(Path(top).resolve())
            if not there.exists():
                raise CompareError(f"{shown(path)} is not in revision {shown(revision)}", "give one that has it")
            yield str(there)
        finally:
            _git(folder, "worktree", "remove", "--force", str(tree), error="")


def _git(folder: Path, *words: str, error: str) -> str:
    try:
        done = subprocess.run(["git", "-C", str(folder), *words], check=False, capture_output=True, text=True)
    except OSError:
        raise CompareError("git cannot be run", "install it, or give both scenes") from None
    if done.returncode and error:
        why = done.stderr.strip().splitlines()
        raise CompareError(error, why[-1][:200] if why else "see 'git log'")
    return done.stdout.strip()


def head(folder: Path) -> str:
    """The commit that is checked out there; "": none is known."""
    try:
        return _git(folder, "rev-parse", "HEAD", error="none")
    except CompareError:
        return ""


def changed_files(folder: Path) -> bool:
    """Whether anything in that folder is other than in its commit, or there is none."""
    try:
        return bool(_git(folder, "status", "--porcelain", "--", ".", error="none"))
    except CompareError:
        return True
