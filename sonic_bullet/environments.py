"""Sound as an observation, by the name that users have: `sonic_bullet.apps.environments`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sonic_bullet.apps import environments as _environments

if TYPE_CHECKING:
    from sonic_bullet.apps.environments import SoundObservation, log_mel, mel_filters

__all__ = ["SoundObservation", "log_mel", "mel_filters"]


def __getattr__(name: str) -> Any:
    """Import a name when it is first used: SoundObservation alone needs gymnasium."""
    if name in __all__:
        return getattr(_environments, name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
