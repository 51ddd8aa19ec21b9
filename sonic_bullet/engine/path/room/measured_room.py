"""A measured room: what follows the direct sound of its impulse response, over that direct sound.

    out = own + h' * own,   h'(t) = w(t) h(t0 + t)/A,   A² = Σ h² from t0 - 2.5 ms to t0 + 2.5 ms

t0: where the response first comes within 20 dB of its peak; A has the sign of that peak. w: 0 up to 2.5 ms after t0,
a quarter of a cosine later 1 [Zahorik, JASA 112(5), 2002: 2.5 ms part direct from reverberant sound]. The render's own
direct sound stays as it is, distance and all; no level is chosen. A wall or a floor nearer than 0.4 m is lost, as part
of the direct sound.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.engine.path.room.room_plan import RoomPlan
from sonic_bullet.engine.path.space.ear_filters import ONSET_SHARE, resample_response
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array, Microphone, RoomResponse, channels_of
from sonic_bullet.records.errors import SceneError


def plan_response(room: RoomResponse, log: ContactLog) -> RoomPlan:
    """Plan a measured room for a log. Raises SceneError where its channels are not those of the log."""
    response, channels = np.asarray(room.response), channels_of(log.sensors)
    count, hears = len(response), [one.channels > 1 for one in log.sensors if isinstance(one, Microphone)]
    if count > 1 and any(hears):
        raise SceneError(
            f"{room.name} has {count} channels, and a microphone that hears directions needs one of its own",
            "give --response a file of one channel, or plain microphones",
        )
    if count not in (1, channels):
        raise SceneError(
            f"{room.name} has {count} channels, and the render {channels}",
            "give --response a file of one channel, or as many --microphone",
        )
    note = f"{room.name}: T60 {_describe(decay_time_s(response, room.sr))}"
    if room.sr != log.sr:
        response = resample_response(response, room.sr, log.sr)
        note += f", resampled from {room.sr} Hz to {log.sr} Hz"
    parts = [late_part(one, log.sr) for one in response]
    made = np.zeros((count, max(len(one) for one in parts)))
    for row, one in zip(made, parts, strict=True):
        row[: len(one)] = one
    early, late = made, np.zeros((channels, 0, 1))
    if count > 1:
        early, late = made[:0], np.eye(count)[:, :, None] * made
    mixing = np.concatenate([np.eye(channels), np.eye(channels)])
    return RoomPlan(log.sensors, mixing, channels, early, late, made.shape[1] / log.sr, 0.0, note)


def late_part(response: Array, sr: int) -> Array:
    """Cut the direct sound from a response (n,), over it: (n - t0,), from t0 on."""
    direct_s = 2.5e-3
    begin, direct = onset(response), round(direct_s * sr)
    own = response[max(0, begin - direct) : begin + direct]
    level = np.sqrt((own**2).sum()) * np.sign(own[np.argmax(np.abs(own))])
    late = response[begin:] / level
    fade_s = 0.5e-3
    ramp = np.sin(np.pi / 2 * np.arange(round(fade_s * sr)) / (fade_s * sr)) ** 2
    late[:direct] = 0.0
    late[direct : direct + len(ramp)] *= ramp[: len(late[direct:])]
    return np.asarray(late)


def onset(response: Array) -> int:
    """Find the sample at which a response (n,) first comes within 20 dB of its peak [ISO 3382-1:2009, A.2.3]."""
    size = np.abs(response)
    return int(np.argmax(size >= ONSET_SHARE * size.max()))


def decay_time_s(responses: Sequence[Array] | Array, sr: int) -> list[float]:
    """Compute T60 of responses by the slope from -5 to -25 dB, less their noise; NaN where there is no such fall.

    ISO 3382-1:2009, T20; noise: Chu, JASA 63(5), 1978, eq. 4.
    """
    found = []
    tenth = 10  # part of a response, its last, whose mean square is the noise that it was measured in
    for response in responses:
        square = response[onset(response) :] ** 2
        noise = square[-max(1, len(square) // tenth) :].mean()
        left = np.cumsum((square - noise)[::-1])[::-1]
        level = 10 * np.log10(np.maximum(left, 1e-300) / max(float(left[0]), 1e-300))
        first, last = (int(np.argmax(level <= db)) for db in (-5.0, -25.0))
        slope = np.polyfit(np.arange(first, last) / sr, level[first:last], 1)[0] if last - first > 2 else 0.0
        found.append(-60 / float(slope) if slope < 0 and first > 0 else np.nan)
    return found


def _describe(times_s: Sequence[float]) -> str:
    known = [f"{one:.2f}" for one in times_s if np.isfinite(one)]
    return f"{', '.join(known)} s" if known else "unknown: it does not fall by 25 dB"
