"""The kept truth: made by the recipe that stands in the code, near closed forms, and the same by another solver."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
from numpy.typing import ArrayLike

from benchmarks.suite import bricks
from studies.thin_walls import calculix, reference
from studies.thin_walls.blocks import brick_volumes_m3
from studies.thin_walls.bodies import BODIES
from studies.thin_walls.ours import Ours, compared
from studies.thin_walls.reference import Truth, truth
from tests.few_cases import parametrize_few

KEPT = reference.read()["bodies"]
CONVERGED = 5e-3  # coarse to fine; the fine bricks' own error is a fraction of it
AT_THE_HANDLE = {"pan": 7e-3}  # one mode bends the wall where the handle's corners are: 150 000 unknowns leave that


@pytest.mark.parametrize("name", BODIES)
def test_the_truth_is_kept_and_converged(name: str) -> None:
    body, entry = BODIES[name], KEPT[name]
    assert entry["material"] == asdict(body.stuff)
    assert entry["size"] == body.size
    volume_m3 = brick_volumes_m3(body.bricks(fine=False)).sum()
    assert entry["coarse"]["volume_m3"] == pytest.approx(volume_m3, rel=1e-8)
    for mesh, detail in (("coarse", body.coarse), ("fine", body.fine)):
        assert entry[mesh]["detail"] == asdict(detail)
        assert np.all(np.diff(entry[mesh]["frequency_hz"]) >= 0)
    assert len(entry["fine"]["frequency_hz"]) == reference.COUNT
    assert entry["fine"]["unknowns"] > 1.5 * entry["coarse"]["unknowns"]
    assert truth(name).change < AT_THE_HANDLE.get(name, CONVERGED)


@pytest.mark.parametrize("name", [name for name, body in BODIES.items() if body.paired and "bar" not in name])
def test_symmetric_bodies_have_pairs(name: str) -> None:
    assert len(reference.pairs(truth(name).frequency_hz)) >= 2


@parametrize_few("name", ["tube-0.01", "round-plate-0.1"], 1)
def test_another_solver_has_the_same_modes_of_the_same_bricks(name: str) -> None:
    """Assembled and solved here: what is kept needs no ccx to be checked. C3D20R has its mass at 2³ points."""
    body = BODIES[name]
    stiffness = bricks.isotropic(body.stuff.youngs_pa, body.stuff.poisson)
    kept = np.array(KEPT[name]["coarse"]["frequency_hz"])
    found = bricks.modes(
        body.bricks(fine=False), stiffness, body.stuff.density_kg_m3, to_hz=1.01 * kept[-1], mass_points=2
    )
    np.testing.assert_allclose(found.freq_hz[: len(kept)], kept, rtol=1e-6)


@pytest.mark.skipif(calculix.installed() is None, reason=f"ccx is not installed: Debian package {calculix.PACKAGE}")
def test_ccx_repeats_what_is_kept() -> None:
    body = BODIES["square-plate-0.01"]
    run = calculix.modes(body.bricks(fine=False), **asdict(body.stuff))
    assert run.unknowns == KEPT[body.name]["coarse"]["unknowns"]
    np.testing.assert_allclose(run.frequency_hz, KEPT[body.name]["coarse"]["frequency_hz"], rtol=1e-6)


def test_the_eigenvalue_table_is_read() -> None:
    dat = """
     E I G E N V A L U E   O U T P U T

 MODE NO    EIGENVALUE                       FREQUENCY
                                     REAL PART            IMAGINARY PART
                           (RAD/TIME)      (CYCLES/TIME     (RAD/TIME)

      1  -0.2000000E-03   0.0000000E+00   0.0000000E+00   0.1414214E-01
      2   0.3947842E+06   0.6283185E+03   0.1000000E+03   0.0000000E+00

     P A R T I C I P A T I O N   F A C T O R S

      1   0.1000000E+01   0.1000000E+01   0.1000000E+01   0.1000000E+01
"""
    np.testing.assert_allclose(calculix.frequencies_hz(dat), [0.0, 100.0], rtol=1e-6)


def test_modes_are_compared_in_order_and_pairs_by_the_truths() -> None:
    known = Truth(np.array([100.0, 100.001, 300.0]), 0.0)
    found = compared(ours([101.0, 101.101, 300.0, 900.0], "error up to 900 Hz about 1.05 %"), known, paired=True)
    assert found.worst == pytest.approx(0.011, rel=2e-2)
    assert found.split == pytest.approx(1e-3)
    assert (found.told, found.bounded) == (pytest.approx(0.0105), 2)
    assert compared(ours(known.frequency_hz), known, paired=False).split is None
    assert compared(ours([100.0]), known, paired=True).worst == np.inf


def ours(frequency_hz: ArrayLike, note: str = "") -> Ours:
    return Ours(np.array(frequency_hz), 0.0, 0, note)
