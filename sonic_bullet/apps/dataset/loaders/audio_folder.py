"""Hugging Face's AudioFolder: SPLIT/metadata.jsonl, whose file_name leads to SPLIT/000/000017.wav, and a card.

The sound files are the data set's own, by another name in the same file system, else copied. What differs in its keys
from sample to sample becomes a list, as Arrow's columns have one type.
The card is README.md: YAML that names the splits' files, then what a reader should know. `datasets` gives an `audio`
column of its `Audio`.
[Hugging Face `datasets`, "Create an audio dataset": AudioFolder; `hub`, "Dataset Cards"]
"""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, BinaryIO

from sonic_bullet.apps.dataset.sample_folder import LabelledSounds
from sonic_bullet.files.storage.json_text import json_bytes


def write_audio_folder(samples: LabelledSounds, to: Path) -> None:
    """Write all samples, and the card."""
    counts, last = Counter[str](), dict[str, Any]()
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
            counts[split] += 1
            last = rest
    if last:
        (to / "README.md").write_text(data_card(counts, last), encoding="utf-8")


def data_card(counts: Mapping[str, int], labels: Mapping[str, Any]) -> str:
    """Return the card of a set. counts: samples by split; labels: of one sample, whose keys are the columns."""
    files = "\n".join(f"      - split: {split}\n        path: {split}/**" for split in counts)
    columns = "\n".join(f"- `{name}`" for name in ("audio", *labels))
    numbers = "\n".join(f"- `{name}`" for name in labels["parameters"])
    shares = ", ".join(f"{count} {split}" for split, count in counts.items())
    versions = ", ".join(f"{name} {version}" for name, version in labels["versions"].items())
    return f"""---
task_categories:
  - audio-classification
tags:
  - audio
  - physics
  - simulation
configs:
  - config_name: default
    data_files:
{files}
---

# Sounds of simulated contacts

{sum(counts.values())} samples ({shares}), {labels["channels"]} channels at {labels["sr"]} Hz, float32 in pascals at the
microphone: no file is normalised. No sound was recorded: all is computed from physics by sonic_bullet. No object is in
two splits.

## Columns

{columns}

`parameters` is what was drawn for the sample:

{numbers}

## How it was made

Recipe SHA-256 `{labels["recipe_sha256"]}`, seed {labels["seed"][0]}, {versions}. A sample depends on these and on its
`number` alone: the same command makes the same bytes.
"""


def _link(sound: Path, to: Path) -> None:
    try:
        os.link(sound, to)
    except OSError:
        shutil.copyfile(sound, to)
