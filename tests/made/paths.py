"""The sound path by itself: a step's sources in, pressure at the microphones back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet._engine import PATH_DONE, hear
from sonic_bullet.engine.path.propagation import AT_REST, Path, PathState, grow
from sonic_bullet.records import Array

ALL_ALIKE = np.zeros((0, 0, 0))
"""`Course.gain` where all sound reaches each microphone as it is."""


class Emission(NamedTuple):
    """What bodies emit: the engine's struct of this name, src/path/sound_path.hpp, as the two that follow."""

    source: Array
    dipole: Array
    first: int
    sets: Array


class Course(NamedTuple):
    begin_m: Array
    end_m: Array
    teleported: Array
    x: Array
    aim_m: Array
    gain: Array


class Arrivals(NamedTuple):
    out: Array
    at: int
    apart: int


def propagate(
    path: Path,
    state: PathState,
    step: int,
    source: Array,
    dipole: Array,
    position0_m: Array,
    position1_m: Array,
    teleported: Array,
    progress: Array,
    sets: tuple[int, ...] = (),
) -> Array:
    """Pressure (c, n) in Pa at the next n samples. Changes ``state`` in place.

    step ≥ 0: number of the physics step that these samples are (part of). source (b, n) in Pa·m, or (W, b, n) of weight
    sets, with the set that each microphone hears; dipole (b, 3, n) in
    Pa·m, world frame. position0_m, position1_m (b, 3): at the step's start and end; progress (n,): where between them
    each sample lies, 0 … 1. teleported (b,): moved by hand, so both places sound and fade over the step. Bodies are
    summed in order. Below 1e-30 Pa: 0. Raises AudioError on numbers that are not finite, or a sounding body more than
    1 km from a microphone.
    """
    n = len(progress)
    source, dipole, position0_m, position1_m, progress = (
        np.ascontiguousarray(one, float) for one in (source, dipole, position0_m, position1_m, progress)
    )
    source = source if source.ndim == 3 else source[None]
    heard = np.array(sets or [0] * len(path.microphone_m), np.int64)
    out = np.zeros((len(path.microphone_m), n))
    moved = np.ascontiguousarray(teleported, bool)
    while True:
        course = Course(position0_m, position1_m, moved, progress, AT_REST, ALL_ALIKE)
        arrivals = Arrivals(out, 0, 0)
        status = hear(
            state.at,
            step,
            n,
            Emission(source, dipole, 0, heard),
            course,
            (path, state),
            arrivals,
        )
        if status == PATH_DONE:
            break
        grow(path, state, status)
    state.at += n
    return out
