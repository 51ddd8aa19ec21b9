"""Compare folders of scenes, logs or recordings, by pairs of equal names.

A/pour.py B/pour.py -> compared -> its result        A/roll.py alone -> a partner is missing
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sonic_bullet.machine.parallel import parallel_map
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.records.errors import CompareError, SonicBulletError
from sonic_bullet.records.file_endings import AUDIO_FORMATS, GLTF_ENDINGS
from sonic_bullet.session.scene_file import defines_build


@dataclass(frozen=True, slots=True)
class NamePair:
    """A name of either folder. kept: result of its comparison, None: a partner is missing or it failed; error: why."""

    name: str
    kept: Any = None
    error: str = ""
    missing: bool = False


def pairs_of(a: Path, b: Path) -> list[tuple[str, Path | None, Path | None]]:
    """List the names of both folders, or one, in order.

    Raises
    ------
    CompareError
        There is nothing to compare.
    """
    found = [
        {str(path.relative_to(place)): path for path in sorted(place.rglob("*")) if _is_compared(path)}
        for place in (a, b)
    ]
    names = sorted({*found[0], *found[1]})
    if not names:
        raise CompareError(f"{a} and {b} hold no scene, log or recording", "give folders of them")
    return [(name, found[0].get(name), found[1].get(name)) for name in names]


def _is_compared(path: Path) -> bool:
    """Tell whether a file is to be compared; a Python file that makes no step is a module of scenes."""
    if path.suffix.lower() == ".py":
        try:
            return defines_build(path) or "stepSimulation" in path.read_text(encoding="utf-8", errors="replace")
        except SonicBulletError:
            return True
    return path.suffix.lower() in (".npz", *GLTF_ENDINGS, *AUDIO_FORMATS)


def compare_folders(a: Path, b: Path, both: Callable[[Path, Path], dict[str, Any]]) -> tuple[list[NamePair], bool]:
    """Return the result of ``both`` for each pair, and whether it was stopped before the last.

    both: compares two files, on two cores side by side; "stopped" in its result ends all.
    """
    at_once = 4  # Pairs given to two processes at a time; finished ones are kept when the run is stopped
    listed = pairs_of(a, b)
    reached: list[NamePair] = []

    def do(one: tuple[str, Path | None, Path | None]) -> NamePair:
        name, first, second = one
        if first is None or second is None:
            return NamePair(name, error=f"is in {'B' if first is None else 'A'} alone", missing=True)
        try:
            found = NamePair(name, both(first, second))
        except SonicBulletError as error:
            found = NamePair(name, error=str(error))
        reached.append(found)
        if found.kept is not None and found.kept["stopped"]:
            raise KeyboardInterrupt
        return found

    done: list[NamePair] = []
    try:
        for start in range(0, len(listed), at_once):
            report_progress(f"{start} of {len(listed)}")
            done += parallel_map(do, listed[start : start + at_once])
    except KeyboardInterrupt:
        known = {one.name for one in done}
        return [*done, *(one for one in reached if one.name not in known)], True
    return done, False
