"""A Timeline as a Reaper project, which is plain text: a line a value, a block from "<NAME" to ">".

    <REAPER_PROJECT version
      SAMPLERATE rate, use it, -          PROJOFFS start of the timeline in s
      MARKER number place name, 1 of a region, whose end is a second line of the same number
      <TRACK> NAME, VOLPAN, MUTESOLO, NCHAN
        <ITEM> POSITION, LENGTH, NAME in s
          <SOURCE WAVE|VIDEO> FILE

Seconds have 14 digits after the point: times the rate, and rounded, they are the samples again for centuries.
"""

from __future__ import annotations

from collections.abc import Iterator

from sonic_bullet.apps.soundtrack.editing.timeline import Timeline


def reaper_project(timeline: Timeline) -> bytes:
    """Write the text of NAME.rpp."""
    return "\n".join([*_lines(timeline), ""]).encode("utf-8", "replace")


def _lines(timeline: Timeline) -> Iterator[str]:
    version = '0.1 "6.0"'  # Version of the format: fields that it lacks have their defaults in any later Reaper
    sr, film = timeline.sr, timeline.film
    yield f"<REAPER_PROJECT {version} 0"
    yield f"  PROJOFFS {_seconds(timeline.begins, sr)} 0 0"
    yield f"  SAMPLERATE {sr} 1 0"
    if film is not None:
        yield f"  VIDEO_CONFIG 0 0 256\n  TIMEMODE 1 5 -1 {round(film.fps)} 0 0 -1"
    for number, marker in enumerate(timeline.markers, start=1):
        region = int(marker.samples > 0)
        yield f"  MARKER {number} {_seconds(marker.sample, sr)} {_quote_text(marker.label)} {region}"
        if region:
            yield f'  MARKER {number} {_seconds(marker.sample + marker.samples, sr)} "" 1'
    if film is not None:
        length = f"{float(film.pictures / film.fps):.14f}"
        yield from _track("film", film.path, "VIDEO", length, channels=2, volume=0)
    for one in timeline.sounds:
        yield from _track(one.name, one.path, "WAVE", _seconds(one.frames, sr), channels=one.channels, muted=one.muted)
    yield ">"


def _track(
    name: str, path: str, source: str, length: str, *, channels: int, muted: bool = False, volume: int = 1
) -> Iterator[str]:
    """Write a track with one item that begins where the project does."""
    yield "  <TRACK"
    yield f"    NAME {_quote_text(name)}"
    yield f"    VOLPAN {volume} 0 -1 -1 1"
    yield f"    MUTESOLO {int(muted)} 0 0"
    yield f"    NCHAN {max(channels + channels % 2, 2)}"
    yield "    <ITEM"
    yield f"      POSITION {0:.14f}"
    yield f"      LENGTH {length}"
    yield "      LOOP 0"
    yield "      FADEIN 0 0 0\n      FADEOUT 0 0 0"
    yield f"      NAME {_quote_text(name)}"
    yield f"      <SOURCE {source}"
    yield f"        FILE {_quote_text(path)}"
    yield "      >\n    >\n  >"


def _seconds(samples: int, sr: int) -> str:
    return f"{samples / sr:.14f}"


def _quote_text(text: str) -> str:
    """Quote a text with a mark that it does not hold; where it holds all, backticks become apostrophes."""
    plain = " ".join(text.split())
    mark = next((mark for mark in "\"'`" if mark not in plain), "`")
    return mark + (plain.replace("`", "'") if mark in plain else plain) + mark
