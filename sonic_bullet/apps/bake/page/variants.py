"""A baked body in other materials: a few numbers of each mode, from the baked model alone.

    f₀' = f₀ √(E'ρ/Eρ'),   φ' = φ √(ρ/ρ')               the shapes of one Poisson's ratio
    d' = (α' + β' ω₀'²)/2 + heat of the wall + radiation
    P' = P · P̂(r)/P̂(1) √(ρ/ρ'),   r = f₀'/f₀       P̂: of the surface of the model's points
    ln |P̂| a parabola in ln r through three ratios, since the radiation of each takes seconds
        [radiation.far_field; effects.damping_law.thermoelastic]

The page's own JavaScript goes on from there to other sizes (variant.js). Poisson's ratio stays that of the baked
material: from 0.2 to 0.35 it moves frequencies by some percent. A material with a grain has no variants, nor is one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.apps.bake.baked_model import BakedModel
from sonic_bullet.apps.bake.strike_playback import pressure_of
from sonic_bullet.effects.presets_of_effects import with_modes
from sonic_bullet.files.presets import load_material
from sonic_bullet.radiation.radiated import radiation_and_note
from sonic_bullet.records import Air, Array, Material, ModalModel

PAGE_MATERIALS = ("steel", "aluminium", "brass", "copper", "glass", "porcelain", "concrete", "wood", "plastic")
"""Those of a page's list: isotropic, and not softer by so much that a body's modes leave the band they are baked in."""


@dataclass(frozen=True, slots=True, eq=False)
class MaterialVariant:
    """Modes of a baked body in a material, at the baked size.

    Attributes
    ----------
    freq0_hz : (m,)
        Of the undamped modes.
    steady_per_s
        Part of each decay that no size changes: α/2.
    own_per_s : (m,)
        The rest of what the body itself loses.
    pressure_pa_m : (m,) complex
        As of `BakedModel`.
    shape_factor
        Shapes are the baked ones times this.
    contact_modulus_pa
        As of `BakedMaterial`.
    """

    name: str
    freq0_hz: Array
    steady_per_s: float
    own_per_s: Array
    pressure_pa_m: Array
    shape_factor: float
    contact_modulus_pa: float


def material_variants(
    model: BakedModel,
    names: tuple[str, ...] = PAGE_MATERIALS,
    *,
    radiating_share: float = 1.0,
    coarse: BakedModel | None = None,
) -> tuple[MaterialVariant, ...]:
    """Compute the baked material's own variant, first, and those of other materials.

    Parameters
    ----------
    model : BakedModel
    names : tuple of str
        Of the other materials.
    radiating_share : float
        As of its mounting.
    coarse : BakedModel, optional
        The same modes at fewer points, from which radiation is computed sooner. None: the model.

    Raises
    ------
    ModalError
        Where nothing says how the model radiates.
    """
    air, baked = Air(), model.material
    pressure = pressure_of(model)
    omega0 = np.sqrt((2 * np.pi * model.freq_hz) ** 2 + model.decay_per_s**2)
    steady = 0.0 if baked.alpha_per_s is None else baked.alpha_per_s / 2
    radiated = radiating_share * _radiated_per_s(pressure, air)
    steady = min(steady, float((model.decay_per_s - radiated).min(initial=steady).clip(0)))
    own = MaterialVariant(
        baked.name or "as baked",
        omega0 / (2 * np.pi),
        steady,
        model.decay_per_s - steady - radiated,
        pressure,
        1.0,
        baked.contact_modulus_pa or np.inf,
    )
    return (own, *_others(model if coarse is None else coarse, own, names))


def _radiated_per_s(pressure_pa_m: Array, air: Air) -> Array:
    """Compute Δd = 2π|P|²/ρ₀c [radiation.far_field]."""
    return np.asarray(2 * np.pi * np.abs(pressure_pa_m) ** 2 / (air.density_kg_m3 * air.sound_speed_m_s))


def _others(model: BakedModel, own: MaterialVariant, names: tuple[str, ...]) -> Iterator[MaterialVariant]:
    """Yield the variants of other materials, where the baked one is known and the same in every direction."""
    baked = model.material
    if not names:
        return
    if baked.youngs_pa is None or baked.density_kg_m3 is None or baked.stiffness_pa is not None or not len(model.face):
        return
    order = np.argsort(own.freq0_hz, kind="stable")
    rank = np.argsort(order)
    solid = ModalModel(
        own.freq0_hz[order], np.zeros(len(order)), model.shape[:, :, order], model.point_m, model.face,
        np.zeros(len(model.face)), 0.0, 0.0,
    )  # fmt: skip
    others = [made for made in map(load_material, names) if made.name != baked.name]
    ratios = [_ratios(material, baked.youngs_pa, baked.density_kg_m3) for material in others]
    loudness = _loudness_by_pitch(solid, [1.0, *(pitch for pitch, _ in ratios)])
    for material, (pitch, lightness) in zip(others, ratios, strict=True):
        freq0 = solid.freq_hz * pitch
        lossless = replace(solid, freq_hz=freq0, shape=(solid.shape * np.float32(lightness)))
        omega0 = 2 * np.pi * freq0
        heat = np.interp(*_decay_of(with_modes(lossless, material), freq0))
        rise = lightness * loudness(pitch)
        alpha, beta = (0.0 if one is None else one for one in (material.alpha_per_s, material.beta_s))
        yield MaterialVariant(
            material.name,
            freq0[rank],
            alpha / 2,
            (beta * omega0**2 / 2 + heat)[rank],
            own.pressure_pa_m * rise[rank],
            lightness,
            material.plane_strain_pa,
        )


def _loudness_by_pitch(model: ModalModel, ratios: list[float]) -> Callable[[float], Array]:
    """Return the function r -> P̂(r)/P̂(1) of the modes, from three ratios."""
    low, high = min(ratios), max(ratios)
    knots = np.unique([low, np.sqrt(low * high), high])
    level = np.array([
        np.log(np.maximum(np.abs(
            radiation_and_note(replace(model, freq_hz=model.freq_hz * knot), Air(), keep_surface=True)[0]
        ), 1e-300))
        for knot in knots
    ])  # fmt: skip
    parabola = np.polynomial.polynomial.polyfit(np.log(knots), level, len(knots) - 1)

    def rise(ratio: float) -> Array:
        return np.asarray(np.exp(np.polynomial.polynomial.polyval(np.log(ratio), parabola) - parabola[0]))

    return rise


def _decay_of(model: ModalModel, freq0_hz: Array) -> tuple[Array, Array, Array]:
    """Return the arguments of np.interp for the decays of a model whose modes may have changed their order."""
    undamped = np.sqrt(model.omega0_squared_per_s2) / (2 * np.pi)
    order = np.argsort(undamped, kind="stable")
    return freq0_hz, undamped[order], model.decay_per_s[order]


def _ratios(material: Material, youngs_pa: float, density_kg_m3: float) -> tuple[float, float]:
    """Return the ratios of frequencies and of shapes."""
    pitch = np.sqrt(material.youngs_pa / material.density_kg_m3 / (youngs_pa / density_kg_m3))
    return float(pitch), float(np.sqrt(density_kg_m3 / material.density_kg_m3))
