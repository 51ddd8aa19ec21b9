"""A steel ball that rolls is heard to turn: its own roughness comes back once a turn.

scene script -> render -> WAV -> envelope -> line at v/2πR
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sonic_bullet.files import read_audio
from tests.apps.cli.called_here import call_here

SPEED_M_S, RADIUS_M = 0.5, 0.015
SCENE = f"""
SECONDS = 4.0
MICROPHONE = (0.0, -0.5, 0.3)


def build(client):
    client.setGravity(0, 0, -9.81)
    floor = client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    shape = client.createCollisionShape(client.GEOM_SPHERE, radius={RADIUS_M})
    ball = client.createMultiBody(7850 * 4.19 * {RADIUS_M}**3, shape, basePosition=[-1, 0, {RADIUS_M}])
    for body in (floor, ball):
        client.changeDynamics(body, -1, lateralFriction=0.6, linearDamping=0, angularDamping=0)
    client.resetBaseVelocity(ball, [{SPEED_M_S}, 0, 0], [0, {SPEED_M_S / RADIUS_M}, 0])
    return {{ball: {{"material": "steel", "name": "ball"}}, floor: "glass"}}  # a floor not added is rough as any
"""


def test_the_turn_stands_6_db_over_its_neighbours(tmp_path: Path) -> None:
    (tmp_path / "ball.py").write_text(SCENE)
    assert call_here(tmp_path, "render", "ball.py", "-o", "ball.wav").returncode == 0
    samples, sr = read_audio(tmp_path / "ball.wav")
    sound = samples[0, sr // 2 : 4 * sr]
    frames = sound[: len(sound) // 96 * 96].reshape(-1, 96)
    envelope = np.sqrt((frames**2).mean(axis=1))
    power = np.abs(np.fft.rfft((envelope - envelope.mean()) * np.hanning(len(envelope)))) ** 2
    f = np.fft.rfftfreq(len(envelope), 96 / sr)
    turn = SPEED_M_S / (2 * np.pi * RADIUS_M)
    over = []
    for line in (turn, 2 * turn, 3 * turn):
        off = np.abs(f - line)
        over.append(10 * np.log10(power[off < 0.4].max() / power[(off > 1) & (off < turn / 2)].mean()))
    print(f"lines at 1, 2, 3 times {turn:.2f} Hz: {over[0]:.1f}, {over[1]:.1f}, {over[2]:.1f} dB over their neighbours")
    assert min(over) >= 6
