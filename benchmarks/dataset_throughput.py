"""Processor time and clips per second of a data set: processes of one machine beside a Dask cluster, and one writer.

    .venv/bin/python benchmarks/dataset_throughput.py [--count 100] [--workers 2]
    .venv/bin/python benchmarks/dataset_throughput.py --empty [--count 200]      the ready recipe from an empty cache
    .venv/bin/python benchmarks/dataset_throughput.py --household [--count 24]   2 s clips, an object each, then known

Both make the same samples of the ready recipe, whose shapes are known by then; the bytes are compared. Each is run with
few samples and with all: the difference is what a sample takes, the rest what a start takes. Processor time holds on a
busy machine, too; clips per second do not.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

FEW = 4


@dataclass(frozen=True)
class Cost:
    """Of a run: processor time of all its processes, and wall time of the command."""

    cpu_s: float
    wall_s: float


def make(folder: Path, count: int, workers: int, *more: str, recipe: str = "impacts") -> float:
    """Make a data set; return its wall time in seconds."""
    words = ["dataset", recipe, "-o", str(folder), "--count", str(count), "--seed", "1"]
    words += ["--workers", str(workers), *more]
    start_s = time.monotonic()
    subprocess.run([sys.executable, "-m", "sonic_bullet", *words], check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - start_s


def cost(run: Callable[[], float]) -> Cost:
    """Run something; all its processes have ended when it returns."""
    before = os.times()
    wall_s = run()
    after = os.times()
    return Cost(sum(after[:4]) - sum(before[:4]), wall_s)


def on_pool(folder: Path, count: int, workers: int) -> Cost:
    """Make a data set by processes of this machine."""
    return cost(lambda: make(folder, count, workers))


def on_dask(folder: Path, count: int, workers: int) -> Cost:
    """Make a data set by a cluster of one worker a process; its scheduler runs in this one."""
    from distributed import LocalCluster

    def run() -> float:
        made: Any = LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None)
        with made as cluster:
            return make(folder, count, 1, "--scheduler", cluster.scheduler_address)

    return cost(run)


def writes_per_cpu_s(folder: Path, count: int = 50) -> tuple[float, float]:
    """Return how many samples of 1.5 s of two channels one process writes: per second, per second of processor."""
    from sonic_bullet.apps.dataset.sample_folder import SampleFolder
    from sonic_bullet.apps.dataset.samples import Sample

    sound = np.random.default_rng(0).normal(size=(2, 72_000)).astype(np.float32)
    kept = SampleFolder(folder)
    start_s, cpu_s = time.monotonic(), time.process_time()
    for number in range(count):
        kept.keep(Sample(number, 48_000, sound, {"object": "one"}), "train")
    return count / (time.monotonic() - start_s), count / (time.process_time() - cpu_s)


def contents(folder: Path) -> dict[Path, bytes]:
    """Read all files of a folder."""
    return {one.relative_to(folder): one.read_bytes() for one in folder.rglob("*") if one.is_file()}


def show(name: str, few: Cost, whole: Cost, count: int) -> None:
    """Print what a clip and a start take."""
    clip_s = (whole.cpu_s - few.cpu_s) / (count - FEW)
    print(f"{name:10} processor s a clip {clip_s:.3f}, a start {few.cpu_s - FEW * clip_s:.1f} s")
    print(f"{'':10} clips/s {(count - FEW) / (whole.wall_s - few.wall_s):.2f} here; {1 / clip_s:.2f} a whole core")


def household(root: Path, count: int) -> None:
    """Print clips a minute and core of objects of their own and of known ones, and whether workers change bytes."""
    runs = {}
    for name, clips, workers in (("fresh", count, 1), ("again", count, 2), ("few", FEW, 1)):
        runs[name] = cost(lambda name=name, clips=clips, workers=workers: make(  # type: ignore[misc]
            root / name, clips, workers, "--sr", "24000", recipe="household"
        ))  # fmt: skip
    known_s = (runs["again"].cpu_s - runs["few"].cpu_s) / (count - FEW)
    start_s = runs["few"].cpu_s - FEW * known_s
    fresh_s = (runs["fresh"].cpu_s - start_s) / count
    print(f"an object of its own: processor {fresh_s:.2f} s a clip, {60 / fresh_s:.0f} a minute and core")
    print(f"known ones: {known_s:.3f} s, {60 / known_s:.0f} a minute and core; a start {start_s:.1f} s")
    print(f"one worker and two give equal bytes: {contents(root / 'fresh') == contents(root / 'again')}")


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--empty", action="store_true", help="only the ready recipe, with no model known")
    parser.add_argument("--household", action="store_true", help="the household's recipe, with no model known")
    given = parser.parse_args()
    os.environ["SONIC_BULLET_PROGRESS"] = "0"
    with (
        tempfile.TemporaryDirectory() as place,
        tempfile.TemporaryDirectory() if given.empty or given.household else nullcontext() as models,
    ):
        root = Path(place)
        if models is not None:
            os.environ["SONIC_BULLET_CACHE"] = models
            if given.household:
                household(root, given.count)
                return
            found = on_pool(root / "one", given.count, given.workers)
            print(
                f"{given.count} samples from an empty cache: processor {found.cpu_s:.0f} s, wall {found.wall_s:.0f} s"
            )
            return
        make(root / "known", given.count, given.workers)  # shapes
        for name, run in (("pool", on_pool), ("Dask", on_dask)):
            few = run(root / f"few {name}", FEW, given.workers)
            show(name, few, run(root / name, given.count, given.workers), given.count)
        made = contents(root / "pool")
        print(f"equal bytes {made == contents(root / 'Dask')}")
        print(f"{sum(map(len, made.values())) / given.count / 1e6:.3f} MB a clip")
        here, alone = writes_per_cpu_s(root / "writer")
        print(f"one writer: {here:.0f} clips/s here, {alone:.0f} a second of processor")


if __name__ == "__main__":
    main()
