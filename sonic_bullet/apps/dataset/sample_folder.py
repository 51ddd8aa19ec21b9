"""The folder of a data set.

    dataset.json               what made it: recipe, seed, rate, versions
    samples/000/000017.wav     float32 pascals
    samples/000/000017.json    its labels; written last: a sample that has it is done
    manifest.jsonl             the labels of all samples, a line each, by number
    failures.jsonl             numbers without a sample, each with its reason

Nothing in them depends on time, order or machine: equal runs give equal bytes. Until a run has ended, both lists have
what it did at their ends, in its order.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec

from sonic_bullet.apps.dataset.samples import Sample
from sonic_bullet.apps.jobs.job_folder import append_json_line, open_job_folder, write_json_lines
from sonic_bullet.files.audio import write_audio
from sonic_bullet.files.storage.atomic import replace_file, write_errors
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.records.errors import FileError

LabelledSounds = Callable[[], Iterator[tuple[dict[str, Any], Path]]]
"""Labels and sound file of each sample, by number, from the first at each call."""


class SampleFolder:
    """A data set's folder, open for one run. Made by `open_folder`."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def place(self, number: int, ending: str) -> Path:
        """Return where a sample's file is."""
        a_folder = 1000  # samples in one folder: file systems slow down with many more
        return self.root / "samples" / f"{number // a_folder:03d}" / f"{number:06d}{ending}"

    def is_done(self, number: int) -> bool:
        """Tell whether there is such a sample, whole."""
        return self.place(number, ".json").is_file()

    def keep(self, sample: Sample, split: str) -> None:
        """Write a sample and list it: sound first, labels, its line."""
        audio = self.place(sample.number, ".wav")
        with write_errors(audio):
            audio.parent.mkdir(parents=True, exist_ok=True)
        labels = {"audio": str(audio.relative_to(self.root)), "split": split, **sample.labels}
        write_audio(audio, sample.sound.astype(float), sample.sr, subtype="FLOAT")
        try:
            with replace_file(self.place(sample.number, ".json")) as file:
                file.write(json_bytes(labels))
            append_json_line(self.root / "manifest.jsonl", labels)
        except FileError:  # a full disk: what is not listed is not there
            self.place(sample.number, ".json").unlink(missing_ok=True)
            audio.unlink(missing_ok=True)
            raise

    def list_failure(self, number: int, reason: str) -> None:
        """List a number without a sample."""
        append_json_line(self.root / "failures.jsonl", {"number": number, "reason": reason})

    def labels(self, numbers: range) -> Iterator[dict[str, Any]]:
        """Yield the labels of those of the samples that are kept, by number."""
        for number in numbers:
            place = self.place(number, ".json")
            if place.is_file():
                yield msgspec.json.decode(place.read_bytes())

    def write_lists(self, numbers: range, failures: Mapping[int, str]) -> None:
        """Write manifest and failures."""
        write_json_lines(self.root / "manifest.jsonl", self.labels(numbers))
        failed = ({"number": number, "reason": why} for number, why in sorted(failures.items()))
        write_json_lines(self.root / "failures.jsonl", failed)


@contextmanager
def open_folder(root: str | os.PathLike[str], made_by: Mapping[str, Any]) -> Iterator[SampleFolder]:
    """Open a data set's folder for a run, a new one or one that the same settings ``made_by`` began.

    Raises
    ------
    FileError
        It is another data set's, another run writes it, it holds other files, or it cannot be written.
    """
    with open_job_folder(root, "dataset.json", made_by, kind="data set", own=("samples",)) as place:
        yield SampleFolder(place)
