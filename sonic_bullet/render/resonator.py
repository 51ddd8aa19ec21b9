"""A body as the synthesizer plays it: its audible modes, their weights at each sensor, and where on its surface a
contact lies.

    Body (records) + sensors + rate + air -> Sounder;  contact points -> Touch -> Uᵀf (participation)

A rigid body that is pushed sounds too: acceleration noise. A sphere of radius a whose velocity jumps by U is heard as p
= ρ₀c U (a/r) cosθ e^{-wt}(cos wt - sin wt), w = c/a [Kirchhoff 1876; Koss, Alfredson 1973, eq. 9]. That is the impulse
response of a mode with decay w and frequency w, to the letter (synth.bank), so the three translations of a body are
three more modes of the bank, of one pole: strikes are exact there too. At low frequency it is the compact law p = 3ρ₀V
cosθ/(8πcr)·da/dt [Chadwick, Zheng, James 2012], whose coefficient K makes ρ₀ca = 2Kw²; unlike it, it does not grow
without bound where the body is no longer small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.geometry.nearest_point import SurfaceIndex, nearest, surface_index
from sonic_bullet.machine.compiled import njit
from sonic_bullet.radiation.far_field import jerk_coefficient
from sonic_bullet.radiation.radiated import radiation_of
from sonic_bullet.records import Air, Array, Body, Microphone, ModalSum, Sensor, Vibrometer
from sonic_bullet.synth.bank import Translation, audible

CREASE_COS = np.cos(np.radians(20.0))
EDGE_RADIUS_SHARE = 0.005
EDGE_RADIUS_LEAST_M = 2e-4
FASTEST_RIGID = 0.6
"""Share of sr/2 at which a small body's w is cut: below, its click is the compact law's, which no longer hangs on w."""


@dataclass(frozen=True, slots=True, eq=False)
class Resonator:
    """omega_rad_s, decay_per_s (m,): with the air's damping, once. weight (w, m): complex, one row a weight set (row 0:
    pressure at 1 m). bend, damping_growth (m,): of frequency per |z|², of decay by
    (damping_growth·|z|)^damping_growth_power, None in a linear body. shape (v, 3, m) float32: audible modes only.
    size_m: cube root of the volume. jerk_pa_s3: dipole coefficient [Chadwick 2012]. dropped: modes not played.
    """

    body: Body
    omega_rad_s: Array
    decay_per_s: Array
    weight: Array
    shape: Array
    index: SurfaceIndex | None
    normal: Array
    size_m: float
    radius_m: float
    rigid: Translation | None
    dropped: int
    bend: Array | None = None
    damping_growth: Array | None = None
    damping_growth_power: float = 1.0

    @property
    def mode_count(self) -> int:
        return len(self.omega_rad_s)


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """Contacts on one body's surface: face (k,), barycentric (k, 3) and the surface's curvature there (k,) in 1/m."""

    face: Array
    barycentric: Array
    curvature_per_m: Array


def weight_sets(sensors: tuple[Sensor, ...]) -> tuple[Sensor, ...]:
    """The sensors that read modes by themselves, one weight set each behind row 0 (which serves all microphones)."""
    return tuple(sensor for sensor in sensors if not isinstance(sensor, Microphone))


def build_resonator(body: Body, sensors: tuple[Sensor, ...], sr: int, air: Air) -> Resonator:
    """Prepare one body. Modes at or above sr/2 and overdamped ones are dropped and counted.

    The pressure weight of mode and microphone is the far-field map of `radiation.far_field`; a vibrometer reads (φ(q)·n);
    the seed's plain sum reads a·sin(ωt) for each mode [Ren et al. 2013, eq. 13], hence the turn by -i/(1 + i d/ω).
    """
    model = body.model
    readers = weight_sets(sensors)
    if model is None:
        none = np.zeros(0)
        return Resonator(
            body,
            none,
            none,
            np.zeros((1 + len(readers), 0), complex),
            np.zeros((0, 3, 0), np.float32),
            None,
            np.zeros((0, 3)),
            _size(body),
            0.0,
            None,
            0,
        )
    pressure, extra = radiation_of(model, air)
    omega0_squared = model.omega0_squared_per_s2
    own = np.nan_to_num(model.decay_per_s)
    decay = own if model.includes_radiation else own + extra
    omega = np.sqrt(np.maximum(omega0_squared - decay**2, 0.0))
    keep = audible(omega, decay, sr)
    omega, decay = omega[keep], decay[keep]
    shape = np.ascontiguousarray(model.shape[:, :, keep])
    weight = np.zeros((1 + len(readers), len(omega)), complex)
    weight[0] = pressure[keep]
    index = surface_index(model.vertex_m, model.face) if len(model.face) else None
    for row, sensor in enumerate(readers, start=1):
        if isinstance(sensor, ModalSum):
            weight[row] = sensor.scale * -1j / (1 + 1j * decay / omega)
        elif (
            isinstance(sensor, Vibrometer)
            and (sensor.body_id, sensor.link) == (body.body_id, body.link)
            and index is not None
        ):
            face, barycentric, _ = nearest(index, sensor.point_m[None], None)
            weight[row] = participation(shape, model.face, face, barycentric, sensor.direction[None])
    corner = model.vertex_m[model.face]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) if len(corner) else np.zeros((0, 3))
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    radius = float(np.linalg.norm(model.vertex_m, axis=1).max(initial=0.0))
    dropped = model.dropped + int(np.sum(~keep))
    rigid = _rigid(body, sr, air)
    # velocity at the surface of a mode with |z| = 1
    most = np.sqrt((shape.astype(float) ** 2).sum(axis=1)).max(axis=0, initial=0.0)
    bend = None if model.bend_s2_m2 is None else model.bend_s2_m2[keep] * most**2
    damping_growth = None if model.damping_growth_s_m is None else model.damping_growth_s_m[keep] * most
    return Resonator(
        body,
        omega,
        decay,
        weight,
        shape,
        index,
        normal,
        _size(body),
        radius,
        rigid,
        dropped,
        bend,
        damping_growth,
        model.damping_growth_power,
    )


def _rigid(body: Body, sr: int, air: Air) -> Translation | None:
    """The mode that each translation of a moving body is; its gain is the force along it, its weight Pa·m per N·s."""
    radius = (3 * body.volume_m3 / (4 * np.pi)) ** (1 / 3)
    if body.mass_kg <= 0 or radius <= 0 or body.material is None:  # the least of volumes have a radius of none, too
        return None
    rate = min(air.sound_speed_m_s / radius, FASTEST_RIGID * np.pi * sr)
    return Translation(rate, rate, 2 * jerk_coefficient(body.volume_m3, air) * rate**2 / body.mass_kg)


def _size(body: Body) -> float:
    return float(max(body.volume_m3, 1e-9) ** (1 / 3))


def touch_one(resonator: Resonator, point_m: Array, outward: Array) -> tuple[Array, Array, Array]:
    """Face (k,), barycentric (k, 3) and curvature (k,) where contacts (k, 3) in the body frame, outward normals (k, 3),
    lie on the true surface.

    Where the contact's normal leans more than 20° from the face's, an edge or corner is touched: its radius is taken as
    0.5 % of the body's size, at least 0.2 mm (a broken edge, as made things have).
    """
    count = len(point_m)
    body = resonator.body
    everywhere = body.curvature_per_m if np.isfinite(body.curvature_per_m) else 0.0
    if resonator.index is None or body.model is None:
        return np.zeros(count, np.int64), np.zeros((count, 3)), np.full(count, everywhere)
    face, barycentric, _ = nearest(resonator.index, point_m, outward)
    if np.isfinite(body.curvature_per_m):
        return face, barycentric, np.full(count, everywhere)
    edge = 1.0 / max(EDGE_RADIUS_SHARE * resonator.size_m, EDGE_RADIUS_LEAST_M)
    leaning = np.einsum("ki,ki->k", resonator.normal[face], outward) < CREASE_COS
    return face, barycentric, np.where(leaning, edge, body.model.curvature_per_m[face])


def uplift(resonator: Resonator, face: Array, barycentric: Array, force: Array) -> Array:
    """Uᵀf (m,): forces (k, 3) in the body frame at contacts, onto the body's audible modes, summed."""
    if resonator.body.model is None or resonator.mode_count == 0:
        return np.zeros(resonator.mode_count)
    return np.asarray(
        participation(resonator.shape, resonator.body.model.face, face, barycentric, np.ascontiguousarray(force))
    )


@njit(nogil=True)
def participation(
    shape: Array, face: Array, at_face: Array, barycentric: Array, force: Array
) -> Array:  # pragma: no cover - compiled
    """Σ over contacts of the shapes, linear in the triangle, times the force:

    (v, 3, m), (f, 3), (k,), (k, 3), (k, 3) -> (m,).
    """
    modes = shape.shape[2]
    total = np.zeros(modes)
    for k in range(len(at_face)):
        for corner in range(3):
            vertex = face[at_face[k], corner]
            for axis in range(3):
                factor = barycentric[k, corner] * force[k, axis]
                if factor != 0.0:
                    for m in range(modes):
                        total[m] += factor * shape[vertex, axis, m]
    return total
