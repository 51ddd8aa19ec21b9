"""Is the error that a model's note tells the true one, within a factor of two, in nine of ten bodies?

    python studies/estimates.py [--json]

Bodies of revolution and boxes, free. Each is solved as usual, on a coarse section or with few polynomials, so that
there is an error to see, and much finer, which is taken for the truth: errors of the worst of fifteen modes. One
under 0.01 % holds where the truth is under 0.02 %. Exits 1 where fewer than nine of ten hold.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np

from sonic_bullet.modal import analyse, polynomials
from sonic_bullet.modal.revolution import fourier, section
from sonic_bullet.records import Material, Shape
from studies.thin_walls.bodies import BODIES

COUNT = 15
LEFT_OUT = ("angle", "t-section", "channel", "stiffened-panel", "open-box", "mug", "pan")  # are tetrahedra
FACTOR, SHARE = 2.0, 0.9
STEEL = Material.isotropic("steel", youngs_pa=2e11, poisson=0.3, density_kg_m3=7850.0)
BOXES = [
    (0.3, 0.3, 0.003), (0.3, 0.02, 0.02), (0.1, 0.1, 0.01), (0.05, 0.05, 0.05), (0.2, 0.13, 0.01), (0.1, 0.02, 0.006),
    (0.08, 0.06, 0.025), (0.4, 0.2, 0.004), (0.06, 0.03, 0.03),
]  # fmt: skip
CYLINDERS = [(0.05, 0.1), (0.05, 0.02), (0.01, 0.2), (0.1, 0.004)]
NAMED = [
    Shape("sphere", np.array([0.05, 0, 0])),
    Shape("capsule", np.array([0.02, 0.1, 0])),
    *(Shape("cylinder", np.array([*size, 0])) for size in CYLINDERS),
]


@contextmanager
def fineness(wall: float, wave: float, degrees: int, fewest: int) -> Iterator[None]:
    """Sections whose sides are so long over wall and wave, boxes with so many more polynomials along each axis."""
    rule = polynomials.degrees

    def more(size: object, of: float) -> tuple[int, ...]:
        return tuple(max(3, n + degrees) for n in rule(size, of))  # type: ignore[arg-type]

    with (
        patch.object(section, "WALL", wall),
        patch.object(section, "WAVE", wave),
        patch.object(fourier, "FEWEST_NODES", fewest),
        patch.object(polynomials, "degrees", more),
    ):
        yield


def bodies() -> Iterator[tuple[str, Shape, Material]]:
    """Name, shape and material of each."""
    for name, body in BODIES.items():
        yield name, body.shape(), body.material
    for shape in NAMED:
        yield f"{shape.kind} {shape.size_m[0]:g} x {shape.size_m[1]:g}", shape, STEEL
    for size in BOXES:
        yield "box " + " x ".join(f"{s:g}" for s in size), Shape("box", np.array(size)), STEEL


def told(note: str) -> float | None:
    """The error that a note tells, 0 for one too small to tell; None where it tells none."""
    found = re.search(r"error up to \d+ Hz (about|under) ([\d.e-]+) %", note)
    return None if found is None else float(found[2]) / 100 * (found[1] == "about")


def row(
    name: str, shape: Shape, material: Material, setting: str, how: tuple[float, float, int, int]
) -> dict[str, Any]:
    """What is told and what is true of a body at one setting."""
    with fineness(*how):
        model = analyse((shape,), material, count=COUNT, accuracy=0.5, cache=None)
    with fineness(0.25, 0.1, 4, 400):
        true = analyse((shape,), material, count=COUNT, cache=None)
    error, estimate = float(np.abs(model.freq_hz / true.freq_hz - 1).max()), told(model.note)
    assert estimate is not None, name
    held = error < 2e-4 if estimate == 0 else 1 / FACTOR < estimate / error < FACTOR
    return {"body": name, "setting": setting, "told": estimate, "true": error, "held": held}


def said(row: dict[str, Any]) -> str:
    """A row as a line."""
    return f"{row['body']:28} {row['setting']:7} told {row['told']:.2%}, true {row['true']:.2%}, {row['held']}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    rows = []
    for name, shape, material in bodies():
        note = analyse((shape,), material, count=1, cache=None).note if shape.kind != "mesh" else "body of revolution"
        if name in LEFT_OUT or not note.startswith(("body of revolution", "box")):
            continue
        for setting, how in (
            ("usual", (section.WALL, section.WAVE, 0, fourier.FEWEST_NODES)),
            ("coarse", (3.0, 1.0, -3, 0)),
        ):
            rows.append(row(name, shape, material, setting, how))
            print(
                json.dumps(rows[-1]) if asked.json else said(rows[-1]),
                flush=True,
            )
    for setting in ("usual", "coarse"):
        mine = [r["held"] for r in rows if r["setting"] == setting]
        print(f"{setting}: {sum(map(bool, mine))} of {len(mine)} hold")
    return int(sum(bool(r["held"]) for r in rows) < SHARE * len(rows))


if __name__ == "__main__":
    sys.exit(main())
