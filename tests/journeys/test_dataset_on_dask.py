"""A data set on a Dask cluster, by the command line: the bytes of one process, whatever dies; nothing done twice."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.apps.cli.test_commands import error_of, run
from tests.journeys.test_recipe_to_dataset import RECIPE, contents

SR = 8000
SHORT = """
SECONDS = 0.1

def parameters(rng):
    return {"object": f"box {rng.integers(4)}", "height_m": rng.uniform(0.002, 0.01)}

def build(client, object, height_m):
    client.setGravity(0, 0, -9.81)
    floor = client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    box = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.1, 0.05, 0.01])
    body = client.createMultiBody(1.5, box, basePosition=[0, 0, 0.01 + height_m])
    return {floor: {"material": "concrete", "name": "floor"}, body: {"material": "steel", "count": 2, "name": object}}
"""
"""Two impacts of two modes: 0.05 s of a processor, a fiftieth of what a worker takes to start."""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fall.py").write_text(RECIPE)
    return tmp_path


@pytest.fixture
def cluster(place: Path) -> Iterator[Any]:
    """A cluster of 4 worker processes of one thread each, whose dead workers are started again."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=4, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as made:
        yield made


def words(folder: str, count: int, address: str, *more: str) -> list[str]:
    given = ["dataset", "fall.py", "-o", folder, "--count", str(count), "--sr", str(SR), "--scheduler", address]
    return [sys.executable, "-m", "sonic_bullet", *given, *more]


def pids(cluster: Any) -> list[int]:
    return [worker.pid for worker in cluster.workers.values() if worker.pid]


@pytest.mark.slow
@pytest.mark.timeout(3000)
@pytest.mark.parametrize(("count", "kills"), [(24, 4), (500, 25)])
def test_killed_workers_change_no_byte_and_nothing_is_lost(cluster: Any, count: int, kills: int) -> None:
    Path("fall.py").write_text(SHORT)
    # first, so that four workers do not all solve the same shapes
    assert run("dataset", "fall.py", "-o", "one", "--count", count, "--sr", SR, "--workers", 1) == 0
    running = subprocess.Popen(words("many", count, cluster.scheduler_address), stdout=subprocess.PIPE)
    chosen = random.Random(1)
    for number in range(kills):
        until = time.monotonic() + 600
        while len(list(Path("many", "samples", "000").glob("*.json"))) < (number + 1) * count // (kills + 1):
            assert running.poll() is None and time.monotonic() < until
            time.sleep(0.1)
        while not (alive := pids(cluster)):
            time.sleep(0.1)
        os.kill(chosen.choice(alive), signal.SIGKILL)
    out, _ = running.communicate(timeout=600)
    assert running.returncode == 0 and f"{count} samples, {count} made now" in out.decode()
    assert contents("many") == contents("one")


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_killed_scheduler_is_one_line_and_the_same_command_goes_on(
    place: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    from distributed import LocalCluster

    scheduler = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard", "--host", "127.0.0.1",
         "--scheduler-file", "scheduler.json"], stderr=subprocess.DEVNULL
    )  # fmt: skip
    address = wait_for_address()
    workers = [
        subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard",
             "--death-timeout", "60"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        ) for _ in range(2)
    ]  # fmt: skip
    running = subprocess.Popen(words("cut", 30, address), stderr=subprocess.PIPE)
    try:
        while len(list(Path("cut").rglob("0*.json"))) < 3:
            assert running.poll() is None
            time.sleep(0.05)
        scheduler.send_signal(signal.SIGKILL)
        _, said = running.communicate(timeout=120)
    finally:
        for process in (scheduler, *workers):
            process.kill()
            process.wait()
    last = said.decode().strip().splitlines()[-1]
    assert running.returncode == 2 and "went away; start it again" in last
    assert "Traceback" not in said.decode()
    done = [json.loads(line)["number"] for line in Path("cut", "manifest.jsonl").read_text().splitlines()]
    assert 3 <= len(done) < 30
    stamps = {number: Path("cut", "samples", "000", f"{number:06d}.wav").stat().st_mtime_ns for number in done}
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50) as other:
        assert subprocess.run(words("cut", 30, other.scheduler_address), check=False).returncode == 0
    assert run("dataset", "fall.py", "-o", "one", "--count", 30, "--sr", SR) == 0
    assert contents("cut") == contents("one")
    after = {number: Path("cut", "samples", "000", f"{number:06d}.wav").stat().st_mtime_ns for number in done}
    assert after == stamps


def wait_for_address() -> str:
    until = time.monotonic() + 60
    while time.monotonic() < until:
        if Path("scheduler.json").is_file():
            return str(json.loads(Path("scheduler.json").read_text())["address"])
        time.sleep(0.1)
    raise AssertionError("no scheduler")


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_what_raises_or_never_ends_is_listed_and_the_rest_goes_on(cluster: Any) -> None:
    text = RECIPE.replace(
        "def build(client, object, height_m):",
        "def build(client, object, height_m):\n"
        "    if height_m > 0.045:\n        raise ValueError('too high')\n"
        "    while height_m < 0.0255:\n        pass",
    )
    Path("fall.py").write_text(text)
    done = subprocess.run(words("out", 12, cluster.scheduler_address, "--limit", "25"), check=False)
    assert done.returncode == 1
    failed = [json.loads(line) for line in Path("out", "failures.jsonl").read_text().splitlines()]
    made = [json.loads(line)["number"] for line in Path("out", "manifest.jsonl").read_text().splitlines()]
    assert sorted(made + [one["number"] for one in failed]) == list(range(12)) and made
    reasons = " ".join(one["reason"] for one in failed)
    assert "ValueError: too high" in reasons and "4 workers ended while they made it" in reasons


def test_no_scheduler_is_one_line_and_makes_nothing(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for address in ("tcp://127.0.0.1:9", "nowhere"):
        said = error_of(capfd, "dataset", "fall.py", "-o", "out", "--count", "2", "--scheduler", address)
        assert "no scheduler answers at" in said
    assert not Path("out").exists()
