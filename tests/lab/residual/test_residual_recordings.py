"""Modal sound with its residual is nearer to recordings that were not fitted.

The whole table: studies/residual_table.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studies import residual_table
from tests.few_cases import parametrize_few


@pytest.mark.shared
@parametrize_few(("case", "farther"), [("practice-01", 0.1), ("practice-02", 0.0)], 1)
@pytest.mark.slow
def test_held_out_strikes_of_a_case_are_nearer(shared_path: Path, case: str, farther: float) -> None:
    """Nothing is lacking in practice-01, so nothing may be spoilt; practice-02's damping is not Rayleigh's."""
    rows = list(residual_table.of_case(shared_path / "practice" / case))
    assert len(rows) == 3
    change = [beside - without for _, without, beside, _ in rows]
    assert max(change) < farther


@pytest.mark.shared
def test_a_measured_object_is_nearer(shared_path: Path) -> None:
    """Features of one strike for modes, the other strike judged."""
    residual_table.SHARED = shared_path
    name, sounds, sr = next(x for x in residual_table.measured() if "polycarbonate" in x[0])
    rows = list(residual_table.of_object(name, sounds, sr))
    assert len(rows) == 1
    assert np.mean([beside - without for _, without, beside, _ in rows]) < -1.0
