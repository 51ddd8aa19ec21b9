"""Temporary files and folders, reported to whoever removes them where this process is killed.

note_leftover(path) -> the reporter that `report_leftovers` was given (`sonic_bullet.machine.worker`); without one,
nothing
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

_reporters: list[Callable[[str], None]] = []


def report_leftovers(reporter: Callable[[str], None]) -> None:
    """Set the function that is called with each path, in place of an earlier one."""
    _reporters[:] = [reporter]


def note_leftover(path: str | Path) -> None:
    """Register a file or folder to be removed where this process is killed, unless it has been renamed by then."""
    for report in _reporters:
        report(str(path))


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Provide a folder that is removed afterwards, however this process ends."""
    with tempfile.TemporaryDirectory(prefix="sonic-bullet-") as folder:
        note_leftover(folder)
        yield Path(folder)
