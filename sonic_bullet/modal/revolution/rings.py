"""Recognition of bodies of revolution: balls, cylinders and capsules by name, closed meshes by their meridian.

The section is the polygon of the meridian (meridian.py), so that the body is round where the mesh is faceted. What does
not fit is no body of revolution: a handle, a spout, a dent, a prism of few sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.geometry import CREASE_RAD
from sonic_bullet.modal.meshing.shape_meshes import rotation
from sonic_bullet.modal.revolution.meridian import ROUND, meridian
from sonic_bullet.records import Array, Shape


@dataclass(frozen=True, slots=True, eq=False)
class BodyOfRevolution:
    """A body of revolution.

    Attributes
    ----------
    outline_m : (p, 2) polygon of (r, z), counter-clockwise, on the axis where r = 0
    axes : (3, 3) as columns, the last the axis
    centre_m : (3,)
    """

    outline_m: Array
    axes: Array
    centre_m: Array

    @property
    def area_m2(self) -> float:
        """Area of the section."""
        r, z = self.outline_m.T
        return float((r * np.roll(z, -1) - np.roll(r, -1) * z).sum() / 2)

    @property
    def volume_m3(self) -> float:
        """Volume, by Pappus."""
        return float(_swept(self.outline_m).sum())

    @property
    def on_axis(self) -> Array:
        """Which sides (p,) of the outline lie on the axis: the body continues behind them."""
        r = self.outline_m[:, 0]
        return np.asarray((r == 0) & (np.roll(r, -1) == 0))

    def curvature_per_m(self, side: Array, at: Array) -> Array:
        """Compute the smooth outline's curvature (k,), positive where it bulges, at the part ``at`` (k,) of sides (k,).

        A bend is an arc that begins half the shorter side before it and ends as far behind. A corner has none, and a
        side that ends in one continues as it is. On the axis the outline meets its mirror image.
        """
        alike = 0.3  # relative difference of sides that are taken for chords of one arc
        along = np.roll(self.outline_m, -1, axis=0) - self.outline_m
        length, heading = np.linalg.norm(along, axis=1), np.arctan2(along[:, 1], along[:, 0])
        turn, short, on = turns(self.outline_m), np.minimum(length, np.roll(length, 1)), self.on_axis
        first, last = np.roll(on, 1), on
        turn = np.where(first, _wrap_angle(2 * heading), np.where(last, _wrap_angle(-2 * np.roll(heading, 1)), turn))
        short = np.where(first, length, np.where(last, np.roll(length, 1), short))
        smooth = np.abs(turn) < CREASE_RAD
        arc = np.where(smooth, turn / short, 0)
        after = (side + 1) % len(length)
        mine, other = np.where(at < 0.5, side, after), np.where(at < 0.5, after, side)
        away = np.minimum(at, 1 - at) * length[side]
        going_on = np.where(short[other] > (1 - alike) * length[side], arc[other], 0)
        return np.asarray(np.where(smooth[mine], np.where(away < (0.5 + ROUND) * short[mine], arc[mine], 0), going_on))

    def scale(self, factor: float) -> BodyOfRevolution:
        """Return the outline scaled by ``factor``; axes and centre stay."""
        return BodyOfRevolution(self.outline_m * factor, self.axes, self.centre_m)


def turns(polygon: Array) -> Array:
    """Compute by how much (p,) in rad a closed polygon (p, 2) turns left at each corner."""
    along = np.roll(polygon, -1, axis=0) - polygon
    heading = np.arctan2(along[:, 1], along[:, 0])
    return _wrap_angle(heading - np.roll(heading, 1))


def _wrap_angle(angle: Array) -> Array:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def _swept(polygon: Array) -> Array:
    """Compute what each side (p,) of a polygon adds to the volume swept about the z axis."""
    r, z = polygon.T
    s, t = np.roll(r, -1), np.roll(z, -1)
    return np.asarray(np.pi / 3 * (r + s) * (r * t - s * z))


def of_shape(shape: Shape) -> BodyOfRevolution | None:
    """Return the body of revolution that a named shape or a closed surface is, in the body's frame, else None."""
    turn = rotation(shape.quaternion_xyzw)
    if shape.kind == "mesh":
        found = recognise_revolution(shape.vertex_m, shape.face)
        return found and BodyOfRevolution(found.outline_m, turn @ found.axes, turn @ found.centre_m + shape.position_m)
    outline = _ring_of_shape(shape)
    return None if outline is None else BodyOfRevolution(outline, turn, np.asarray(shape.position_m, float))


def _ring_of_shape(shape: Shape) -> Array | None:
    radius, half = float(shape.size_m[0]), float(shape.size_m[1]) / 2
    if shape.kind == "cylinder":
        return np.array([[0, -half], [radius, -half], [radius, half], [0, half]])
    if shape.kind not in ("sphere", "capsule"):
        return None
    half = half if shape.kind == "capsule" else 0.0
    arc_sides = 256  # sides of a half circle: its area to 5e-5
    angle = np.linspace(-np.pi / 2, np.pi / 2, arc_sides + 1)
    arc = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    arc[[0, -1], 0] = 0
    if half == 0:
        return arc
    low, high = arc[: arc_sides // 2 + 1], arc[arc_sides // 2 :]
    end = np.array([0, half])
    return np.concatenate([low - end, high + end])


def recognise_revolution(vertex_m: Array, face: Array) -> BodyOfRevolution | None:
    """Recognise the body of revolution that a closed surface, outward, is, else return None."""
    used, face = np.unique(face, return_inverse=True)
    vertex_m, face = geometry.weld_vertices(vertex_m[used], face.reshape(-1, 3))
    if len(face) == 0 or not geometry.is_closed(face) or not geometry.volume_m3(vertex_m, face) > 0:
        return None
    _, centre, inertia = geometry.inertia(vertex_m, face, 1.0)
    _, direction = np.linalg.eigh(inertia)
    for k in range(3):
        axes = np.roll(direction, 2 - k, axis=1)
        axes = axes * [1, 1, np.sign(np.linalg.det(axes))]
        found = meridian((vertex_m - centre) @ axes, face)
        if found is not None:
            outline, turn, shift = found
            axes = axes @ turn.T
            outline = outline if _swept(outline).sum() > 0 else outline[::-1]
            return BodyOfRevolution(outline, axes, centre - axes @ shift)
    return None
