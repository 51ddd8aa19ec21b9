"""CalculiX's modes of a shape in cells of two sizes, carried on to none, and where they are kept.

    f∞ = f(h) − (f(rh) − f(h)) / (r^p − 1),  p = 3: between 4, smooth, and 1.1 to 2.7, creases [Strang & Fix 1973, 6.3]

The change from fine to f∞ is kept as how uncertain the truth is.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.records import Array
from studies.thin_walls import calculix
from studies.twenty_shapes.catalogue import Entry

STORED = Path(__file__).with_name("truth.json")
COUNT = 20
POWER = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Limit:
    """frequency_hz (m,) as the cells vanish; uncertain (m,): relative change from the fine cells to that."""

    frequency_hz: Array
    uncertain: Array


def solved(entry: Entry) -> dict[str, Any]:
    """Solve a shape in two sizes by ccx: its part of truth.json. Raises CcxError."""
    made: dict[str, Any] = {"material": asdict(entry.stuff), "ratio": entry.ratio}
    for mesh in ("coarse", "fine"):
        node, cell, element = entry.cells(mesh == "fine")
        run = calculix.solve(node, cell, **asdict(entry.stuff), count=COUNT, element=element)
        made[mesh] = {
            "element": element,
            "cells": len(cell),
            "unknowns": run.unknowns,
            "processor_s": round(run.processor_s, 2),
            "peak_mb": round(run.peak_bytes / 1e6),
            "frequency_hz": [round(float(f), 4) for f in run.frequency_hz[:COUNT]],
        }
    return made


def read() -> dict[str, Any]:
    """truth.json: one entry a shape."""
    kept: dict[str, Any] = json.loads(STORED.read_text()) if STORED.exists() else {}
    return kept


def keep(name: str, entry: dict[str, Any]) -> None:
    """Put an entry into truth.json, beside the others."""
    lines = [f"{json.dumps(k)}: {json.dumps(v)}" for k, v in sorted({**read(), name: entry}.items())]
    STORED.write_text("{\n" + ",\n".join(lines) + "\n}\n")


def limit(name: str) -> Limit:
    """The kept truth of a shape. Raises KeyError where there is none."""
    entry = read()[name]
    coarse, fine = (np.array(entry[mesh]["frequency_hz"]) for mesh in ("coarse", "fine"))
    far = np.log(coarse / fine) / (entry["ratio"] ** POWER - 1)
    return Limit(fine * np.exp(-far), np.abs(np.expm1(-far)))
