"""Write samples in pascals to an audio file.

    y = g·x,  g of `levels`: 1 by default, so that 1.0 in the file is 1 Pa

Float files hold y as it is, above full scale too. Every other format holds |y| ≤ 1: larger samples are clipped and
counted in `AudioReport.clipped`. float32 subnormals are flushed to zero (decaying tails are full of them, and they slow
every player), NaN and infinities are refused. The file states its full scale in pascals (riff/scale.py), and
`read_audio` returns pascals. Equal samples give equal bytes, except in OGG, whose streams carry a random serial number.

libsndfile reports neither why a write failed nor, when it closes, whether one did. Before a file gets its name it is
therefore read to its end and its rate, channels and frames are compared with those written; where they differ the disk
is tested for the reason.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from sonic_bullet.files.levels import FileLevel, as_sound, check_sr, find_level
from sonic_bullet.files.loudness.audio_report import AudioReport
from sonic_bullet.files.riff.scale import ixml_chunk, scale_text
from sonic_bullet.files.riff.wave_chunks import append_chunks, forget_time, wave_chunks
from sonic_bullet.files.storage.atomic import PartialFile, cannot, check_output, kept_name
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.machine.worker import note_closing, stop_word
from sonic_bullet.options.audio import AudioFileOptions
from sonic_bullet.options.option import takes
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import as_path, as_text, brief, nearest, quote
from sonic_bullet.records.cues import Cue
from sonic_bullet.records.errors import AudioError, FileError, SonicBulletError
from sonic_bullet.records.file_endings import AUDIO_FORMATS

CHUNK_LIMIT_BYTES = 2**32 - 2**16  # what the 32-bit sizes of WAV and AIFF can count, less room for headers
BLOCK_FRAMES = 1 << 18


def check_audio_output(path: str | os.PathLike[str], subtype: str | None = None) -> tuple[Path, str, str]:
    """Return real path, container and sample format for ``path``, before any sample is rendered.

    Raises FileError where the file cannot be written, or its extension or subtype is unknown.
    """
    path = as_path(path, "path", "name a sound file, such as out.wav")
    extension = Path(path).suffix.lower()
    if extension not in AUDIO_FORMATS:
        raise FileError(
            f"cannot write {brief(path)}: {quote(extension)} is no audio format known here",
            f"end the name with one of {' '.join(AUDIO_FORMATS)}",
        )
    target = check_output(path)
    container, default = AUDIO_FORMATS[extension][:2]
    wanted = (
        default
        if subtype is None
        else as_text(subtype, "subtype", "give one of libsndfile's names, PCM_16 say", error=FileError).upper()
    )
    if wanted != default:
        import soundfile

        if not soundfile.check_format(container, wanted):
            known = list(soundfile.available_subtypes(container))
            raise FileError(
                f"cannot write {brief(path)}: {container} holds no subtype {quote(wanted)}", nearest(wanted, known)
            )
    return target, container, wanted


class AudioWriter:
    """An audio file that grows block by block; a context manager.

    `write` appends (channels, n) pascals to a partial file. Leaving the block reads it back and gives it the name
    NAME.EXT. Leaving it with an error, or with Ctrl-C, keeps the samples as a valid file NAME.partial.EXT, which the
    error names; NAME.EXT is untouched. gain_per_pa: file units for one pascal. expected_frames: chooses RF64 over WAV
    where the file will pass 4 GiB. chunks: of `wave_chunks`, for a WAV. scale: whether the file states its full scale;
    False: the level is unknown.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        sr: int,
        channels: int,
        *,
        gain_per_pa: float = 1.0,
        subtype: str | None = None,
        expected_frames: int = 0,
        chunks: bytes = b"",
        scale: bool = True,
    ) -> None:
        """Open the partial file; FileError (place, extension, subtype), AudioError (rate, channels, gain, size)."""
        sample_bytes = {"FLOAT": 4, "DOUBLE": 8, "PCM_32": 4, "PCM_24": 3, "PCM_16": 2, "PCM_S8": 1, "PCM_U8": 1}
        import soundfile

        self.path = os.fspath(path)
        self.target, self.format, self.subtype = check_audio_output(path, subtype)
        own = AUDIO_FORMATS[Path(path).suffix.lower()]
        self.sr, self.channels, self.gain_per_pa = check_sr(sr, measured=not scale), channels, float(gain_per_pa)
        if not (math.isfinite(self.gain_per_pa) and self.gain_per_pa > 0):
            raise AudioError(f"a gain of {gain_per_pa} per Pa", "give a full scale above zero")
        self.scale_pa = 1 / self.gain_per_pa if scale else None
        if own.text == "chunks" and self.scale_pa is not None:
            chunks = ixml_chunk(self.scale_pa) + (chunks or wave_chunks([], description=scale_text(self.scale_pa)))
        self.over_4_gib = own.over_4_gib
        self.frame_bytes, self.chunks = channels * sample_bytes.get(self.subtype, 0), chunks
        if self.format == "WAV" and expected_frames * self.frame_bytes + len(chunks) > CHUNK_LIMIT_BYTES:
            self.format, self.over_4_gib = "RF64", True
        self.frames = self.clipped = self.over = 0
        self.peak_pa = self.energy_pa2 = 0.0
        try:
            self.partial = PartialFile(self.target.parent)
        except OSError as error:
            raise cannot("write", path, error) from error
        try:
            self.file: Any = soundfile.SoundFile(
                self.partial.fd, "w", self.sr, channels, self.subtype, format=self.format, closefd=False
            )
        except soundfile.LibsndfileError as error:
            reason = self.partial.refusal()
            self.partial.close()
            if reason is not None:
                raise cannot("write", path, reason) from error
            raise AudioError(
                f"cannot write {channels} channels at {self.sr} Hz to {path}: {error.error_string}",
                "write .wav, or fewer channels",
            ) from error

        if self.scale_pa is not None and own.text == "comment":
            self.file.comment = scale_text(self.scale_pa)

    @property
    def is_float(self) -> bool:
        """Whether samples are floating-point numbers."""
        return self.subtype in ("FLOAT", "DOUBLE")

    def write(self, samples: Array) -> None:
        """Append (channels, n) samples in Pa.

        Raises AudioError (not finite, shape, over 4 GiB) and FileError (disk).
        """
        smallest_normal = 2.0**-126  # of float32
        import soundfile

        block = np.asarray(samples, float)
        if block.ndim != 2 or block.shape[0] != self.channels:
            raise AudioError(f"samples of shape {block.shape} for {self.channels} channels", "pass (channels, n)")
        if not self.over_4_gib and (self.frames + block.shape[1]) * self.frame_bytes > CHUNK_LIMIT_BYTES:
            raise AudioError(
                f"{self.path} would pass 4 GiB, which {self.format} cannot hold", "write .w64, .rf64 or .flac"
            )
        scaled = block * self.gain_per_pa
        if not (np.abs(scaled) < 3.4e38).all():  # False for NaN too
            channel, frame = (int(i[0]) for i in np.nonzero(~(np.abs(scaled) < 3.4e38)))
            raise AudioError(
                f"sample {self.frames + frame} of channel {channel} is {block[channel, frame]}",
                "sound must be finite: examine the scene with 'sonic-bullet doctor'",
            )
        beyond = int(np.count_nonzero(np.abs(scaled) > 1))
        self.over += beyond
        if not self.is_float:
            self.clipped += beyond
            scaled = np.clip(scaled, -1, 1)
        if self.subtype != "DOUBLE":
            scaled[np.abs(scaled) < smallest_normal] = 0
            scaled = scaled.astype(np.float32) if self.subtype == "FLOAT" else scaled
        else:
            scaled[np.abs(scaled) < np.finfo(float).tiny] = 0
        try:
            self.file.write(scaled.T)
        # soundfile asserts that all was written: a full disk
        except (soundfile.LibsndfileError, AssertionError) as error:
            raise self._refusal_error() from error
        self.frames += block.shape[1]
        if block.size:
            self.peak_pa = max(self.peak_pa, float(np.abs(block).max()))
            self.energy_pa2 += float(np.sum(block**2))

    def report(self) -> AudioReport:
        """Report what has been written so far."""
        rms = math.sqrt(self.energy_pa2 / (self.frames * self.channels)) if self.frames else 0.0
        return AudioReport(
            self.path, self.format, self.subtype, self.sr, self.channels, self.frames, self.gain_per_pa, self.peak_pa,
            rms, self.clipped, self.over,
        )  # fmt: skip

    def __enter__(self) -> AudioWriter:
        """Return the writer."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Name the whole file, or keep the partial one after an error."""
        if error is not None:
            note_closing()
        try:
            with suppress(RuntimeError):  # LibsndfileError: reading the file back shows its state
                self.file.close()
            if error is None:
                self._name_it()
                return
            kept = self._keep()
        except OSError as failure:
            raise cannot("write", self.path, failure) from error or failure
        finally:
            self.partial.close()
        if not kept:
            return
        saved = f"the first {kept / self.sr:.3f} s are in {kept_name(self.target)}"
        if isinstance(error, SonicBulletError):
            raise type(error)(error.what, f"{error.remedy}; {saved}" if error.remedy else saved) from error
        if isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt(f"{stop_word() or 'stopped'}; {saved}") from error
        error.add_note(saved)

    def _name_it(self) -> None:
        """Give the whole file its name; raises FileError, OSError."""
        self._append()
        if self._read_back() != self.frames:
            raise self._refusal_error()
        forget_time(self.partial.fd)
        self.partial.replace(self.target)

    def _append(self) -> None:
        """Append the chunks after the samples; raises OSError."""
        if self.chunks:
            append_chunks(self.partial.fd, self.chunks)

    def _keep(self) -> int:
        """Keep the readable part of an unfinished file; return its frames; raises OSError."""
        frames = self._read_back() if self.frames else 0
        if frames:
            with suppress(OSError):  # the disk may be full: the kept file then has no scale
                self._append()
            self.partial.replace(kept_name(self.target))
        return frames

    def _refusal_error(self) -> FileError:
        """Find, by the disk, why the file differs from what was written."""
        reason = self.partial.refusal() or OSError("the disk took only a part of it")
        return cannot("write", self.path, reason)

    def _read_back(self) -> int:
        """Count the frames of the closed file by decoding it; -1 of another rate or channels, 0 if unreadable."""
        import soundfile

        os.lseek(self.partial.fd, 0, os.SEEK_SET)
        frames = 0
        try:
            with soundfile.SoundFile(self.partial.fd, closefd=False) as file:
                if (file.samplerate, file.channels) != (self.sr, self.channels):
                    return -1
                while count := len(file.read(BLOCK_FRAMES, dtype="float32", always_2d=True)):
                    frames += count
        except (soundfile.LibsndfileError, AssertionError):
            pass
        return frames


@takes(AudioFileOptions, 3)
def write_audio(
    path: str | os.PathLike[str], samples: Array | KeptSound, sr: int, options: AudioFileOptions
) -> AudioReport:
    """Write ``samples`` (channels, n) or (n,), float64 pascals, whole or not at all, by blocks.

    The extension chooses the format (`AUDIO_FORMATS`). Over 4 GiB a .wav is written as RF64. The file states its full
    scale, and `read_audio` undoes it.

    Raises
    ------
    AudioError
        Rate, level, NaN, silence or under 0.4 s where loudness is asked for, a loudness that cannot be reached.
    FileError
        The file cannot be written in that place or format.
    """
    scale = options.full_scale_pa is not None
    rate = check_sr(sr, measured=not scale)
    _, container, _ = check_audio_output(path, options.subtype)
    if options.cues is not None and AUDIO_FORMATS[Path(path).suffix.lower()].text != "chunks":
        raise FileError(f"cannot write cue points to {brief(path)}: {container} has none", "end the name with .wav")
    sound = as_sound(samples)
    level = find_level(sound, rate, options.peak_dbfs, options.lufs, options.full_scale_pa or 1.0)
    return write_at_level(path, sound, rate, level, options.subtype, options.cues, options.time_reference, scale=scale)


def write_at_level(
    path: str | os.PathLike[str],
    sound: KeptSound,
    sr: int,
    level: FileLevel,
    subtype: str | None = None,
    cues: Sequence[Cue] | None = None,
    time_reference: int = 0,
    *,
    scale: bool = True,
) -> AudioReport:
    """Write as `write_audio` does, at a level already found; raises AudioError, FileError."""
    gain, (channels, frames) = level.gain_per_pa, sound.shape
    words = f"{Path(path).stem[:80]}; {scale_text(1 / gain)}" if scale else Path(path).stem
    chunks = b"" if cues is None else wave_chunks(cues, description=words, time_reference=time_reference)
    options: dict[str, Any] = {"gain_per_pa": gain, "subtype": subtype, "expected_frames": frames, "chunks": chunks}
    with AudioWriter(path, sr, channels, scale=scale, **options) as writer:
        for block in sound.with_curve(level.curve).blocks(BLOCK_FRAMES):
            writer.write(block)
    return replace(writer.report(), limited_db=level.limited_db, limited_s=level.limited_s)
