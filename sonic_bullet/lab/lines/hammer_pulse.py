"""The force of an instrumented hammer -> the pulse of one strike.

    J = ∫ F dt over the pulse,   τ = πJ/(2 F̂)   as long as a half-sine of that impulse and peak

F from its median, which is what stands there while nothing touches, and turned where its largest excursion is negative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.signal.robust import normal_sd


@dataclass(frozen=True, slots=True)
class HammerPulse:
    """A strike's force. impulse, peak: in the units of its samples, times s; hits: how often it touched.

    turned: whether it was negative. flat: samples at its ceiling, 0 where it was not cut off.
    """

    impulse: float
    peak: float
    hits: int
    turned: bool
    flat: int

    @property
    def contact_s(self) -> float:
        """Length of the half-sine of this impulse and peak."""
        return float(np.pi * self.impulse / (2 * self.peak))


def measure_pulse(force: Array, sr: int) -> HammerPulse | None:
    """Measure the pulse in a take's force (n,); None where none stands above its noise."""
    # samples at the ceiling; of the contact: 0.02 of a half-sine in 16 bits is its flat top
    flat_samples, flat_fraction = (
        3,
        0.05,
    )
    above_noise = 8.0  # times its rms, which noise alone does not reach in 10¹⁴ samples
    rest = force - np.median(force)
    turned = -rest.min() > rest.max()
    rest = -rest if turned else rest
    # of the half that is nearest, whatever the other half holds: 1/Φ⁻¹(3/4)
    noise, peak = float(normal_sd(rest)), float(rest.max())
    if not peak > above_noise * noise:
        return None
    # of the peak: what exceeds it is contact; two such stretches further apart than gap_s are two hits
    contact_share = 0.1
    touching = np.flatnonzero(rest > max(contact_share * peak, above_noise * noise / 2))
    gap_s = 2e-4
    parts = np.split(touching, np.flatnonzero(np.diff(touching) > max(1, round(gap_s * sr))) + 1)
    at = int(np.argmax(rest))
    hit = next(part for part in parts if part[0] <= at <= part[-1])
    over = rest > noise
    before, after = np.flatnonzero(~over[: hit[0]]), np.flatnonzero(~over[hit[-1] :])
    start = int(before[-1]) + 1 if len(before) else 0
    stop = hit[-1] + int(after[0]) if len(after) else len(rest)
    top = int(np.count_nonzero(rest[start:stop] >= peak * (1 - 1e-6)))
    flat = top if top >= max(flat_samples, flat_fraction * len(hit)) else 0
    return HammerPulse(float(rest[start:stop].sum()) / sr, peak, len(parts), bool(turned), flat)
