"""A cache entry of which a bit is flipped is what was kept, or a miss."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sonic_bullet.files.storage import cache

ARRAYS = {"x": np.arange(12.0).reshape(4, 3), "i": np.array([0, 3]), "b": np.array([True])}


def saved(folder: Path) -> Path:
    cache.save(folder, "k", ARRAYS, "note")
    assert cache.load(folder, "k") is not None
    return folder / "k.npz"


def test_flipped_bits_are_a_miss_or_change_nothing(tmp_path: Path) -> None:
    path = saved(tmp_path)
    whole = path.read_bytes()
    missed = 0
    positions = range(0, len(whole), 7)
    for position in positions:
        path.write_bytes(whole[:position] + bytes([whole[position] ^ 1 << position % 8]) + whole[position + 1 :])
        found = cache.load(tmp_path, "k")
        missed += found is None
        assert found is None or (
            found[1] == "note" and all(found[0][name].tobytes() == ARRAYS[name].tobytes() for name in ARRAYS)
        )
    assert missed > 0.7 * len(positions)
