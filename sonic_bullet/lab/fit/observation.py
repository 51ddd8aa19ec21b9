"""What a sensor hears of each mode: the model of observation that a case declares.

    sum       Σ J (φ(p)·e) e^{−dt} sin ωt
        [Ren, Yeh, Lin 2013, eq. 11, 13]
    velocity  Σ J (φ(p)·e)(φ(q)·n) e^{−dt} (cos ωt − (d/ω) sin ωt)       an impulse J at p along e, seen at q along n
    pressure  Σ J (φ(p)·e) |w| e^{−dt} cos ωt, w the radiation weight of the mode          [radiation.far_field]

All as Re[A e^{(−d+iω)t}]: A = g·J·ψ·(−i | 1 + i d/ω | 1), with ψ the real transfer of the mode and g the gain, one
number for the case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.geometry import outward_normals
from sonic_bullet.geometry.nearest_point import closest_point
from sonic_bullet.modal.isotropic_family import Family
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import MeshError


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """How s strikes of one body are observed, in the family's basis.

    strike (s, b): J φ(p)·e; sensor (b,): φ(q)·n, or None for what has no place.
    known (s,): whether a strike's place is declared. level (s,): whether its impulse is. kind: as `Case.sensor`.
    """

    strike: Array
    sensor: Array | None
    known: Array
    level: Array
    kind: str
    scale_per_kg: float

    def transfer(self, vector: Array, weight: Array | None = None) -> Array:
        """Return real ψ (s, m), J included, of modes (b, m) in the basis; NaN for strikes unknown.

        weight (m,): of the sensor where it has no place.
        """
        at_sensor = (
            self.sensor @ vector
            if self.sensor is not None
            else weight
            if weight is not None
            else np.ones(vector.shape[1])
        )
        power = 1.0 if self.sensor is not None else 0.5
        psi = (self.strike @ vector) * at_sensor * self.scale_per_kg**power
        return np.where(self.known[:, None], psi, np.nan)

    def start(self, freq_hz: Array, decay_per_s: Array) -> Array:
        """Complex factor (m,) of a mode's amplitude: the phase it starts with."""
        if self.kind == "velocity":
            return np.asarray(1 + 1j * decay_per_s / (2 * np.pi * freq_hz))
        return np.full(len(freq_hz), -1j if self.kind == "sum" else 1.0 + 0j)


def observation(
    family: Family,
    density_kg_m3: float,
    kind: str,
    strikes: list[tuple[tuple[float, float, float] | None, tuple[float, float, float] | None, float | None]],
    sensor_m: tuple[float, float, float] | None = None,
    sensor_direction: tuple[float, float, float] | None = None,
) -> Observation:
    """Return how strikes of a body are observed by a sensor.

    Strikes are (position in m, direction, impulse in N·s), None where not known; a direction not given is the inward
    normal. Raises MeshError where a point lies off the surface.
    """
    s, b = len(strikes), family.skin.shape[2]
    rows, known = np.zeros((s, b)), np.array([position is not None for position, _, _ in strikes])
    for i, (position, direction, impulse) in enumerate(strikes):
        if position is None:
            continue
        unit = direction_at(family, position, direction, inward=True)
        rows[i] = _row(family, position, unit, f"strike {i + 1}") * (1.0 if impulse is None else impulse)
    sensor = None
    if kind == "velocity" and sensor_m is not None:
        unit = direction_at(family, sensor_m, sensor_direction, inward=False)
        sensor = _row(family, sensor_m, unit / np.linalg.norm(unit), "sensor")
    level = np.array([impulse is not None for _, _, impulse in strikes])
    return Observation(rows, sensor, known, level, kind, 1 / (density_kg_m3 * family.length_m**3))


def _row(family: Family, position: tuple[float, float, float], direction: Array, what: str) -> Array:
    rows, distance = family.points(np.array([position]), direction[None, :])
    _check_near(distance[0], family.length_m, position, what)
    return np.asarray(rows[0])


def _check_near(distance_m: float, length_m: float, position: tuple[float, float, float], what: str) -> None:
    """Raise MeshError for a point off the surface of a body of a diagonal length_m."""
    off_surface = 0.02  # of the body's diagonal: farther from the surface a point is not on it
    if not distance_m <= off_surface * length_m:
        place = ", ".join(f"{x:g}" for x in position)
        raise MeshError(
            f"{what} at ({place}) m lies {distance_m:.3g} m off the surface",
            "give its place in the mesh's frame, in metres; check the mesh's unit",
        )


def check_strikes(shape: Shape, positions_m: list[tuple[float, float, float] | None]) -> int:
    """Return how many strikes have a place; raise MeshError where one lies off a mesh's surface, as a fit would."""
    known = [(i, position) for i, position in enumerate(positions_m, 1) if position is not None]
    length_m = float(np.linalg.norm(np.ptp(shape.vertex_m[np.unique(shape.face)], axis=0)))
    if known:
        _, _, distance = closest_point(shape.vertex_m, shape.face, np.array([position for _, position in known]))
        for (i, position), off_m in zip(known, distance, strict=True):
            _check_near(float(off_m), length_m, position, f"strike {i}")
    return len(known)


def direction_at(
    family: Family, position: tuple[float, float, float], given: tuple[float, float, float] | None, *, inward: bool
) -> Array:
    """Return the given direction (3,), or the unit normal at the surface point nearest to a position in m."""
    if given is not None:
        return np.array(given, float)

    face, _, _ = closest_point(family.vertex_m, family.face, np.array([position]))
    normal = np.asarray(outward_normals(family.vertex_m, family.face[face])[0])
    return -normal if inward else normal
