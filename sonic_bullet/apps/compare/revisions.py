"""A repository at a git revision: its whole tree in a temporary folder, removed afterwards.

    revision -> an index of its own -> git checkout-index -> TREE      the repository itself is unchanged

The installed package renders both, so that only the revision's files differ.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sonic_bullet.apps.compare.revision_tree import RevisionTree
from sonic_bullet.machine.leftovers import temporary_folder
from sonic_bullet.records.coerce import quote
from sonic_bullet.records.errors import CompareError


@contextmanager
def at_revision(path: str, revision: str) -> Iterator[tuple[str, RevisionTree]]:
    """Check out a file or folder at that revision within the block; yield it and its tree.

    Raises
    ------
    CompareError
        git or the revision is missing, or the file is not in it.
    """
    place = Path(path).resolve()
    folder = place if place.is_dir() else place.parent
    if not folder.is_dir():
        raise CompareError(f"no file {quote(path)}", "give a scene that is there")
    top = Path(_git(folder, "rev-parse", "--show-toplevel", error=f"{quote(path)} lies in no git repository")).resolve()
    commit = _git(
        folder, "rev-parse", "--verify", "--quiet", "--end-of-options", f"{revision}^{{commit}}",
        error=f"there is no revision {quote(revision)} in {top}",
    )  # fmt: skip
    with temporary_folder() as made:
        tree = made.resolve() / "tree"
        tree.mkdir()
        index = {"GIT_INDEX_FILE": str(made.resolve() / "index")}
        no_tree = "git gives no tree of that revision"
        _git(top, "read-tree", commit, error=no_tree, settings=index)
        _git(top, "checkout-index", "--all", "--quiet", f"--prefix={tree}{os.sep}", error=no_tree, settings=index)
        there = tree / place.relative_to(top)
        if not there.exists():
            raise CompareError(f"{quote(path)} is not in revision {quote(revision)}", "give one that has it")
        yield str(there), RevisionTree(top, tree, _link_untracked(top, tree, commit))


def _link_untracked(top: Path, tree: Path, commit: str) -> tuple[str, ...]:
    """Link untracked files to the tree: generated files, data, modules of other repositories."""
    listed = _git(top, "ls-files", "--others", "--directory", "--no-empty-directory", "-z", error="").split("\0")
    entries = _git(top, "ls-tree", "-r", "-z", commit, error="").split("\0")
    modules = [entry.partition("\t")[2] for entry in entries if entry.startswith("160000")]
    names = [name.rstrip("/") for name in (*listed, *modules) if name and "__pycache__" not in name.split("/")]
    for name in names:
        place, source = tree / name, top / name
        if place.is_dir() and not any(place.iterdir()):  # of a submodule
            place.rmdir()
        if not os.path.lexists(place) and source.exists():
            place.parent.mkdir(parents=True, exist_ok=True)
            place.symlink_to(source)
    return tuple(names)


def _git(folder: Path, *words: str, error: str, settings: dict[str, str] | None = None) -> str:
    command, given = ["git", "-C", str(folder), *words], {**os.environ, **(settings or {})}
    try:
        done = subprocess.run(command, check=False, capture_output=True, text=True, errors="surrogateescape", env=given)
    except OSError:
        raise CompareError("git cannot be run", "install it, or give both scenes") from None
    if done.returncode and error:
        why = done.stderr.strip().splitlines()
        raise CompareError(error, why[-1][:200] if why else "see 'git log'")
    return done.stdout.strip()


def head(folder: Path) -> str:
    """Return the commit that is checked out; "": none is known."""
    try:
        return _git(folder, "rev-parse", "HEAD", error="none")
    except CompareError:
        return ""


def changed_files(folder: Path) -> bool:
    """Tell whether any file of that folder differs from its commit, or there is none."""
    try:
        return bool(_git(folder, "status", "--porcelain", "--", ".", error="none"))
    except CompareError:
        return True
