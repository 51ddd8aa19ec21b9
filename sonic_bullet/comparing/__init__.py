"""Comparison of two versions of a scene, by the name that users have: `sonic_bullet.apps.compare`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sonic_bullet.apps import compare as _compare

if TYPE_CHECKING:
    from sonic_bullet.apps.compare import Comparison, Consequence, Difference, SceneSide, compare

__all__ = ["Comparison", "Consequence", "Difference", "SceneSide", "compare"]


def __getattr__(name: str) -> Any:
    """Import a name when it is first used, as the package itself does."""
    if name in __all__:
        return getattr(_compare, name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
