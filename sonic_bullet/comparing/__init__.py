"""Two versions of a scene, and which input makes them sound different.

    scene, scene -> sides -> calls side by side -> inputs that differ ┐
                    logs  -> effects, first difference first          ├─> Comparison -> words, JSON, page
                    put back one by one in the second scene -> causes ┘

sides: what is compared, run | call_pairs: the calls of two runs, side by side | input_differences: what of them differs
put_back: the second scene again with inputs of the first | causes: the smallest set that makes the first of it
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonic_bullet.comparing.compared_sides import compare
    from sonic_bullet.comparing.comparison import Comparison, Difference, Effect
    from sonic_bullet.comparing.sides import SceneSide

__all__ = ["Comparison", "Difference", "Effect", "SceneSide", "compare"]

_HOME = {
    "Comparison": "comparison",
    "Difference": "comparison",
    "Effect": "comparison",
    "SceneSide": "sides",
    "compare": "compared_sides",
}


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"sonic_bullet.comparing.{_HOME[name]}"), name)
    raise AttributeError(f"module 'sonic_bullet.comparing' has no attribute '{name}'")
