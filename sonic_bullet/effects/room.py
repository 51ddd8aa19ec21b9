"""`room`: reflections and reverberation: the same late decay in every band, whatever the object.

    y = x + h * x,   h(t) Gaussian with variance w² 2δ e^{−2δt},
        rt60 = ln(10³)/δ, reverberant level w = energy of h over the direct sound's 1, rooted
        [Schroeder 1965; statistics of the tail: Polack 1988; Kuttruff 2009, ch. 4]

δ is the one rate that makes all lines likeliest as modes that ring on in such a tail
(lab/effects/common/reverberant_tail.py), each with a decay and a level of its own; lines that of themselves decay
faster than the room must agree on it, as in every room and in no body. h, where several strikes identify it, by least
squares with that variance as its prior [Wiener 1949]. With a room, lines are identified as they would be without it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar

import numpy as np

from sonic_bullet.effects.protocol import Dereverberates, Number, Owner, Sound, Stage
from sonic_bullet.records import Array

RT60 = float(np.log(1e3))


@dataclass(frozen=True)
class Room(Dereverberates):
    """Reverberation of the room."""

    id: ClassVar[str] = "room"
    stage: ClassVar[Stage] = Stage.SOUND
    owner: ClassVar[Owner] = Owner.ROOM
    reference: ClassVar[str] = "Schroeder 1965; Polack 1988; Kuttruff 2009, ch. 4"

    rt60_s: Annotated[float, Number("time in which the tail falls by 60 dB", least=0.0, free=1)]
    reverberant_level: Annotated[float, Number("w of the module's first equation", least=0.0, free=1, key="wet")]
    seed: int = 0
    response: Array = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)
    sr: int = 0

    def taps(self, sr: int, n: int) -> Array:
        """Compute the tail (n,) at a sampling rate."""
        if len(self.response) and self.sr == sr:
            return np.asarray(np.concatenate([self.response[:n], np.zeros(max(n - len(self.response), 0))]))
        if len(self.response):
            from scipy.signal import resample_poly

            return Room(
                self.rt60_s,
                self.reverberant_level,
                self.seed,
                np.asarray(resample_poly(self.response, sr, self.sr)) * self.sr / sr,
                sr,
            ).taps(sr, n)
        delta = RT60 / self.rt60_s
        t = np.arange(n) / sr
        return np.asarray(
            self.reverberant_level
            * np.sqrt(2 * delta / sr)
            * np.exp(-delta * t)
            * np.random.default_rng(self.seed).standard_normal(n)
        )

    def apply(self, x: Sound) -> Sound:
        """Add the tail to the sound."""
        if self.reverberant_level == 0 or not len(x.sample):
            return x
        from scipy.signal import fftconvolve

        tail = fftconvolve(x.sample, self.taps(x.sr, len(x.sample)))[: len(x.sample)]
        return replace(x, sample=x.sample + tail)
