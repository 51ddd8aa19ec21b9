"""Somebody's own simulator, without PyBullet: arrays -> log -> `sonic-bullet render` -> a sound at its time."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

import sonic_bullet as sb

REPO = Path(__file__).resolve().parents[2]
PAGE = REPO / "docs" / "how-to" / "bring-your-own-simulator.md"
BLOCKED = "import sys; sys.modules.update(pybullet=None, pybullet_utils=None, pybullet_data=None)\n"


def test_a_log_of_arrays_sounds_without_pybullet(tmp_path: Path) -> None:
    script = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.S | re.M)[0]
    assert len(script.splitlines()) <= 40
    render = "sys.argv = 'sonic-bullet render ball.npz -o ball.wav --pascals'.split()\n"
    code = BLOCKED + script + render + "from sonic_bullet.apps.cli import main\nmain()\n"
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True, text=True, cwd=tmp_path, timeout=240,
        env={**os.environ, "PYTHONPATH": str(REPO)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    audio, sr = sb.read_audio(tmp_path / "ball.wav")
    onset = np.flatnonzero(np.abs(audio[0]) > 0.05 * np.abs(audio).max())[0] / sr
    fall_s = np.sqrt(2 * (0.2 - 0.02 - 0.0075) / 9.81)
    away_s = np.linalg.norm([0.04, 0.53, 0.3]) / 343
    assert abs(onset - fall_s - away_s) < 2 / 240
    assert 1e-3 < np.abs(audio).max() < 100
