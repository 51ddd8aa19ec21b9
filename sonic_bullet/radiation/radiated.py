"""How a body's modes radiate, computed once: the first scene with a model waits a second or two for it, the next ones
do not.

sha256(frequencies, shapes, surface, air, source text of radiation.far_field) -> weight, Δd in the cache that keeps the
models themselves
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sonic_bullet.machine.while_alive import WhileAlive
from sonic_bullet.modal import cache as store
from sonic_bullet.radiation import entrained_mass as added_mass
from sonic_bullet.radiation import far_field as radiation
from sonic_bullet.records import Air, Array, ModalModel
from sonic_bullet.records.errors import ModalError

SOURCES = tuple(Path(str(room.__file__)).resolve() for room in (radiation, added_mass))
PACKAGES = ("numpy", "scipy", "numba")
NO_SURFACE = (
    "a body's surface crosses itself or has no extent: how it radiates cannot be said",
    "build the model anew from a closed mesh",
)
LAYOUT = {name: store.Kept("f8", ("m",)) for name in ("real", "imag", "damping")}


@WhileAlive
def radiation_of(model: ModalModel, air: Air, cache: store.Place = "default") -> tuple[Array, Array]:
    """`radiation.far_field.radiation` of a model: pressure weight (m,) complex and radiation damping (m,).

    Bodies that share a model share it (models are compared by identity). cache: folder, "default" or None.
    """
    m = model.mode_count
    if m == 0 or len(model.face) == 0:
        return radiation.radiation(model, air)
    code = store.code_digest(SOURCES, PACKAGES)
    name = store.key(
        "radiation",
        model.freq_hz,
        model.shape,
        model.vertex_m,
        model.face,
        air.density_kg_m3,
        air.sound_speed_m_s,
        code=code,
    )
    known = _recall(store.load(cache, name, LAYOUT), m)
    if known is None:
        known = _solved(model, air)
        store.save(cache, name, {"real": known[0].real, "imag": known[0].imag, "damping": known[1]}, "")
    return known


def _solved(model: ModalModel, air: Air) -> tuple[Array, Array]:
    """`radiation` of a surface that has one.

    Raises ModalError where it has not: triangles that cross or meet themselves, or lie in one point.
    """
    try:
        weight, damping = radiation.radiation(model, air)
    except (ZeroDivisionError, np.linalg.LinAlgError) as error:
        raise ModalError(*NO_SURFACE) from error
    if not (np.isfinite(weight).all() and np.isfinite(damping).all()):
        raise ModalError(*NO_SURFACE)
    return weight, damping


def _recall(found: tuple[dict[str, Array], str] | None, m: int) -> tuple[Array, Array] | None:
    """What was kept, where it is of as many modes."""
    if found is None or len(found[0]["real"]) != m:
        return None
    a = found[0]
    weight = np.empty(m, complex)
    weight.real, weight.imag = a["real"], a["imag"]
    return weight, np.array(a["damping"])
