"""What a force pulse is, in numpy: its cumulated force, the nodes and cells by which the bank plays it, its jerk."""

from __future__ import annotations

import numpy as np

from sonic_bullet.bank.strike_pool import NODES_PER_PULSE
from sonic_bullet.contact.pulse_shape import cumulated, pulse_table
from sonic_bullet.records import Array


def cumulated_force(s: Array, *, flat: bool = False) -> Array:
    """Q(s): the share of the impulse handed over by the share s (k,) of the pulse; 0 before, 1 after."""
    return np.array([cumulated(one, pulse_table(), flat) for one in np.asarray(s, float)])


def pulse_nodes(tau_s: float, sr: int, *, flat: bool = False) -> tuple[float, float, Array]:
    """The pulse as equidistant micro-impulses: time of the first after the strike's start in s, spacing in s, weights
    (count,), sum 1: midpoints of at least 24 cells, none longer than half a sample.
    """
    count = max(NODES_PER_PULSE, int(np.ceil(2 * sr * tau_s)))
    s = (np.arange(count) + 0.5) / count
    force = np.sin(np.pi * s) if flat else np.interp(s, np.linspace(0, 1, pulse_table().shape[1]), pulse_table()[1])
    return tau_s / count / 2, tau_s / count, force / force.sum()


def pulse_cells(start: float, tau_s: float, sr: int, least: int, *, flat: bool = False) -> tuple[float, float, Array]:
    """The pulse as forces that are even over cells of the sample grid: centre of the first and spacing in samples,
    impulses (count,), sum 1.

    start: of the pulse, in samples, any fraction. least: cells a sample, more where the pulse is short.
    """
    cells = max(least, int(np.ceil(NODES_PER_PULSE / (sr * tau_s))))
    first = int(np.floor(start * cells))
    edges = np.arange(first, int(np.ceil((start + tau_s * sr) * cells)) + 1) / cells
    return (first + 0.5) / cells, 1 / cells, np.diff(cumulated_force((edges - start) / (tau_s * sr), flat=flat))


def jerk_of(start: float, length: float, flat: bool, count: int) -> Array:
    """(count,) dF/dt of a pulse of impulse 1 at the samples, start and length in samples: the mean under a triangle one
    sample to either side.
    """
    sample = np.arange(-1, count + 1)
    return np.diff(cumulated_force((sample - start) / length, flat=flat), 2)
