"""One steel, one empty cache folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from sonic_bullet.records import Material


@pytest.fixture
def steel() -> Material:
    return Material.isotropic("steel", youngs_pa=200e9, poisson=0.3, density_kg_m3=7850.0, alpha_per_s=1.0, beta_s=1e-8)


@pytest.fixture(scope="session")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("modes")
