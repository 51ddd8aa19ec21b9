"""Runs of neighbouring modes, as dashpots couple those and hardly others."""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def split_into_runs(omega: Array, most: int) -> list[Array]:
    """Divide modes into runs of neighbours that nearly do not couple with other runs.

    Parameters
    ----------
    omega : (m,)
        Angular frequencies, ascending.
    most : int
        Modes in a run at most.

    Returns
    -------
    list of (r,)
        Indices, cut where frequencies lie farthest from each other.
    """
    runs, done = [np.arange(len(omega))], []
    while runs:
        run = runs.pop()
        if len(run) <= most:
            done.append(run)
            continue
        gap = np.diff(np.log(omega[run]))
        middle = np.minimum(np.arange(1, len(run)), np.arange(len(run) - 1, 0, -1)) / len(run)  # no runs of one
        cut = int(np.argmax(gap * np.sqrt(middle))) + 1
        runs += [run[:cut], run[cut:]]
    return sorted(done, key=lambda run: int(run[0]))
