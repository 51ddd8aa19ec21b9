"""Factor per sample, common to all channels and to all stems of a mix, so that the stems still add up to it.

    seconds of fading in and out, decibels of a limiter -> GainCurve -> KeptSound.shaped

fade(t) = (1 - cos πt/T)/2: half a Hann window, whose slope is zero at both ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class GainCurve:
    """Factor per frame of a sound.

    Parameters
    ----------
    frames
        Of the sound.
    fade_in, fade_out
        In frames.
    limiter : Array, shape (frames,)
        Factors; None: ones.
    gain
        Of all frames.
    """

    frames: int
    fade_in: int = 0
    fade_out: int = 0
    limiter: Array | None = None
    gain: float = 1.0

    def read(self, start: int, stop: int) -> Array:
        """Return the factors of the frames start … stop - 1, fewer at the end."""
        frame = np.arange(start, min(stop, self.frames))
        factor = np.full(len(frame), self.gain)
        if self.limiter is not None:
            factor *= self.limiter[start:stop]
        if self.fade_in:
            factor *= _half_hann(frame / self.fade_in)
        if self.fade_out:
            factor *= _half_hann((self.frames - 1 - frame) / self.fade_out)
        return factor


def _half_hann(share: Array) -> Array:
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(share, 0.0, 1.0)))
