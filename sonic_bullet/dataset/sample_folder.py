"""The folder of a data set.

    dataset.json               what made it: recipe, seed, rate, versions
    samples/000/000017.wav     float32 pascals
    samples/000/000017.json    its labels; written last: a sample that has it is done
    manifest.jsonl             the labels of all samples, a line each, by number
    failures.jsonl             numbers without a sample, each with its reason

Nothing in them depends on time, order or machine: equal runs give equal bytes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec

from sonic_bullet.dataset.samples import Sample
from sonic_bullet.files.atomic import cannot, replacing
from sonic_bullet.files.audio import write_audio
from sonic_bullet.machine.json_text import json_bytes
from sonic_bullet.records.errors import FileError

try:
    import fcntl
except ImportError:  # Windows has no such locks: two runs there share a folder unnoticed
    fcntl = None  # type: ignore[assignment]

LabelledSounds = Callable[[], Iterator[tuple[dict[str, Any], Path]]]
"""Labels and sound file of each sample, by number, from the first at each call."""
A_FOLDER = 1000
"""Samples in one folder: file systems slow down with many more."""


class SampleFolder:
    """A data set's folder, open for one run. Made by `open_folder`."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def place(self, number: int, ending: str) -> Path:
        """Return where a sample's file is."""
        return self.root / "samples" / f"{number // A_FOLDER:03d}" / f"{number:06d}{ending}"

    def is_done(self, number: int) -> bool:
        """Tell whether there is such a sample, whole."""
        return self.place(number, ".json").is_file()

    def keep(self, sample: Sample, split: str) -> None:
        """Write a sample: sound first, labels last."""
        audio = self.place(sample.number, ".wav")
        with _written(audio):
            audio.parent.mkdir(parents=True, exist_ok=True)
        write_audio(audio, sample.sound.astype(float), sample.sr, subtype="FLOAT")
        with replacing(self.place(sample.number, ".json")) as file:
            file.write(json_bytes({"audio": str(audio.relative_to(self.root)), "split": split, **sample.labels}))

    def labels(self, numbers: range) -> Iterator[dict[str, Any]]:
        """Yield the labels of those of the samples that are kept, by number."""
        for number in numbers:
            place = self.place(number, ".json")
            if place.is_file():
                yield msgspec.json.decode(place.read_bytes())

    def write_lists(self, numbers: range, failures: Mapping[int, str]) -> None:
        """Write manifest and failures."""
        with replacing(self.root / "manifest.jsonl") as file:
            file.writelines(json_bytes(one) + b"\n" for one in self.labels(numbers))
        with replacing(self.root / "failures.jsonl") as file:
            file.writelines(json_bytes({"number": n, "reason": why}) + b"\n" for n, why in sorted(failures.items()))


@contextmanager
def open_folder(root: str | os.PathLike[str], made_by: Mapping[str, Any]) -> Iterator[SampleFolder]:
    """Open a data set's folder for a run, a new one or one that the same settings ``made_by`` began.

    Raises
    ------
    FileError
        It is another data set's, another run writes it, it holds other files, or it cannot be written.
    """
    place = Path(root).absolute()
    about = place / "dataset.json"
    with _written(place):
        place.mkdir(parents=True, exist_ok=True)
        lock = os.open(place, os.O_RDONLY) if fcntl is not None else None
    try:
        if lock is not None:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise FileError(f"another run writes {root}", "wait for its end, or give another folder") from None
        if about.is_file():
            _check_same(root, about, made_by)
        elif any(one.name != "samples" and not one.name.endswith(".partial") for one in place.iterdir()):
            raise FileError(f"{root} holds other files", "give an empty folder, or a new one")
        with replacing(about) as file:
            file.write(json_bytes(dict(made_by), indent=2))
        yield SampleFolder(place)
    finally:
        if lock is not None:
            os.close(lock)


def _check_same(root: object, about: Path, made_by: Mapping[str, Any]) -> None:
    """Raise FileError where a folder was made by other settings."""
    try:
        before = msgspec.json.decode(about.read_bytes())
    except (OSError, msgspec.DecodeError):
        before = {}
    wanted = msgspec.json.decode(json_bytes(dict(made_by)))
    other = [name for name in wanted if not isinstance(before, dict) or before.get(name) != wanted[name]]
    if other:
        what = f"{root} is a data set of another {' and '.join(other).replace('_', ' ')}"
        raise FileError(what, "give another folder, or what it was begun with")


@contextmanager
def _written(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise cannot("write", path, error) from error
