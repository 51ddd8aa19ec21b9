"""A MuJoCo scene is heard without PyBullet, and as PyBullet's is, where both give the same impulse."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from tests.made.baked import third_octave_db
from tests.made.models import STEEL, box_model
from tests.made.worlds import ball

mujoco = pytest.importorskip("mujoco")

REPO = Path(__file__).resolve().parents[2]
BLOCKED = "import sys; sys.modules.update(pybullet=None, pybullet_utils=None, pybullet_data=None)\n"
EDGES_M, TONES_HZ, RADIUS_M, MASS_KG = (0.3, 0.2, 0.01), (740.0, 1230.0, 2950.0, 5210.0, 9000.0), 0.02, 0.1
HEIGHT_M, MICROPHONE = 0.2, (0.1, -0.4, 0.3)
TO_12_KHZ = 16
"""Third octaves from 400 Hz on. Above, 30 dB down, PyBullet's own differ by up to 10 dB when the ball falls 1 mm
farther: the pulse begins between two samples."""


@pytest.mark.slow
def test_the_page_runs_without_pybullet(tmp_path: Path) -> None:
    page = (REPO / "docs" / "how-to" / "listen-in-mujoco.md").read_text(encoding="utf-8")
    scripts = re.findall(r"^```python\n(.*?)^```", page, re.S | re.M)
    render = "sys.argv = 'sonic-bullet render board.npz -o again.wav --pascals'.split()\n"
    code = BLOCKED + "".join(scripts) + render + "from sonic_bullet.apps.cli import main\nmain()\n"
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True, text=True, cwd=tmp_path, timeout=280,
        env={**os.environ, "PYTHONPATH": str(REPO)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    one, two = (sb.read_audio(tmp_path / name)[0] for name in ("board.wav", "again.wav"))
    assert np.abs(one).max() > 1e-3
    assert np.array_equal(one, two[:, : one.shape[1]])


def plate_sound(listener: Any, who: object, step: Any, lift: Any, dt_s: float) -> tuple[np.ndarray, float, float]:
    """A strike's sound, faded out over 0.3 s, and its impulse and speed; then the ball is gone, lest it bounce."""
    listener.add(who, material=STEEL, model=box_model(EDGES_M, TONES_HZ))
    strike = np.zeros(0, int)
    while not len(strike):
        step()
        rows = listener.contacts.rows
        strike = np.flatnonzero(rows.impulse_n_s[:, 2] ** 2 > (0.5 * MASS_KG) ** 2)
    lift()
    for _ in range(round(0.35 / dt_s)):
        step()
    sound = listener.sound()[0]
    onset = int(np.flatnonzero(np.abs(sound) > 1e-3 * np.abs(sound).max())[0])
    fade = np.cos(np.pi / 2 * np.arange(14_400) / 14_400) ** 2
    return sound[onset : onset + len(fade)] * fade, abs(rows.impulse_n_s[strike[0], 2]), rows.approach_m_s[strike[0]]


def in_mujoco(solref: str, timestep: float, integrator: str) -> tuple[np.ndarray, float, float]:
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><option timestep='{timestep}' integrator='{integrator}'/><worldbody>"
        f"<geom name='plate' type='box' size='.15 .1 .005' solref='{solref}'/>"
        f"<body name='ball' pos='.04 .03 {HEIGHT_M}'><freejoint/>"
        f"<geom type='sphere' size='.02' mass='.1' solref='{solref}'/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)

    def lift() -> None:
        data.qpos[2], data.qvel[:] = 5.0, 0.0

    with sb.attach((model, data), microphone=MICROPHONE, supports=False) as listener:
        return plate_sound(listener, "plate", lambda: mujoco.mj_step(model, data), lift, timestep)


def in_pybullet(client: Any, restitution: float) -> tuple[np.ndarray, float, float]:
    import pybullet as p

    client.setGravity(0, 0, -9.81)
    client.setTimeStep(1 / 240)
    plate = client.createMultiBody(0, client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.15, 0.1, 0.005]))
    client.changeDynamics(plate, -1, restitution=restitution / 0.6, contactProcessingThreshold=0)
    body = ball(client, (0.04, 0.03, HEIGHT_M), radius=RADIUS_M, mass=MASS_KG)

    def lift() -> None:
        client.resetBasePositionAndOrientation(body, (0, 0, 5), (0, 0, 0, 1))
        client.resetBaseVelocity(body, (0, 0, 0), (0, 0, 0))

    with sb.attach(client, microphone=MICROPHONE, supports=False) as listener:
        return plate_sound(listener, plate, client.stepSimulation, lift, 1 / 240)


@pytest.mark.parametrize(("solref", "timestep", "integrator"), [("0.02 1", 0.002, "Euler"), ("0.01 1", 0.001, "RK4")])
def test_third_octaves_are_pybullets(client: Any, solref: str, timestep: float, integrator: str) -> None:
    """A ball falls on a plate. What MuJoCo gives at its speed is what PyBullet is asked to give; the pulse follows."""
    sound, impulse, speed = in_mujoco(solref, timestep, integrator)
    rebound = impulse / (MASS_KG * speed) - 1
    assert 0 < rebound < 0.3
    other, same, fast = in_pybullet(client, rebound)
    assert fast == pytest.approx(speed, rel=0.02)
    mine, theirs = (third_octave_db(one, low_hz=400.0) for one in (sound, other))
    gap = (mine - theirs - 20 * np.log10(impulse / same))[:TO_12_KHZ]
    print(f"impulses {impulse:.4f}, {same:.4f} N s; largest difference {np.abs(gap).max():.2f} dB of {len(gap)} bands")
    assert np.isfinite(gap).all()
    assert np.abs(sound).max() > 1e-3
    assert np.abs(gap).max() < 1.0
