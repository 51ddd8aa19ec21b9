"""Tail of a run: what still sounds after its last step, by the same run time without physics.

    state at the end -> steps without motion or contact -> blocks -> until each channel is tail_db below its peak

Bodies stay where the last step left them, and keep the poles that they had there: a body at rest on another is damped
as before. There are no strikes and no friction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.engine.contact.load_splitting import LOOKAHEAD
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import as_number
from sonic_bullet.records.contacts import Contacts, Step
from sonic_bullet.records.errors import AudioError

if TYPE_CHECKING:
    from sonic_bullet.engine.runtime.synthesis_state import Setup, State

TAIL_DB = -60.0
"""Default end of a tail: the fall of level that reverberation times are stated for [ISO 3382-1:2009, sec. 3.2]."""
CHECKED_S = 0.1
"""Length checked at once: longer than beats of neighbouring modes that a listener hears as one decay."""


def as_tail_db(tail_db: object, name: str = "tail_db") -> float | None:
    """Check a tail's end in dB re the peak, below 0; None and 0: no tail. Raises AudioError, which names ``name``."""
    if tail_db is None:
        return None
    remedy = "give at most 0: -60 ends it 60 dB below the peak, 0 leaves it out"
    return as_number(tail_db, name, remedy, least=-200, most=0, error=AudioError) or None


def ring_on(setup: Setup, state: State, last: Step) -> Iterator[Array]:
    """Yield blocks (channels, n) of what sounds after the end of ``last``, the newest step taken in, for ever.

    ``state`` is not changed.
    """
    step_s = 1 / 240  # steps of a tail are no shorter: nothing happens in them
    from sonic_bullet.engine.runtime.synthesizer import advance

    state = state.copy()
    state.observer = None
    still = replace(last, contacts=Contacts.none(), teleported=np.zeros(len(last.teleported), bool))
    advance(setup, state, [still] * LOOKAHEAD)  # up to the end of ``last``, which is rendered already
    state.credit_s = np.zeros(0)  # no new poles
    state.mark_changed()
    step = replace(still, dt_s=max(still.dt_s, step_s))
    while True:
        yield advance(setup, state, [step] * max(1, round(CHECKED_S / step.dt_s)))


def with_tail(
    sound: KeptSound, setup: Setup, state: State, last: Step | None, tail_db: float, longer_s: float = 0.0
) -> KeptSound:
    """Extend the sound up to the end of ``last`` by its tail, until each channel is tail_db below its peak.

    At most 10 s longer; longer_s: by so much more, for what a room makes of it.
    """
    most_s = 10.0
    if last is None or not len(setup.sensors):
        return sound
    microphone_m = setup.microphone_m if state.space is None else state.space.place_m
    travel_s = max(
        (float(np.linalg.norm(last.position_m - m, axis=1).max(initial=0.0)) for m in microphone_m), default=0.0
    )
    quiet_s = CHECKED_S + travel_s / setup.air.sound_speed_m_s
    weakest, peak = 10 ** (tail_db / 20), sound.peaks()
    frames = sound.shape[1]
    loud = bool((_peak(sound.read(max(0, frames - math.ceil(CHECKED_S * setup.sr)), frames)) > weakest * peak).any())
    kept: list[Array] = []
    waiting: list[Array] = []
    room, silent = round((most_s + longer_s) * setup.sr), 0
    for made in ring_on(setup, state, last):
        block = made[:, :room]
        now = _peak(block)
        room, peak = room - block.shape[1], np.maximum(peak, now)
        waiting.append(block)
        silent += block.shape[1]
        if (now > weakest * peak).any():
            kept, waiting, silent, loud = [*kept, *waiting], [], 0, True
        if not room or silent >= (quiet_s + longer_s) * setup.sr:
            break
    kept += waiting if longer_s else waiting[:1] if loud else []
    return KeptSound(sound.spool, sound.count, np.concatenate([sound.rest, *kept], axis=1))


def _peak(block: Array) -> Array:
    """Return the peaks (channels,) of (channels, n)."""
    return np.asarray(np.abs(block).max(axis=1, initial=0.0))
