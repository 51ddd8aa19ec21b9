"""Tables of events for other programs: JSON and CSV, a row an active impact, roll or slide, in order of time.

Times in s, places in m, world frame; level in dB re 20 µPa at the first microphone. Silent events are left out.
"""

from __future__ import annotations

import csv
import io
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sonic_bullet.engine.runtime.sound_events import SoundEvent
from sonic_bullet.files import replace_file
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.storage.json_text import json_bytes

EVENT_COLUMNS = (
    "kind",
    "start_s",
    "end_s",
    "arrival_s",
    "body_a",
    "link_a",
    "name_a",
    "body_b",
    "link_b",
    "name_b",
    "x_m",
    "y_m",
    "z_m",
    "impulse_n_s",
    "speed_m_s",
    "level_db",
)


def rows_of(events: Sequence[SoundEvent], log: ContactLog) -> list[dict[str, Any]]:
    """Return the active events, by column."""
    rows = []
    for one in events:
        if one.kind in ("impact", "roll", "slide") and not one.reason:
            a, b = log.bodies[one.low], log.bodies[one.high]
            names = [body.name.encode("utf-8", "replace").decode() for body in (a, b)]
            values = (
                one.kind, one.start_s, one.end_s, one.arrival_s, a.body_id, a.link, names[0], b.body_id, b.link,
                names[1], *one.place_m.tolist(), one.impulse_n_s, one.speed_m_s, one.level_db,
            )  # fmt: skip
            rows.append(dict(zip(EVENT_COLUMNS, values, strict=True)))
    return rows


def write_events(path: str | os.PathLike[str], events: Sequence[SoundEvent], log: ContactLog) -> dict[str, int]:
    """Write a .json or .csv, whole or not at all; return how many there are of each kind. Raises FileError."""
    rows = rows_of(events, log)
    if Path(path).suffix.lower() == ".csv":
        text = io.StringIO()
        table = csv.DictWriter(text, EVENT_COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
        content = text.getvalue()
    else:
        content = json_bytes({"sounding": rows}, indent=1).decode()
    with replace_file(path) as file:
        file.write(content.encode("utf-8", "replace"))
    return dict(Counter(row["kind"] for row in rows))
