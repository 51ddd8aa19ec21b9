"""A script that reads the clock reads the simulation's: as long as it says, the same steps each time."""

from __future__ import annotations

import datetime
import time
from pathlib import Path
from typing import Any

import pytest

from sonic_bullet.scene import examine_scene, render_scene
from sonic_bullet.simulators import own_clients, run_script, running_clock, scene_clock
from sonic_bullet.simulators.pybullet.scene_clock import EPOCH_S, LOOK_S, PAUSE_S, SceneClock

HEAD = """
import time
from time import perf_counter as clock
import datetime as dt
import pybullet as p
p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
p.createMultiBody(0.1, p.createCollisionShape(p.GEOM_SPHERE, radius=0.02), basePosition=[0, 0, 0.1])
count = 0
def step():
    global count
    p.stepSimulation()
    count += 1
"""
LOOPS = {
    "steps until the clock says so": "t = time.time()\nwhile time.time() - t < 0.5:\n    step()\n",
    "paced by looks": (
        "begin = last = time.time()\nwhile time.time() - begin < 0.5:\n"
        "    if time.time() - last >= 1 / 240:\n        step()\n        last = time.time()\n"
    ),
    "paced by sleeps": "t = time.monotonic()\nwhile time.monotonic() - t < 0.5:\n    step()\n    time.sleep(1 / 240)\n",
    "ten steps a sleep": (
        "t = clock()\nwhile clock() - t < 0.5:\n    for _ in range(10):\n        step()\n    time.sleep(10 / 240)\n"
    ),
    "after a pause": "time.sleep(1)\nt = time.time_ns()\nwhile time.time_ns() - t < 500_000_000:\n    step()\n",
    "the rest of each period": (
        "t = clock()\nwhile clock() - t < 0.5:\n    begin = clock()\n    step()\n"
        "    time.sleep(max(0, 1 / 240 - (clock() - begin)))\n"
    ),
    "dates": "t = dt.datetime.now()\nwhile (dt.datetime.now() - t).total_seconds() < 0.5:\n    step()\n",
    "real time, asleep": "p.setRealTimeSimulation(1)\nt = clock()\nwhile clock() - t < 0.5:\n    time.sleep(0.01)\n",
    "real time, awake": "p.setRealTimeSimulation(1)\nt = clock()\nwhile clock() - t < 0.5:\n    p.getNumBodies()\n",
}


def steps_of(path: Path, text: str) -> tuple[int, dict[str, Any]]:
    seen: list[int] = []
    path.write_text(HEAD + text)
    with own_clients():
        return len(seen), run_script(path, (None, seen.append), 20) | {"seen": seen}


@pytest.mark.parametrize("kind", LOOPS)
def test_half_a_second_is_half_a_second_of_physics(tmp_path: Path, kind: str) -> None:
    first, second = (len(steps_of(tmp_path / "scene.py", LOOPS[kind])[1]["seen"]) for _ in range(2))
    assert first == second == pytest.approx(120, abs=1)


def test_slow_control_goes_by_the_sleeps(tmp_path: Path) -> None:
    """Sleeps that are longer than the steps between them: the clock says what a wall clock would."""
    text = "t = clock()\nwhile clock() - t < 0.5:\n    step()\n    time.sleep(0.01)\n"
    assert len(steps_of(tmp_path / "scene.py", text)[1]["seen"]) == pytest.approx(50, abs=1)


def test_the_modules_below_a_scenes_folder_read_its_clock_and_others_do_not(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "beside.py").write_text("import time\ndef read():\n    return time.time()\n")
    (tmp_path / "site-packages").mkdir()
    (tmp_path / "site-packages" / "installed.py").write_text("import time\ndef read():\n    return time.time()\n")
    text = (
        "import sys, os\nfrom pathlib import Path\nhere = Path(__file__).parent\n"
        "sys.path[:0] = [str(here / 'parts'), str(here / 'site-packages')]\n"
        "import beside, installed, random\nours, theirs = beside.read(), installed.read()\n"
        "import timeit\nlibrary = timeit.default_timer()\nown = time.time()\n"
        "made = dt.datetime.now()\nkind = isinstance(dt.datetime(2020, 1, 1), dt.datetime)\n"
        "late = made > dt.datetime(1999, 1, 1)\n"
    )
    real = time.time()
    names = steps_of(tmp_path / "scene.py", text)[1]
    assert names["ours"] == pytest.approx(EPOCH_S, abs=1) and names["own"] == pytest.approx(EPOCH_S, abs=1)
    assert abs(names["theirs"] - real) < 60
    assert abs(names["library"] - time.perf_counter()) < 60
    assert names["made"].year in (1999, 2000) and names["kind"] and names["late"]
    assert isinstance(names["made"], datetime.datetime)
    assert running_clock() is None
    assert abs(names["beside"].read() - real) < 60  # without a scene, the real one again


def test_a_clock_by_itself() -> None:
    clock = SceneClock()
    clock.sleep(0.01)
    clock.step(0.004)
    assert clock.now_s == pytest.approx(0.01)  # was waited for
    clock.step(0.004)
    clock.step(0.004)
    assert clock.now_s == pytest.approx(0.012)
    clock.sleep(0.004)  # half of it for as long as the half of the step before that was not waited for
    assert clock.now_s == pytest.approx(0.014)
    clock.sleep(2 * PAUSE_S)
    clock.step(0.004)
    assert clock.now_s == pytest.approx(0.018 + 2 * PAUSE_S)
    with pytest.raises(ValueError, match="non-negative"):
        clock.sleep(-1)
    before_s = clock.now_s
    clock.sleep(0)
    assert clock.now_s - before_s == pytest.approx(LOOK_S)


def test_a_clock_is_put_back_where_a_scene_fails(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), scene_clock(tmp_path / "scene.py"):
        assert running_clock() is not None
        raise RuntimeError
    assert running_clock() is None
    assert abs(__import__("time").time() - time.time()) < 1


BUILT = """
import time
SECONDS = 0.5
TIMES = []

def build(client):
    client.setGravity(0, 0, -9.81)
    begin = time.time()
    while time.time() - begin < 0.1:
        client.stepSimulation()
    TIMES.append(time.time() - begin)
    return {client.createMultiBody(0.1, client.createCollisionShape(client.GEOM_SPHERE, radius=0.02)): "steel"}

def act(client, time_s):
    TIMES.append(time.time())
"""


def test_a_file_with_build_reads_it_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[list[float]] = []
    monkeypatch.setattr("tests.simulators.test_scene_clock.KEPT", found, raising=False)
    (tmp_path / "a.py").write_text(
        BUILT + "\nfrom tests.simulators import test_scene_clock\ntest_scene_clock.KEPT.append(TIMES)\n"
    )
    for _ in range(2):
        render_scene(tmp_path / "a.py", microphones=())
    first, second = found
    assert first == second
    assert first[0] == pytest.approx(0.1, abs=1 / 240)
    assert first[-1] - first[1] == pytest.approx(0.5, rel=0.02)


@pytest.mark.shared
@pytest.mark.parametrize("name", ["scene", "realtime"])
def test_the_faults_scenes_are_two_seconds_long_with_the_same_bits(shared_path: Path, name: str) -> None:
    path = shared_path / "faults" / "07-wall-clock-loop" / f"{name}.py"
    sounds = [render_scene(path, sr=8000).samples for _ in range(2)]
    assert sounds[0].shape[1] == pytest.approx(2 * 8000, rel=0.005)
    assert len({sound.tobytes() for sound in sounds}) == 1
    assert abs(sounds[0]).max() > 1e-3


def test_doctor_names_real_time_simulation(tmp_path: Path) -> None:
    """Stepped here for as long as the script waits; with `attach` nobody sees its steps."""
    path = tmp_path / "scene.py"
    path.write_text(
        "import time\nimport pybullet as p\np.connect(p.DIRECT)\np.setGravity(0, 0, -10)\n"
        "p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))\n"
        "p.createMultiBody(1, p.createCollisionShape(p.GEOM_SPHERE, radius=0.1), basePosition=(0, 0, 0.2))\n"
        "p.setRealTimeSimulation(1)\nwhile True:\n    time.sleep(0.01)\n"
    )
    (said,) = [one for one in examine_scene(path, 0.1) if one.id == "real-time"]
    assert said.what.startswith("'scene.py' line 7 turns real-time") and "stepSimulation" in said.remedy


@pytest.mark.shared
def test_doctor_names_the_loop(shared_path: Path) -> None:
    found = examine_scene(shared_path / "faults" / "07-wall-clock-loop" / "scene.py", 0.1)
    said = [one for one in found if one.id == "wall-clock"]
    assert {one.severity for one in said} == {"info"}
    assert [one.what.partition(" reads")[0] for one in said] == [
        "'scene.py' line 10",
        "'scene.py' line 11",
        "'scene.py' line 13",
    ]
