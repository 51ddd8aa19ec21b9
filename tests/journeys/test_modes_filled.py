"""A sheet of which few modes are solved goes on above them by --fill-modes, and so does its log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from tests.apps.cli.test_commands import run

SCENE = """
SECONDS = 0.3
MICROPHONE = (0.2, -0.4, 0.3)
def build(client):
    client.setGravity(0, 0, -9.81)
    half = [0.2, 0.15, 0.002]
    sheet = client.createMultiBody(0, client.createCollisionShape(client.GEOM_BOX, halfExtents=half))
    ball = client.createMultiBody(
        0.004, client.createCollisionShape(client.GEOM_SPHERE, radius=0.005), basePosition=[0.03, 0.02, 0.03])
    for body in (sheet, ball):
        client.changeDynamics(body, -1, restitution=0.6)
    return {sheet: {"material": "made-aluminium", "name": "sheet", "count": 12},
            ball: {"material": "steel", "name": "ball"}}
"""
FLAT = "--pascals", "--tail", "0"


def test_the_band_above_the_last_mode_sounds_and_the_log_gives_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scene.py").write_text(SCENE)
    assert run("render", "scene.py", "-o", "few.wav", "--contacts", "few.npz", *FLAT) == 0
    assert run("render", "scene.py", "-o", "all.wav", "--contacts", "all.npz", "--fill-modes", *FLAT) == 0
    assert run("render", "all.npz", "-o", "again.wav", *FLAT) == 0
    assert Path("all.wav").read_bytes() == Path("again.wav").read_bytes()
    spectrum = [np.abs(np.fft.rfft(soundfile.read(name)[0])) ** 2 for name in ("few.wav", "all.wav")]
    hertz = np.fft.rfftfreq(2 * len(spectrum[0]) - 2, 1 / 48_000)
    over = [10 * np.log10(spectrum[1][band].sum() / spectrum[0][band].sum()) for band in (hertz < 400, hertz > 6000)]
    assert abs(over[0]) < 3 and over[1] > 10  # a sheet that yields more takes a little of the ball's impulse
    capfd.readouterr()
    assert run("render", "few.npz", "-o", "no.wav", "--fill-modes", *FLAT) == 2
    assert "render its scene with --fill-modes" in capfd.readouterr().err
