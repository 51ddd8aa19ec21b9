"""From a data set's folder to a layout for loaders: SampleFolder -> FORMATS[name] -> DIR/name, renamed when whole."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sonic_bullet.apps.dataset.loaders.audio_folder import write_audio_folder
from sonic_bullet.apps.dataset.loaders.lerobot_rows import write_lerobot
from sonic_bullet.apps.dataset.loaders.maniwav import write_replay_buffers
from sonic_bullet.apps.dataset.loaders.tar_shards import write_tar_shards
from sonic_bullet.apps.dataset.sample_folder import LabelledSounds, SampleFolder
from sonic_bullet.files.storage.atomic import replacing_folder
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.records.coerce import nearest
from sonic_bullet.records.errors import FileError


@dataclass(frozen=True, slots=True)
class LoaderFormat:
    """A layout. write(samples, to): library: of its writer, "": none."""

    write: Callable[[LabelledSounds, Path], None]
    library: str = ""

    def check_library(self) -> None:
        """Raise FileError where its library is not installed."""
        if self.library:
            try:
                __import__(self.library)
            except ImportError as error:
                what = f"the format needs {self.library}: {error}"
                raise FileError(what, f"pip install 'sonic_bullet[{self.library}]'") from None


FORMATS: Mapping[str, LoaderFormat] = {
    "audiofolder": LoaderFormat(write_audio_folder),
    "lerobot": LoaderFormat(write_lerobot, "lerobot"),
    "webdataset": LoaderFormat(write_tar_shards, "webdataset"),
    "zarr": LoaderFormat(write_replay_buffers, "zarr"),
}


def check_formats(names: Iterable[str]) -> None:
    """Raise FileError for a format that there is not, or whose library is not installed."""
    for name in names:
        if name not in FORMATS:
            raise FileError(f"there is no format {name}", nearest(name, list(FORMATS)))
        FORMATS[name].check_library()


def write_layout(name: str, kept: SampleFolder, numbers: range) -> Path:
    """Write the samples of these numbers in a format, in place of older ones, and return its folder.

    Raises
    ------
    FileError
        It cannot be written, or the format cannot hold these samples.
    """
    to = kept.root / name

    def samples() -> Iterator[tuple[dict[str, Any], Path]]:
        for labels in kept.labels(numbers):
            yield labels, kept.root / labels["audio"]

    report_progress(name)
    with replacing_folder(to) as partial:
        FORMATS[name].write(samples, partial)
    return to
