"""Read recordings: audio files of any format to samples, and the selection of a channel.

    file -> libsndfile, by descriptor, forward only -> blocks to the end -> samples (channels, n), rate

The length stated in a file is not used: streams may not know it beforehand, and other files state it wrongly.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import numpy as np

from sonic_bullet.files.riff.scale import read_chunk_scale, scale_in
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.records.arrays import Array
from sonic_bullet.records.coerce import as_path
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError, FileError
from sonic_bullet.records.regular_files import check_regular

# from a slow accelerometer's to a fast vibrometer's
LEAST_RECORDING_RATE_HZ = 1000
MOST_RECORDING_RATE_HZ = 10_000_000
# a range of full scale 1: below the first nothing is audible, below the second only the last bits toggle
SILENT_PEAK = 2e-7
QUIET_PEAK = 1e-3
FEWEST_LEVELS = 8  # that a quiet recording's samples take

# half a gibibyte as float64; or samples a byte of the file, which only packed silence exceeds
MOST_SAMPLES, UNPACKED = 1 << 26, 64
UNBROKEN = "give an unbroken audio file"
Given = TypeVar("Given")


def read_audio_scale(path: str | os.PathLike[str]) -> float | None:
    """Return the full scale in Pa that a sound file states; None: its level is unknown.

    Raises
    ------
    FileError
        The file cannot be read.
    """
    return _read_sound(path, _scale)[0]


def read_audio(path: str | os.PathLike[str]) -> tuple[Array, int]:
    """Read samples (channels, n) float64 and the rate in Hz: pascals where the file states its scale, else file units.

    Raises
    ------
    FileError
        The file is missing, cut, not audio, of a rate outside that of recordings, or unpacks to too many samples.
    """

    def read(sound: Any, fd: int) -> Array:
        samples, scale = _samples(sound, path, os.fstat(fd).st_size), _scale(sound, fd)
        return samples if scale is None or scale == 1.0 else samples * scale

    return _read_sound(path, read)


def _read_sound(path: str | os.PathLike[str], what: Callable[[Any, int], Given]) -> tuple[Given, int]:
    """Read something from an open sound file and its descriptor; return it with the rate; raises FileError."""
    import soundfile

    path = as_path(path, "path", "name a sound file")
    with reading_file(path, "audio file", FileError, UNBROKEN):
        check_regular(path, "check the path")
        if not os.path.getsize(path):
            raise FileError(f"cannot read {path}: it is empty", UNBROKEN)
    with reading_file(path, "audio file", FileError, UNBROKEN), open(path, "rb") as file:
        # by its descriptor: its bytes determine the format; for a name that ends in .raw libsndfile would guess
        try:
            with _forward()(file.fileno(), "r", closefd=False) as sound:
                return what(sound, file.fileno()), int(sound.samplerate)
        except soundfile.LibsndfileError as error:
            raise FileError(f"cannot read {path}: {error.error_string.rstrip('.')}", UNBROKEN) from error


def _scale(sound: Any, fd: int) -> float | None:
    """Return the full scale of an open file."""
    return read_chunk_scale(fd) or scale_in(str(sound.comment).encode("utf-8", "replace"))


@cache
def _forward() -> Any:
    """Return a SoundFile class that never seeks, which a stream without a stated length cannot."""
    import soundfile

    class Forward(soundfile.SoundFile):  # type: ignore[misc]
        def seekable(self) -> bool:
            return False

    return Forward


def _samples(sound: Any, path: object, file_bytes: int) -> Array:
    """Read all samples (channels, n) of an open file; raises FileError."""
    unknown_length = 1 << 62  # libsndfile's count for a stream that does not state its length, and more
    block_samples = 1 << 18
    if not LEAST_RECORDING_RATE_HZ <= sound.samplerate <= MOST_RECORDING_RATE_HZ:
        raise FileError(
            f"cannot read {path}: sampled at {sound.samplerate} Hz",
            f"give a recording of {LEAST_RECORDING_RATE_HZ} to {MOST_RECORDING_RATE_HZ} Hz",
        )
    most = max(MOST_SAMPLES, UNPACKED * file_bytes)
    size = max(1, block_samples // sound.channels)
    blocks, frames = [], 0
    while True:
        block = sound.read(size, dtype="float64", always_2d=True)
        frames += len(block)
        if frames * sound.channels > most:
            raise FileError(
                f"cannot read {path}: it unpacks to more than {most} samples", "cut out the part that matters"
            )
        blocks.append(block)
        if len(block) < size:
            break
    if sound.frames < unknown_length and frames < sound.frames:
        raise FileError(f"cannot read {path}: it claims {sound.frames} frames and holds {frames}", UNBROKEN)
    samples = np.empty((sound.channels, frames))
    at = 0
    while blocks:
        block = blocks.pop(0)
        samples[:, at : at + len(block)] = block.T
        at += len(block)
    return samples


def read_channel(path: str | os.PathLike[str], channel: int | None = None) -> tuple[Array, int, str]:
    """Read one channel of a recording.

    Parameters
    ----------
    path : path
        Of the sound file.
    channel : int, optional
        Counted from 0; None: the first that is not dead.

    Returns
    -------
    (n,) array
        Its samples, as of `read_audio`.
    int
        The rate in Hz.
    str
        Which channel of how many it is; empty where there is but one.

    Raises
    ------
    FileError
        The file cannot be read or has no such channel.
    AudioError
        The channel is silent, too short or not finite.
    """
    samples, sr = read_audio(path)
    observed, words = live_channel(samples, channel, path)
    return observed, sr, words


def live_channel(samples: Array, channel: int | None, name: object) -> tuple[Array, str]:
    """Select a channel (n,) of samples (channels, n) by its number or, None, the first that is not dead; describe it.

    Raises
    ------
    FileError
        There is no such channel.
    AudioError
        It is silent, too short or not finite.
    """
    shortest = 64  # samples: a millisecond at a usual rate
    count, frames = samples.shape
    if channel is not None and not 0 <= channel < count:
        known = f"{format_count(count, 'channel')}, 0" + f" to {count - 1}" * (count > 1)
        raise FileError(f"{name} has no channel {channel}", f"it has {known}")
    if frames < shortest:
        raise AudioError(f"{name} holds {frames} samples", "give a recording of an impact, from before it to its decay")
    level = np.ptp(np.nan_to_num(samples), axis=1)
    dead_share = 1e-3  # of the loudest channel's range: an input with nothing plugged in
    live = level > dead_share * level.max()
    used = int(np.argmax(live)) if channel is None else channel
    observed: Array = samples[used]
    if not np.isfinite(observed).all():
        raise AudioError(f"{name} holds NaN or infinite samples", "export it again")
    others = f"{'channel' if live.sum() == 1 else 'channels'} {_format_numbers(np.flatnonzero(live))}"
    if level[used] < SILENT_PEAK or (level[used] < QUIET_PEAK and len(np.unique(observed)) < FEWEST_LEVELS):
        if live[used] or not live.any():
            raise AudioError(f"{name} is silent", "record an impact, or leave it out")
        raise AudioError(f"channel {used} of {name} is silent", f"sound is in {others}")
    if count == 1:
        return observed, ""
    words = f"{count} channels: "
    if channel is not None:
        return observed, f"{words}channel {channel} is used, counted from 0" + f", though sound is in {others}" * (
            not live[used]
        )
    if used == 0:
        return observed, f"{words}the first is used, channel 0"
    dead = "channel 0 is" if used == 1 else f"channels {_format_numbers(np.arange(used))} are"
    return observed, f"{words}{dead} dead, channel {used} is used, counted from 0"


def _format_numbers(numbers: Array) -> str:
    return ", ".join(str(k) for k in numbers)
