"""What stands beside the lines of takes: noise, by its levels in bands and over time.

N(b, t) = max(<P(b, t)> − P_lines(b, t), 0),   P of band_time.py, takes brought to one level

Its waveform is another in every take, so nothing predicts that; its levels are what takes share. A sound of lines with
this noise has P_lines + N, as the two are not correlated.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.signal.band_time import BandTime


def noise_beside_lines(takes: Sequence[BandTime], lines: Sequence[BandTime], strength: Array | None = None) -> BandTime:
    """Measure the noise that takes share beside their lines.

    Parameters
    ----------
    takes : sequence of BandTime
        As recorded.
    lines : sequence of BandTime
        Of each take, what lines or modes have of it; without strengths also one for all.
    strength : (t,) array
        Impulses of the strikes, to which amplitudes are proportional. Without them takes are brought to one energy, the
        geometric mean.

    Returns
    -------
    BandTime
        Power (b, m) as far as the shortest take goes, of a strike of unit strength or of that energy.
    """
    count = min(one.power.shape[1] for one in (*takes, *lines))
    power = np.array([one.power[:, :count] for one in takes])
    made = np.array([one.power[:, :count] for one in lines])
    if strength is None:
        energy = np.maximum(power.sum(axis=(1, 2)), 1e-300)
        ratio = energy / energy[0]  # of equal energies 1 exactly
        power *= (np.exp(np.log(ratio).mean()) / ratio)[:, None, None]
    else:
        power, made = (each / np.asarray(strength, float)[:, None, None] ** 2 for each in (power, made))
    beside = power.mean(axis=0) - made.mean(axis=0)
    return BandTime(np.maximum(beside, 0.0), np.mean([one.noise for one in takes], axis=0))


def with_noise_part(lines: BandTime, noise: BandTime, strength: float = 1.0) -> BandTime:
    """Return lines with a noise beside them, of a strike of that strength."""
    count = min(lines.power.shape[1], noise.power.shape[1])
    return BandTime(lines.power[:, :count] + strength**2 * noise.power[:, :count], lines.noise)
