"""`radiation`: a mode loses energy to the air as it radiates, and its level follows the radiation.

    Δd = s ½ ρ₀ c σ A,  A = ∮(φ·n)² dS,  σ = (ka)²/(1 + (ka)²) with a net flow of volume, (ka)⁴/(4 + (ka)⁴) without
        [k = ω/c; Kinsler et al. 2000, ch. 7;
    Fahy & Gardonio 2007, ch. 3: the pulsating and the oscillating sphere]
    level tilts as √σ where the sensor is in the far field

Identified by the decays above Rayleigh's: the difference grows with ka, then flattens, and goes with each mode's own
area A. The decays give the order of ka, too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, NamedTuple, Self

import numpy as np

from sonic_bullet.effects.protocol import (
    Effect,
    Evidence,
    Number,
    ObjectEvidence,
    Owner,
    Stage,
    Traits,
    ascending,
)
from sonic_bullet.geometry import area_vectors_m2
from sonic_bullet.records import Array, ModalModel
from sonic_bullet.signal.robust import fit_nonnegative


class _RadiationNumbers(NamedTuple):
    """Numbers of radiation."""

    impedance: float = 1.2 * 343.0  # ρ₀ c in kg/(m² s)
    sound: float = 343.0
    scatter: float = 0.03
    orders: tuple[int, ...] = (2, 4)


RADIATION = _RadiationNumbers()


@dataclass(frozen=True)
class Radiation(Effect):
    """Loss of modes by radiation, of one equivalent source."""

    id: ClassVar[str] = "radiation"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.OBJECT
    reference: ClassVar[str] = "Fahy & Gardonio 2007, ch. 3"
    traits: ClassVar[Traits] = Traits(needs_unknown_medium=True)

    radius_m: Annotated[float, Number("radius a of the source", least=0.0, free=1)]
    strength: Annotated[float, Number("s, 1 by the law", least=0.0, free=1)]
    tilt: Annotated[float, Number("exponent of σ in the level at the sensor, 0 or ½")] = 0.0
    order: Annotated[int, Number("of ka where it is small: 2 monopole, 4 dipole", known=(2, 4))] = 2

    def efficiency(self, freq_hz: Array) -> Array:
        """Compute σ (k,) at frequencies (k,) in Hz."""
        low = (2 * np.pi * np.asarray(freq_hz) * self.radius_m / RADIATION.sound) ** self.order
        return np.asarray(low / (self.order**2 / 4 + low))

    def apply(self, x: ModalModel) -> ModalModel:
        """Add the loss to the decays of a body's modes, and the tilt to their levels at the sensor."""
        sigma = self.efficiency(x.freq_hz)
        omega = np.sqrt(x.omega0_squared_per_s2)
        decay = np.minimum(x.decay_per_s + self.strength * 0.5 * RADIATION.impedance * sigma * areas(x), 0.99 * omega)
        freq = np.sqrt(omega**2 - decay**2) / (2 * np.pi)
        shape = x.shape.copy() if self.tilt else x.shape
        if self.tilt:
            shape[-1] *= (sigma**self.tilt).astype(np.float32)  # the last vertex is the sensor's
        return ascending(x, freq, decay, shape)

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        """Fit radius, order and strength to the decays and the tilt to the levels; None where none is identified."""
        fewest_lines, fewest_lines_again = 6, 4  # lines: to look for it, and to fit it again to a part of them
        again = 2.0  # times smaller or larger, where it is fitted again
        clearer = 0.45  # twice the ln likelihood, a line, that a tilt must be worth
        better = 14.0
        observed = max(evidence.observed, key=lambda h: len(h.freq_hz) if h.model is not None else 0)
        with_decay = int((~np.isposinf(observed.decay_sd_per_s)).sum())  # in a room some lines tell no decay
        if (
            observed.model is None
            or with_decay < (fewest_lines if evidence.known is None else fewest_lines_again)
            or not np.isfinite(observed.decay_per_s).all()
        ):
            return None
        area = areas(observed.model)
        # of modes that share a line, the louder is observed: a plate's own plane hardly moves the air
        loud = (np.abs(observed.push) ** 2).sum(axis=0) + 1e-300
        mine = np.array([np.average(area[m], weights=loud[m]) for m in observed.mode])
        decay, w2 = observed.decay_per_s, observed.omega**2
        sd = np.hypot(observed.decay_sd_per_s, RADIATION.scatter * decay) + 1e-3
        across = float(np.linalg.norm(np.ptp(observed.model.vertex_m[np.unique(observed.model.face)], axis=0)))
        rayleigh = [np.full(len(w2), 0.5), 0.5 * w2]
        plain = float(fit_nonnegative(decay, sd, np.stack(rayleigh, axis=1))[1].sum())
        radii = np.geomspace(0.02 * across, across, 40)
        # a part of the lines may leave the knee anywhere below the band: it is this one that is fitted again
        if isinstance(evidence.known, cls):
            # by either law: which one, a pulse or a filter may have hidden
            radii = evidence.known.radius_m * np.geomspace(1 / again, again, 21)
        found = []
        for one in (cls(float(radius), 1.0, order=order) for order in RADIATION.orders for radius in radii):
            lost = 0.5 * RADIATION.impedance * one.efficiency(observed.freq_hz) * mine
            x, rest = fit_nonnegative(decay, sd, np.stack([*rayleigh, lost], axis=1))
            if x[2] > 0:
                found.append((float(rest.sum()), replace(one, strength=float(x[2]))))
        if not found:
            return None
        left, best = min(found, key=lambda one: one[0])
        if evidence.known is None and (not plain - left > better + 2 * np.log(len(w2)) or left > 0.5 * plain):
            return None
        # what radiates is observed: levels tell the knee, too
        tilted = [(left + _level_cost(observed, one, 0.5), one) for left, one in found]
        least, observed_so = min(tilted, key=lambda one: one[0])
        plain_so = left + _level_cost(observed, best, 0.0) - clearer * len(w2)
        return replace(observed_so, tilt=0.5) if least < plain_so else best


def areas(x: ModalModel) -> Array:
    """Compute A = ∮(φ·n)² dS (m,) in m²/kg of a model's modes."""
    from scipy.sparse import csr_array

    corner = x.vertex_m[x.face]
    normal = area_vectors_m2(x.vertex_m, x.face)
    size = np.linalg.norm(normal, axis=1)
    direction = np.broadcast_to(
        (normal / np.maximum(3 * size, 1e-300)[:, None])[:, None], corner.shape
    )  # of a triangle's middle: a third of each corner's motion
    place = 3 * x.face[:, :, None] + np.arange(3)
    normal_part = csr_array(
        (direction.ravel(), place.ravel(), np.arange(0, 9 * len(x.face) + 1, 9)), shape=(len(x.face), 3 * len(x.shape))
    )
    along = normal_part @ x.shape.reshape(-1, x.mode_count)
    return np.asarray((along**2 * size[:, None]).sum(axis=0))


def _level_cost(observed: ObjectEvidence, made: Radiation, tilt: float) -> float:
    """Compute twice the negative log likelihood (Cauchy) of the levels' misfit: lines of other modes lie far off.

    Misfit: ln of a line's level over the expected one, median of the strikes, less tilt and common gain.
    """
    ratio = np.log(np.maximum(np.abs(observed.amplitude), 1e-300) / np.maximum(np.abs(observed.expected), 1e-300))
    off = np.median(ratio, axis=0) - tilt * np.log(made.efficiency(observed.freq_hz))
    return float(2 * np.log1p(((off - np.median(off)) / RADIATION.scatter) ** 2).sum())
