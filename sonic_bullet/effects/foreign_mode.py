"""`foreign-mode`: the striker, the stand or a neighbour vibrates too.

y(t) = J Σ_k a_k e^{−d_k t} cos(2πf_k t + φ_k)
    the same f, d wherever the object is struck, a in units of the file per N·s
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from sonic_bullet.effects.common.ringing import synthesize_ring
from sonic_bullet.effects.protocol import Impact, Number, Numbers, Owner, Ring, RingsAlong, Sound, Stage


@dataclass(frozen=True)
class ForeignMode(RingsAlong):
    """Lines of another resonator that the same impact excites, one number a line."""

    id: ClassVar[str] = "foreign-mode"
    stage: ClassVar[Stage] = Stage.SOUND
    owner: ClassVar[Owner] = Owner.STRIKER
    reference: ClassVar[str] = "physics of a second resonator driven by the same impact: Morse & Ingard 1968, ch. 2"

    freq_hz: Annotated[Numbers, Number("(k,), of each line", least=0.0, free=1, table="modes")]
    decay_per_s: Annotated[Numbers, Number("(k,), of each line", least=0.0, free=1, table="modes")]
    amplitude_per_n_s: Annotated[Numbers, Number("(k,), in units of the file per N·s", free=1, table="modes")]
    phase_rad: Annotated[Numbers, Number("(k,), at the onset", table="modes")]

    def apply(self, x: Sound) -> Sound:
        """Add the lines to the sound."""
        a = x.impulse_n_s * np.array(self.amplitude_per_n_s) * np.exp(1j * np.array(self.phase_rad))
        none = np.zeros(len(a))
        ring = Ring(np.array(self.freq_hz), np.array(self.decay_per_s), a, none, none, none)
        return replace(
            x, sample=x.sample + synthesize_ring(ring, Impact(1.0, np.zeros(1), np.ones(1)), len(x.sample), x.sr)
        )

    def lines(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the frequencies in Hz and decays in 1/s of the lines."""
        return self.freq_hz, self.decay_per_s

    def parameters(self) -> dict[str, Any]:
        """Return its parameters by name, in SI units, for reports and JSON."""
        return {
            "modes": [list(row) for row in zip(self.freq_hz, self.decay_per_s, self.amplitude_per_n_s, strict=True)]
        }
