"""ManiWAV's replay buffer, a zarr of format 2 in a zip file: SPLIT.zarr.zip, and labels an episode in SPLIT.jsonl.

    data/mic_0, mic_1, …   (rows, sr/60) float32 pascals, a channel each; 60 rows a second, the last one of an episode
                           filled up with zeros
    meta/episode_ends      (episodes,) int64, rows before each episode's end; a sample is an episode

[Z. Liu et al. 2024, ManiWAV, 07_generate_replay_buffer: blocks of 800 samples at 48 kHz]
What it has of a robot (poses, gripper, camera) a data set of sounds has not.
"""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.dataset.loaders.audio_rows import ROWS_PER_S, audio_rows, count_rows, one_kind
from sonic_bullet.apps.dataset.sample_folder import LabelledSounds
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.records import Array


def write_replay_buffers(samples: LabelledSounds, to: Path) -> None:
    """Write all samples; FileError where their rates or channels differ, or a row is no whole number of samples."""
    kind = one_kind("zarr", (labels for labels, _ in samples()))
    if kind is None:
        return
    rows: dict[str, list[int]] = {}
    for labels, _ in samples():
        rows.setdefault(labels["split"], []).append(count_rows(labels))
    for split, counts in rows.items():
        _write_split(
            to,
            split,
            (one for one in samples() if one[0]["split"] == split),
            np.cumsum(counts, dtype=np.int64),
            kind,
        )


def _write_split(
    to: Path, split: str, samples: Iterator[tuple[dict[str, Any], Path]], ends: Array, kind: tuple[int, int]
) -> None:
    import zarr

    sr, channels = kind
    width = sr // ROWS_PER_S
    folder = to / f"{split}.zarr"
    root = zarr.create_group(store=str(folder), zarr_format=2)
    # not compressed: noise and decays lose some tenth of their size
    how: dict[str, Any] = {"compressors": None, "fill_value": 0}
    meta = root.create_group("meta").create_array(
        "episode_ends", shape=ends.shape, chunks=ends.shape, dtype="i8", **how
    )
    meta[:] = ends
    data = root.create_group("data", attributes={"sr": sr, "rows_per_s": ROWS_PER_S})
    size = {"shape": (int(ends[-1]), width), "chunks": (ROWS_PER_S, width), "dtype": "f4"}
    channel = [data.create_array(f"mic_{number}", **size, **how) for number in range(channels)]
    with (to / f"{split}.jsonl").open("wb") as lines:
        for (labels, path), start, end in zip(samples, np.append(0, ends), ends, strict=False):
            for of, row in zip(channel, audio_rows(path, sr), strict=True):
                of[start:end] = row
            lines.write(json_bytes({key: value for key, value in labels.items() if key != "audio"}) + b"\n")
    _zip(folder, to / f"{split}.zarr.zip")
    shutil.rmtree(folder)


def _zip(folder: Path, to: Path) -> None:
    """Put a folder's files into a zip file; zarr's own ZipStore puts the time of writing into it."""
    with zipfile.ZipFile(to, "w", zipfile.ZIP_STORED) as whole:
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                name = path.relative_to(folder).as_posix()
                with path.open("rb") as source, whole.open(zipfile.ZipInfo(name), "w", force_zip64=True) as place:
                    shutil.copyfileobj(source, place)
