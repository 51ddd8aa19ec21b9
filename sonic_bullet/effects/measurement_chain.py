"""`measurement-chain`: one filter, limit or tone common to all recordings.

high-pass, low-pass: Butterworth of order 1 to 4, |H|² = 1/(1 + (f/f_c)^{±2n})
    [Oppenheim & Schafer 2010, app. B]
limit: samples beyond ± L are set to it
hum: Σ_i a_i cos(2π i f₀ t + φ_i) that is there before, during and after, however hard the strike
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from sonic_bullet.effects.protocol import Effect, Number, Numbers, Owner, Sound, Stage

ORDERS = (1, 2, 3, 4)


@dataclass(frozen=True)
class MeasurementChain(Effect):
    """Filters, limit and hum of the recording equipment."""

    id: ClassVar[str] = "measurement-chain"
    stage: ClassVar[Stage] = Stage.SOUND
    owner: ClassVar[Owner] = Owner.CHAIN
    reference: ClassVar[str] = "Oppenheim & Schafer 2010, app. B"

    high_pass_hz: Annotated[float, Number("corner, 0 for none", least=0.0, free=2, of="high_pass_hz")] = 0.0
    high_order: Annotated[int, Number("order of the filter", known=ORDERS, of="high_pass_hz")] = 1
    low_pass_hz: Annotated[float, Number("corner, 0 for none", least=0.0, free=2, of="low_pass_hz")] = 0.0
    low_order: Annotated[int, Number("order of the filter", known=ORDERS, of="low_pass_hz")] = 1
    limit: Annotated[float, Number("in units of the file, 0 for none", least=0.0, free=1, of="limit")] = 0.0
    hum_hz: Annotated[float, Number("fundamental of the hum, 0 for none", least=0.0, free=1, of="hum_hz")] = 0.0
    hum_amplitude: Annotated[Numbers, Number("(i,), of its harmonics, in units of the file", free=1, of="hum_hz")] = ()
    hum_phase_rad: Annotated[Numbers, Number("(i,), at the onset", shown=False)] = ()

    def apply(self, x: Sound) -> Sound:
        """Filter and limit the sound, and add the hum."""
        from scipy.signal import butter, sosfilt

        y = x.sample
        for kind, corner, order in (
            ("highpass", self.high_pass_hz, self.high_order),
            ("lowpass", self.low_pass_hz, self.low_order),
        ):
            if 0 < corner < 0.5 * x.sr:
                y = sosfilt(butter(order, corner, kind, fs=x.sr, output="sos"), y)
        if self.hum_hz:
            t = np.arange(len(y)) / x.sr
            for i, (a, phase) in enumerate(zip(self.hum_amplitude, self.hum_phase_rad, strict=True), 1):
                if a:
                    y = y + a * np.cos(2 * np.pi * i * self.hum_hz * t + phase)
        return replace(x, sample=np.clip(y, -self.limit, self.limit) if self.limit else y)
