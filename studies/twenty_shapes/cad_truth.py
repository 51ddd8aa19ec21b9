"""The modes of the twenty shapes that count as true, how uncertain they are, and where they are kept.

    a drawing: NGSolve's, polynomials of three degrees on two meshes (polynomials.py); CalculiX's C3D10 beside them
    a round body: the same on its section, with a Fourier series round (axisymmetric.py)
    other bricks: CalculiX's C3D20R in two sizes, f∞ = f(h) − (f(rh) − f(h)) / (r³ − 1); uncertain by f(h) to f∞

The power 3 lies between 4, smooth, and 1.1 to 2.7, creases [Strang & Fix 1973, 6.3].
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.records import Array
from studies.thin_walls import calculix, reference
from studies.twenty_shapes import polynomials
from studies.twenty_shapes.catalogue import ENTRIES, Entry
from studies.twenty_shapes.drawings import DRAWINGS

STORED = Path(__file__).with_name("truth.json")
COUNT = 20
JUDGED = 15
POWER = 3.0
WIDER = {"coarse": 3.6, "fine": 1.8}  # edges for polynomials over CalculiX's fine ones


@dataclass(frozen=True, slots=True, eq=False)
class Limit:
    """frequency_hz (m,), which count as true; uncertain (m,): by which share."""

    frequency_hz: Array
    uncertain: Array


def by_calculix(entry: Entry) -> dict[str, Any]:
    """Solve a shape in two sizes by ccx: its part of truth.json. Raises CcxError."""
    made: dict[str, Any] = {"material": asdict(entry.stuff)}
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


def by_polynomials(entry: Entry) -> dict[str, Any]:
    """Solve a drawing in two sizes and three degrees by NGSolve: "polynomials" of its part of truth.json."""
    made: dict[str, Any] = {}
    for size, wider in WIDER.items():
        mesh, off = polynomials.mesh(DRAWINGS[entry.truth](), wider * entry.edge_mm)
        degrees = polynomials.degrees(mesh) if size == "fine" else polynomials.DEGREES
        runs = [polynomials.solve(mesh, p, **asdict(entry.stuff), count=COUNT) for p in degrees]
        made[size] = {
            "cells": mesh.ne,
            "volume_off": float(f"{off:.2e}"),
            "unknowns": runs[-1].unknowns,
            "processor_s": round(sum(run.processor_s for run in runs), 2),
            "frequency_hz": [[round(float(f), 4) for f in run.frequency_hz] for run in runs],
        }
    return made


def read() -> dict[str, Any]:
    """truth.json: one entry a shape."""
    kept: dict[str, Any] = json.loads(STORED.read_text()) if STORED.exists() else {}
    return kept


def keep(name: str, **entry: Any) -> None:
    """Put what is new of an entry into truth.json."""
    kept = read()
    kept[name] = {**kept.get(name, {}), **entry}
    lines = [f"{json.dumps(k)}: {json.dumps(v)}" for k, v in sorted(kept.items())]
    STORED.write_text("{\n" + ",\n".join(lines) + "\n}\n")


def calculix_limit(name: str) -> Limit:
    """CalculiX's modes of a shape as its cells vanish; of a body of thin_walls those kept there. Raises KeyError where
    there are none.
    """
    entry = read().get(name) or reference.read()["bodies"][name]
    coarse, fine = (np.array(entry[mesh]["frequency_hz"]) for mesh in ("coarse", "fine"))
    ratio = next(one.ratio for one in ENTRIES.values() if one.truth == name)
    far = np.log(coarse / fine) / (ratio**POWER - 1)
    return Limit(fine * np.exp(-far), np.abs(np.expm1(-far)))


def limit(name: str) -> Limit:
    """The kept truth of a shape: polynomials', else CalculiX's. Raises KeyError where there is none."""
    kept = read().get(name, {}).get("polynomials")
    if not kept:
        return calculix_limit(name)
    coarse, fine = (np.array(kept[size]["frequency_hz"]) for size in WIDER)
    far, power = polynomials.limit(coarse)
    near, _ = polynomials.limit(fine, power if len(fine) < len(coarse) else None)
    return Limit(near, np.maximum(np.abs(far - near), (fine[-1] - near) / 2) / near)
