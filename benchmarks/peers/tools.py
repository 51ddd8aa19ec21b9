"""Programs that are not Python: where they are, what they cost, and which Debian package would bring a missing one."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from sonic_bullet.records import Array

SR = 48_000
LIMIT_S = 300


class MissingTool(Exception):
    """A program that is not installed; ``package``: what brings it."""

    def __init__(self, package: str) -> None:
        super().__init__(f"Debian package {package}")
        self.package = package


def tool(name: str, package: str) -> str:
    """Path of a program. Raises MissingTool."""
    found = shutil.which(name)
    if found is None:
        raise MissingTool(package)
    return found


def run(command: Sequence[str], folder: Path) -> str:
    """What a program prints, run in a folder. Raises RuntimeError with its last words where it fails or never ends."""
    try:
        done = subprocess.run(
            command, cwd=folder, check=False, capture_output=True, text=True, timeout=LIMIT_S, stdin=subprocess.DEVNULL
        )
    except subprocess.TimeoutExpired as error:
        raise RuntimeError(f"{command[0]} ran for {LIMIT_S} s") from error
    if done.returncode:
        raise RuntimeError(
            f"{os.path.basename(command[0])}: exit {done.returncode}: {(done.stdout + done.stderr)[-400:]}"
        )
    return done.stdout


def processor_s(command: Sequence[str], folder: Path) -> float:
    """Processor seconds of a program and all that it starts."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run(command, folder)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def long_less_short(command: Callable[[float], Sequence[str]], folder: Path, seconds: float, repeats: int = 3) -> float:
    """Processor seconds for so many seconds of sound: those of a run that is as much longer, less those of a short one;
    the least of some repeats each. Start and set-up fall out. command: from the length of sound to what is run.
    """
    short, long = (min(processor_s(command(length), folder) for _ in range(repeats)) for length in (1.0, 1.0 + seconds))
    return max(long - short, 1e-9)


def spread_modes(count: int) -> tuple[Array, Array]:
    """Frequencies in Hz, evenly from 50 to 18 050, and decay times to -60 dB in s, 0.3 to 2.3, in no order."""
    k = np.arange(count)
    return 50 + 18_000 * (k + 0.5) / count, 0.3 + 2.0 * (37 * k % count) / count
