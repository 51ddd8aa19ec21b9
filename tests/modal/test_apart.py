"""What has not six rigid modes: parts that do not hang together, and sheets too thin for the digits there are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import block_diag, csc_array

from sonic_bullet.modal import lanczos
from sonic_bullet.records.errors import ModalError


def test_both_causes_are_named() -> None:
    spring = csc_array([[1.0, -1.0], [-1.0, 1.0]])
    apart = csc_array(block_diag([spring, spring, spring]))
    with pytest.raises(ModalError, match=r"not 1 rigid modes.*hang together, its walls be thicker"):
        lanczos.solve(apart, csc_array(np.eye(6)), -1.0, rigid=1, enough=lambda value: len(value) > 0, most=3)
