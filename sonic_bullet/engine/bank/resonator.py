"""A body for the synthesizer: its audible modes and their weights at each sensor.

    Body (records) + sensors + rate + air -> Resonator

A rigid body that is accelerated sounds too: acceleration noise. A sphere of radius a whose velocity jumps by U radiates
p = ρ₀c U (a/r) cosθ e^{-wt}(cos wt - sin wt), w = c/a [Kirchhoff 1876; Koss, Alfredson 1973, eq. 9]. That is exactly
the impulse response of a mode with decay w and frequency w, so the three translations of a body are three
more modes of the bank: strikes are exact there too. At low frequency it is the compact law p = 3ρ₀V
cosθ/(8πcr)·da/dt [Chadwick, Zheng, James 2012], whose coefficient K makes ρ₀ca = 2Kw²; unlike it, it does not grow
without bound where the body is no longer small.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sonic_bullet._engine import find_largest_motions
from sonic_bullet.engine.bank import Translation, audible
from sonic_bullet.engine.bank.rigid_motion import rigid_columns, rigid_rows
from sonic_bullet.engine.contact.coupling import BodyMobility, ContactSide
from sonic_bullet.engine.contact.coupling.mobility import alike_pairs
from sonic_bullet.geometry.nearest_point import SurfaceIndex, nearest, surface_index
from sonic_bullet.machine.identity_cache import WhileAlive
from sonic_bullet.radiation.far_field import UNEVEN_AXIS, jerk_coefficient
from sonic_bullet.radiation.radiated import radiation_of
from sonic_bullet.records import Air, Array, Body, Microphone, ModalModel, ModalSum, Sensor, Vibrometer
from sonic_bullet.records.mounting import Mounting, loss_factor, radiating_share
from sonic_bullet.signal.elementary import cbrt, complex_product, complex_root, complex_size, exp


@dataclass(frozen=True, slots=True, eq=False)
class Resonator:
    """A body's audible modes at each sensor.

    Attributes
    ----------
    omega_rad_s, decay_per_s : (m,) with the air's damping, once
    weight : (w, m) complex, one row a weight set (row 0: pressure at 1 m)
    shape : (v, 3, m) float32
    size_m : cube root of the volume
    translation : acceleration noise, dipole coefficient by [Chadwick 2012]
    dropped : number of modes not played
    mobility, side : where it is touched, and its elastic properties there
    bend, damping_growth : (m,) of frequency per |z|², of decay by (damping_growth·|z|)^damping_growth_power
        None in a linear body
    rigid_columns : 6 where its rigid motion is played too, else 0
    keep : which of its model's modes are audible
    touched : the surface that says how it is curved where it is touched, None where it is that of index
    """

    body: Body
    omega_rad_s: Array
    decay_per_s: Array
    weight: Array
    shape: Array
    index: SurfaceIndex | None
    size_m: float
    radius_m: float
    translation: Translation | None
    dropped: int
    mobility: BodyMobility
    side: ContactSide
    bend: Array | None = None
    damping_growth: Array | None = None
    damping_growth_power: float = 1.0
    rigid_columns: int = 0
    keep: Array | None = None
    touched: SurfaceIndex | None = None

    @property
    def mode_count(self) -> int:
        """Number of audible modes."""
        return len(self.omega_rad_s)


def weight_sets(sensors: tuple[Sensor, ...]) -> tuple[Sensor, ...]:
    """Return the sensors that read modes themselves, one weight set each behind row 0, that of all microphones."""
    return tuple(sensor for sensor in sensors if not isinstance(sensor, Microphone))


def weight_set_count(sensors: tuple[Sensor, ...]) -> int:
    """Count row 0, a row for each of `weight_sets`, and those that read rigid motions."""
    return 1 + len(weight_sets(sensors)) + len(directional(sensors)) + rigid_rows(sensors)


def directional(sensors: tuple[Sensor, ...]) -> tuple[int, ...]:
    """Return the numbers, among the microphones, of those that hear on which side of a body they are."""
    microphones = [one for one in sensors if isinstance(one, Microphone)]
    return tuple(c for c, one in enumerate(microphones) if one.directivity)


def aimed_sets(sensors: tuple[Sensor, ...]) -> Array:
    """Return (W,) which of the `directional` microphones each weight set is of, -1 for none."""
    first, count = 1 + len(weight_sets(sensors)), len(directional(sensors))
    aims = np.full(weight_set_count(sensors), -1, np.int64)
    aims[first : first + count] = np.arange(count)
    return aims


def microphone_sets(sensors: tuple[Sensor, ...]) -> Array:
    """Return the weight set (c,) of each microphone: 0, that of all, or its own."""
    sets = np.zeros(sum(isinstance(one, Microphone) for one in sensors), np.int64)
    sets[list(directional(sensors))] = np.flatnonzero(aimed_sets(sensors) >= 0)
    return sets


def read_sets(sensors: tuple[Sensor, ...]) -> Array:
    """Return the weight set (c,) that each sensor reads, 0 for all microphones; then those of rigid motions."""
    own = np.array([not isinstance(one, Microphone) for one in sensors] + [True] * rigid_rows(sensors), bool)
    sets = np.where(own, np.cumsum(own), 0)
    sets[len(sensors) :] += len(directional(sensors))  # which stand between
    return sets.astype(np.int64)


def build_resonator(body: Body, sensors: tuple[Sensor, ...], sr: int, air: Air) -> Resonator:
    """Prepare one body. Modes at or above sr/2 and overdamped ones are dropped and counted.

    The pressure weight of mode and microphone is the far-field map of `radiation.far_field`; a vibrometer reads
    (φ(q)·n); a plain modal sum reads a·sin(ωt) for each mode [Ren et al. 2013, eq. 13], hence the turn by -i/(1 + i
    d/ω).
    """
    rigid = ContactSide(np.inf, 0.3, 0.0, 0.0)  # side of a partner of unknown material
    model = body.model
    readers, sets = weight_sets(sensors), weight_set_count(sensors)
    side = rigid if body.material is None else ContactSide.of(body.material)
    if model is None:
        none = np.zeros(0)
        return Resonator(
            body,
            none,
            none,
            np.zeros((sets, 0), complex),
            np.zeros((0, 3, 0), np.float32),
            None,
            _size(body),
            0.0,
            None,
            0,
            BodyMobility(none, none, body.mass_kg, body.inertia_kg_m2),
            side,
        )
    keep, omega, decay, pressure, shape, most, index, radius, touched = _compute_played(model, air, sr, body.mounting)
    weight = np.zeros((sets, len(omega)), complex)
    weight[0] = pressure
    weight[aimed_sets(sensors) >= 0] = pressure
    for row, sensor in enumerate(readers, start=1):
        if isinstance(sensor, ModalSum):
            weight[row] = sensor.scale * -1j / (1 + 1j * decay / omega)
        elif (
            isinstance(sensor, Vibrometer)
            and (sensor.body_id, sensor.link) == (body.body_id, body.link)
            and index is not None
        ):
            face, barycentric, _ = nearest(index, sensor.point_m[None], None)
            corners = shape[model.face[face[0]]].astype(float)
            weight[row] = (barycentric[0][:, None, None] * corners * sensor.direction[:, None]).sum(axis=(0, 1))
    dropped = model.dropped + int(np.sum(~keep))
    translation = _translation(body, sr, air)
    if body.silent or body.gain_db:  # of its sound at sensors; its coupling to partners stays
        weight *= body.sounding_gain
        if translation is not None:
            translation = replace(translation, weight=translation.weight * body.sounding_gain)
    bend = None if model.bend_s2_m2 is None else model.bend_s2_m2[keep] * most**2
    damping_growth = None if model.damping_growth_s_m is None else model.damping_growth_s_m[keep] * most
    return Resonator(
        body,
        omega,
        decay,
        weight,
        shape,
        index,
        _size(body),
        radius,
        translation,
        dropped,
        BodyMobility(omega, decay, body.mass_kg, body.inertia_kg_m2),
        side,
        bend,
        damping_growth,
        model.damping_growth_power,
        rigid_columns(body, sensors) if index is not None else 0,
        keep,
        touched,
    )


class _SharedModes(NamedTuple):
    """What bodies that share a model share.

    Attributes
    ----------
    keep : which of its modes are audible
    omega_rad_s, decay_per_s, pressure, shape : see `Resonator`, of those
    most : velocity at the surface of a mode with |z| = 1
    """

    keep: Array
    omega_rad_s: Array
    decay_per_s: Array
    pressure: Array
    shape: Array
    most: Array
    surface: SurfaceIndex | None
    radius_m: float
    touched: SurfaceIndex | None


@WhileAlive
def _compute_played(model: ModalModel, air: Air, sr: int, mounting: Mounting) -> _SharedModes:
    """Compute once what bodies that share a model and mounting share (records are compared by identity)."""
    pressure, extra = radiation_of(model, air)
    pressure, extra = np.sqrt(radiating_share(mounting)) * pressure, radiating_share(mounting) * extra
    omega0_squared = model.omega0_squared_per_s2
    own = np.nan_to_num(model.decay_per_s)
    decay = own if model.includes_radiation else own + extra
    decay = decay + loss_factor(mounting) / 2 * np.sqrt(omega0_squared)
    omega = np.sqrt(np.maximum(omega0_squared - decay**2, 0.0))
    keep = audible(omega, decay, sr)
    shape = np.ascontiguousarray(model.shape if keep.all() else model.shape[:, :, keep])
    most = np.empty(shape.shape[2])
    find_largest_motions(shape, most)
    index = surface_index(model.vertex_m, model.face, model.curvature_per_m) if len(model.face) else None
    radius = float(np.linalg.norm(model.vertex_m, axis=1).max(initial=0.0))
    pairs = _round_pairs(omega[keep], pressure[keep])
    if model.stands_for is not None:  # what was filled in is no round body's
        solved = model.stands_for[keep] <= 1
        pairs = pairs[solved[pairs] & solved[pairs + 1]]
    pressure = _in_quadrature(pressure[keep], pairs, shape, model.vertex_m)
    given = model.touched
    touched = None if given is None else surface_index(given.vertex_m, given.face, given.curvature_per_m)
    return _SharedModes(keep, omega[keep], decay[keep], pressure, shape, most, index, radius, touched)


def _round_pairs(omega_rad_s: Array, pressure: Array) -> Array:
    """Return those of `alike_pairs` (p,) that a round body makes: of one frequency, and as loud as each other."""
    same_pitch, same_size = 1e-3, 0.1  # meshes of round bodies split pairs by 5e-4; sizes differed by 8 % at most
    pairs, size = alike_pairs(omega_rad_s), complex_size(pressure)
    one, other = size[pairs], size[pairs + 1]
    alike = np.abs(np.diff(omega_rad_s)[pairs]) < same_pitch * omega_rad_s[pairs]
    return np.asarray(pairs[alike & (np.abs(other - one) < same_size * np.maximum(one, other))])


def _in_quadrature(pressure: Array, pairs: Array, shape: Array, vertex_m: Array) -> Array:
    """Give the weights (m,) of the two of each pair (p,) phases a quarter of a turn apart.

    w_1 = |w_1| u e^{-jψ},  w_2 = j |w_2| u e^{-jψ},  e^{jψ} = (c_1 + j c_2)/|c|,  c = ∫ g a·φ
    Over all directions the two of a round body do not interfere, for their maps are orthogonal, as cos nθ and sin nθ
    are: <|p|²> = |w_1 z_1|² + |w_2 z_2|². So they do not where sensors receive the mean over directions. Others of
    their plane have c turned as they are, and Σ w z is the same, whichever two a mesh has. In the other order they turn
    the other way round the body, from a towards b, and -j stands for j.
    """
    spot = 40.0  # of g = e^{spot (cos - 1)}, about the direction a: with waves of up to some 20 around a body in it
    if not len(pairs) or not len(vertex_m):
        return pressure
    beside = np.array([-0.05, 0.0, 0.05])  # b - a: of a turn round any axis of the body, less than half a wave
    both = np.stack([pairs, pairs + 1])

    def seen(toward: Array) -> Array:
        axis = toward / np.sqrt((toward**2).sum())
        cosine = (vertex_m * axis).sum(axis=1) / np.maximum(np.linalg.norm(vertex_m, axis=1), 1e-300)
        moved = exp(spot * (cosine - cosine.max()))[:, None] * axis
        return np.asarray((moved[:, :, None, None] * shape[:, :, both]).sum(axis=(0, 1)))

    c, there = seen(UNEVEN_AXIS), seen(UNEVEN_AXIS + beside)
    quarter = np.where(c[0] * there[1] < c[1] * there[0], -1j, 1j)
    shared = complex_root(complex_product(pressure[both], pressure[both]).sum(axis=0))
    phase = complex_product(shared * np.where(shared.real < 0, -1, 1), c[0] - quarter * c[1])
    size = complex_size(phase)
    unit = np.where(size > 0, phase / np.where(size > 0, size, 1), 1)
    turned = pressure.copy()
    unit = np.stack([unit, unit * quarter])
    turned[both] = complex_size(pressure[both]) * unit
    return turned


def _translation(body: Body, sr: int, air: Air) -> Translation | None:
    """Return the mode of each translation of a moving body: gain is the force along it, weight Pa·m per N·s."""
    # Fraction of sr/2 at which a small body's w is cut: below, its click is the compact law's, which no longer depends
    # on w
    fastest_rigid = 0.6
    radius = float(cbrt(3 * body.volume_m3 / (4 * np.pi)))
    if body.mass_kg <= 0 or radius <= 0 or body.material is None:  # a tiny volume's radius may round to zero
        return None
    rate = min(air.sound_speed_m_s / radius, fastest_rigid * np.pi * sr)
    return Translation(rate, rate, 2 * jerk_coefficient(body.volume_m3, air) * rate**2 / body.mass_kg)


def _size(body: Body) -> float:
    return float(cbrt(max(body.volume_m3, 1e-9)))
