"""WebDataset: SPLIT-000000.tar, each of up to 1000 samples: 000017.json, its labels, and 000017.wav.

[webdataset 1.0, ShardWriter]
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

from sonic_bullet.apps.dataset.sample_folder import LabelledSounds
from sonic_bullet.files.storage.json_text import json_bytes


def write_tar_shards(samples: LabelledSounds, to: Path) -> None:
    """Write all samples."""
    a_shard = 1000  # Samples: at 1.5 s of two channels 0.6 GB, of the size that webdataset's pages advise
    from webdataset import ShardWriter

    with ExitStack() as stack:
        writers = dict[str, Any]()
        for labels, sound in samples():
            split = labels["split"]
            if split not in writers:
                pattern = str(to / split).replace("%", "%%") + "-%06d.tar"
                # mtime: else it is the time of writing; encoder: the values are bytes already
                writer = ShardWriter(pattern, maxcount=a_shard, encoder=False, mtime=0, verbose=0)
                writers[split] = stack.enter_context(writer)
            rest = {key: value for key, value in labels.items() if key != "audio"}
            writers[split].write({"__key__": sound.stem, "json": json_bytes(rest), "wav": sound.read_bytes()})
