"""LeRobot's data set, version 3, written by its own library: SPLIT/ of data/, meta/, and labels in SPLIT.jsonl.

    observation.audio.mic_0, mic_1, …   (sr/60,) float32 pascals a frame, a channel each; 60 frames a second, the last
                                        one of an episode filled up with zeros; a sample is an episode
    task                                whose sound it is: the sample's object

[LeRobot, `LeRobotDataset`, codebase version v3.0]
What it has of a robot (state, action, cameras) a data set of sounds has not.
"""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
import numpy as np

from sonic_bullet.apps.dataset.loaders.audio_rows import ROWS_PER_S, audio_rows, one_kind
from sonic_bullet.apps.dataset.sample_folder import LabelledSounds
from sonic_bullet.files.storage.json_text import json_bytes


def write_lerobot(samples: LabelledSounds, to: Path) -> None:
    """Write all samples; FileError where their rates or channels differ, or a row is no whole number of samples."""
    # nothing is fetched, and no bars beside our own
    for name in ("HF_HUB_OFFLINE", "HF_DATASETS_DISABLE_PROGRESS_BARS"):
        os.environ.setdefault(name, "1")
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    kind = one_kind("lerobot", (labels for labels, _ in samples()))
    if kind is None:
        return
    sr, channels = kind
    names = [f"observation.audio.mic_{number}" for number in range(channels)]
    features = {name: {"dtype": "float32", "shape": (sr // ROWS_PER_S,), "names": None} for name in names}
    made, lists = dict[str, Any](), dict[str, BinaryIO]()
    with ExitStack() as stack:
        for labels, path in samples():
            split = labels["split"]
            if split not in made:
                made[split] = LeRobotDataset.create(
                    f"sonic_bullet/{split}", ROWS_PER_S, features, root=to / split, use_videos=False
                )
                stack.callback(made[split].finalize)
                lists[split] = stack.enter_context((to / f"{split}.jsonl").open("wb"))
            for frame in np.swapaxes(audio_rows(path, sr), 0, 1):
                made[split].add_frame({"task": labels["object"], **dict(zip(names, frame, strict=True))})
            made[split].save_episode()
            lists[split].write(json_bytes({key: value for key, value in labels.items() if key != "audio"}) + b"\n")
    for split in made:
        _sort_keys(to / split / "meta" / "stats.json")


def _sort_keys(path: Path) -> None:
    """Sort the keys of a JSON file: the library takes them from a set, whose order differs from process to process."""
    path.write_bytes(json_bytes(_sort_entries(msgspec.json.decode(path.read_bytes())), indent=4))


def _sort_entries(value: Any) -> Any:
    return {name: _sort_entries(value[name]) for name in sorted(value)} if isinstance(value, dict) else value
