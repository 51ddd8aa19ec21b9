"""Run a scene in the whole tree of a revision, with its working folder, import path and modules.

    working tree   top/scenes/bar.py   top/parts/cup.py   cwd top/scenes
    revision       tree/scenes/bar.py  tree/parts/cup.py  cwd tree/scenes      installed packages are common

Files that no revision determines are noted in the run: files outside the repository, files by absolute path in the
working tree, files that git does not know.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
import sysconfig
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

import sonic_bullet


@dataclass(frozen=True, slots=True)
class RevisionTree:
    """Files of a revision of the repository at ``top``, in ``tree``; untracked: files linked from there."""

    top: Path
    tree: Path
    untracked: tuple[str, ...] = ()

    def place(self, path: Path) -> Path:
        """Return the place in the tree of a path in the repository; other paths stay."""
        return self.tree / path.relative_to(self.top) if path.is_relative_to(self.top) else path

    def is_untracked(self, inside: Path) -> bool:
        """Tell whether git does not know that path of the repository."""
        return any(inside.is_relative_to(one) for one in self.untracked)


@dataclass(slots=True)
class ReadFiles:
    """Absolute paths of files opened for reading while it is the last of `_noted`."""

    paths: set[str] = field(default_factory=set)


_noted: list[ReadFiles] = []
_hooks: list[Any] = []


def _audit(event: str, arguments: tuple[Any, ...]) -> None:
    if event != "open" or not _noted:
        return
    path, mode, flags = arguments
    reads = mode is None or "r" in str(mode) or "+" in str(mode)
    if reads and isinstance(path, (str, bytes)) and not (mode is None and flags & (os.O_WRONLY | os.O_CREAT)):
        with suppress(OSError, ValueError):
            _noted[-1].paths.add(os.path.join(os.getcwd(), os.fsdecode(path)))


@contextmanager
def noted_files() -> Iterator[ReadFiles]:
    """Record the files that Python opens within the block."""
    if not _hooks:
        _hooks.append(_audit)
        sys.addaudithook(_audit)
    _noted.append(ReadFiles())
    try:
        yield _noted[-1]
    finally:
        _noted.pop()


def find_unpinned(paths: set[str], revision: RevisionTree, *, old: bool) -> set[str]:
    """Return those of the files read by a side that are not of its version, each with the reason."""
    found = set()
    temporary = Path(tempfile.gettempdir()).resolve()
    system_folders = ("/proc", "/dev", "/sys", "/etc", "/usr", "/lib", "/run", "/bin", "/opt")
    for name in paths:
        path = Path(os.path.normpath(name))
        real = path.resolve()
        if not path.is_file() or _is_installed(path) or _is_installed(real) or "__pycache__" in path.parts:
            continue
        of_system = any(real.is_relative_to(one) for one in (*system_folders, sys.prefix, sys.base_prefix))
        home = revision.tree if old else revision.top
        inside = next((one.relative_to(home) for one in (path, real) if one.is_relative_to(home)), None)
        if inside is not None:
            if revision.is_untracked(inside):
                found.add(f"{inside} (git does not know it)")
            elif not real.is_relative_to(home):
                found.add(f"{real} (outside the repository)")
        elif real.is_relative_to(revision.top):
            found.add(f"{real} (by its absolute path: A reads the present one)")
        elif not (real.is_relative_to(revision.tree) or of_system or real.parent == temporary):
            found.add(f"{real} (outside the repository)")
    return found


def unpinned_words(found: set[str]) -> tuple[str, ...]:
    """Make the note of a report."""
    if not found:
        return ()
    named = sorted(found)
    most_named = 8
    more = f", and {len(named) - most_named} more" if len(named) > most_named else ""
    return (f"both sides read the same of what no revision holds: {', '.join(named[:most_named])}{more}",)


def _is_installed(path: Path) -> bool:
    """Tell whether a file belongs to the interpreter, its packages, this package or its cache."""
    installed_at = tuple(Path(one).resolve() for one in sonic_bullet.__path__)
    from sonic_bullet.files.storage.user_folder import cache_folders

    library = [Path(sysconfig.get_paths()[name]) for name in ("stdlib", "platstdlib")]
    homes: list[Path] = [*library, *installed_at, *cache_folders()]
    package_folders = ("site-packages", "dist-packages")
    # folders of installed packages' metadata, wherever a package itself is
    metadata_endings = (".egg-info", ".dist-info")
    return any(part in package_folders or part.endswith(metadata_endings) for part in path.parts) or any(
        path.is_relative_to(one) for one in homes
    )


def _places(module: ModuleType) -> list[Path]:
    """Return the files, or folders, of a module."""
    file = getattr(module, "__file__", None)
    with suppress(Exception):  # a module may be any object
        places: list[str] = [file] if file else list(getattr(module, "__path__", ()))
        return [Path(one).resolve() for one in places]
    return []


@contextmanager
def own_modules(revision: RevisionTree | None) -> Iterator[None]:
    """Give a scene its own modules and import path, as modules of another version have the same names.

    revision: of the old side, which gets nothing of the working tree; None: the scene as it is now.
    """
    before, path, finders = dict(sys.modules), list(sys.path), list(sys.meta_path)
    folder = _folder()
    importlib.invalidate_caches()
    try:
        if revision is not None:
            for name, module in before.items():
                if any(one.is_relative_to(revision.top) and not _is_installed(one) for one in _places(module)):
                    del sys.modules[name]
            sys.path[:] = [_move_entry(one, revision) for one in path]
            sys.meta_path.insert(0, _OfTheTree(revision))
            if folder is not None and folder.is_relative_to(revision.top):
                revision.place(folder).mkdir(parents=True, exist_ok=True)
                os.chdir(revision.place(folder))
        yield
    finally:
        sys.path[:], sys.meta_path[:] = path, finders
        if folder is not None:
            os.chdir(folder)
        for name in set(sys.modules) - set(before):
            if any(not _is_installed(one) for one in _places(sys.modules[name])):
                del sys.modules[name]
        sys.modules.update({name: one for name, one in before.items() if sys.modules.get(name) is not one})
        importlib.invalidate_caches()


def _folder() -> Path | None:
    with suppress(OSError):
        return Path.cwd().resolve()
    return None


def _move_entry(entry: str, revision: RevisionTree) -> str:
    """Move an entry of the import path to the tree where it is in the repository; "" is the working folder."""
    if not entry:
        return entry
    path = Path(entry).resolve()
    return entry if _is_installed(path) else str(revision.place(path))


@dataclass(frozen=True, slots=True)
class _OfTheTree:
    """A finder that takes modules of the working tree from the revision's, or does not find them."""

    revision: RevisionTree

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        for finder in sys.meta_path:
            if finder is self or not hasattr(finder, "find_spec"):
                continue
            spec = finder.find_spec(name, path, target)
            if spec is not None:
                return self._moved(name, spec)
        return None

    def _moved(self, name: str, spec: ModuleSpec) -> ModuleSpec:
        places = list(spec.submodule_search_locations or ())
        origin = Path(spec.origin).resolve() if spec.has_location and spec.origin else None
        if origin is not None and origin.is_relative_to(self.revision.top) and not _is_installed(origin):
            there = self.revision.place(origin)
            if not there.is_file():
                raise ModuleNotFoundError(f"No module named {name!r} in this revision", name=name)
            inside = [str(self.revision.place(Path(one).resolve())) for one in places] or None
            return importlib.util.spec_from_file_location(name, there, submodule_search_locations=inside) or spec
        if origin is None and places:
            spec.submodule_search_locations = [_move_entry(one, self.revision) for one in places]
        return spec
