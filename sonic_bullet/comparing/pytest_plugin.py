"""The pytest plugin, by the name that users have: `sonic_bullet.apps.compare.pytest_plugin`."""

from __future__ import annotations

from sonic_bullet.apps.compare.pytest_plugin import pytest_addoption, pytest_terminal_summary, sonic_scene

__all__ = ["pytest_addoption", "pytest_terminal_summary", "sonic_scene"]
