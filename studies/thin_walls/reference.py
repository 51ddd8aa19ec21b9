"""The truth as it is kept: calculix.json, one entry a body, with the recipe that made it.

ThinBody -> bricks, coarse and fine -> ccx -> Truth -> calculix.json -> Truth, where ccx is not installed
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.records import Array
from studies.thin_walls import calculix
from studies.thin_walls.blocks import brick_volumes_m3
from studies.thin_walls.bodies import ThinBody

STORED = Path(__file__).with_name("calculix.json")
COUNT = 15
SAME = 2e-4  # relative: modes of a symmetric body nearer than that are a pair


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """frequency_hz (15,) of the fine bricks; change: the largest relative difference between coarse and fine."""

    frequency_hz: Array
    change: float


def solved(body: ThinBody) -> dict[str, Any]:
    """A body's entry of calculix.json: both meshes solved by ccx now, where what is kept is not of the same bricks.
    Raises CcxError.
    """
    entry: dict[str, Any] = {"size": body.size, "material": asdict(body.stuff)}
    kept = read()["bodies"].get(body.name, {})
    for name in ("coarse", "fine"):
        bricks = body.bricks(fine=name == "fine")
        mesh = {
            "detail": asdict(body.fine if name == "fine" else body.coarse),
            "bricks": len(bricks.cell),
            "unknowns": 3 * len(bricks.node_m),
            "volume_m3": float(f"{brick_volumes_m3(bricks).sum():.9e}"),
        }
        if kept.get("material") == entry["material"] and {**kept.get(name, {}), **mesh} == kept.get(name):
            entry[name] = kept[name]
            continue
        run = calculix.modes(bricks, count=COUNT, **asdict(body.stuff))
        entry[name] = {
            **mesh,
            "processor_s": round(run.processor_s, 2),
            "peak_mb": round(run.peak_bytes / 1e6),
            "frequency_hz": [round(float(f), 6) for f in run.frequency_hz],
        }
    return entry


def read() -> dict[str, Any]:
    """calculix.json: recipe, bodies."""
    kept: dict[str, Any] = json.loads(STORED.read_text()) if STORED.exists() else {"recipe": {}, "bodies": {}}
    return kept


def keep(entries: dict[str, Any]) -> None:
    """Put these bodies' entries into calculix.json, beside those of other bodies."""
    kept = read()
    recipe = {
        "made by": "python -m studies.thin_walls truth",
        "solver": f"CalculiX {calculix.version()}, Debian package {calculix.PACKAGE}, one thread",
        "element": "C3D20R, free body, *FREQUENCY, six rigid modes left out",
        "units": "m, kg, s, Pa; detail: cells a quarter turn, factor along walls, cells through them",
    }
    bodies = {**kept["bodies"], **entries}
    line = [f"{json.dumps(name)}: {json.dumps(entry)}" for name, entry in sorted(bodies.items())]
    text = '{"recipe": ' + json.dumps(recipe, indent=1) + ',\n"bodies": {\n' + ",\n".join(line) + "\n}}\n"
    STORED.write_text(text)


def truth(name: str) -> Truth:
    """The kept truth of a body. Raises KeyError where there is none."""
    entry = read()["bodies"][name]
    fine, coarse = (np.array(entry[mesh]["frequency_hz"]) for mesh in ("fine", "coarse"))
    return Truth(fine, float(np.abs(coarse / fine - 1).max()))


def pairs(frequency_hz: Array) -> list[int]:
    """Places k of modes k, k + 1 that are a pair."""
    near = np.diff(frequency_hz) / frequency_hz[:-1] < SAME
    found: list[int] = []
    for k in np.flatnonzero(near):
        if not found or k > found[-1] + 1:
            found.append(int(k))
    return found
