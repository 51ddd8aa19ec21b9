"""Measured bodies whose decays are compared with presets: what each is made of, and where its decays are from.

Takes of recordings are pieces (file, from, to in s). Of some bodies the sets hold numbers alone: lines of recordings
that are not passed on, damping ratios of plates. Two dates, two bells of one cymbal's strokes, or two tools are one
body. A material in `STANDS_FOR` counts as another one as well.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured import Piece
from benchmarks.recorded_objects import hammer_takes

TAKES = 4
"""Most takes of one body that are read."""
TRUSTED_R2 = 0.9
"""Of the line through a logarithmic envelope, least that a published decay has."""
STANDS_FOR = {"steel": ("steel", "metal"), "iron": ("metal",), "bronze": ("metal",)}
TDW_CLASSES = {
    "metal": "metal", "ceramic": "porcelain", "Ceramic": "porcelain", "glass": "glass", "wood": "wood",
    "plastic_hard": "plastic", "plastc_hard": "plastic", "rubber": "rubber", "stone": "concrete",
}  # fmt: skip


DecayLine = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class MeasuredBody:
    """A body that was struck: its material, its set, and takes, or else lines.

    A line is (frequency in Hz, T60 in s, amplitude at the onset in a unit of the body's own).
    """

    name: str
    material: str
    set: str
    takes: tuple[Piece, ...] = ()
    lines: tuple[DecayLine, ...] = ()


def measured_bodies(data: Path) -> Iterator[MeasuredBody]:
    """List the bodies of all sets, each once."""
    for name, material, word in (
        ("ceramic mug", "porcelain", "ceramic mug"),
        ("polycarbonate cup", "plastic", "polycarbonate cup"),
        ("wooden utensil holder", "wood", "wooden utensil holder"),
    ):
        folder = "diffimpact-hammer"
        yield MeasuredBody(name, material, folder, hammer_takes(word)(data / folder)[:TAKES])
    yield from _single_takes(data)
    yield from _published_lines(data)


def _single_takes(data: Path) -> Iterator[MeasuredBody]:
    for folder, pattern, material, name, start_s, stop_s in (
        ("diffsound-bowl", "mic[0246].flac", "porcelain", "ceramic bowl", 0.5, 3.5),
        ("agogo-forzee", "dev/AgogoHigh-*.flac", "steel", "agogo bell", 0.0, 2.5),
        ("pyrfda-steel-bar", "dev/*.flac", "steel", "bar of mild steel", 0.0, 2.5),
        ("bell-sonicpi", "dev/*.flac", "bronze", "small bell", 0.0, 5.0),
        ("ride-bja", "dev/BL_01.flac", "bronze", "ride cymbal", 0.0, 5.0),
        ("wood-iet-timbr", "dev/*.flac", "wood", "timber G5", 0.0, 0.5),
    ):
        files = sorted((data / folder).glob(pattern))[:TAKES]
        yield MeasuredBody(name, material, folder, tuple((file, start_s, stop_s) for file in files))
    for folder, pattern, material, word, stop_s in (
        ("glockenspiel-fluidr3", "dev/*.flac", "steel", "glockenspiel bar", 0.78),
        ("xylophone-vcsl", "dev/*.flac", "wood", "xylophone bar", 2.5),
    ):
        for file in sorted((data / folder).glob(pattern)):
            yield MeasuredBody(f"{word} {file.stem.split('_')[-1 if stop_s < 1 else 0]}", material, folder,
                               ((file, 0.0, stop_s),))  # fmt: skip
    for stem, material, name in (
        ("Cup", "glass", "glass cup"),
        ("IronMortar", "iron", "iron mortar"),
        ("PitcherCeramic", "porcelain", "ceramic pitcher"),
        ("SmallSwanCeramic", "porcelain", "ceramic swan"),
        ("WoodPad", "wood", "wooden pad"),
    ):
        folder = "realimpact-clips"
        yield MeasuredBody(name, material, folder, ((data / folder / f"{stem}.flac", 0.0, 2.5),))


def _published_lines(data: Path) -> Iterator[MeasuredBody]:
    folder = "tables-derived"
    clips = _read(data / folder / "dev" / "realimpact_clips.json")["clips"]
    for clip, material, name in (
        ("CeramicKoiBowl", "porcelain", "ceramic koi bowl"),
        ("IronSkillet", "iron", "iron skillet"),
        ("SteelStand", "steel", "steel stand"),
        ("PlasticScoop", "plastic", "plastic scoop"),
    ):
        entry = next(one for one in clips if one["object"] == clip)
        lines = tuple(
            (m["f_hz"], m["t60_s"], 10 ** (m["level_db"] / 20))
            for m in entry["modes"]
            if m.get("r2", 0.0) >= TRUSTED_R2
        )
        yield MeasuredBody(name, material, folder, lines=lines)
    for plate in _read(data / folder / "dev" / "spruce_plates_1-3.json")["plates"]:
        found: list[DecayLine] = []
        for mode in plate["modes"]:
            # a mode of damping ratio ζ decays as e^(-ζωt); at its peak |v/F| = A/d, where it answers an impulse with A
            decay = 2 * np.pi * mode["f_hz"] * mode["zeta"]
            found.append((mode["f_hz"], float(np.log(1000) / decay), float(10 ** (mode["mobility_db"] / 20) * decay)))
        yield MeasuredBody(f"spruce plate {plate['plate']}", "spruce", folder, lines=tuple(found))


def size_classes(data: Path) -> Iterator[MeasuredBody]:
    """List TDW's classes of material and size, which are shown and not counted: no recording is named behind them."""
    longest_s = 5.0  # the set's own advice: some are clipped far beyond
    for file in sorted((data / "tdw-material-modes" / "data").glob("*.json")):
        kind = file.stem.removesuffix("_mm").rsplit("_", 1)[0]
        material = TDW_CLASSES.get(kind, TDW_CLASSES.get(kind.split("_")[0]))
        if material is None or "soft_foam" in kind:
            continue
        table = _read(file)
        lines = tuple(
            (float(f), min(float(t), longest_s), 10 ** (float(level) / 20))
            for f, t, level in zip(table["cf"], table["rt"], table["op"], strict=True)
        )
        yield MeasuredBody(file.stem.removesuffix("_mm"), material, "tdw-material-modes", lines=lines)


def _read(file: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(file.read_text())
    return found
