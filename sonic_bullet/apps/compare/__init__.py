"""Compare two versions of a scene, and find which input makes them sound different.

    scene, scene -> sides -> calls side by side -> inputs that differ ┐
                    logs  -> effects, first difference first          ├─> Comparison -> words, JSON, page
                    substituted one by one in the second scene -> causes ┘

sides: the two to compare, run | compared_sides: the comparison | comparison_record: its result | words: text of it
inputs: pairing, substitution, the smallest set that is the cause | outcome: effects | ensemble: chance
baselines, revisions, folders: of projects | pytest_plugin, failure_folder: of their tests
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonic_bullet.apps.compare.compared_sides import compare
    from sonic_bullet.apps.compare.comparison_record import Comparison, Consequence, Difference
    from sonic_bullet.apps.compare.sides import SceneSide

__all__ = ["Comparison", "Consequence", "Difference", "SceneSide", "compare"]


def __getattr__(name: str) -> Any:
    home = {
        "Comparison": "comparison_record",
        "Difference": "comparison_record",
        "Consequence": "comparison_record",
        "SceneSide": "sides",
        "compare": "compared_sides",
    }
    if name in home:
        return getattr(importlib.import_module(f"sonic_bullet.apps.compare.{home[name]}"), name)
    raise AttributeError(f"module 'sonic_bullet.apps.compare' has no attribute '{name}'")
