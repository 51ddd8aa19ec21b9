"""What a force pulse is, in numpy: its cumulated force, the nodes and cells by which the bank plays it, its jerk."""

from __future__ import annotations

import numpy as np

from sonic_bullet._engine import NODES_PER_PULSE, NODES_PER_SAMPLE
from sonic_bullet.engine.contact.pulse_shape import interpolate_impulse, pulse_table
from sonic_bullet.records import Array


def cumulated_force(s: Array, *, flat: bool = False) -> Array:
    """Q(s): the share of the impulse handed over by the share s (k,) of the pulse; 0 before, 1 after."""
    return interpolate_impulse(s, flat=flat)


def pulse_nodes(start: float, tau_s: float, sr: int, *, flat: bool = False) -> tuple[float, float, Array]:
    """The pulse as equidistant micro-impulses: place of the first and spacing in samples, weights (count,), sum 1.

    They stand in the middles of `pulse_cells`, two a sample at least; within the pulse where it is next to nothing.
    """
    if sr * tau_s > 1e-3:
        first, spacing, part = pulse_cells(start, tau_s, sr, NODES_PER_SAMPLE, flat=flat)
    else:
        spacing = sr * tau_s / NODES_PER_PULSE
        first, part = start + spacing / 2, np.zeros(NODES_PER_PULSE)
    s = (first - start + spacing * np.arange(len(part))) / (sr * tau_s)
    hertz = np.interp(s, np.linspace(0, 1, pulse_table().shape[1]), pulse_table()[1], left=0, right=0)
    force = np.where((s >= 0) & (s <= 1), np.sin(np.pi * s), 0.0) if flat else hertz
    return first, spacing, force / force.sum()


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
