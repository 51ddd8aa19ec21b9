"""The recordings, split once by source: one half may be looked at, the other gives the published number.

A source (a set, or both sets of the same four objects) is in one half as a whole, so no object, room or microphone is
in both. The halves were fixed before anything was learnt in this study, by two rules: a material with bodies of several
sources has some in each half; else the source goes where fewer bodies are. Glass has one body, in the closed half, and
plastic one, in the open half.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from benchmarks.decay_objects import MeasuredBody, measured_bodies

OPEN = ("diffimpact-hammer", "diffimpact-robot", "xylophone-vcsl", "glockenspiel-fluidr3", "ride-bja")
CLOSED = ("realimpact-clips", "diffsound-bowl", "wood-iet-timbr", "agogo-forzee", "pyrfda-steel-bar", "bell-sonicpi")
CLASSES = ("metal", "glass", "ceramic", "plastic", "wood")
CLASS_OF = {
    "steel": "metal", "iron": "metal", "bronze": "metal", "glass": "glass", "porcelain": "ceramic",
    "plastic": "plastic", "wood": "wood",
}  # fmt: skip
"""Of measured bodies' materials."""


def bodies_of(data: Path, sets: tuple[str, ...]) -> Iterator[tuple[MeasuredBody, str]]:
    """List the bodies of some sets that have takes, each with its class."""
    for body in measured_bodies(data):
        if body.set in sets and body.takes and body.material in CLASS_OF:
            yield body, CLASS_OF[body.material]
