"""Hugging Face's AudioFolder: SPLIT/metadata.jsonl, whose file_name leads to SPLIT/000/000017.wav.

The sound files are the data set's own, by another name in the same file system, else copied. What differs in its keys
from sample to sample becomes a list, as Arrow's columns have one type.
[Hugging Face `datasets`, "Create an audio dataset": AudioFolder]
"""

from __future__ import annotations

import os
import shutil
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO

from sonic_bullet.apps.dataset.sample_folder import LabelledSounds
from sonic_bullet.files.storage.json_text import json_bytes


def write_audio_folder(samples: LabelledSounds, to: Path) -> None:
    """Write all samples."""
    with ExitStack() as stack:
        lists = dict[str, BinaryIO]()
        for labels, sound in samples():
            split = labels["split"]
            name = Path(sound.parent.name, sound.name)
            (to / split / name).parent.mkdir(parents=True, exist_ok=True)
            _link(sound, to / split / name)
            if split not in lists:
                lists[split] = stack.enter_context((to / split / "metadata.jsonl").open("wb"))
            rest = {key: value for key, value in labels.items() if key not in {"audio", "split"}}
            rest["bodies"] = [{"name": body, "material": of} for body, of in labels["bodies"].items()]
            lists[split].write(json_bytes({"file_name": name.as_posix(), **rest}) + b"\n")


def _link(sound: Path, to: Path) -> None:
    try:
        os.link(sound, to)
    except OSError:
        shutil.copyfile(sound, to)
