"""The bodies whose modes are known: thin walls of every kind, of real sizes, as bricks and as a user's closed surface.

A body's drawing takes a `Detail` and gives blocks. With other counts it is bricks at two sizes, or the surface of
triangles (`surface`), with `FACETS` round. Sizes in m, angles in degrees.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.suite.bricks import Bricks
from sonic_bullet.records import Array, Material, Shape
from studies.thin_walls.blocks import Block, cartesian, disc, grip, quad, strip, swept, walk, welded

FACETS = 96
"""Triangles' edges round a body of revolution: chords stray 5e-4 of the radius at most.

Wall and radius shrink alike and a wall's frequency goes with t/r²: what remains is less (`tests/thin_walls`, a tube).
"""


@dataclass(frozen=True, slots=True)
class Detail:
    """Cells: quarter of a turn; along: factor to those along walls; across: through a wall."""

    quarter: int
    along: float
    across: int = 1

    def cells(self, count: float) -> int:
        return max(1, round(self.along * count))


SURFACE = Detail(FACETS // 4, 3.0)


@dataclass(frozen=True, slots=True)
class Stuff:
    """An isotropic material's constants."""

    youngs_pa: float
    poisson: float
    density_kg_m3: float


STEEL = Stuff(200e9, 0.30, 7850.0)
GLASS = Stuff(72e9, 0.22, 2500.0)
BRASS = Stuff(100e9, 0.34, 8500.0)
BRONZE = Stuff(105e9, 0.34, 8700.0)
PORCELAIN = Stuff(75e9, 0.22, 2400.0)


@dataclass(frozen=True, slots=True)
class ThinBody:
    """name; size in words; stuff; draw: blocks at a detail; coarse, fine: details of the bricks; paired: whether its
    symmetry makes modes come in pairs; facets: detail of its surface.
    """

    name: str
    size: str
    stuff: Stuff
    draw: Callable[[Detail], list[Block]]
    coarse: Detail
    fine: Detail
    paired: bool = True
    facets: Detail = SURFACE

    @property
    def material(self) -> Material:
        """Without damping: frequencies are those of the undamped body."""
        return Material.isotropic(self.name, **{k: getattr(self.stuff, k) for k in self.stuff.__slots__})

    def bricks(self, *, fine: bool = True) -> Bricks:
        return welded(self.draw(self.fine if fine else self.coarse))

    def surface(self) -> tuple[Array, Array]:
        """vertex_m (v, 3), face (f, 3): closed, outward, flat facets between points of the true surface."""
        made = welded(self.draw(self.facets))
        return made.node_m[made.skin], made.face

    def shape(self) -> Shape:
        vertex_m, face = self.surface()
        return Shape("mesh", vertex_m=vertex_m, face=face.astype(np.int32))


def _bar(d: Detail) -> list[Block]:
    return cartesian([0, 0.3], [0, 0.02], [0, 0.02], [d.cells(16)], [2 * d.across], [2 * d.across])


def _rod(d: Detail) -> list[Block]:
    return disc(d.quarter, 1, d.cells(16), quad((0, 0), (0.006, 0), (0.006, 0.2), (0, 0.2)))


def _plate(side: float, thick: float) -> Callable[[Detail], list[Block]]:
    return lambda d: cartesian([0, side], [0, side], [0, thick], [d.cells(12)], [d.cells(12)], [d.across])


def _round_plate(radius: float, thick: float) -> Callable[[Detail], list[Block]]:
    return lambda d: disc(d.quarter, d.cells(4), d.across, quad((0, 0), (radius, 0), (radius, thick), (0, thick)))


def _tube(radius: float, wall: float, length: float) -> Callable[[Detail], list[Block]]:
    a, b = radius - wall / 2, radius + wall / 2
    section = quad((a, 0), (a, length), (b, length), (b, 0))
    return lambda d: [swept(d.quarter, d.cells(8), d.across, section)]


def _walls(base: float, steps: list[tuple[float, float, float, int]], thick: float) -> Callable[[Detail], list[Block]]:
    """A flat round bottom of radius base, then steps of `walk`: length or radius, turn, thickness at the end, cells."""

    def draw(d: Detail) -> list[Block]:
        sections = walk((base, 0.0), 0.0, thick, [step[:3] for step in steps])
        bottom = strip(lambda s: (base * s, 0 * s, 0 * s, -1 + 0 * s), thick, thick)
        return [
            *disc(d.quarter, d.cells(3), d.across, bottom),
            *(swept(d.quarter, d.cells(step[3]), d.across, part) for step, part in zip(steps, sections, strict=True)),
        ]

    return draw


def _cap(radius: float, thick: float, half: float) -> Callable[[Detail], list[Block]]:
    """Part of a sphere: disc to a third of the angle, then swept."""

    def arc(start: float, end: float) -> Callable[[Array, Array], tuple[Array, Array]]:
        def section(s: Array, w: Array) -> tuple[Array, Array]:
            angle = np.radians(start + (end - start) * s)
            reach = radius + (w - 0.5) * thick
            return reach * np.sin(angle), -reach * np.cos(angle)

        return section

    return lambda d: [
        *disc(d.quarter, d.cells(3), d.across, arc(0, half / 3)),
        swept(d.quarter, d.cells(8), d.across, arc(half / 3, half)),
    ]


def _cup(outer: float, wall: float, base: float, d: Detail) -> list[Block]:
    """The bottom of a straight cup: its floor, and the ring under its wall."""
    inner = outer - wall
    return [
        *disc(d.quarter, d.cells(3), d.across, quad((0, 0), (inner, 0), (inner, base), (0, base))),
        swept(d.quarter, d.across, d.across, quad((inner, 0), (outer, 0), (outer, base), (inner, base))),
    ]


def _rise(outer: float, wall: float, heights: list[float], cells: list[int], d: Detail) -> list[Block]:
    """A straight wall from height to height."""
    inner = outer - wall
    return [
        swept(d.quarter, n, d.across, quad((inner, a), (inner, b), (outer, b), (outer, a)))
        for a, b, n in zip(heights[:-1], heights[1:], cells, strict=True)
    ]


def _mug(d: Detail) -> list[Block]:
    """Handle: a bent bar of 16 × 7 mm, the mean radius of its bend 22 mm, on the wall at both ends."""
    outer, wall, base, height = 0.040, 0.004, 0.005, 0.090
    middle, bend, bar, stub = 0.048, 0.022, 0.007, 0.010
    low, high = middle - bend - bar / 2, middle + bend - bar / 2
    heights = [base, low, low + bar, high, high + bar, height]
    n = d.cells(1)
    cells = [d.cells(2), n, d.cells(4), n, d.cells(2)]
    return [
        *_cup(outer, wall, base, d),
        *_rise(outer, wall, heights, cells, d),
        grip(d.quarter, d.quarter // 4, n, 8 * n, outer, middle, bend, bar, stub),  # its bend begins at a node
    ]


def _pan(d: Detail) -> list[Block]:
    """Handle: a straight bar of 26 × 5 mm, 0.16 m long."""
    outer, wall, base, height = 0.100, 0.003, 0.004, 0.050
    n = d.cells(1)
    return [
        *_cup(outer, wall, base, d),
        *_rise(outer, wall, [base, 0.035, 0.040, height], [d.cells(3), n, d.cells(1)], d),
        grip(d.quarter, d.quarter // 6, n, d.cells(8), outer, 0.0375, None, 0.005, 0.160),
    ]


def _tumbler(d: Detail) -> list[Block]:
    low, high, wall, base, height = 0.031, 0.040, 0.0022, 0.007, 0.110
    at = low + (high - low) * base / height
    return [
        *disc(d.quarter, d.cells(3), 2, quad((0, 0), (low - wall, 0), (at - wall, base), (0, base))),
        swept(d.quarter, d.across, 2, quad((low - wall, 0), (low, 0), (at, base), (at - wall, base))),
        swept(
            d.quarter,
            d.cells(9),
            d.across,
            quad((at - wall, base), (high - wall, height), (high, height), (at, base)),
        ),
    ]


def _wine_glass(d: Detail) -> list[Block]:
    """Foot of radius 34 mm, stem of 4.5 mm, a bowl that is half a ball and then narrows."""
    stem, foot, plate, wall, radius, length = 0.0045, 0.034, 0.003, 0.0016, 0.036, 0.075
    near = 0.009  # cells as small as the foot is thick: its joint with the stem yields
    start = float(np.arcsin(stem / (radius + wall / 2)))
    centre = length + (radius + wall / 2) * np.cos(start)

    def floor(s: Array, w: Array) -> tuple[Array, Array]:
        inner = radius - wall / 2
        r = (1 - w) * s * stem + w * inner * np.sin(s * start)
        return r, (1 - w) * length + w * (centre - inner * np.cos(s * start))

    heading = float(np.degrees(start))
    first = (radius * np.sin(start), centre - radius * np.cos(start))
    bowl = walk(first, heading, wall, [(radius, 90 - heading, wall), (0.25, 8, wall)])
    return [
        *disc(d.quarter, 1, d.across, quad((0, 0), (stem, 0), (stem, plate), (0, plate))),
        *disc(d.quarter, 1, d.cells(6), quad((0, plate), (stem, plate), (stem, length), (0, length))),
        *disc(d.quarter, 1, d.across, floor),
        swept(d.quarter, d.cells(2), d.across, quad((stem, 0), (near, 0), (near, plate), (stem, plate))),
        swept(d.quarter, d.cells(2), d.across, quad((near, 0), (foot, 0), (foot, plate), (near, plate))),
        swept(d.quarter, d.cells(12), d.across, bowl[0]),
        swept(d.quarter, d.cells(3), d.across, bowl[1]),
    ]


def _bottle(d: Detail) -> list[Block]:
    outer, wall, base = 0.036, 0.003, 0.005
    steps = [(0.140, 0.0, wall), (0.030, 50.0, wall), (-0.020, -50.0, wall), (0.060, 0.0, wall)]
    sections = walk((outer - wall / 2, base), 90.0, wall, steps)
    return [
        *_cup(outer, wall, base, d),
        *(swept(d.quarter, d.cells(n), d.across, part) for n, part in zip((8, 3, 2, 3), sections, strict=True)),
    ]


def _tray(d: Detail) -> list[Block]:
    """A box with its lid off. Beside each wall, and in what follows each rib, a band as wide as the wall is thick."""
    t, (a, b, c) = 0.0015, (0.20, 0.15, 0.08)
    n = d.across
    return cartesian(
        [0, t, 2 * t, a - 2 * t, a - t, a], [0, t, 2 * t, b - 2 * t, b - t, b], [0, t, 2 * t, c],
        [n, n, d.cells(12), n, n], [n, n, d.cells(9), n, n], [n, n, d.cells(6)],
        lambda x, y, z: z < t or not (t < x < a - t and t < y < b - t))  # fmt: skip


def _panel(d: Detail) -> list[Block]:
    """A plate with two ribs along x."""
    rib, plate, n = 0.003, 0.002, d.across
    y = [0, *(middle + off for middle in (0.1, 0.2) for off in (-1.5 * rib, -rib / 2, rib / 2, 1.5 * rib)), 0.3]
    bay = d.cells(4)
    return cartesian(
        [0, 0.4], y, [0, plate, 2 * plate, 0.020],
        [d.cells(16)], [bay, n, n, n, bay, n, n, n, bay], [n, n, d.cells(2)],
        lambda x, y, z: z < plate or min(abs(y - 0.1), abs(y - 0.2)) < rib / 2)  # fmt: skip


def _angle(d: Detail) -> list[Block]:
    t, n = 0.003, d.across
    return cartesian(
        [0, 0.3], [0, t, 2 * t, 0.04], [0, t, 2 * t, 0.04],
        [d.cells(20)], [n, n, d.cells(3)], [n, n, d.cells(3)],
        lambda x, y, z: y < t or z < t)  # fmt: skip


def _tee(d: Detail) -> list[Block]:
    t, w, h, n = 0.004, 0.05, 0.05, d.across
    return cartesian(
        [0, 0.4], [0, w / 2 - 1.5 * t, w / 2 - t / 2, w / 2 + t / 2, w / 2 + 1.5 * t, w], [0, t, 2 * t, h],
        [d.cells(20)], [d.cells(2), n, n, n, d.cells(2)], [n, n, d.cells(4)],
        lambda x, y, z: z < t or abs(y - w / 2) < t / 2)  # fmt: skip


def _channel(d: Detail) -> list[Block]:
    t, w, h, n = 0.002, 0.04, 0.025, d.across
    return cartesian(
        [0, 0.25], [0, t, 2 * t, w - 2 * t, w - t, w], [0, t, 2 * t, h],
        [d.cells(20)], [n, n, d.cells(4), n, n], [n, n, d.cells(3)],
        lambda x, y, z: z < t or min(y, w - y) < t)  # fmt: skip


_FLAT = Detail(FACETS // 4, 0.01)  # flat sides and straight generators as few triangles as their outline allows
_SHEET = Detail(6, 1.0), Detail(9, 2.0, 2)
_STOUT = Detail(6, 1.0, 2), Detail(9, 1.5, 3)
_SHELL = Detail(9, 1.5), Detail(14, 2.25, 2)
_RIBBED = Detail(6, 0.75, 2), Detail(6, 1.25, 2)
_TUBE = Detail(6, 1.5, 2), Detail(9, 2.25, 3)
_OPEN_SECTION = Detail(6, 1.0, 3), Detail(6, 1.75, 4)  # twist is soft, and the corner takes cells both ways

_BRASS_BOWL = [(0.035, 80.0, 0.003, 5), (0.040, 0.0, 0.005, 4)]
_GONG_RIM = [(0.010, 85.0, 0.0015, 2), (0.020, 0.0, 0.0015, 2)]
_BELL_WAIST = [(0.012, 78.0, 0.003, 2), (0.045, 0.0, 0.003, 4), (-0.050, -33.0, 0.007, 4)]

BARS = (
    ThinBody("square-bar", "300 × 20 × 20 mm", STEEL, _bar, Detail(6, 2.0), Detail(6, 3.0, 2), facets=_FLAT),
    ThinBody("round-bar", "⌀ 12 × 200 mm", STEEL, _rod, Detail(3, 2.0), Detail(4, 3.0), facets=_FLAT),
    ThinBody("angle", "40 × 40 × 3 mm, 300 mm long", STEEL, _angle, *_OPEN_SECTION, paired=False, facets=_FLAT),
    ThinBody("t-section", "50 × 50 × 4 mm, 400 mm long", STEEL, _tee, *_OPEN_SECTION, paired=False, facets=_FLAT),
    ThinBody("channel", "40 × 25 × 2 mm, 250 mm long", STEEL, _channel, *_OPEN_SECTION, paired=False, facets=_FLAT),
)
PLATES = (
    ThinBody(
        "square-plate-0.002",
        "300 × 300 × 0.6 mm",
        STEEL,
        _plate(0.3, 0.0006),
        Detail(6, 1.0),
        Detail(6, 2.0),
        facets=_FLAT,
    ),
    ThinBody("square-plate-0.01", "300 × 300 × 3 mm", STEEL, _plate(0.3, 0.003), *_SHEET, facets=_FLAT),
    ThinBody("square-plate-0.1", "100 × 100 × 10 mm", GLASS, _plate(0.1, 0.01), *_STOUT, facets=_FLAT),
    ThinBody(
        "round-plate-0.002",
        "⌀ 300 × 0.6 mm",
        BRASS,
        _round_plate(0.15, 0.0006),
        Detail(11, 1.75),
        Detail(15, 2.5),
        facets=_FLAT,
    ),
    ThinBody("round-plate-0.01", "⌀ 300 × 3 mm", BRASS, _round_plate(0.15, 0.003), *_SHELL, facets=_FLAT),
    ThinBody("round-plate-0.1", "⌀ 100 × 10 mm", GLASS, _round_plate(0.05, 0.01), *_STOUT, facets=_FLAT),
    ThinBody(
        "stiffened-panel",
        "400 × 300 × 2 mm, two ribs of 18 × 3 mm",
        STEEL,
        _panel,
        *_RIBBED,
        paired=False,
        facets=_FLAT,
    ),
    ThinBody(
        "open-box",
        "200 × 150 × 80 mm, walls 1.5 mm",
        STEEL,
        _tray,
        *_RIBBED,
        paired=False,
        facets=_FLAT,
    ),
)
TUBES = (
    ThinBody(
        "tube-0.01",
        "⌀ 60 × 200 mm, wall 0.3 mm",
        BRASS,
        _tube(0.03, 0.0003, 0.2),
        Detail(9, 1.5),
        Detail(14, 2.25),
        facets=_FLAT,
    ),
    ThinBody("tube-0.05", "⌀ 40 × 300 mm, wall 1 mm", BRASS, _tube(0.02, 0.001, 0.3), *_SHELL, facets=_FLAT),
    ThinBody("tube-0.2", "⌀ 30 × 200 mm, wall 3 mm", STEEL, _tube(0.015, 0.003, 0.2), *_TUBE, facets=_FLAT),
    ThinBody(
        "ring",
        "⌀ 70 × 6 mm, wall 1.5 mm",
        BRASS,
        _tube(0.035, 0.0015, 0.006),
        Detail(15, 0.4, 2),
        Detail(18, 0.5, 3),
        facets=_FLAT,
    ),
)
SHELLS = (
    ThinBody(
        "bowl",
        "half a ball ⌀ 140 mm, wall 3 mm",
        PORCELAIN,
        _cap(0.07, 0.003, 90.0),
        Detail(12, 2.0),
        Detail(16, 2.75, 2),
    ),
    ThinBody(
        "dome",
        "of a ball of radius 200 mm, 50° each way, 2 mm",
        STEEL,
        _cap(0.2, 0.002, 50.0),
        Detail(12, 2.0),
        Detail(14, 2.5, 2),
    ),
    ThinBody(
        "singing-bowl",
        "⌀ 150 × 75 mm, wall 3 mm, rim 5 mm",
        BRONZE,
        _walls(0.035, _BRASS_BOWL, 0.003),
        Detail(10, 1.5, 2),
        Detail(14, 2.25, 2),
    ),
    ThinBody(
        "gong",
        "⌀ 240 mm, 1.5 mm, rim of 30 mm",
        BRONZE,
        _walls(0.110, _GONG_RIM, 0.0015),
        Detail(9, 1.5),
        Detail(13, 2.25),
        facets=Detail(24, 4.0),
    ),
    ThinBody("bell", "⌀ 105 × 95 mm, wall 3 mm, lip 7 mm", BRONZE, _walls(0.020, _BELL_WAIST, 0.003), *_SHELL),
    ThinBody("tumbler", "⌀ 80 × 110 mm, wall 2.2 mm", GLASS, _tumbler, *_SHELL),
    ThinBody(
        "wine-glass",
        "bowl ⌀ 74 mm, 1.6 mm, stem ⌀ 9 mm, foot ⌀ 68 mm",
        GLASS,
        _wine_glass,
        Detail(8, 1.5, 2),
        Detail(11, 2.0, 2),
    ),
    ThinBody("bottle", "⌀ 72 × 250 mm, wall 3 mm", GLASS, _bottle, Detail(9, 1.75, 2), Detail(13, 2.5, 2)),
    ThinBody(
        "mug",
        "⌀ 80 × 90 mm, wall 4 mm, handle 16 × 7 mm",
        PORCELAIN,
        _mug,
        Detail(12, 1.5, 2),  # quarters of the turn in fours: the handle's ends are patches
        Detail(16, 2.0, 3),
        paired=False,
    ),
    ThinBody(
        "pan",
        "⌀ 200 × 50 mm, wall 3 mm, handle 26 × 5 × 160 mm",
        STEEL,
        _pan,
        Detail(18, 2.25, 2),  # quarters of the turn in sixes
        Detail(24, 3.0, 3),
        paired=False,
    ),
)


def _notched(d: Detail) -> list[Block]:
    return cartesian(
        [0, 0.05, 0.10], [0, 0.04, 0.08], [0, 0.06],
        [d.cells(12)] * 2, [d.cells(10)] * 2, [d.cells(14)], lambda x, y, z: x < 0.05 or y < 0.04,
    )  # fmt: skip


SOLID = ThinBody(
    "notched-block",
    "100 × 80 × 60 mm, a notch of 50 × 40 mm",
    STEEL,
    _notched,
    Detail(6, 0.5),
    Detail(6, 1.0),
    paired=False,
    facets=_FLAT,
)
"""No thin wall: a solid to race on."""

BODIES = {body.name: body for body in (*BARS, *PLATES, *TUBES, *SHELLS)}
