"""What a scene opens ends with it, and a script is run in a client of its own."""

from __future__ import annotations

from pathlib import Path

import pybullet
import pytest
from pybullet_utils.bullet_client import BulletClient

from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators import own_clients, run_script


def connected() -> list[int]:
    return [number for number in range(1024) if pybullet.isConnected(number)]


def test_what_is_opened_ends_and_what_was_open_stays() -> None:
    before = BulletClient(pybullet.DIRECT)
    was = connected()
    assert before._client in was
    with own_clients():
        kept, plain = BulletClient(pybullet.DIRECT), pybullet.connect(pybullet.DIRECT)
        assert {kept._client, plain} <= set(connected()) - set(was)
    assert connected() == was
    after = BulletClient(pybullet.DIRECT)
    del kept  # its number is another's by now
    assert connected() == sorted({*was, after._client})


def test_a_script_that_steps_what_it_did_not_open_is_one_line(tmp_path: Path) -> None:
    scene = tmp_path / "s.py"
    scene.write_text("import pybullet as p\np.connect(p.DIRECT)\np.stepSimulation()\n")
    with own_clients():
        pybullet.connect(pybullet.DIRECT)
        assert 0 in connected()  # this one, or one that other tests left
        with pytest.raises(SceneError, match=r"^the scene steps client 0, which it did not open"):
            run_script(scene, None, 1.0)
