"""Which cases the suite holds: singles, pairs, nulls, effects on no list, and cases that lack audio or a mesh.

draw: 0 is the one whose cases were looked at while the diagnosis was written; any other has other numbers everywhere
and other bodies for each effect, so it says what the first no longer can.
"""

from __future__ import annotations

import zlib
from dataclasses import replace
from itertools import cycle
from typing import Any

from benchmarks.suite.cases import Plan
from benchmarks.suite.effects import LISTED, UNLISTED

PLATES = ("plate_glass", "square_alu", "plate_alu")
ROUND = ("bowl_porcelain", "cup_glass", "ring_brass", "tube_alu")
BARS = ("bar_steel_170", "tapered_steel")
ANY = (*PLATES, *BARS, *ROUND, "slab_porcelain", "plank_wood", "angle_plastic")
STRUCK = {  # on what an effect is told from others: two places a strength
    "damping-law": ("bar_steel_170", "plate_alu", "slab_porcelain", "cup_glass", "ring_brass", "plate_glass"),
    "support-damping": ("plate_glass", "bar_steel_170", "plate_alu", "tapered_steel", "bowl_porcelain", "ring_brass"),
    "contact-time": ("slab_porcelain", "square_alu", "tapered_steel", "plate_glass", "cup_glass", "plate_alu"),
    "mode-splitting": ROUND,
    "amplitude-pitch": ("square_alu", "ring_brass", "plate_glass", "bar_steel_170", "plate_alu", "cup_glass"),
    "amplitude-damping": ("plate_alu", "bar_steel_170", "square_alu", "ring_brass", "bowl_porcelain", "tapered_steel"),
    "room": ("cup_glass", "plate_glass", "slab_porcelain", "bar_steel_170", "plank_wood", "ring_brass"),
    "foreign-mode": (
        "tapered_steel",
        "bowl_porcelain",
        "slab_porcelain",
        "plate_glass",
        "angle_plastic",
        "bar_steel_170",
    ),
    "orthotropy": ("plank_wood", "plate_alu", "slab_porcelain", "plank_wood", "square_alu", "plate_glass"),
    "added-mass": ("plate_glass", "bar_steel_170", "square_alu", "ring_brass", "slab_porcelain", "plate_alu"),
    "rebound": ("ring_brass", "plate_glass", "bar_steel_170", "slab_porcelain", "angle_plastic", "tube_alu"),
    "radiation": ("square_alu", "plate_glass", "plate_alu", "bowl_porcelain", "square_alu", "plate_glass"),
    "measurement-chain": ("angle_plastic", "plate_alu", "bar_steel_170", "cup_glass", "plate_glass", "slab_porcelain"),
}
PAIRS = (
    ("damping-law", "contact-time", "bar_steel_170"),
    ("damping-law", "room", "plate_alu"),
    ("damping-law", "support-damping", "ring_brass"),
    ("support-damping", "contact-time", "plate_alu"),
    ("support-damping", "foreign-mode", "plate_glass"),
    ("support-damping", "room", "square_alu"),
    ("contact-time", "room", "slab_porcelain"),
    ("contact-time", "foreign-mode", "cup_glass"),
    ("contact-time", "mode-splitting", "bowl_porcelain"),
    ("room", "foreign-mode", "tapered_steel"),
    ("room", "measurement-chain", "plate_glass"),
    ("foreign-mode", "damping-law", "plate_glass"),
    ("orthotropy", "damping-law", "plank_wood"),
    ("orthotropy", "room", "slab_porcelain"),
    ("added-mass", "contact-time", "square_alu"),
    ("added-mass", "foreign-mode", "bar_steel_170"),
    ("rebound", "damping-law", "bar_steel_170"),
    ("amplitude-pitch", "contact-time", "square_alu"),
    ("amplitude-damping", "foreign-mode", "ring_brass"),
    ("radiation", "contact-time", "plate_glass"),
)
NAMES = ("weak", "medium", "strong")


def _seed(draw: int, *what: object) -> int:
    return zlib.crc32(" ".join(map(str, (*what, *([f"draw {draw}"] if draw else [])))).encode())


def _turned(places: tuple[str, ...], draw: int) -> cycle[str]:
    """The bodies in turn, by ``draw`` other ones first."""
    return cycle(places[draw % len(places) :] + places[: draw % len(places)])


def singles(draw: int = 0) -> list[Plan]:
    """13 effects x 3 strengths x 2 objects."""
    out = []
    for name in LISTED:
        places = _turned(STRUCK[name], draw)
        for strength in range(3):
            for k in range(2):
                seed = _seed(draw, "single", name, strength, k)
                out.append(
                    Plan(
                        f"single-{name}-{NAMES[strength]}-{k}",
                        next(places),
                        ((name, strength),),
                        seed,
                        transfer=seed % 2 == 0,
                        **_recorded(seed),
                    )
                )
    return out


def _recorded(seed: int) -> dict[str, Any]:
    """How a case is recorded: rate, noise and its colour."""
    return {
        "rate": (44_100, 48_000)[seed // 2 % 2],
        "noise_db": (-72.0, -66.0, -78.0)[seed // 4 % 3],
        "colour": ("room", "room", "white", "pink")[seed // 12 % 4],
    }


def nulls(count: int = 50, draw: int = 0) -> list[Plan]:
    """Nothing missing, but other noise, strikes, ν, bodies, lengths and meshes."""
    out = []
    for k in range(count):
        seed = _seed(draw, "null", k)
        how: dict[str, Any] = {
            "noise_db": (-72.0, -60.0, -84.0, -66.0, -54.0)[k % 5],
            "colour": ("room", "white", "pink")[k % 3],
            "rate": (44_100, 48_000)[k // 2 % 2],
            "seconds": (2.0, 1.0, 1.5)[k % 3],
            "fineness": 0.85 if k % 24 < 12 else 1.0,
        }
        out.append(Plan(f"null-{k:02d}", ANY[(k + draw) % len(ANY)], (), seed, transfer=k % 4 == 0, **how))
    return out


def pairs(draw: int = 0) -> list[Plan]:
    """Twenty pairs, both of medium strength or stronger."""
    out = []
    for a, b, place in PAIRS:
        seed = _seed(draw, "pair", a, b)
        out.append(
            Plan(
                f"pair-{a}+{b}",
                place,
                ((a, 1 + seed % 2), (b, 1 + seed // 2 % 2)),
                seed,
                transfer=seed // 4 % 2 == 0,
                **_recorded(seed),
            )
        )
    return out


def unlisted(draw: int = 0) -> list[Plan]:
    """What no effect explains, medium and strong."""
    places = _turned(("plate_glass", "bar_steel_170", "slab_porcelain", "square_alu", "ring_brass"), draw)
    return [
        Plan(f"unlisted-{name}-{NAMES[s]}", next(places), ((name, s),), _seed(draw, "unlisted", name, s))
        for name in UNLISTED
        for s in (1, 2)
    ]


def poor(draw: int = 0) -> list[Plan]:
    """Lines in place of audio, and recordings without a mesh."""
    return [
        Plan("features-orthotropy", "plank_wood", (("orthotropy", 2),), 11 + 100 * draw, form="features"),
        Plan("features-orthotropy-mild", "plate_alu", (("orthotropy", 1),), 12 + 100 * draw, form="features"),
        Plan("features-null", "plate_glass", (), 13 + 100 * draw, form="features"),
        Plan("no-mesh-damping-law", "bar_steel_170", (("damping-law", 2),), 14 + 100 * draw, form="no-mesh"),
        Plan("no-mesh-room", "slab_porcelain", (("room", 2),), 15 + 100 * draw, form="no-mesh"),
        Plan("no-mesh-null", "plate_glass", (), 16 + 100 * draw, form="no-mesh"),
    ]


def live(plan: Plan) -> Plan:
    """The same case in a room as it is, every second one without impulses."""
    return replace(plan, name=f"{plan.name}-live", live=True, impulses=plan.seed // 48 % 2 == 0)


def _half_live(plans: list[Plan], *periods: int) -> list[Plan]:
    """Every second of the plans live, counted in runs of these lengths, so that each of what they vary is in both."""
    return [live(p) if sum(i // n for n in (1, *periods)) % 2 else p for i, p in enumerate(plans)]


def quick(draw: int = 0) -> list[Plan]:
    """A single a listed effect, three nulls, two pairs, two unlisted; half of them in rooms as they are."""
    each, none, two, other, _ = kinds(draw)
    return [p for p in each if "-medium-0" in p.name] + none[:3] + two[:2] + other[1:4:2]


def kinds(draw: int = 0) -> tuple[list[Plan], ...]:
    """Singles, nulls, pairs, unlisted, half of each in rooms as they are; poor cases."""
    return (
        _half_live(singles(draw), 2),
        _half_live(nulls(draw=draw)),
        _half_live(pairs(draw)),
        _half_live(unlisted(draw), 2),
        poor(draw),
    )


def whole(draw: int = 0) -> list[Plan]:
    """All of it, the kinds interleaved so that a part of it says something already."""
    order = [
        ((i + 0.5) / len(kind), j, plan)
        for j, kind in enumerate(kinds(draw))
        for i, plan in enumerate(_mixed(kind) if j == 0 else kind)
    ]
    return [plan for _, _, plan in sorted(order, key=lambda o: o[:2])]


def _mixed(plans: list[Plan]) -> list[Plan]:
    """Singles by turns: all effects at medium, then strong, then weak."""
    rank = {"medium": 0, "strong": 1, "weak": 2}

    def place(p: Plan) -> tuple[int, int]:
        *_, strength, number = p.name.removesuffix("-live").split("-")
        return int(number), rank[strength]

    return sorted(plans, key=place)
