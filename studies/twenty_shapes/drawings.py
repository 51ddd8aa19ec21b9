"""Shapes as CAD has them, drawn in mm by Open CASCADE (part of Netgen): nut, fork, brackets, parts of unlike thickness.

drawing -> BRepMesh's triangles, welded: irregular, as an STL file has them      (what a user gives)
        -> Netgen's curved quadratic tetrahedra on the drawing itself            (what CalculiX solves)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from sonic_bullet.records import Array

TET10 = [0, 1, 2, 3, 4, 7, 5, 6, 8, 9]
"""CalculiX's order of a tetrahedron's nodes by Netgen's, whose edges are 01 02 03 12 13 23."""
SWAPPED = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
"""The same tetrahedron seen from the other side, both in CalculiX's order."""
SAME_MM = 1e-6
TURN_RAD = 0.15
"""From facet to facet of what is round, at most: 42 round a hole."""


def triangles(shape: Any) -> tuple[Array, Array]:
    """Vertices (v, 3) in m and faces (f, 3), outward, of a drawing as its triangulation has them."""
    from netgen.occ import OCCGeometry

    drawn = OCCGeometry(shape)._visualizationData(angle=TURN_RAD)
    corner, outward = (np.array(drawn[name], float).reshape(-1, 3, 3) for name in ("vertices", "normals"))
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    turned = np.einsum("fx,fx->f", across, outward.sum(axis=1)) < 0
    corner[turned] = corner[turned][:, ::-1]
    _, first, one = np.unique(
        np.round(corner.reshape(-1, 3) / (10 * SAME_MM)), axis=0, return_index=True, return_inverse=True
    )
    face = one.reshape(-1, 3)
    face = face[(face != np.roll(face, 1, axis=1)).all(axis=1)]
    return corner.reshape(-1, 3)[first] / 1000, face


def tetrahedra(shape: Any, edge_mm: float) -> tuple[Array, Array]:
    """Nodes (n, 3) in m and quadratic tetrahedra (t, 10) in CalculiX's order on the drawing's own surface."""
    from netgen.occ import OCCGeometry

    mesh = OCCGeometry(shape).GenerateMesh(maxh=edge_mm, grading=0.5, curvaturesafety=1.0, segmentsperedge=0.5)
    mesh.SecondOrder()
    node = np.array(mesh.Coordinates()) / 1000
    tet = mesh.Elements3D().NumPy()["nodes"][:, :10].astype(np.int64) - 1
    tet = tet[:, TET10]
    a, b, c, d = (node[tet[:, k]] for k in range(4))
    inside_out = np.einsum("tx,tx->t", np.cross(b - a, c - a), d - a) < 0
    tet[inside_out] = tet[inside_out][:, SWAPPED]
    used, tet = np.unique(tet, return_inverse=True)
    return node[used], tet.reshape(-1, 10)


def _cylinder(x: float, y: float, z: float, radius: float, height: float) -> Any:
    from netgen.occ import Cylinder, Pnt, Z

    return Cylinder(Pnt(x, y, z), Z, radius, height)


def _box(*ends: float) -> Any:
    from netgen.occ import Box, Pnt

    return Box(Pnt(*ends[:3]), Pnt(*ends[3:]))


def nut() -> Any:
    """M12: 19 mm across its flats, 10 high, both ends turned off by 30°."""
    from netgen.occ import Cone, Dir, Pnt, WorkPlane, gp_Ax2

    side = 19 / np.sqrt(3)
    plane = WorkPlane().MoveTo(side, 0)
    for k in range(1, 6):
        plane = plane.LineTo(side * np.cos(k * np.pi / 3), side * np.sin(k * np.pi / 3))
    hexagon = plane.Close().Face().Extrude(10)
    slope = np.tan(np.radians(30))
    up = Cone(gp_Ax2(Pnt(0, 0, 0), Dir(0, 0, 1)), 9.3, 9.3 + 20 / slope / 2, 10, 2 * np.pi)
    down = Cone(gp_Ax2(Pnt(0, 0, 10), Dir(0, 0, -1)), 9.3, 9.3 + 20 / slope / 2, 10, 2 * np.pi)
    return hexagon * up * down - _cylinder(0, 0, -1, 5.25, 12)


def fork() -> Any:
    """Prongs of 5 × 8 mm, 110 long and 9 apart, a round bend, a stem of 7 mm."""
    outer = _box(-9.5, -4, 0, 9.5, 4, 110) + _turned_cylinder(9.5)
    inner = _box(-4.5, -5, 0, 4.5, 5, 111) + _turned_cylinder(4.5, 10)
    return outer - inner + (_cylinder(0, 0, -50, 3.5, 43))


def _turned_cylinder(radius: float, wide: float = 8.0) -> Any:
    from netgen.occ import Cylinder, Pnt, Y

    return Cylinder(Pnt(0, -wide / 2, 0), Y, radius, wide)


def bracket() -> Any:
    """Angle of 60 × 60 × 40, 4 mm, its inner corner rounded by 6, a gusset of 3, four holes of 6."""
    angle = _box(0, 0, 0, 60, 40, 4) + _box(0, 0, 0, 4, 40, 60)
    corner = _box(4, 0, 4, 10, 40, 10) - _along_y(10, 10, 6, 60)
    gusset = _prism_y([(4, 4), (40, 4), (4, 40)], 18.5, 21.5)
    made = angle + corner + gusset
    for y in (9, 31):
        made = made - _cylinder(45, y, -1, 3, 8) - _along_x(-1, y, 45, 3, 8)
    return made


def _along_y(x: float, z: float, radius: float, length: float) -> Any:
    from netgen.occ import Cylinder, Pnt, Y

    return Cylinder(Pnt(x, -10, z), Y, radius, length)


def _along_x(x: float, y: float, z: float, radius: float, length: float) -> Any:
    from netgen.occ import Cylinder, Pnt, X

    return Cylinder(Pnt(x, y, z), X, radius, length)


def _prism_y(corner: list[tuple[float, float]], low: float, high: float) -> Any:
    """Polygon of (x, z) pulled along y from low to high."""
    from netgen.occ import Face, Pnt, Prism, Segment, Vec, Wire

    at = [Pnt(x, low, z) for x, z in corner]
    wire = Wire([Segment(a, b) for a, b in zip(at, at[1:] + at[:1], strict=True)])
    return Prism(Face(wire), Vec(0, high - low, 0))


def clip() -> Any:
    """Sheet of 1.5 mm bent twice to a U: 70 wide, legs of 35, 30 deep, bent on a radius of 2; holes of 8 and 5."""
    t, r, w, h, d = 1.5, 2.0, 70.0, 35.0, 30.0

    def block(inset: float, radius: float, up: float) -> Any:
        made = _box(inset, -10, inset + radius, w - inset, d + 10, up)
        made = made + _box(inset + radius, -10, inset, w - inset - radius, d + 10, up)
        for x in (inset + radius, w - inset - radius):
            made = made + _along_y(x, inset + radius, radius, d + 20)
        return made

    made = (block(0, r + t, h) - block(t, r, h + 1)) * _box(-1, 0, -1, w + 1, d, h + 1)
    made = made - _cylinder(w / 2, d / 2, -1, 4, 4)
    return made - _along_x(-1, d / 2, 22, 2.5, w + 2)


def perforated() -> Any:
    """Plate of 120 × 80 × 2 with 6 × 4 holes of 12 mm."""
    made = _box(0, 0, 0, 120, 80, 2)
    for i in range(6):
        for j in range(4):
            made = made - _cylinder(10 + 20 * i, 10 + 20 * j, -1, 6, 4)
    return made


def flywheel() -> Any:
    """Hub of 40 × 30 with a bore and a key's groove, a web of 3, a rim of 10 × 25, 160 outside."""
    made = _cylinder(0, 0, -12.5, 80, 25) - _cylinder(0, 0, 1.5, 70, 30) - _cylinder(0, 0, -31.5, 70, 30)
    made = made + _cylinder(0, 0, -15, 20, 30) - _cylinder(0, 0, -20, 10, 40)
    return made - _box(0, -3, -20, 13, 3, 20)


def heat_sink() -> Any:
    """Base of 80 × 60 × 6, nine fins of 1.2 × 25."""
    made = _box(0, 0, 0, 80, 60, 6)
    for k in range(9):
        x = 1.2 + k * (80 - 2.4 - 1.2) / 8
        made = made + _box(x, 0, 6, x + 1.2, 60, 31)
    return made


def crank() -> Any:
    """Hub of 40 × 40 with a bore of 20, an arm of 5 × 22, 120 long, a pin of 14 × 30."""
    made = _box(0, -11, 0, 120, 11, 5) + _cylinder(120, 0, 0, 11, 5)
    made = made + _cylinder(0, 0, -10, 20, 40) - _cylinder(0, 0, -20, 10, 60)
    return made + _cylinder(120, 0, 0, 7, 35)


def housing() -> Any:
    """Box without a lid, 100 × 70 × 35, walls of 1.5, a flange of 4 × 8, four bosses of 8 with holes of 3."""
    made = _box(0, 0, 0, 100, 70, 35) + _box(-8, -8, 31, 108, 78, 35)
    made = made - _box(1.5, 1.5, 1.5, 98.5, 68.5, 40)
    for x in (8, 92):
        for y in (8, 62):
            made = made + _cylinder(x, y, 0, 4, 20)
    for x in (8, 92):
        for y in (8, 62):
            made = made - _cylinder(x, y, 6, 1.5, 20)
    return made


def spoon() -> Any:
    """Half an ellipsoid of 44 × 32 × 18, 1.2 thick, a handle of 8 × 3, 110 long."""
    from netgen.occ import Axes, Ellipsoid, Pnt, X, Z

    outer = Ellipsoid(Axes(Pnt(0, 0, 0), n=Z, h=X), 22, 16, 9)
    inner = Ellipsoid(Axes(Pnt(0, 0, 0), n=Z, h=X), 20.8, 14.8, 7.8)
    solid = outer * _box(-30, -30, -30, 30, 30, 0) + _box(15, -4, -3.2, 130, 4, -0.4)
    return solid - inner


def hammer() -> Any:
    """Head of 26 × 26 × 90 with a handle of 14 × 8, 200 long, that is 22 × 14 at its grip."""
    made = _box(-45, -13, -13, 45, 13, 13)
    made = made + _box(-7, -4, -210, 7, 4, -13) + _box(-11, -7, -290, 11, 7, -210)
    return made


def fan() -> Any:
    """Hub of 30 × 16 with a bore of 6, five blades of 1.2 × 26, 45 long, turned by 35°."""
    from netgen.occ import Axis, Pnt, X, Z

    made = _cylinder(0, 0, -8, 15, 16)
    for k in range(5):
        blade = _box(10, -13, -0.6, 60, 13, 0.6) * _box(10, -9, -1, 60, 9, 1)
        blade = blade.Rotate(Axis(Pnt(0, 0, 0), X), 35).Rotate(Axis(Pnt(0, 0, 0), Z), 72 * k)
        made = made + blade
    return made - _cylinder(0, 0, -10, 3, 20)


def spanner() -> Any:
    """Open end for 17 mm: a head of 38, a shank of 14 × 5, 130 long, an eye of 24 at its end."""
    made = _cylinder(0, 0, 0, 19, 7) + _box(0, -7, 1, 130, 7, 6) + _cylinder(130, 0, 0.5, 12, 6)
    return made - _box(-25, -8.5, -1, 6, 8.5, 9) - _cylinder(130, 0, -1, 7, 9)


def wheel() -> Any:
    """Rim of 8 × 10, 180 outside, five spokes of 8 × 2.5, a hub of 30 × 14 with a bore of 10."""
    made = _cylinder(0, 0, -5, 90, 10) - _cylinder(0, 0, -6, 82, 12) + _cylinder(0, 0, -7, 15, 14)
    from netgen.occ import Axis, Pnt, Z

    for k in range(5):
        made = made + _box(10, -4, -1.25, 85, 4, 1.25).Rotate(Axis(Pnt(0, 0, 0), Z), 72 * k)
    return made - _cylinder(0, 0, -10, 5, 20)


def angle() -> Any:
    """Angle of 50 × 30 × 35 with sharp corners, legs of 6 and 3."""
    return _box(0, 0, 0, 50, 30, 6) + _box(0, 0, 0, 3, 30, 35)


def mallet() -> Any:
    """Head of 40 × 40 × 110 with a round handle of 9, 220 long."""
    return _box(-55, -20, -20, 55, 20, 20) + _cylinder(0, 0, -240, 4.5, 225)


def finned_block() -> Any:
    """Block of 60 × 40 × 20 with five fins of 2 × 15 across."""
    made = _box(0, 0, 0, 60, 40, 20)
    for k in range(5):
        made = made + _box(5 + 12 * k, 0, 20, 7 + 12 * k, 40, 35)
    return made


def grooved_ring() -> Any:
    """Ring of 70 outside, 50 inside, 16 high, a groove of 4 × 5 round it, cut through at one side by 6."""
    made = _cylinder(0, 0, 0, 35, 16) - _cylinder(0, 0, -1, 25, 18)
    made = made - (_cylinder(0, 0, 6, 40, 4) - _cylinder(0, 0, 5, 30, 6))
    return made - _box(0, -3, -1, 50, 3, 20)


DRAWINGS: dict[str, Callable[[], Any]] = {
    one.__name__: one
    for one in (
        nut, fork, bracket, clip, perforated, flywheel, heat_sink, crank, housing, spoon, hammer, fan, spanner, wheel,
        angle, mallet, finned_block, grooved_ring,
    )
}  # fmt: skip
