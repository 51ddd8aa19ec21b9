"""A Timeline for OpenTimelineIO: tracks of one clip each, times in samples at the rate, pictures at theirs.

SoundItem -> Track(Audio)[Clip(source_range 0, frames @ sr, ExternalReference path)]
FilmItem  -> Track(Video)[Clip(source_range 0, pictures @ fps)]
markers   -> Marker(marked_range sample, samples @ sr) of the stack         begins -> global_start_time
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any
from urllib.parse import quote

from sonic_bullet.apps.soundtrack.editing.timeline import Timeline


def is_installed() -> bool:
    """Return whether OpenTimelineIO is installed, an extra."""
    return find_spec("opentimelineio") is not None


def otio_timeline(timeline: Timeline) -> bytes:
    """Write the text of NAME.otio."""
    from opentimelineio import adapters, opentime, schema

    def clip(name: str, path: str, count: int, rate: float) -> Any:
        within = opentime.TimeRange(opentime.RationalTime(0, rate), opentime.RationalTime(count, rate))
        return schema.Clip(name, schema.ExternalReference(quote(path), within), within)

    made = schema.Timeline(timeline.name, global_start_time=opentime.RationalTime(timeline.begins, timeline.sr))
    made.metadata["sonic_bullet"] = {"sr": timeline.sr}
    film = timeline.film
    if film is not None:
        track = schema.Track("film", kind=schema.TrackKind.Video)
        track.append(clip("film", film.path, film.pictures, float(film.fps)))
        made.tracks.append(track)
    for one in timeline.sounds:
        track = schema.Track(one.name, kind=schema.TrackKind.Audio)
        track.enabled = not one.muted
        track.append(clip(one.name, one.path, one.frames, timeline.sr))
        made.tracks.append(track)
    for marker in timeline.markers:
        start, lasts = (opentime.RationalTime(count, timeline.sr) for count in (marker.sample, marker.samples))
        made.tracks.markers.append(schema.Marker(marker.label, opentime.TimeRange(start, lasts)))
    return str(adapters.write_to_string(made, "otio_json")).encode("utf-8", "replace")
