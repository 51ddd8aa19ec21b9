"""Rows come back to the bit wherever they lie; nothing is left in the folder; a full disk loses nothing."""

from __future__ import annotations

import os
import tempfile
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonic_bullet.files.storage import spool as spool_module
from sonic_bullet.files.storage.spool import BLOCK_BYTES, Spool
from sonic_bullet.files.storage.spooled_sound import KeptSound, SoundSpool
from sonic_bullet.records.contacts import CONTACT
from sonic_bullet.records.errors import FileError
from tests.made.disks import full_disk


def rows_of(dtype: Any, tail: tuple[int, ...], count: int, seed: int) -> np.ndarray:
    size = np.dtype(dtype).itemsize * int(np.prod(tail)) * count
    raw = np.random.default_rng(seed).bytes(size)
    return np.frombuffer(raw, dtype).reshape(count, *tail)


@pytest.mark.parametrize("memory_bytes", [0, 100_000, 1 << 30])
@pytest.mark.parametrize(("dtype", "tail"), [(CONTACT, ()), (float, (2,)), ("i4", (3, 2))])
def test_rows_come_back_bit_for_bit_from_memory_disk_and_both(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, dtype: Any, tail: tuple[int, ...], memory_bytes: int
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    kept, rng, given = Spool(dtype, tail, what="rows", memory_bytes=memory_bytes), np.random.default_rng(0), []
    for seed in range(60):
        given.append(rows_of(dtype, tail, int(rng.integers(0, 1500)), seed))
        kept.append(given[-1])
        kept.spill()
    whole = np.concatenate(given)
    assert len(kept) == len(whole) and kept.on_disk == (memory_bytes < 1 << 30)
    cuts = [(0, len(whole)), (0, 0), (5, 3), (len(whole) - 1, len(whole) + 9), *rng.integers(0, len(whole), (50, 2))]
    for start, stop in cuts:
        found = kept[start:stop]
        assert found.dtype == np.dtype(dtype) and found.tobytes() == whole[start:stop].tobytes()
        assert found.shape == whole[start:stop].shape and not found.flags.writeable
    assert list(tmp_path.iterdir()) == []  # nameless from its first moment: a kill leaves nothing


def test_a_full_disk_is_one_line_and_loses_no_row(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    kept = Spool(float, what="contact log", instead="attach with keep_log=False", memory_bytes=0)
    block = BLOCK_BYTES // 8
    given = [rows_of("i8", (), block, seed).view(float) for seed in range(6)]

    def filled(rows: np.ndarray) -> None:
        kept.append(rows)
        kept.spill()

    filled(given[0])
    with full_disk(2 * BLOCK_BYTES + 1000):
        filled(given[1])
        for rows in given[2:4]:
            with pytest.raises(FileError, match="contact log") as caught:
                filled(rows)
        assert kept[:].tobytes() == np.concatenate(given[:4]).tobytes()
    said = str(caught.value)
    assert "TMPDIR" in said and "keep_log=False" in said and str(tmp_path) in said and "\n" not in said
    filled(given[4])  # there is room again
    assert kept[:].tobytes() == np.concatenate(given[:5]).tobytes()


def test_where_no_folder_takes_a_file_the_rows_stay_in_memory(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    kept, rows = Spool(float, what="sound", memory_bytes=0), np.arange(BLOCK_BYTES, dtype=float)
    kept.append(rows)
    with pytest.raises(FileError, match="TMPDIR"):
        kept.spill()
    assert (kept[:] == rows).all()


@pytest.mark.parametrize("channels", [0, 1, 3])
def test_kept_sound_is_read_by_blocks_and_stays_what_it_was(monkeypatch: pytest.MonkeyPatch, channels: int) -> None:
    monkeypatch.setattr(spool_module, "MEMORY_BYTES", 1000)
    monkeypatch.setattr(spool_module, "BLOCK_BYTES", 500)
    rng = np.random.default_rng(1)
    frames = [rng.normal(size=(channels, int(n))) for n in rng.integers(0, 300, 20)]
    spool = SoundSpool(channels)
    for frame in frames:
        spool.add(frame)
    kept = KeptSound(spool, len(spool), rng.normal(size=(channels, 77)))
    whole = np.concatenate([*frames, kept.rest], axis=1)
    spool.add(np.ones((channels, 50)))
    assert kept.shape == whole.shape
    assert (kept.samples() == whole).all() and kept.samples().flags.writeable
    assert (np.concatenate([*kept.blocks(123)], axis=1) == whole).all()
    assert max(block.shape[1] for block in kept.blocks(123)) == 123
    assert (kept.peaks() == np.abs(whole).max(axis=1)).all()
    assert (KeptSound.of(whole).samples() == whole).all()
    nan = whole.copy()
    nan[:, 5] = np.nan
    assert np.isnan(KeptSound.of(nan).peaks()).all()


def test_a_snapshot_is_read_in_one_thread_while_another_appends() -> None:
    spool = Spool(np.int64, what="rows", memory_bytes=1 << 12)
    stop, wrong = threading.Event(), []

    def read() -> None:
        while not stop.is_set():
            count = len(spool)
            if not np.array_equal(spool[max(count - 50, 0) : count], np.arange(max(count - 50, 0), count)):
                wrong.append(count)

    reader = threading.Thread(target=read)
    reader.start()
    try:
        for start in range(0, 40_000, 100):
            spool.append(np.arange(start, start + 100))
            spool.spill()
    finally:
        stop.set()
        reader.join()
    assert not wrong
    assert np.array_equal(spool[0:40_000], np.arange(40_000))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_process_goes_on_in_a_file_of_its_own() -> None:
    many = 1 << 16
    spool = Spool(np.int64, what="rows", memory_bytes=1 << 10)
    spool.append(np.arange(many))
    spool.spill()
    child = os.fork()
    if child == 0:
        spool.append(np.full(many, -7))
        spool.spill()
        os._exit(0 if np.array_equal(spool[many - 1 : many + 1], [many - 1, -7]) else 1)
    assert os.waitpid(child, 0)[1] == 0
    spool.append(np.arange(many, 2 * many))
    spool.spill()
    assert np.array_equal(spool[0 : 2 * many], np.arange(2 * many))
