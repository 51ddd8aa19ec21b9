"""The draft's own ladders of impacts come out as it predicts, but for one, of which the page says why."""

from __future__ import annotations

from pathlib import Path

import pytest

from studies.gltf_ladders.__main__ import judge
from studies.gltf_ladders.impacts import IMPACTS
from studies.gltf_ladders.verdicts import AGREES, ERRS


@pytest.mark.shared
@pytest.mark.slow
def test_impacts_come_out_as_the_draft_predicts(shared_path: Path) -> None:
    found = judge(shared_path / "gltf-audio", [name.split("/")[-1] for name in IMPACTS])
    assert set(found) == set(IMPACTS)
    for name, one in found.items():
        assert one.verdict == (ERRS if name.endswith("RestitutionLadder") else AGREES), (name, one)
        assert one.verdict == AGREES or one.right, name
