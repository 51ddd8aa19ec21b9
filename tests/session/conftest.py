from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "render"))
sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def client() -> Iterator[Any]:
    from sonic_bullet.listener import direct_client, disconnect

    made = direct_client()
    made.setGravity(0, 0, -9.81)
    yield made
    disconnect(made)
