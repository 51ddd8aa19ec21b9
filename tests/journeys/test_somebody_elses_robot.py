"""Somebody else's four lines with a robot on the usual ground, rendered as they stand."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import soundfile

REPO = Path(__file__).parents[2]
COMMAND = "from sonic_bullet.apps.cli import main; main()"
SCRIPT = """\
import pybullet as p, pybullet_data; p.connect(p.GUI); p.setAdditionalSearchPath(pybullet_data.getDataPath())
p.setGravity(0, 0, -9.81); p.loadURDF("plane.urdf"); p.loadMJCF("mjcf/hopper.xml")
p.loadURDF("cube_small.urdf", [1, 0, 0.2])
p.createMultiBody(0, p.createCollisionShape(p.GEOM_MESH, vertices=[[1, 1, 0], [2, 1, 0], [1, 2, 0]], indices=[0, 1, 2]))
for _ in range(240): p.stepSimulation()
"""


def test_a_robot_on_the_usual_ground_is_heard_and_the_rest_is_named(tmp_path: Path) -> None:
    (tmp_path / "robot.py").write_text(SCRIPT)
    command = [sys.executable, "-c", COMMAND, "render", "robot.py", "-o", "robot.wav", "--seconds", "0.5"]
    command += ["--material", "steel", "--sr", "16000", "--json"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, errors="replace")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    notes = "\n".join(told["notes"])
    assert "plane (body 0) is ground (static, 200 m long): a silent partner with concrete's contact" in notes
    assert "body 3 is a silent partner: mesh is a flat sheet" in notes
    assert {body["body"] for body in told["bodies"] if body["material"] == "steel"} == {1, 2}
    assert "touched by nobody, so silent: hopper/torso (body 1)" in notes  # it hangs above the ground
    modes = {body["body"]: body["modes"] for body in told["bodies"] if body["material"] == "steel"}
    assert modes == {1: None, 2: 0}  # the hopper's are not solved, and the cube has none below 20 kHz
    assert soundfile.info(tmp_path / "robot.wav").duration == 0.5
    assert told["peak_pa"] > 0.01
