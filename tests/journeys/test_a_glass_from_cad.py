"""A wine glass as CAD writes it, without rings: `modes` finds its modes, in pairs, and tells an error that holds."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.test_commands import run

HZ = (572.1, 572.1, 594.8, 613.4, 613.4, 1600.4, 1600.4, 1835.7)
"""By CalculiX, quadratic tetrahedra of two sizes; the stem's torsion by hand: 593 Hz."""


def test_a_glass_of_irregular_triangles_rings_as_a_round_one(
    shared_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = run(
        "modes", str(shared_path / "faults/06-wine-glass-cad/wineglass.obj"),
        "--young", "7e10", "--poisson", "0.23", "--density", "2500", "--count", "15", "--json",
    )  # fmt: skip
    said = capsys.readouterr()
    assert code == 0, said.err
    hz = [mode["freq_hz"] for mode in json.loads(said.out)["modes"]]
    assert hz[:8] == pytest.approx(HZ, rel=0.01)
    for a, b in ((0, 1), (3, 4), (5, 6), (7, 8)):
        assert hz[b] / hz[a] - 1 < 5e-4
