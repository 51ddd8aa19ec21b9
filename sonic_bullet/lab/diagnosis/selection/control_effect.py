"""The control effect: as many numbers as a candidate effect has, spent where nothing is known to act.

What they gain is chance.

ln d and ln level of every mode += Σ_i amount_i v_ik,
    v random directions of the modes, amounts by least squares on the same evidence
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from sonic_bullet.effects.protocol import Effect, Number, Numbers, Owner, Stage
from sonic_bullet.lab.effects.evidence import Evidence
from sonic_bullet.records import ModalModel


@dataclass(frozen=True)
class ControlEffect(Effect):
    """Changes of ln d and ln level of every mode along random directions, which `seed` draws."""

    id: ClassVar[str] = "null"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.FIXTURE  # after whatever acts on modes, as a candidate effect may
    reference: ClassVar[str] = "a control, not physics"

    amount: Annotated[Numbers, Number("one a direction, half of them of ln d", free=1)]
    seed: int

    def apply(self, x: ModalModel) -> ModalModel:
        """Change the decays and levels of a body's modes."""
        direction = directions(self.seed, len(self.amount), x.mode_count)
        half = (len(self.amount) + 1) // 2
        decay = x.decay_per_s * np.exp(np.clip(np.array(self.amount[:half]) @ direction[:half], -3, 3))
        shape = x.shape.copy()
        shape[-1] *= (
            np.exp(np.clip(np.array(self.amount[half:]) @ direction[half:], -3, 3)).astype(np.float32)
            if len(direction) > half
            else np.float32(1)
        )
        return replace(x, decay_per_s=decay, shape=shape)

    @classmethod
    def fitted(cls, evidence: Evidence, freedom: int, seed: int) -> Self | None:
        """Fit amounts to the first object's lines; None where there are too few.

        Parameters
        ----------
        evidence : Evidence
            The evidence.
        freedom : int
            Count of numbers, of which no more are spent than half as many as there are lines.
        seed : int
            Of the directions.
        """
        h = evidence.observed[0]
        count, freedom = len(h.all_hz), min(freedom, len(h.freq_hz) // 2)
        direction = directions(seed, freedom, count)
        half = (freedom + 1) // 2
        if not freedom:
            return None
        member = [int(np.argmin(np.abs(h.all_hz - f))) for f in h.freq_hz]
        y = np.log(np.maximum(h.decay_per_s, 1e-3) / np.maximum(h.expected_decay_per_s, 1e-3))
        size = np.log(np.maximum(np.abs(h.amplitude), 1e-12) / np.maximum(np.abs(h.expected), 1e-12))
        z = np.nan_to_num(np.median(size, axis=0))
        a = np.linalg.lstsq(direction[:half, member].T, np.nan_to_num(y), rcond=None)[0]
        b = (
            np.linalg.lstsq(direction[half:, member].T, z - np.median(z), rcond=None)[0]
            if freedom > half
            else np.zeros(0)
        )
        return cls(tuple(float(v) for v in np.concatenate([a, b])), seed)


def directions(seed: int, count: int, modes: int) -> np.ndarray[Any, Any]:
    """Draw random directions (count, modes): the same for the same seed, whatever the number of modes."""
    return np.random.default_rng([seed, 77]).standard_normal((modes, count)).T
