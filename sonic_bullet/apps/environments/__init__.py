"""Sound as an observation of a gymnasium environment whose world is PyBullet's or MuJoCo's.

env.step -> the same run time -> an observation -> log-mel features

gymnasium is an extra: `pip install "sonic_bullet[environments]"`. Names are imported when first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from sonic_bullet.records.errors import SceneError

if TYPE_CHECKING:
    from sonic_bullet.apps.environments.mel_features import log_mel, mel_filters
    from sonic_bullet.apps.environments.sound_observation import SoundObservation

__all__ = ["SoundObservation", "log_mel", "mel_filters"]


def __getattr__(name: str) -> Any:
    home = {"SoundObservation": "sound_observation", "log_mel": "mel_features", "mel_filters": "mel_features"}
    if name not in home:
        raise AttributeError(f"module 'sonic_bullet.apps.environments' has no attribute '{name}'")
    try:
        return getattr(importlib.import_module(f"sonic_bullet.apps.environments.{home[name]}"), name)
    except ModuleNotFoundError as error:
        if error.name != "gymnasium":
            raise
        raise SceneError("gymnasium is not installed", 'pip install "sonic_bullet[environments]"') from None
