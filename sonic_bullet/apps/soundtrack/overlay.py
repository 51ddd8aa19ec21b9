"""Contacts drawn into a picture when they sound, and silent ones with the reason.

    SoundEvent + where the pair touches now -> pixel (the camera's projection) -> ring, dot or cross, a line of words

p = (x·f/z, y·f/z), f = height/2 / tan(view/2): a pinhole at the camera's eye [Hartley, Zisserman 2004, eq. 6.1].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sonic_bullet.engine.runtime.sound_events import SoundEvent, name_pair
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array
from sonic_bullet.simulators.pictures import Camera

COLOURS = {
    "impact": (255, 120, 0),
    "roll": (0, 120, 255),
    "slide": (220, 0, 160),
    "support": (110, 110, 110),
    "uncaused strike": (110, 110, 110),
}
SHOWN_S = 0.25
"""How long an impact is shown: one of a millisecond would be in no picture."""


def pixel(place_m: Array, camera: Camera, size: tuple[int, int]) -> tuple[float, float] | None:
    """Project a point of the world to a picture, x from the left and y from the top; None behind the camera."""
    x, y, z = camera.to_camera_axes(place_m)
    if z <= 0:
        return None
    focal = camera.focal(size[1])
    return float(size[0] / 2 + focal * x / z), float(size[1] / 2 - focal * y / z)


def with_contacts(
    picture: Array,
    events: Sequence[SoundEvent],
    touching: Mapping[tuple[int, int], Any],
    log: ContactLog,
    time_s: float,
    camera: Camera,
) -> Array:
    """Draw the events under way at a time into the picture (height, width, 3). touching: where pairs touch then."""
    from PIL import Image, ImageDraw

    size = picture.shape[1], picture.shape[0]
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    unit = max(size[1] / 720, 0.5)
    for event in events:
        touch = None if event.kind == "impact" else touching.get((event.low, event.high))
        at = pixel(np.array(touch.place_m) if touch is not None else event.place_m, camera, size)
        if at is not None and abs(at[0]) < 1e5 and abs(at[1]) < 1e5:
            _mark(draw, event, at, unit, time_s)
    worded = _select_worded_events(events)
    lines = [f"{time_s:7.3f} s", *(_words(event, log) for event in worded)]
    if len(events) > len(worded):
        lines.append(f"and {len(events) - len(worded)} more")
    colours = [(30, 30, 30), *(COLOURS[event.kind] for event in worded), (30, 30, 30)]
    for row, (words, colour) in enumerate(zip(lines, colours, strict=False)):
        draw.text((10 * unit, (8 + 17 * row) * unit), words, fill=colour, font_size=14 * unit)
    return np.asarray(image)


def shown_at(events: Sequence[SoundEvent], time_s: float) -> list[SoundEvent]:
    """Return the events shown at a time: lasting ones while they last, the others for `SHOWN_S`."""
    return [
        one
        for one in events
        if one.start_s <= time_s + 1e-9
        and time_s < max(one.end_s, one.start_s + (SHOWN_S if one.kind == "impact" else 0))
    ]


def _select_worded_events(events: Sequence[SoundEvent]) -> list[SoundEvent]:
    """Choose the events that are described in words: what lasts, the latest impacts, and then what is silent."""
    lines, silent_lines = 7, 4
    sounds = sorted((x for x in events if not x.reason), key=lambda x: (x.kind == "impact", -x.start_s))
    silent = sorted((x for x in events if x.reason), key=lambda x: (x.kind == "support", -x.start_s))
    return sounds[:lines] + silent[:silent_lines]


def _mark(draw: Any, event: SoundEvent, at: tuple[float, float], unit: float, time_s: float) -> None:
    """Draw a mark: a ring that opens for an impact, larger if louder; a dot for friction; cross or square if silent."""
    quietest_db, pixels_a_db = 40.0, 0.5
    colour, (x, y) = COLOURS[event.kind], at
    loud = max((event.level_db or quietest_db) - quietest_db, 4.0)
    if event.kind == "impact":
        radius = unit * (3 + pixels_a_db * loud * (0.4 + 0.6 * min((time_s - event.start_s) / SHOWN_S, 1.0)))
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), outline=colour, width=max(round(3 * unit), 1))
    elif event.kind in ("roll", "slide"):
        radius = unit * (3 + 0.15 * loud)
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour)
    elif event.kind == "support":
        draw.rectangle((x - 3 * unit, y - 3 * unit, x + 3 * unit, y + 3 * unit), outline=colour)
    else:
        for turn in (-1, 1):
            draw.line((x - 4 * unit, y - 4 * turn * unit, x + 4 * unit, y + 4 * turn * unit), fill=colour)


def _words(event: SoundEvent, log: ContactLog) -> str:
    size = (
        f"{event.impulse_n_s * 1e3:.3g} mN·s"
        if event.kind in ("impact", "uncaused strike")
        else f"{event.speed_m_s:.2g} m/s"
    )
    level = f"{event.level_db:.0f} dB" if event.level_db is not None else ""
    silent = f"silent: {event.reason}" if event.reason else level
    return f"{event.kind}  {name_pair(event, log)}  {'' if event.kind == 'support' else size}  {silent}"
