"""What a mesh's error is extrapolated from, against powers with a known answer; measured objects get a verdict."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.estimator.fit.mesh_error import halved


@pytest.mark.parametrize("order", [2.0, 2.5, 3.0, 4.0])
@pytest.mark.parametrize("ratios", [(2.0, 2.0), (1.6, 1.9)])
def test_halving_is_foretold_for_errors_that_are_a_power_of_the_edge(order: float, ratios: tuple[float, float]) -> None:
    edges = [1.0, ratios[0], ratios[0] * ratios[1]]
    error = 0.01 * np.array(edges) ** order
    assert halved(edges, list(error[1:] - error[0])) == pytest.approx(0.01 * 0.5**order - 0.01, rel=0.01)


def test_meshes_that_are_alike_tell_nothing() -> None:
    assert np.isnan(halved([1.0, 1.05, 2.0], [0.001, 0.01]))


@pytest.mark.shared
@pytest.mark.parametrize(("name", "words"), [("pyrfda-main-lines", "8909 Hz"), ("spruce-plates", "Rayleigh's law")])
def test_measured_objects_get_a_verdict(
    shared_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, words: str
) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    sys.modules.pop("measured_fit", None)
    from measured_fit import fitted

    found = fitted(shared_path / "measured", name)
    assert words in found.fit.verdict
    if name == "pyrfda-main-lines":
        assert found.youngs_pa == pytest.approx(2.1e11, rel=0.04)  # what steel has, from size, mass and pitch alone
