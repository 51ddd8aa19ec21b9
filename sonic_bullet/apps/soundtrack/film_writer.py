"""Pictures and sound in one film file, on one clock.

    picture k -> shown from k/fps on, counted in the stream's own unit 1/fps, a fraction: nothing is summed or rounded
    sample i  -> heard at i/sr, counted in 1/sr
    the file's clock: both begin at 0, and both end at the end of the last picture

n pictures last n/fps seconds: `samples_of` of them are played, silence where the sound is shorter. Lossy codecs begin
with samples that are no sound (aac 1024, opus 312, mp3 1105). The encoder gives them times before 0 and the container
leaves them out (an edit list in mp4 and mov, CodecDelay in mkv). aac and mp3 code blocks of 1024 and 1152 samples, and
decoders play the silence that fills the last. So as many samples go before time 0 besides the codec's own that the last
block is full (`lead_of`; not in mkv, which has no edit list), and blocks after the end stay out of the file. No picture
waits for a later one (no B-frames), so that pictures need no such list. mkv stores times in whole milliseconds, each
rounded by itself; the number of its pictures and samples is exact.

Written to a temporary file, then renamed: NAME.EXT is the whole film, or what it was before. Left with an error or
Ctrl-C, what is finished is a film of its own, NAME.partial.EXT.
"""

from __future__ import annotations

import math
import os
from contextlib import nullcontext, suppress
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from sonic_bullet.files import check_output, check_sr
from sonic_bullet.files.riff.scale import scale_text
from sonic_bullet.files.storage.atomic import PartialFile, cannot, kept_name
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.machine.worker import note_closing
from sonic_bullet.options.film import fraction_of
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import nearest, quote
from sonic_bullet.records.errors import AudioError, FileError, SonicBulletError
from sonic_bullet.records.film_codecs import CODECS, CONTAINERS


def as_fps(text: object) -> Fraction:
    """Parse pictures a second, as a fraction: 30, "30000/1001", "29.97". Raises FileError."""
    fps_most = 1000
    remedy = "give pictures a second, 24, 25, 30000/1001 or 60 say"
    try:
        fps = fraction_of(str(text))
    except ValueError:
        raise FileError(f"fps is {quote(text)}", remedy) from None
    # what is written as 29.97 or 23.976 is meant so [SMPTE ST 12-1, sec. 4]
    for whole in (24, 30, 48, 60, 120):
        exact = Fraction(whole * 1000, 1001)
        if fps != exact and any(float(fps) == round(float(exact), digits) for digits in (2, 3)):
            fps = exact
    if not 1 <= fps <= fps_most or fps.denominator > 100_000:
        raise FileError(f"fps is {quote(text)}", remedy)
    return fps


def samples_of(pictures: int, fps: Fraction, sr: int) -> int:
    """Count the samples until the end of so many pictures: the nearest to n·sr/fps, by whole numbers."""
    return math.floor(pictures * sr / fps + Fraction(1, 2))


def pictures_of(samples: int, fps: Fraction, sr: int) -> int:
    """Count the fewest pictures that last so many samples: the inverse of `samples_of`."""
    return math.ceil((samples - Fraction(1, 2)) * fps / sr)


def lead_of(codec: str, samples: int) -> int:
    """Count the silent samples before time 0 with which delay, lead and sound are whole blocks."""
    chosen = CODECS[codec]
    return -(chosen.delay + samples) % chosen.block if chosen.block else 0


def check_film_output(
    path: str | os.PathLike[str], sr: int, channels: int, codec: str | None = None
) -> tuple[Path, str]:
    """Check a film's path and audio codec before anything is drawn; return the real path and the codec.

    Raises FileError (place, extension, codec, no PyAV), AudioError (a rate or channels that the codec has not).
    """
    extension = Path(path).suffix.lower()
    if extension not in CONTAINERS:
        raise FileError(
            f"cannot write {path}: {quote(extension)} is no film format known here",
            f"end the name with one of {' '.join(CONTAINERS)}",
        )
    chosen = CONTAINERS[extension][0] if codec is None else codec
    if chosen not in CONTAINERS[extension]:
        raise FileError(f"{extension} films hold no {quote(chosen)} here", nearest(chosen, CONTAINERS[extension]))
    av = pyav()
    try:
        rates = av.codec.Codec(CODECS[chosen].name, "w").audio_rates
    except av.codec.codec.UnknownCodecError:
        raise FileError(f"this PyAV has no {chosen}", f"give one of {' '.join(CONTAINERS[extension])}") from None
    if rates and sr not in rates:
        raise AudioError(
            f"{chosen} has no sample rate of {sr} Hz", f"give --sr {min(rates, key=lambda rate: abs(rate - sr))}"
        )
    if channels > 2:
        raise AudioError(f"films have one channel or two, here are {channels}", "give one or two microphones")
    return check_output(path), chosen


def pyav() -> Any:
    """Import the library that writes films. Raises FileError where it is not installed."""
    try:
        import av
    except ImportError as error:
        raise FileError(f"films need PyAV: {error}", "pip install 'sonic_bullet[film]'") from None
    return av


class FilmWriter:
    """Film that grows picture by picture, each with its sound; a context manager.

    sound: (channels, n) pascals; gain_per_pa: file units a pascal, more than 1 is clipped and counted; size: width and
    height, even numbers; pictures: how many there will be, None: as many as the sound lasts (with another number the
    last block of aac or mp3 ends in silence).
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        sound: KeptSound,
        sr: int,
        *,
        fps: Fraction,
        size: tuple[int, int],
        codec: str | None = None,
        gain_per_pa: float = 1.0,
        pictures: int | None = None,
    ) -> None:
        # Cost of pictures: 3 to 8 ms of 1280×720 on one core, and no visible loss [x264's own scale: 18]
        x264 = {"preset": "veryfast", "crf": "18", "bf": "0"}
        av = pyav()
        self.path, self.sr, self.fps, self.sound, self.gain = os.fspath(path), check_sr(sr), fps, sound, gain_per_pa
        self.target, self.codec = check_film_output(path, self.sr, sound.shape[0], codec)
        self.size = check_size(size)
        self.pictures = self.samples = self.clipped = 0
        container = {".mp4": "mp4", ".mov": "mov", ".mkv": "matroska"}[self.target.suffix.lower()]
        try:
            self.partial = PartialFile(self.target.parent)
        except OSError as error:
            raise cannot("write", path, error) from error
        try:
            self._file = os.fdopen(self.partial.fd, "wb", closefd=False)
            # no random ids, no time of day: equal films, equal bytes
            options: dict[str, str] = {"fflags": "+bitexact"}
            if container != "matroska":  # whose tracks end at times of this unit, else of milliseconds
                options["movie_timescale"] = str(self.sr)
            self._container = av.open(self._file, "w", format=container, options=options)
            self._container.metadata["comment"] = scale_text(1 / gain_per_pa)
            self._video = self._container.add_stream("libx264", rate=fps, options=x264)
            self._video.width, self._video.height = self.size
            self._video.pix_fmt = "yuv420p"
            self._video.codec_context.time_base = 1 / fps
            chosen, layout = CODECS[self.codec], "mono" if sound.shape[0] == 1 else "stereo"
            options = {"flags": "+bitexact"} if chosen.bits_per_s else {}
            self._audio = self._container.add_stream(chosen.name, rate=self.sr, layout=layout, options=options)
            self._audio.format = chosen.sample
            if chosen.bits_per_s:
                self._audio.bit_rate = chosen.bits_per_s * sound.shape[0]
        except BaseException:
            self.partial.close()
            raise
        if pictures is None:
            pictures = pictures_of(sound.shape[1], fps, self.sr)
        self._lead = 0 if container == "matroska" else lead_of(self.codec, samples_of(pictures, fps, self.sr))
        self._ahead, self._blocks = CODECS[self.codec].delay + self._lead, 0

    def write(self, picture: Array) -> None:
        """Append a picture (height, width, 3) uint8, and the sound that goes with it. Raises FileError (disk)."""
        av = pyav()
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
        frame.pts, frame.time_base = self.pictures, 1 / self.fps
        # how far sound is ahead of the pictures in the file, at most: players read both without jumping
        sound_block_s = 0.5
        with self._disk():
            self._container.mux(self._video.encode(frame))
            self.pictures += 1
            due = samples_of(self.pictures, self.fps, self.sr)
            if due - self.samples >= sound_block_s * self.sr:
                self._hear(due)

    def _hear(self, stop: int, end: int | None = None) -> None:
        """Write sound up to sample ``stop``; end: where it stops for good, once that is known."""
        av = pyav()
        if stop <= self.samples:
            return
        lead = 0 if self.samples else self._lead
        block = np.zeros((self.sound.shape[0], lead + stop - self.samples), np.float32)
        known = self.sound.read(self.samples, stop) * self.gain
        self.clipped += int(np.count_nonzero(np.abs(known) > 1))
        block[:, lead : lead + known.shape[1]] = np.clip(known, -1, 1)
        frame = av.AudioFrame.from_ndarray(block, format="fltp", layout=self._audio.layout.name)
        frame.sample_rate, frame.pts, frame.time_base = self.sr, self.samples - lead, Fraction(1, self.sr)
        self._mux_sound(self._audio.encode(frame), end)
        self.samples = stop

    def _mux_sound(self, packets: Any, end: int | None = None) -> None:
        """Write coded sound into the file. end: the sample where all of it ends: what begins later is left out."""
        block = CODECS[self.codec].block
        for packet in packets:
            # counted here: lame's last packet has a time before its place
            begin, self._blocks = self._blocks * block - self._ahead, self._blocks + 1
            if end is not None and block:
                if begin >= end:
                    continue
                packet.duration = min(block, end - begin)
            self._container.mux(packet)

    def _disk(self) -> Any:
        return _Refusal(self.path, self.partial)

    def __enter__(self) -> FilmWriter:
        """Return the writer."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the film, or keep what is finished as NAME.partial.EXT."""
        kept = False
        if error is not None:
            note_closing()
        try:
            with suppress(FileError) if error is not None else nullcontext():
                self._finish()
                kept = self.pictures > 0
            if error is None:
                self.partial.replace(self.target)
                return
            if kept:
                self.partial.replace(kept_name(self.target))
        except OSError as failure:
            raise cannot("write", self.path, failure) from error or failure
        finally:
            self.partial.close()
        if not kept:
            if isinstance(error, KeyboardInterrupt):
                raise KeyboardInterrupt(
                    f"{str(error) or 'stopped'}; no picture was drawn yet: no film is left"
                ) from error
            return
        saved = f"the first {float(self.pictures / self.fps):.3f} s are in {kept_name(Path(self.path))}"
        if isinstance(error, SonicBulletError):
            raise type(error)(error.what, f"{error.remedy}; {saved}" if error.remedy else saved) from error
        if isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt(f"{str(error) or 'stopped'}; {saved}") from error

    def _finish(self) -> None:
        """Write all that encoders hold into the file, and close it. Raises FileError."""
        with self._disk():
            end = samples_of(self.pictures, self.fps, self.sr)
            self._hear(end, end)
            self._container.mux(self._video.encode(None))
            self._mux_sound(self._audio.encode(None), end)
            self._container.close()
            self._file.flush()


class _Refusal:
    """Context that reports a disk's error as the disk's, not as the library's."""

    def __init__(self, path: str, partial: PartialFile) -> None:
        self.path, self.partial = path, partial

    def __enter__(self) -> None:
        """Enter the context."""
        return None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Raise the disk's error, or one of the format, in place of the library's."""
        if not isinstance(error, Exception) or isinstance(error, SonicBulletError):
            return
        reason = self.partial.refusal()
        if reason is not None:
            raise cannot("write", self.path, reason) from error
        raise FileError(f"cannot write {self.path}: {error}", "try another format, .mkv say") from error


def check_size(size: tuple[int, int]) -> tuple[int, int]:
    """Check width and height of a picture, even numbers. Raises FileError."""
    width, height = (int(side) for side in size)
    side_most = 8192
    if not all(16 <= side <= side_most and side % 2 == 0 for side in (width, height)):
        raise FileError(f"pictures of {width}x{height}", f"give even numbers from 16 to {side_most}, 1280x720 say")
    return width, height
