"""Measured objects get a verdict."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.few_cases import parametrize_few


@pytest.mark.shared
@parametrize_few(("name", "words"), [("pyrfda-main-lines", "8909 Hz"), ("spruce-plates", "Rayleigh's law")], 1)
def test_measured_objects_get_a_verdict(
    shared_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, words: str
) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[3] / "studies"))
    sys.modules.pop("measured_fit", None)
    from measured_fit import fitted

    found = fitted(shared_path / "measured", name)
    assert words in found.fit.verdict
    if name == "pyrfda-main-lines":
        assert found.youngs_pa == pytest.approx(2.1e11, rel=0.04)  # what steel has, from size, mass and pitch alone
