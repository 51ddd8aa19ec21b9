"""Options of `film`. `FilmLook` is also what `sonic_bullet.apps.soundtrack.film.make_film` takes."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from sonic_bullet.options.option import Options, group, option, require_option
from sonic_bullet.options.render import (
    LevelOptions,
    Point,
    RoomOptions,
    SceneOptions,
    SpaceOptions,
    json_option,
    read_size,
)
from sonic_bullet.records.film_codecs import CODECS, USUAL_CODECS


def fraction_of(text: str) -> Fraction:
    """Read 24, 29.97, 30000/1001. Raises ValueError.

    Powers of ten are refused, as ten digits of one would take all memory.
    """
    longest = 20
    try:
        if len(text) <= longest and "e" not in text.lower():
            return Fraction(text)
    except (ValueError, ZeroDivisionError):
        pass
    raise ValueError(f"fps is {text[:40]!r}: give pictures a second, 24, 25, 30000/1001 or 60 say")


@dataclass(frozen=True, slots=True)
class FilmLook(Options):
    """Pictures."""

    fps: Fraction = option(Fraction(30), "Pictures a second: 24, 25, 30000/1001, 60 …", metavar="F", read=fraction_of)
    size: tuple[int, int] = option(
        (1280, 720), "Of the pictures, even numbers.", metavar="WxH", read=read_size, unset="1280x720"
    )
    eye_m: Point | None = option(
        None, "Where the camera stands, in m.", "--camera", metavar="X,Y,Z", unset="it takes in what moves"
    )
    target_m: Point | None = option(
        None, "What it looks at, in m.", "--look-at", metavar="X,Y,Z", unset="the middle of what moves"
    )
    follow: str | None = option(None, "Name of a body that the camera goes with.", metavar="BODY")
    shadows: bool = option(False, "Draw shadows; takes twice as long.")


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmOptions(Options):
    """Outputs."""

    output: str = field(metadata=require_option("Film: .mp4 .mov .mkv", "-o", "--output", metavar="NAME.mp4"))
    codec: str | None = option(None, "Codec of the sound.", "--audio", choices=tuple(CODECS), unset=USUAL_CODECS)
    overlay: bool = option(False, "Draw contacts as they are heard, and why others are silent.")
    json_to: str | None = json_option()
    look: FilmLook = group(FilmLook)
    scene: SceneOptions = group(SceneOptions)
    level: LevelOptions = group(LevelOptions)
    space: SpaceOptions = group(SpaceOptions)
    room: RoomOptions = group(RoomOptions)
