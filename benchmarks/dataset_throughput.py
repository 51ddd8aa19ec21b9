"""Clips per second of a data set: processes of one machine beside a Dask cluster of as many workers, and one writer.

    .venv/bin/python benchmarks/dataset_throughput.py [--count 200] [--workers 2]

Both make the same samples of the ready recipe, whose shapes are known by then; the bytes are compared.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np


def make(folder: Path, count: int, workers: int, *more: str) -> float:
    """Make a data set; return its wall time in seconds."""
    words = ["dataset", "impacts", "-o", str(folder), "--count", str(count), "--seed", "1"]
    words += ["--workers", str(workers), *more]
    start_s = time.monotonic()
    subprocess.run([sys.executable, "-m", "sonic_bullet", *words], check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - start_s


def writes_per_s(folder: Path, count: int = 50) -> float:
    """Return how many samples of 1.5 s of two channels one process writes a second."""
    from sonic_bullet.dataset.sample_folder import SampleFolder
    from sonic_bullet.dataset.samples import Sample

    sound = np.random.default_rng(0).normal(size=(2, 72_000)).astype(np.float32)
    kept = SampleFolder(folder)
    start_s = time.monotonic()
    for number in range(count):
        kept.keep(Sample(number, 48_000, sound, {"object": "one"}), "train")
    return count / (time.monotonic() - start_s)


def contents(folder: Path) -> dict[Path, bytes]:
    """Read all files of a folder."""
    return {one.relative_to(folder): one.read_bytes() for one in folder.rglob("*") if one.is_file()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    os.environ["SONIC_BULLET_PROGRESS"] = "0"
    from distributed import LocalCluster

    with tempfile.TemporaryDirectory() as place:
        root = Path(place)
        make(root / "known", given.count, given.workers)  # shapes and machine code
        bare_s = make(root / "one", 1, 1)
        before = os.times()
        pool_s = make(root / "pool", given.count, given.workers)
        after = os.times()
        used_s = after.children_user + after.children_system - before.children_user - before.children_system
        with LocalCluster(n_workers=given.workers, threads_per_worker=1, dashboard_address=None) as cluster:
            address = cluster.scheduler_address
            make(root / "first", given.workers * 2, 1, "--scheduler", address)
            dask_s = make(root / "dask", given.count, 1, "--scheduler", address)
        equal = contents(root / "pool") == contents(root / "dask")
        size = sum(map(len, contents(root / "pool").values())) / given.count
        print(f"one sample, start to end       {bare_s:.1f} s")
        print(f"processor time a clip, pool    {used_s / given.count:.2f} s")
        print(f"pool of {given.workers}, clips/s             {given.count / pool_s:.2f}")
        print(f"Dask, {given.workers} workers, clips/s       {given.count / dask_s:.2f}")
        print(f"equal bytes                    {equal}")
        print(f"bytes a clip                   {size / 1e6:.3f} MB")
        print(f"one writer, clips/s            {writes_per_s(root / 'writer'):.0f}")


if __name__ == "__main__":
    main()
