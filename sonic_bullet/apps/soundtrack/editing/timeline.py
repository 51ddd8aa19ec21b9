"""Items of a timeline and their positions, counted in samples.

All begin together, at `begins`: stems and mix are of one length, a film lasts whole pictures. Paths are those within
the session's folder, so that it may be moved.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from sonic_bullet.records.cues import Cue

MIX_FILE = "mix.wav"
FILM_FILE = "film.mov"


@dataclass(frozen=True, slots=True)
class SoundItem:
    """A sound file: its track's name, its path, frames and channels; muted: its sum or parts sound in its place."""

    name: str
    path: str
    frames: int
    channels: int
    muted: bool = False


@dataclass(frozen=True, slots=True)
class FilmItem:
    """A film: path, pictures, pictures a second. Its sound is the mix's, so it is muted."""

    path: str
    pictures: int
    fps: Fraction


@dataclass(frozen=True, slots=True)
class Timeline:
    """Timeline of a session.

    name: of the scene; sr: in Hz; sounds: a track each; markers: from the first sample on; begins: the first sample on
    the timeline that the session is for.
    """

    name: str
    sr: int
    sounds: tuple[SoundItem, ...]
    film: FilmItem | None = None
    markers: tuple[Cue, ...] = field(default=())
    begins: int = 0
