"""Ordinary scripts run as they stand: no window, no waiting, an end, and everything put back."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pybullet
import pybullet as p
import pytest
from pybullet_utils.bullet_client import BulletClient

from sonic_bullet.records.errors import SceneError, exception_words
from sonic_bullet.session.scene_file import scene_module
from sonic_bullet.simulators import own_clients, run_script

RAW = """
import pybullet as p, time
c = p.connect(p.GUI, options="--width=800")
p.setGravity(0, 0, -9.81)
slider = p.addUserDebugParameter("height", 0, 2, 0.5)
ball = p.createMultiBody(1, p.createCollisionShape(p.GEOM_SPHERE, radius=0.1), \
basePosition=[0, 0, p.readUserDebugParameter(slider)])
count = 0
while True:
    p.stepSimulation()
    count += 1
    time.sleep(1 / 240)
"""
OBJECT = """
from pybullet_utils import bullet_client
import pybullet
client = bullet_client.BulletClient(connection_mode=pybullet.GUI)
count = 0
while client.isConnected():
    client.stepSimulation()
    count += 1
"""


@pytest.fixture
def script(tmp_path: Path) -> Any:
    opened = []

    def run(text: str, seconds: float = 0.5, after: Any = None, before: Any = None) -> dict[str, Any]:
        path = tmp_path / "scene.py"
        path.write_text(text)
        return run_script(path, (before or opened.append, after or (lambda _: None)), seconds)

    with own_clients():
        yield run


@pytest.mark.parametrize("text", [RAW, OBJECT])
def test_endless_scripts_end_on_time(script: Any, text: str) -> None:
    seen: list[int] = []
    functions = p.connect, p.stepSimulation, p.disconnect, time.sleep, BulletClient.__getattr__, p.setRealTimeSimulation
    start = time.process_time()
    names = script(text, 0.5, after=seen.append)
    assert len(seen) == 120
    assert names["count"] == 119
    assert time.process_time() - start < 5
    assert functions == (
        p.connect,
        p.stepSimulation,
        p.disconnect,
        time.sleep,
        BulletClient.__getattr__,
        p.setRealTimeSimulation,
    )
    assert p.isConnected(seen[0])
    assert p.getConnectionInfo(seen[0])["connectionMethod"] == p.DIRECT


def test_short_scripts_end_where_they_end(script: Any) -> None:
    seen: list[int] = []
    names = script(
        "import pybullet as p\nc = p.connect(p.DIRECT)\nfor _ in range(10):\n    p.stepSimulation()\n"
        "p.disconnect()\nx = 3\n",
        5,
        after=seen.append,
    )
    assert len(seen) == 10 and names["x"] == 3


def test_time_steps_are_added_as_they_are(script: Any) -> None:
    seen: list[int] = []
    script(
        "import pybullet as p\np.connect(p.DIRECT)\np.setTimeStep(0.01)\nwhile True: p.stepSimulation()\n",
        0.3,
        after=seen.append,
    )
    assert len(seen) == 30


def test_real_time_scripts_step_while_they_sleep(script: Any) -> None:
    seen: list[int] = []
    script(
        "import pybullet as p, time\np.connect(p.GUI)\np.setRealTimeSimulation(1)\nwhile True: time.sleep(0.1)\n",
        0.5,
        after=seen.append,
    )
    assert len(seen) == 120


def test_scripts_cannot_swallow_the_end(script: Any) -> None:
    seen: list[int] = []
    text = (
        "import pybullet as p\np.connect(p.DIRECT)\nwhile True:\n    try:\n        p.stepSimulation()\n"
        "    except Exception:\n        pass\n"
    )
    script(text, 0.1, after=seen.append)
    assert len(seen) == 24


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("import pybullet as p\np.connect(p.DIRECT)\np.loadURDF('nowhere.urdf')\n", "'scene.py' line 3: error"),
        ("x = 1\ny = x +\n", "'scene.py' line 2"),
        ("def f():\n    return 1 / 0\n\nf()\n", "'scene.py' line 2: ZeroDivisionError"),
        ("import nothing_of_this_name\n", "'scene.py' line 1: ModuleNotFoundError"),
    ],
)
def test_errors_name_the_line(script: Any, text: str, message: str) -> None:
    before = p.stepSimulation
    with pytest.raises(SceneError, match=message):
        script(text)
    assert p.stepSimulation is before


def test_errors_of_hooks_pass_and_exits_are_ends(script: Any) -> None:
    def fail(_: int) -> None:
        raise SceneError("broken", "mend")

    with pytest.raises(SceneError, match=r"^broken; mend$"):
        script(RAW, after=fail)
    step = "c = p.connect(p.DIRECT)\np.stepSimulation(physicsClientId=c)\n"
    stepped = f"import sys\nimport pybullet as p\n{step}x = 1\nsys.exit(0)\n"
    assert script(stepped)["x"] == 1
    with pytest.raises(SceneError, match="line 2: SystemExit"):  # it has made no sound, and would not be missed
        script("import sys\nsys.exit(0)\n")


def test_missing_files_are_named() -> None:
    with pytest.raises(SceneError, match="cannot be read"):
        run_script("nowhere.py", None, 1)


def test_listening_leaves_stdout_alone() -> None:
    """PyBullet's own "argv[0]=" and "?" must not get into a pipe of JSON."""
    code = (
        "from sonic_bullet.simulators import direct_client, open_world\nimport pybullet as p\n"
        "c = direct_client()\n"
        "b = c.createMultiBody(0, c.createCollisionShape(p.GEOM_MESH, "
        "vertices=[[0,0,0],[1,0,0],[0,1,0],[0,0,1]], indices=[0,1,2,0,1,3]))\n"
        "try:\n    open_world(c).shapes_of(b)\nexcept Exception:\n    pass\nprint('{}')\n"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout == "{}\n"


def test_importing_the_project_leaves_pybullet_out() -> None:
    code = "import sys, sonic_bullet, sonic_bullet.simulators; assert 'pybullet' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_message_that_ends_with_a_full_stop_loses_it_before_the_remedy(tmp_path: Path) -> None:
    path = tmp_path / "missing.py"
    path.write_text("import pybullet as p\np.connect(p.DIRECT)\np.loadURDF('none.urdf')\n")
    with pytest.raises(SceneError, match=r"line 3: error: Cannot load URDF file; mend the scene$"):
        run_script(path, lambda client: None, 0.1)
    while pybullet.isConnected():
        pybullet.disconnect()
    path.write_text("raise ValueError('it broke.')\n")
    with pytest.raises(SceneError, match=r"line 1: ValueError: it broke; mend the scene$"):
        scene_module(path)
    assert exception_words(ValueError("and so on...")) == "ValueError: and so on..."
