"""Cache of the radiation of a body's modes: the first scene with a model takes a second or two, the next none.

sha256(frequencies, shapes, surface, air, source text of radiation.far_field) -> weight, Δd in the cache that keeps the
models themselves
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from sonic_bullet.files.storage import cache as store
from sonic_bullet.machine.identity_cache import WhileAlive
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.modal.keys import code_digest, key
from sonic_bullet.radiation import compact, near_mesh, pattern, surface_waves
from sonic_bullet.radiation import entrained_mass as added_mass
from sonic_bullet.radiation import far_field as radiation
from sonic_bullet.records import Air, Array, ModalModel
from sonic_bullet.signal.elementary import complex_size

SOURCES = tuple(
    Path(str(module.__file__)).resolve() for module in (radiation, added_mass, near_mesh, surface_waves, compact)
)
PACKAGES = ("numpy", "scipy")


def radiation_of(model: ModalModel, air: Air, cache: store.Place = "default") -> tuple[Array, Array]:
    """Compute `radiation.far_field.radiation` of a model: pressure weight (m,) complex and radiation damping (m,).

    Bodies that share a model share the result (models are compared by identity). cache: folder, "default" or None.
    """
    return radiation_and_note(model, air, cache)[:2]


def radiation_note(model: ModalModel, air: Air, cache: store.Place = "default") -> str:
    """Name the simpler law by which a model radiates, where it does, else return ""."""
    return radiation_and_note(model, air, cache)[2]


@WhileAlive
def radiation_and_note(
    model: ModalModel, air: Air, cache: store.Place = "default", keep_surface: bool = False
) -> tuple[Array, Array, str]:
    """Compute `radiation.far_field.radiation_and_note` of a model, cached as by `radiation_of`.

    A resonator that stands for N modes has the shape √N φ, so that z holds their energy. Their pressures add in power,
    √N w_1 z_1 = w_1 z with w_1 = w/√N, and it is damped as each of them, by Δd/N. Its phase is no mode's: real, Re(w z)
    follows the velocity.

    keep_surface: also cache the air that its surface moves, some 4 MB: another material of the same shape needs it.
    """
    weight, damping, note = _all_modes(model, air, cache, keep_surface)
    if model.stands_for is None:
        return weight, damping, note
    weight = np.where(model.stands_for > 1, complex_size(weight), weight)
    return weight / np.sqrt(model.stands_for), damping / model.stands_for, note


def _all_modes(model: ModalModel, air: Air, cache: store.Place, keep_surface: bool) -> tuple[Array, Array, str]:
    """Compute the same for each mode as it stands."""
    m = model.mode_count
    if m == 0 or len(model.face) == 0:
        return radiation.radiation_and_note(model, air)
    code = code_digest(SOURCES, PACKAGES)
    name = key(
        "radiation",
        model.freq_hz,
        model.shape,
        model.vertex_m,
        model.face,
        air.density_kg_m3,
        air.sound_speed_m_s,
        model.solution,
        code=code,
    )
    known = _recall(store.load(cache, name), m)
    if known is None:
        with one_thread():
            known = radiation.radiation_and_note(model, air, partial(_kept_air, cache) if keep_surface else None)
        store.save(cache, name, {"real": known[0].real, "imag": known[0].imag, "damping": known[1]}, known[2])
    return known


@WhileAlive
def pattern_of(model: ModalModel, air: Air, cache: store.Place = "default") -> Array | None:
    """Compute `radiation.pattern.radiation_pattern` of a model, cached as by `radiation_of`; None: even all around."""
    if model.mode_count == 0 or len(model.face) == 0:
        return None
    code = code_digest((*SOURCES, Path(str(pattern.__file__)).resolve()), PACKAGES)
    parts = model.freq_hz, model.shape, model.vertex_m, model.face, air.density_kg_m3, air.sound_speed_m_s
    name = key("pattern", *parts, code=code)
    found = store.load(cache, name)
    if found is None or found[0]["real"].shape != (pattern.PATTERN_ROWS * pattern.PATTERN_TURNS, model.mode_count):
        with one_thread():
            made = pattern.radiation_pattern(model, air)
        if made is None:
            return None
        found = {"real": made.real.astype(np.float32), "imag": made.imag.astype(np.float32)}, ""
        store.save(cache, name, *found)
    return np.asarray(found[0]["real"] + 1j * found[0]["imag"])


def _kept_air(
    cache: store.Place, corner: Array, area: Array, normal: Array, least: int
) -> tuple[added_mass.PotentialMap, Array] | None:
    """Recall `radiation.near_mesh.surface_air` of a surface, or compute it."""
    name = key("surface", corner, least, code=code_digest(SOURCES, PACKAGES))
    found = store.load(cache, name)
    if found is not None:
        a = found[0]
        return added_mass.PotentialMap(a["corner"], a["area"], a["length"], a["vector"]), a["nearest"]
    made = near_mesh.surface_air(corner, area, normal, least)
    if made is not None:
        moved, nearest = made
        arrays = {
            "corner": moved.corner_m,
            "area": moved.area_m2,
            "length": moved.length_m,
            "vector": moved.vector,
            "nearest": nearest,
        }
        store.save(cache, name, arrays, "")
    return made


def _recall(found: tuple[dict[str, Array], str] | None, m: int) -> tuple[Array, Array, str] | None:
    """Return the cached result where it has as many modes and is finite."""
    if found is None or len(found[0]["real"]) != m or not all(np.isfinite(value).all() for value in found[0].values()):
        return None
    a = found[0]
    weight = np.empty(m, complex)
    weight.real, weight.imag = a["real"], a["imag"]
    return weight, np.array(a["damping"]), found[1]
