"""The physical effects that a model may lack, as they are played: a file each, or a folder.

`protocol` says what an effect is, `stages` what it acts on; `presets_of_effects` lists those that presets hold. How
each is looked for in recordings is in `sonic_bullet.lab.effects`. An effect from elsewhere is passed with these:
`EFFECTS + (Mine,)`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonic_bullet.effects.every_effect import EFFECTS
    from sonic_bullet.effects.protocol import Effect, Impact, Owner, Ring, Sound, Stage
    from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence

_MODULE_OF_PART = (
    {"EFFECTS": "sonic_bullet.effects.every_effect"}
    | dict.fromkeys(("Effect", "Impact", "Owner", "Ring", "Sound", "Stage"), "sonic_bullet.effects.protocol")
    | dict.fromkeys(("Evidence", "ObjectEvidence"), "sonic_bullet.lab.effects.evidence")
)

__all__ = ["EFFECTS", "Effect", "Evidence", "Impact", "ObjectEvidence", "Owner", "Ring", "Sound", "Stage"]


def __getattr__(name: str) -> Any:
    """Import an effect's part when it is first used: a scene plays a few effects, a diagnosis tries all."""
    if name in _MODULE_OF_PART:
        return vars(importlib.import_module(_MODULE_OF_PART[name]))[name]
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
