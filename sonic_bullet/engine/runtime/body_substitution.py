"""Bodies of the tables that nothing has touched, once their modes are known: in the same places, silent as before.

    State + {index: Body with its model} -> rows, lanes and voices in place of those without modes

What has touched nothing has moved nothing: its modes are at rest, no pair or row names it, and no sound of it is under
way. So a run in which it gets its modes at its first touch has the bits of one that had them from the start.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sonic_bullet.engine import bank
from sonic_bullet.engine.runtime.synthesis_state import Setup, State, sounding_parts
from sonic_bullet.engine.runtime.tables import StepScratch
from sonic_bullet.records import Body, Microphone, Sensor


def can_substitute(sensors: Sequence[Sensor], *, image: bool) -> bool:
    """Tell whether no sensor's own state tells the bodies apart: microphones that stay, without images."""
    plain = all(type(one) is Microphone and not one.moves and not one.directivity for one in sensors)
    return plain and not image


def substitute(setup: Setup, state: State, bodies: Mapping[int, Body]) -> None:
    """Give bodies, by their index in the log, that nothing has touched yet, what they have now; others are left out."""
    place = {index: number for number, index in enumerate(state.body.tolist())}
    known = sorted(set(bodies) & set(place))
    if not known:
        return
    who = np.array([place[index] for index in known], np.int64)
    new, voices, modes, follows, seeds = sounding_parts(setup, [bodies[index] for index in known])
    instrument, ringing = bank.append(state.bank, state.ringing, modes)
    count, keep = len(state.body), np.arange(len(state.body))
    keep[who] = count + np.arange(len(who))
    for one, own, seed in zip(new, follows, seeds, strict=True):
        state.table.add(one, own, seed)
    state.bank, state.ringing = bank.subset(instrument, ringing, keep)
    everyone, every_voice = (*state.resonators, *new), (*state.voices, *voices)
    state.resonators, state.voices = tuple(everyone[i] for i in keep), tuple(every_voice[i] for i in keep)
    none = np.zeros(0, np.int64)
    state.table = state.table.subset(
        keep,
        [
            (one, none if voice is None else voice.follows)
            for one, voice in zip(state.resonators, state.voices, strict=True)
        ],
    )
    state.travelling.sources["radius_m"][who] = [one.radius_m for one in new]
    state.has_residual = any(voice is not None for voice in state.voices)
    state.scratch = StepScratch()
    state.mark_changed()
