"""`recorded-lines`: the modes of an object of unknown shape: recorded lines, at the level of the body that uses them.

    φ_k(x) = s_k g_k(x) n(x),   p_k ∝ s_k² √σ_k ρ₀c √(S/4π),   σ = (ka)²/(1 + (ka)²)       [Chadwick, Zheng, James 2012]
    s_k² √σ_k ∝ A_k,   Σ_k p_k²/4d_k of the lines = Σ_j p_j²/4d_j of the body's own modes

The effect of the place is unknown: each line is excited alike everywhere, but for g_k, a smooth field of unit mean
whose spread in dB is that of the recorded strikes. Decays are total, as recorded. The level of a recording without
calibration gives no pascals: sound energy per impulse is that of the body's own modes in its material.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from sonic_bullet.effects.protocol import Effect, Number, Numbers, Owner, Stage, Traits
from sonic_bullet.geometry import face_areas_m2, outward_normals
from sonic_bullet.records import Array, ModalModel
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import RecordError

MOST_LINES = 512


@dataclass(frozen=True)
class RecordedLines(Effect):
    """Recorded lines in place of modes, one number a line, ascending."""

    id: ClassVar[str] = "recorded-lines"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.OBJECT
    reference: ClassVar[str] = (
        "Chadwick, Zheng, James 2012; Cremer, Heckl, Petersson 2005, ch. 7 (radiation efficiency)"
    )
    traits: ClassVar[Traits] = Traits(replaces_rayleigh=True)

    freq_hz: Annotated[Numbers, Number("(k,), of each line", least=0.0, free=1, table="lines")]
    decay_per_s: Annotated[Numbers, Number("(k,), of each line", least=0.0, free=1, table="lines")]
    amplitude: Annotated[Numbers, Number("(k,), relative to one another", least=0.0, free=1, table="lines")]
    spread_db: Annotated[Numbers, Number("(k,), standard deviation from strike to strike", least=0.0, table="lines")]

    def __post_init__(self) -> None:
        """Check the numbers."""
        super().__post_init__()
        if not 0 < len(self.freq_hz) <= MOST_LINES:
            raise RecordError(f"{len(self.freq_hz)} lines", f"give 1 to {MOST_LINES}")
        if min(self.freq_hz) <= 0 or min(self.decay_per_s) <= 0 or list(self.freq_hz) != sorted(self.freq_hz):
            raise RecordError("lines are not ascending, or one has no frequency or decay", "give ascending lines")

    def apply(self, x: ModalModel) -> ModalModel:
        """Replace a body's modes by the lines; a body without a surface or a mode stays as it is."""
        if not len(x.face) or not x.mode_count:
            return x
        freq, decay, size, spread = (
            np.array(v) for v in (self.freq_hz, self.decay_per_s, self.amplitude, self.spread_db)
        )
        normal, area = _vertex_normals(x)
        radius = float(np.sqrt(area.sum() / (4 * np.pi)))
        own = _loudness(x.freq_hz, np.einsum("vxm,vx->vm", x.shape.astype(float), normal), area, radius)
        known = np.isfinite(x.decay_per_s) & (x.decay_per_s > 0)
        energy = float((own[known] ** 2 / (4 * x.decay_per_s[known])).sum())
        field = _uneven(x.vertex_m, spread)
        bare = _loudness(freq, field, area, radius)
        gain = np.sqrt(energy / max(float((size**2 / (4 * decay)).sum()), 1e-300)) if energy > 0 else 1.0
        scale = np.sqrt(gain * size / np.maximum(bare, 1e-300))
        shape = np.einsum("vx,vm->vxm", normal, field * scale)
        flat = replace(x, bend_s2_m2=None, damping_growth_s_m=None)
        return replace(
            flat,
            freq_hz=freq,
            decay_per_s=decay,
            shape=shape.astype(np.float32),
            includes_radiation=True,
            note=f"{format_count(len(freq), 'recorded line')} at the level of this body's modes",
        )

    def parameters(self) -> dict[str, Any]:
        """Return its parameters by name, in SI units, for reports and JSON."""
        return {name: list(values) for name, values in vars(self).items()}


def _vertex_normals(x: ModalModel) -> tuple[Array, Array]:
    """Compute unit normals (v, 3) and the part of the surface in m² (v,) of each vertex."""
    area = face_areas_m2(x.vertex_m, x.face)
    normal, share = np.zeros((len(x.vertex_m), 3)), np.zeros(len(x.vertex_m))
    weighted = outward_normals(x.vertex_m, x.face) * area[:, None]
    for i in range(3):
        np.add.at(normal, x.face[:, i], weighted)
        np.add.at(share, x.face[:, i], area / 3)
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300), share


def _loudness(freq_hz: Array, normal_motion: Array, area_m2: Array, radius_m: float) -> Array:
    """Compute the pressure (m,) of each mode per impulse, up to one factor.

    It is the rms normal motion (v, m) where the body is struck times √(σ ∮(φ·n)²dS) of the radiation.
    """
    sound_speed_m_s = 343.0
    square = (normal_motion**2 * area_m2[:, None]).sum(axis=0)
    ka = 2 * np.pi * freq_hz / sound_speed_m_s * radius_m
    return np.asarray(square / np.sqrt(area_m2.sum()) * np.sqrt(ka**2 / (1 + ka**2)))


def _uneven(vertex_m: Array, spread_db: Array) -> Array:
    """Make smooth fields (v, m) of spread_db over the surface, seeded by the number of vertices."""
    place = vertex_m - vertex_m.mean(axis=0)
    place = place / np.maximum(np.sqrt((place**2).mean(axis=0)), 1e-12)
    rng = np.random.default_rng(len(vertex_m))
    wave = rng.standard_normal((3, len(spread_db)))
    field = np.sin(place @ wave + rng.uniform(0, 2 * np.pi, len(spread_db)))
    field = (field - field.mean(axis=0)) / np.maximum(field.std(axis=0), 1e-12)
    return np.asarray(10 ** (field * spread_db / 20))
