"""This project beside CalculiX, in one run: processor time for the same modes of one body.

The solid has about 60 k unknowns in both meshes. The plate is filled as a user gets it, its bricks have 60 k unknowns.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from studies.thin_walls import calculix
from studies.thin_walls.blocks import welded
from studies.thin_walls.bodies import BODIES, SOLID, Detail, ThinBody
from studies.thin_walls.ours import measured


@dataclass(frozen=True, slots=True)
class Race:
    """body; bricks: their detail; count of modes; options of `analyse`; at_most: what ours over ccx must hold."""

    body: ThinBody
    bricks: Detail
    count: int
    at_most: float
    options: dict[str, float] = field(default_factory=dict)


RACES = (
    Race(SOLID, Detail(6, 1.0), 40, 0.45, {"edge_m": 0.0053}),
    Race(BODIES["square-plate-0.01"], Detail(6, 4.0, 2), 100, 0.2),
)


def raced(race: Race) -> dict[str, Any]:
    """Figures of one race; ratio is None where one of both has no modes, or ccx is not installed."""
    name = race.body.name
    ours = measured(name, count=race.count, **race.options)
    figures: dict[str, Any] = {"body": name, "modes": race.count, "ours_s": ours.processor_s, "note": ours.note}
    if ours.error or not calculix.installed():
        said = ours.error or f"ccx not run: Debian package {calculix.PACKAGE}"
        return {**figures, "ratio": None, "said": f"{name}: {said}"}
    bricks = welded(race.body.draw(race.bricks))
    theirs = calculix.modes(bricks, count=race.count, **asdict(race.body.stuff))
    ratio = ours.processor_s / theirs.processor_s
    worst = float(abs(ours.frequency_hz[: race.count] / theirs.frequency_hz - 1).max())
    said = (
        f"{name}, {race.count} modes: {ours.processor_s:.1f} s over ccx {theirs.processor_s:.1f} s = {ratio:.2f} "
        f"(must hold <= {race.at_most:g}); ccx {theirs.unknowns} unknowns; {worst:.2%} apart at most; ours: {ours.note}"
    )
    return {**figures, "ccx_s": theirs.processor_s, "ccx_unknowns": theirs.unknowns, "ratio": ratio, "said": said}
