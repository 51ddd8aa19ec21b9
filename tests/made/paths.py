"""The sound path by itself: a step's sources in, pressure at the microphones back."""

from __future__ import annotations

import numpy as np

from sonic_bullet.machine.grouping import gather
from sonic_bullet.path.path_kernel import ALL_ALIKE, AT_REST, WORK, hear
from sonic_bullet.path.path_places import OUTCOME, Arrivals, Course, Emission, PathTables
from sonic_bullet.path.propagation import Path, PathState, grow
from sonic_bullet.records import Array


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
) -> Array:
    """Pressure (c, n) in Pa at the next n samples. Changes ``state`` in place.

    step ≥ 0: number of the physics step that these samples are (part of). source (b, n) in Pa·m; dipole (b, 3, n) in
    Pa·m, world frame. position0_m, position1_m (b, 3): at the step's start and end; progress (n,): where between them
    each sample lies, 0 … 1. teleported (b,): moved by hand, so both places sound and fade over the step. Bodies are
    summed in order. Below 1e-30 Pa: 0. Raises AudioError on numbers that are not finite, or a sounding body more than
    1 km from a microphone.
    """
    n = len(progress)
    source, dipole, position0_m, position1_m, progress = (
        np.ascontiguousarray(one, float) for one in (source, dipole, position0_m, position1_m, progress)
    )
    out, work = np.zeros((len(path.microphone_m), n)), np.zeros(WORK)
    moved = np.ascontiguousarray(teleported, bool)
    while True:
        course = Course(position0_m, position1_m, moved, progress, AT_REST, ALL_ALIKE)
        tables, arrivals = gather(PathTables, path, state), Arrivals(out, 0, 0)
        status = hear(
            state.at,
            step,
            n,
            Emission(source[None], dipole, 0, np.zeros(len(path.microphone_m), np.int64)),
            course,
            tables,
            work,
            arrivals,
        )
        if status == OUTCOME.done:
            break
        grow(path, state, status)
    state.at += n
    return out
