"""A bowl that falls on a board: which two modes of each pair its mesh gives is not heard, at a microphone either."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import soundfile

from sonic_bullet.engine.contact.coupling.mobility import alike_pairs
from sonic_bullet.files import read_log
from tests.apps.cli.test_commands import run

BOWL = Path(__file__).resolve().parents[2] / "assets" / "bowl.obj"
SCENE = f"""
SECONDS = 1.0
MICROPHONE = (0.3, -0.5, 0.4)
def build(client):
    client.setGravity(0, 0, -9.81)
    board = client.createMultiBody(
        0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.25, 0.2, 0.01]), basePosition=[0, 0, -0.01])
    bowl = client.createMultiBody(
        0.59, client.createCollisionShape(client.GEOM_MESH, fileName={str(BOWL)!r}), basePosition=[0, 0, 0.06],
        baseOrientation=client.getQuaternionFromEuler([0.5, 0.2, 0]))
    for body in (board, bowl):
        client.changeDynamics(body, -1, restitution=0.6)
    return {{board: {{"material": "made-wood", "name": "board", "count": 8}},
            bowl: {{"material": "made-steel", "name": "bowl", "count": 12}}}}
"""


def test_a_turn_of_each_pair_by_45_degrees_moves_no_level_by_1_db(tmp_path: Path) -> None:
    (tmp_path / "scene.py").write_text(SCENE)
    said = "--pascals", "--tail", "0"
    assert run("render", str(tmp_path / "scene.py"), "-o", str(tmp_path / "a.wav"),
               "--contacts", str(tmp_path / "a.npz"), *said) == 0  # fmt: skip
    log = read_log(tmp_path / "a.npz")
    bowl = next(body for body in log.bodies if body.name == "bowl")
    assert bowl.model is not None
    first = alike_pairs(bowl.model.freq_hz)
    assert len(first) >= 4
    shape = bowl.model.shape.astype(float).copy()
    one, other = shape[:, :, first].copy(), shape[:, :, first + 1].copy()
    shape[:, :, first], shape[:, :, first + 1] = (one + other) / np.sqrt(2), (other - one) / np.sqrt(2)
    turned = replace(bowl, model=replace(bowl.model, shape=shape.astype(np.float32)))
    bodies = [turned if body is bowl else body for body in log.bodies]
    replace(log, bodies=type(log.bodies)(bodies)).save(tmp_path / "b.npz")
    assert run("render", str(tmp_path / "b.npz"), "-o", str(tmp_path / "b.wav"), *said) == 0
    sound = [soundfile.read(tmp_path / name)[0] for name in ("a.wav", "b.wav")]
    level = [10 * np.log10((x[: len(x) // 2400 * 2400].reshape(-1, 2400) ** 2).mean(axis=1) + 1e-30) for x in sound]
    loud = level[0] > level[0].max() - 60
    assert loud.sum() > 10
    assert np.abs(level[1] - level[0])[loud].max() < 1
