"""Frequency response of a sensor that touches: what its data sheet shows, or what was measured of it.

frequencies and magnitudes -> minimum phase -> FIR at the rate of a render    [Oppenheim, Schafer 2010, sec. 13.4]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet._engine import exp_into, log_into
from sonic_bullet.records.arrays import Array, frozen_array, require, store

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class SensorResponse:
    """Magnitude of a sensor's response, 1: as it is accelerated; between its frequencies linear in log f and dB.

    Parameters
    ----------
    freq_hz : Array, shape (k,)
        Ascending, above 0; the first and the last magnitude hold beyond them.
    magnitude : Array, shape (k,)
        0 or more, not all 0.

    Raises
    ------
    RecordError
        They are not such numbers.
    """

    freq_hz: Array
    magnitude: Array

    if TYPE_CHECKING:  # what may be passed: the fields hold read-only arrays of it

        def __init__(self, freq_hz: ArrayLike, magnitude: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        """Check the fields."""
        freq = frozen_array(self.freq_hz, float, (None,), "sensor response: freq_hz")
        remedy = "give frequencies in Hz that ascend from above 0"
        require(len(freq) > 0 and freq[0] > 0 and bool((np.diff(freq) > 0).all()), "sensor response: freq_hz", remedy)
        magnitude = frozen_array(self.magnitude, float, (len(freq),), "sensor response: magnitude")
        positive = magnitude.min() >= 0 and magnitude.max() > 0
        require(bool(positive), "sensor response: magnitude", "give a factor of 0 or more for each frequency")
        store(self, freq_hz=freq, magnitude=magnitude)

    def at(self, freq_hz: Array) -> Array:
        """Interpolate the magnitude at frequencies (n,), 0 Hz included."""
        least_magnitude = 1e-6  # Magnitude, of the largest, below which a response is taken as that: -120 dB
        level, asked, known, made = (np.empty(len(one)) for one in (self.magnitude, freq_hz, self.freq_hz, freq_hz))
        log_into(np.maximum(self.magnitude, least_magnitude * self.magnitude.max()), level)
        log_into(np.maximum(freq_hz, self.freq_hz[0]), asked)
        log_into(self.freq_hz, known)
        exp_into(np.interp(asked, known, level), made)
        return made
