"""Films of a click: one bright picture, and a short pulse at its first sample."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.soundtrack.film_writer import FilmWriter, samples_of
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.records import Array

SIDE = 16
PULSE = np.hanning(13)[1:-1]
"""Eleven samples: what lossy codecs keep of a click, told from what they add by its shape."""
SR = 48_000


def click_sound(frames: int, at: int, sr: int = SR) -> Array:
    """(1, frames) silence with a pulse whose middle is sample ``at``."""
    sound = np.zeros((1, frames))
    half = len(PULSE) // 2
    first = max(at - half, 0)
    sound[0, first : at + half + 1] = 0.8 * PULSE[first - (at - half) :]
    return sound


def click_pictures(count: int, bright: int) -> Iterator[Array]:
    dark, light = np.zeros((SIDE, SIDE, 3), np.uint8), np.full((SIDE, SIDE, 3), 255, np.uint8)
    return (light if k == bright else dark for k in range(count))


def write_film(path: Path, pictures: Iterable[Array], sound: KeptSound, sr: int, **options: Any) -> FilmWriter:
    """A film of pictures (height, width, 3) uint8 with the sound (channels, n) in pascals."""
    with FilmWriter(path, sound, sr, **options) as film:
        for picture in pictures:
            film.write(picture)
    return film


def click_film(path: Path, fps: Fraction, count: int, at: int, codec: str | None = None, sr: int = SR) -> None:
    frames = samples_of(count, fps, sr)
    sound = KeptSound.of(click_sound(frames, samples_of(at, fps, sr), sr))
    write_film(path, click_pictures(count, at), sound, sr, fps=fps, size=(SIDE, SIDE), codec=codec)


@dataclass(frozen=True)
class Decoded:
    """A film as a decoder gives it. sound (n,): from the container's time 0 on; picture_s: when each is shown;
    ends_s: what the container says of the lengths of pictures and sound, None where it does not.
    """

    sound: Array
    sr: int
    picture_s: list[Fraction]
    brightness: Array
    ends_s: tuple[Fraction, Fraction] | None

    def click(self) -> int:
        """The sample of the pulse's middle."""
        return int(np.argmax(np.correlate(self.sound, PULSE, "same")))


def decoded(path: Path) -> Decoded:
    import av

    parts: list[Array] = []
    first, sr = Fraction(0), 0
    with av.open(str(path)) as file:
        for frame in file.decode(audio=0):
            if not parts:
                assert frame.pts is not None
                first, sr = frame.pts * frame.time_base, frame.sample_rate
            samples = np.asarray(frame.to_ndarray(), float)
            parts.append((samples / 2**31 if frame.format.name.startswith("s32") else samples).ravel())
    pictures: list[Any] = []
    with av.open(str(path)) as file:
        for frame in file.decode(video=0):
            pictures.append((frame.pts * frame.time_base, frame.to_ndarray(format="gray").mean()))
        ends = [one.duration * one.time_base for one in file.streams if one.duration]
    late = round(first * sr)
    sound = np.concatenate([np.zeros(max(late, 0)), *parts])[max(-late, 0) :]
    told = (ends[0], ends[1]) if len(ends) == 2 else None
    return Decoded(sound, sr, [time for time, _ in pictures], np.array([level for _, level in pictures]), told)
