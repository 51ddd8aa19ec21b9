"""What is kept between runs: what was unused for longest goes first, foreign files stay, two processes get along."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet.files.storage import cache
from sonic_bullet.records.errors import FileError


def name(i: int, kind: str = "modes") -> str:
    return f"{kind}-{i:064x}"


def kept(folder: Path, i: int, age_s: float, kind: str = "modes") -> Path:
    """An entry of 8 kB that was used so long ago."""
    cache.save(folder, name(i, kind), {"x": np.full(1000, float(i))}, "")
    path = folder / f"{name(i, kind)}.npz"
    now = path.stat().st_mtime
    os.utime(path, (now - age_s, now - age_s))
    return path


@pytest.mark.parametrize(
    ("words", "size"),
    [("0", 0), ("500MB", 500_000_000), ("1.5 GB", 1_500_000_000), ("2kB", 2000), ("1MiB", 2**20), ("3G", 3 * 10**9)],
)
def test_sizes_in_words(words: str, size: int) -> None:
    assert cache.as_bytes(words, "--limit") == size


@pytest.mark.parametrize("words", ["", "much", "-1", "1 PB", "1e9", "5MBs", "MB"])
def test_what_is_no_size_is_named(words: str) -> None:
    with pytest.raises(FileError, match=f"--limit is '{words}'"):
        cache.as_bytes(words, "--limit")


def test_a_save_past_the_limit_drops_what_was_unused_for_longest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = [kept(tmp_path, i, age_s=1000 - 100 * i) for i in range(5)]
    assert cache.load(tmp_path, name(0)) is not None  # used now, it is the oldest no more
    monkeypatch.setenv(cache.LIMIT_VARIABLE, str(4 * paths[0].stat().st_size))
    new = kept(tmp_path, 9, 0)
    assert [path.exists() for path in paths] == [True, False, False, True, True] and new.exists()


def test_models_that_logs_refer_to_go_last(tmp_path: Path) -> None:
    old, new = kept(tmp_path, 1, 1e6, "model"), kept(tmp_path, 2, 0)
    size = old.stat().st_size
    (removed,) = cache.evict_files(cache.list_models(tmp_path), size)
    assert (removed.path, removed.kind) == (new, "modes") and not new.exists()
    assert [one.path for one in cache.evict_files(cache.list_models(tmp_path), 0)] == [old]


def test_a_limit_that_is_no_size_is_said_after_the_result_was_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(cache.LIMIT_VARIABLE, "plenty")
    with pytest.raises(FileError, match=r"SONIC_BULLET_CACHE_LIMIT is 'plenty'.*2GB"):
        cache.save(tmp_path, name(0), {"x": np.zeros(1000)}, "")
    assert cache.load(tmp_path, name(0)) is not None


def test_only_what_was_kept_here_is_listed(tmp_path: Path) -> None:
    ours = kept(tmp_path, 1, 0)
    for foreign in ("song.npz", "modes-12.npz", f"{name(2)}.npz.bak", "sonic-bullet-0123456789abcdef.partial"):
        (tmp_path / foreign).write_bytes(b"x")
    (tmp_path / f"{name(3)}.npz").mkdir()
    (tmp_path / f"{name(4)}.npz").symlink_to(ours)
    assert [one.path for one in cache.list_models(tmp_path)] == [ours]
    assert cache.list_models(tmp_path / "missing") == []


CLEARING = """
import sys, time
from pathlib import Path
from sonic_bullet.files.storage import cache
removed, end = 0, time.monotonic() + 20
print("begun", flush=True)
while not (Path(sys.argv[1]) / "stop").exists() and time.monotonic() < end:
    removed += len(cache.evict_files(cache.list_models(Path(sys.argv[1])), 0))
print(removed)
"""


def test_another_process_that_clears_costs_nobody_anything(tmp_path: Path) -> None:
    """What is loaded meanwhile is what was saved, or a miss; nothing is raised on either side."""
    words = [sys.executable, "-c", CLEARING, str(tmp_path)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None and other.stdout.readline() == "begun\n"
        found = missed = 0
        for i in range(400):
            cache.save(tmp_path, name(i % 7), {"x": np.full(1000, float(i))}, "")
            entry = cache.load(tmp_path, name(i % 7))
            missed += entry is None
            if entry is not None:
                found += 1
                assert (entry[0]["x"] == i).all()
        (tmp_path / "stop").touch()
        removed = int(other.stdout.readline())
    assert other.returncode == 0 and removed > 0
    assert found + missed == 400 and missed > 0
