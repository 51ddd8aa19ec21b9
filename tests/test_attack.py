"""Every row of `benchmarks/attack.py` ends as it says; kills, shared caches, many listeners and steps leave nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from benchmarks import attack

REPO = Path(__file__).resolve().parents[1]
ROWS = list(attack.rows())


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=[row.name for row in ROWS])
def test_every_row_ends_with_its_exit_and_one_line(tmp_path: Path, row: attack.Row) -> None:
    assert attack.wrong_with(row, tmp_path) == ""


@pytest.mark.slow
def test_a_render_killed_while_it_writes_leaves_nothing_visible_and_runs_again(tmp_path: Path) -> None:
    attack.scene(tmp_path)
    assert attack.killed_while_it_writes(tmp_path, "render a.py -o a.wav --sr 8000", "a.wav") == ""


@pytest.mark.slow
def test_two_processes_on_one_empty_cache_give_the_same(tmp_path: Path) -> None:
    attack.scene(tmp_path)
    done: dict[str, subprocess.CompletedProcess[str]] = {}

    def run(name: str) -> None:
        words = f"render a.py -o {name}.wav --sr 8000"
        done[name] = attack.shell(tmp_path, words, SONIC_BULLET_CACHE=str(tmp_path / "cache"))

    both = [threading.Thread(target=run, args=(name,)) for name in "ab"]
    for one in both:
        one.start()
    for one in both:
        one.join()
    assert [one.returncode for one in done.values()] == [0, 0], [one.stderr for one in done.values()]
    assert (tmp_path / "a.wav").read_bytes() == (tmp_path / "b.wav").read_bytes()


MANY = """
import ctypes, gc, sys
import pybullet as p
import sonic_bullet as sb
from sonic_bullet.simulators import direct_client, disconnect
from tests.made.models import STEEL, box_model
from tests.made.worlds import EDGES_M, box, floor
gc.disable()
def resident_mb():
    ctypes.CDLL(None).malloc_trim(0)  # what is free goes back now, not with the next large block
    return int(open("/proc/self/statm").read().split()[1]) * 4096 / 1e6
def one(steps):
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    listener = sb.attach(client, microphone=(0, -1, 0.5), sr=24_000)
    floor(client)
    model = box_model(EDGES_M, tuple(500.0 + 37.0 * k for k in range(200)), STEEL)
    listener.add(box(client, (0, 0, 0.05)), material=STEEL, model=model)
    for _ in range(steps):
        client.stepSimulation()
    listener.sound()
    listener.detach()
    disconnect(client)
for number in range(int(sys.argv[1])):
    one(int(sys.argv[2]))
    if number == 1:
        early = resident_mb()
print(resident_mb() - early)
"""


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="needs /proc")
@pytest.mark.parametrize(
    ("listeners", "steps", "grown_mb"),
    [
        (12, 4, 20.0),  # a listener that stays holds 89 MB
        pytest.param(100, 24, 100.0, marks=pytest.mark.slow),
        pytest.param(1000, 4, 20.0, marks=pytest.mark.slow),  # measured: 2 kB each
    ],
)
def test_memory_after_many_listeners_is_that_after_two(listeners: int, steps: int, grown_mb: float) -> None:
    """Without a call of the collector."""
    done = subprocess.run(
        [sys.executable, "-c", MANY, str(listeners), str(steps)],
        cwd=REPO, check=True, capture_output=True, text=True, timeout=280,
    )  # fmt: skip
    assert float(done.stdout.split()[-1]) < grown_mb


LONG = """
import json, sys, time
import sonic_bullet as sb
from sonic_bullet.simulators import direct_client
from tests.made.models import STEEL, box_model
from tests.made.worlds import EDGES_M, box, floor
client = direct_client()
client.setGravity(0, 0, -9.81)
listener = sb.attach(client, microphone=(0, -1, 0.5), sr=24_000, keep_log=False, keep_sound=False)
floor(client)
bar = box(client, (0, 0, 0.05))
listener.add(bar, material=STEEL, model=box_model(EDGES_M, tuple(500.0 + 37.0 * k for k in range(20)), STEEL))
parts = []
for part in range(10):
    begun = time.process_time()
    for step in range(int(sys.argv[1]) // 10):
        if step % 100 == 0:
            client.resetBasePositionAndOrientation(bar, (0, 0, 0.05), (0, 0, 0, 1))
        client.stepSimulation()
    resident = int(open("/proc/self/statm").read().split()[1]) * 4096 / 1e6
    parts.append((time.process_time() - begun, resident))
print(json.dumps(parts))
"""


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="needs /proc")
@pytest.mark.parametrize("steps", [20_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_a_long_run_costs_no_more_a_step_and_holds_no_more_at_its_end(steps: int) -> None:
    """Tenths of a run in which a bar falls over and over: the last four against the four after the first."""
    done = subprocess.run(
        [sys.executable, "-c", LONG, str(steps)], cwd=REPO, check=True, capture_output=True, text=True, timeout=280
    )
    seconds, resident_mb = zip(*json.loads(done.stdout.splitlines()[-1]), strict=True)
    assert min(seconds[6:]) < 1.5 * max(seconds[1:5])  # other work beside it slows some of the tenths
    assert resident_mb[-1] - resident_mb[2] < 2.0  # a frame is 0.8 kB; what is bounded is full after 6000 steps
