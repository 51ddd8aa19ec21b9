"""The physical effects that a model may lack: a file each, or a folder with its search beside it.

`protocol` says what an effect is, `stages` what it acts on, `evidence` what it reads; `presets_of_effects` lists those
that presets hold. An effect from elsewhere is passed with these: `EFFECTS + (Mine,)`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonic_bullet.effects.every_effect import EFFECTS
    from sonic_bullet.effects.protocol import Effect, Impact, Owner, Ring, Sound, Stage
    from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence

_MODULE_OF_PART = {"EFFECTS": "every_effect"} | dict.fromkeys(
    ("Effect", "Evidence", "Impact", "ObjectEvidence", "Owner", "Ring", "Sound", "Stage"), "protocol"
)

__all__ = ["EFFECTS", "Effect", "Evidence", "Impact", "ObjectEvidence", "Owner", "Ring", "Sound", "Stage"]


def __getattr__(name: str) -> Any:
    """Import an effect's part when it is first used: a scene plays a few effects, a diagnosis tries all."""
    if name in _MODULE_OF_PART:
        return vars(importlib.import_module(f"{__name__}.{_MODULE_OF_PART[name]}"))[name]
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
