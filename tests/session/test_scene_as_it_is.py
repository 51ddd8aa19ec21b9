"""A scene's file is run as it is now."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sonic_bullet.session.scene_file import scene_module


def test_a_file_changed_within_a_second_is_run_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python's bytecode beside a file counts as its own where size and second of its change are the same."""
    monkeypatch.setattr("sys.dont_write_bytecode", False)
    place = tmp_path / "scene.py"
    for value in (1, 2):
        place.write_text(f"VALUE = {value}\n", encoding="utf-8")
        os.utime(place, (1e9, 1e9))
        assert value == scene_module(place).VALUE
    assert list(tmp_path.iterdir()) == [place]  # nothing that git would not know
