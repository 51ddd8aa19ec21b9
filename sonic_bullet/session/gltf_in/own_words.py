"""What sonic_bullet adds to the draft's objects in `extras.sonic_bullet`, so that its own files come back whole.

    acousticSurfaces: OwnSurface: rms height and Hurst exponent, or octaves; restitution; stiffness of what has a grain
    modalModels:      OwnModel: frequencies and decays in doubles, bending with level, residual

    a node: mounting, whose loss is in its model's decays, too

They count where they agree with the draft's own fields, to float32 in accessors; where those were changed, those count.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec
import numpy as np

from sonic_bullet.files.residual_code import ResidualForm, residual_of
from sonic_bullet.records import Array, Material, Residual
from sonic_bullet.records.bodies import isotropic_stiffness_pa
from sonic_bullet.records.mounting import Mounting, as_mounting, loss_factor
from sonic_bullet.records.roughness import LONGEST_M, WAVE_M
from sonic_bullet.records.touching.surface_form import SurfaceForm
from sonic_bullet.session.gltf_in.finishes import DRAFT_CORRELATION_M

EXTRAS = "sonic_bullet"
FREE: Mounting = "free"
Row = tuple[float, float, float, float, float, float]


class OwnSurface(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Contact properties of a `Material`, under its names. stiffness_pa: of one with a grain."""

    roughness_m: float
    hurst: float
    restitution: float
    octave_rms_m: tuple[float, ...] | None = None
    waviness_m: float | None = None
    waviness_length_m: float | None = None
    stiffness_pa: tuple[Row, Row, Row, Row, Row, Row] | None = None

    @property
    def form(self) -> SurfaceForm | None:
        """Waviness; None: none is known."""
        waves = self.waviness_m, self.waviness_length_m
        return None if waves[0] is None or waves[1] is None else SurfaceForm(waves[0], waves[1])


class OwnModes(msgspec.Struct, frozen=True, kw_only=True):
    """Modes in doubles, in the accessors' order; bending as of `ModalModel`."""

    freq_hz: list[float]
    decay_per_s: list[float]
    bend_s2_m2: list[float] | None = None
    damping_growth_s_m: list[float] | None = None
    damping_growth_power: float = 1.0


class OwnModel(msgspec.Struct, frozen=True, kw_only=True):
    """What is ours of a model."""

    modes: OwnModes
    residual: ResidualForm | None = None

    def residual_called(self, name: str) -> Residual | None:
        """Build the residual; raises MaterialError, RecordError."""
        return None if self.residual is None else residual_of(self.residual, name)


def finish_entry(own: OwnSurface) -> dict[str, float]:
    """Return the draft's finish of a surface: the rms height σ of waves shorter than ℓ, and its slope."""
    if own.octave_rms_m is None:
        sigma = own.roughness_m * (DRAFT_CORRELATION_M / LONGEST_M) ** own.hurst
    else:
        sigma = float(np.sqrt((np.array(own.octave_rms_m)[DRAFT_CORRELATION_M >= WAVE_M] ** 2).sum()))
    found = {"correlationLength": DRAFT_CORRELATION_M, "spectralSlope": -(1 + 2 * own.hurst)}
    if own.waviness_m is not None and own.waviness_length_m is not None:
        found |= {"waviness": own.waviness_m, "wavinessLength": own.waviness_length_m}
    return ({"roughness": sigma} if sigma > 0 else {}) | found


def own_surface(surface: Mapping[str, Any]) -> OwnSurface | None:
    """Read our words of a surface, where the draft's fields are still as we write them."""
    try:
        own = msgspec.convert(_entry_value(surface), OwnSurface)
    except msgspec.ValidationError:
        return None
    same = all(surface.get(key) == value for key, value in finish_entry(own).items())
    return own if same and "profile" not in surface and "normalTexture" not in surface else None


def own_model(entry: Mapping[str, Any], freq_hz: Array, decay_per_s: Array) -> OwnModel | None:
    """Read our words of a model, where they agree with its accessors."""
    try:
        own = msgspec.convert(_entry_value(entry), OwnModel)
    except msgspec.ValidationError:
        return None
    pairs = ((own.modes.freq_hz, freq_hz), (own.modes.decay_per_s, decay_per_s))
    same = all(
        len(ours) == len(theirs) and np.array_equal(np.array(ours, np.float32), theirs.astype(np.float32))
        for ours, theirs in pairs
    )
    return own if same else None


def own_mounting(node: Mapping[str, Any]) -> Mounting:
    """Read how a node's body is held; raises RecordError."""
    said = _entry_value(node)
    return as_mounting(said["mounting"], "mounting") if isinstance(said, dict) and "mounting" in said else FREE


def without_mounting(freq_hz: Array, decay_per_s: Array, mounting: Mounting) -> tuple[Array, Array]:
    """Return frequencies and decays without the loss of a mounting: d - ηω₀/2, as the run time adds it again."""
    omega0 = np.sqrt((2 * np.pi * freq_hz) ** 2 + decay_per_s**2)
    decay = np.maximum(decay_per_s - loss_factor(mounting) / 2 * omega0, 0.0)
    return np.sqrt(omega0**2 - decay**2) / (2 * np.pi), decay


def with_grain(material: Material, own: OwnSurface) -> Array:
    """Return the stiffness (6, 6) of our words, where its average is what the file says of the bulk."""
    if own.stiffness_pa is None:
        return material.stiffness_pa
    made = np.array(own.stiffness_pa)
    other = Material("", material.density_kg_m3, made)
    same = np.allclose(isotropic_stiffness_pa(other.youngs_pa, other.poisson), material.stiffness_pa, rtol=1e-6)
    return made if same else material.stiffness_pa


def _entry_value(entry: Mapping[str, Any]) -> Any:
    extras = entry.get("extras")
    return extras.get(EXTRAS) if isinstance(extras, dict) else None
