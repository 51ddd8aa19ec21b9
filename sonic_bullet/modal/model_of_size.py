"""A shape solved once, for every size and isotropic material.

    Shape -> family (reduced.py) at size 1 -> ModalModel at size s of a material (E, ν, ρ)

    λ = (E/ρ) θ(ν)/(sL)²,   u = u'(ν)/√(ρ (sL)³),   x = s x',   curvature = curvature'/s

so that f ∝ √(E/ρ)/s and u ∝ ρ^(-1/2) s^(-3/2). Damping is the material's at the new λ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sonic_bullet.modal.isotropic_family import Family
from sonic_bullet.modal.modal_analysis import damp_modes
from sonic_bullet.records import Array, Material, ModalModel, isotropic_stiffness_pa
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import ModalError
from sonic_bullet.records.mode_shapes import quantize_shapes


def check_isotropic(material: Material) -> None:
    """Raise ModalError where a material is stiffer in some directions than in others."""
    isotropic = 1e-9  # relative deviation from an isotropic tensor that rounding explains
    even = isotropic_stiffness_pa(material.youngs_pa, material.poisson)
    if np.abs(even - material.stiffness_pa).max() > isotropic * np.abs(even).max():
        raise ModalError(
            f"material {material.name} is not isotropic", "its bodies are solved anew: give `Listener.add` the mesh"
        )


def resize_model(model: ModalModel, size: float, decay_per_s: Callable[[Array], Array]) -> ModalModel:
    """Return a body's modes where it is ``size`` times as large, of the same E, ν and ρ.

    decay_per_s: of eigenvalues (m,) in 1/s²; a mode that would be overdamped keeps 0.99 of its ω.
    """
    value = model.omega0_squared_per_s2 / size**2
    decay = np.minimum(decay_per_s(value), 0.99 * np.sqrt(value))
    shape = model.shape * np.float32(size**-1.5)
    shape.setflags(write=False)  # the record's own: it is most of a model, and would be copied
    return replace(
        model,
        freq_hz=np.sqrt(value - decay**2) / (2 * np.pi),
        decay_per_s=decay,
        shape=shape,
        vertex_m=model.vertex_m * size,
        curvature_per_m=model.curvature_per_m / size,
        touched=None if model.touched is None else model.touched.resize(size),
        volume_m3=model.volume_m3 * size**3,
        mass_kg=model.mass_kg * size**3,
    )


def radiation_of_size(weight: Array, damping_per_s: Array, size: float) -> tuple[Array, Array]:
    """Scale pressure at 1 m per modal velocity and radiation damping (m,) of the same ka: s^(-1/2), 1/s.

    u ∝ s^(-3/2), a surface ∝ s², k ∝ 1/s    [far_field, its first equation]
    """
    return weight / np.sqrt(size), damping_per_s / size


def model_of_size(
    family: Family, material: Material, size: float, to_hz: float, *, exact_shapes: bool = False
) -> tuple[ModalModel, Array]:
    """Make the model of a family's body times ``size`` of an isotropic material.

    exact_shapes: as of `modal.analyse`.

    Returns
    -------
    ModalModel
        Its modes up to to_hz, as far as the family has them.
    Array, shape (m,)
        Which of the family's modes they are.
    """
    density = material.density_kg_m3
    length_m = size * family.length_m
    value, vector = family.modes(material.youngs_pa / density, material.poisson)
    value = value[value <= (2 * np.pi * to_hz * size) ** 2] / size**2
    freq_hz, decay_per_s, alive = damp_modes(value, material)
    skin = family.skin.reshape(-1, family.skin.shape[2])
    shape = skin @ (vector[:, alive] / np.sqrt(density * length_m**3)).astype(np.float32)
    shape = shape.reshape(*family.skin.shape[:2], -1)
    dropped = len(value) - len(alive)
    left_out = f"; {format_count(dropped, 'overdamped mode')} dropped" if dropped else ""
    model = ModalModel(
        freq_hz=freq_hz,
        decay_per_s=decay_per_s,
        shape=shape if exact_shapes else quantize_shapes(shape),
        vertex_m=family.vertex_m * size,
        face=family.face,
        curvature_per_m=family.curvature_per_m / size,
        touched=None if family.touched is None else family.touched.resize(size),
        volume_m3=family.volume_m3 * size**3,
        mass_kg=family.volume_m3 * size**3 * density,
        dropped=dropped,
        note=f"{family.note}; size {size:.6g} of a shape solved once{left_out}",
        includes_radiation=material.includes_radiation,
    )
    return model, alive
