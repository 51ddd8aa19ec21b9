"""What was struck, in the sets whose recordings become presets of the package: takes, words, source and licence.

Sources and licences are those of the sets' own READMEs. Of bars of several sizes the one stands here whose take `fit`
and `residual` describe best.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.measured import LEAD_S, LONGEST_S, Piece

DIFFIMPACT = "https://github.com/samuel-clarke/diffimpact, commit c9f5b949fc5b4194ee861b0c29490b33cdfb4072"
NUMBERS_ALONE = "numbers alone"
"""How the licence ends where the file holds measured facts of takes, and nothing that was recorded."""


@dataclass(frozen=True, slots=True)
class Struck:
    """What was struck. struck and source: words of the file. guess: preset that surface, impact, and what no fit says,
    are taken from. takes: of the set's folder. mesh: file of the set; with it the preset holds numbers alone.
    density_kg_m3: as weighed, else the guess's. band_hz: of the case. shape_note: what the shape does to E/ρ.
    """

    set: str
    struck: str
    source: str
    licence: str
    guess: str
    takes: Callable[[Path], tuple[Piece, ...]]
    mesh: str | None = None
    density_kg_m3: float | None = None
    band_hz: tuple[float, float] | None = None
    shape_note: str = ""


def hammer_takes(word: str) -> Callable[[Path], tuple[Piece, ...]]:
    """The strikes of one file of diffimpact-hammer, each to the next."""

    def takes(folder: Path) -> tuple[Piece, ...]:
        files = json.loads((folder / "case.json").read_text())["files"]
        entry = next(one for one in files if word in one["object"])
        hits = [hit["t_hit_s"] for hit in entry["hits"]]
        ends = [*(hit - LEAD_S for hit in hits[1:]), hits[-1] + LONGEST_S]
        file = folder / entry["file"]
        return tuple((file, h - LEAD_S, min(e, h + LONGEST_S)) for h, e in zip(hits, ends, strict=True))

    return takes


def whole(pattern: str, start_s: float = 0.0, stop_s: float = LONGEST_S) -> Callable[[Path], tuple[Piece, ...]]:
    """All files of a set that a pattern names, between two times."""
    return lambda folder: tuple((path, start_s, stop_s) for path in sorted(folder.glob(pattern)))


OBJECTS = {
    "ceramic-mug": Struck(
        "diffimpact-hammer", "a ceramic mug, by hand with an impact hammer", DIFFIMPACT, "MIT", "porcelain",
        hammer_takes("ceramic mug"),
    ),
    "polycarbonate-cup": Struck(
        "diffimpact-hammer", "a polycarbonate cup, by hand with an impact hammer", DIFFIMPACT, "MIT", "plastic",
        hammer_takes("polycarbonate cup"),
    ),
    "wooden-holder": Struck(
        "diffimpact-hammer", "a wooden utensil holder, by hand with an impact hammer", DIFFIMPACT, "MIT", "wood",
        hammer_takes("wooden utensil holder"),
    ),
    "bell": Struck(
        "bell-sonicpi", "a small bell", "Debian package sonic-pi-samples 3.2.2~repack-8, perc_bell (freesound 221515)",
        "CC0-1.0", "brass", whole("dev/perc_bell.flac"),
    ),
    "glockenspiel-bar": Struck(
        "glockenspiel-fluidr3", "a steel bar of a glockenspiel, 2104 Hz",
        "Debian package fluid-soundfont-gm 3.1-5.3, FluidR3_GM.sf2, the sample of C9", "MIT", "steel",
        whole("dev/glocken_C9.flac", stop_s=0.78),
    ),
    "xylophone-bar": Struck(
        "xylophone-vcsl", "a wooden bar of a xylophone over its resonator, 263 Hz, with a medium mallet",
        "https://github.com/floe-audio/Xylophone, commit 8c4e024822961c5673cabb9551304bce969bf303, C3_ff "
        "(Versilian Community Sample Library)", "CC0-1.0", "wood", whole("dev/C3_ff.flac"),
    ),
    "steel-bar": Struck(
        "pyrfda-steel-bar", "a bar of hot-rolled mild steel, 114.36 × 25.44 × 3.12 mm",
        "numbers measured on https://github.com/jjderooy/pyRFDA, commit 44d3c9600bea936739436c989861cb6bec58b2d7",
        f"MIT, added after this take; {NUMBERS_ALONE}", "steel", whole("dev/*.flac"), mesh="mesh/bar.obj",
        density_kg_m3=7855.0, band_hz=(500.0, 10_000.0),
        shape_note="the spread of E/ρ holds 0.5 % of each dimension",
    ),
    "ceramic-bowl": Struck(
        "diffsound-bowl", "a ceramic bowl; its takes are microphones of one stroke",
        "numbers measured on https://github.com/hellojxt/DiffSound, data/real_audio and data/mesh/bowl, as in the copy "
        "TechnetiumMan/DiffSound at d2a97cd", f"none stated; {NUMBERS_ALONE}", "porcelain",
        whole("mic*.flac", 0.5, 3.5), mesh="bowl.obj",
        shape_note="the spread of E/ρ holds 0.5 % of each dimension; `fit` says that the mesh may move it by 2 %",
    ),
}  # fmt: skip
