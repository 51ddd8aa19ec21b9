"""Body lifetime: which bodies of the log the tables hold, which come, and which leave.

    Step.body -> further bodies, silent at first; those no longer in it ring on at their last pose
        -> once they are silent, and nothing under way names them: out of all tables

Which bodies the tables hold changes no bit: they are summed in the order of their indices, and a silent body adds
nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sonic_bullet.engine import bank
from sonic_bullet.engine.contact.load_splitting import SPAN
from sonic_bullet.engine.path import propagation
from sonic_bullet.engine.path.space.inside import check_outside
from sonic_bullet.engine.runtime.channels.body_images import admit_faces, own_microphones
from sonic_bullet.engine.runtime.synthesis_state import Setup, State, with_bodies
from sonic_bullet.engine.runtime.tables import StepScratch
from sonic_bullet.records import Array, Body
from sonic_bullet.records.contacts import Step, first_bodies
from sonic_bullet.records.errors import LogError

Records = Sequence[Body] | Mapping[int, Body]
"""Bodies by their index in the log."""


def admit(setup: Setup, state: State, step: Step, bodies: Records) -> None:
    """Set the bodies present to those of a step that is to be taken in.

    Raises LogError where a body comes again, or after one of a higher index.
    """
    if np.array_equal(step.body, state.present):
        state.present = state.body if np.array_equal(step.body, state.body) else step.body
        return
    new = ~np.isin(step.body, state.present)
    coming = step.body[new]
    if len(coming) and coming[0] <= state.newest:
        raise LogError(
            f"body {coming[0]} of the log comes again, or after body {state.newest}", "use an unbroken contact log"
        )
    if len(coming):
        records, place, turned = [bodies[i] for i in coming.tolist()], step.position_m[new], step.quaternion_xyzw[new]
        check_outside(own_microphones(setup), records, place, turned)
        with_bodies(setup, state, records, place, turned)
        if state.space is not None:
            state.space.with_bodies(place, turned)
        state.newest = int(coming[-1])
    admit_faces(
        setup, state, step, [bodies[i] for i in coming.tolist()], (step.position_m[new], step.quaternion_xyzw[new])
    )
    _name(state, np.concatenate([state.body, coming]))
    state.present = state.body if len(step.body) == len(state.body) else step.body


def _name(state: State, body: Array) -> None:
    """Set the tables' bodies (b,) by index in the log; `first_bodies` itself where they are the first."""
    first = first_bodies(len(body))
    state.body = first if np.array_equal(body, first) else body


def in_tables(state: State, contacts: Array, poses: tuple[Array, ...]) -> tuple[Array, tuple[Array, ...]]:
    """Translate contact rows (k,) and poses (s, p, ·) of the bodies present to the tables' numbers: (s, b, ·).

    A body that has left keeps its pose.
    """
    if state.mapped:
        contacts = contacts.copy()
        for side in ("a", "b"):
            contacts[side] = np.searchsorted(state.body, contacts[side])
        contacts.setflags(write=False)
    if state.present is not state.body:
        at, window, last = np.searchsorted(state.body, state.present), state.window, (state.taken - 1) % SPAN
        before = window.position_m[last], window.quaternion_xyzw[last], np.zeros(len(state.body), bool)
        poses = tuple(_fill_steps(old, here, at) for old, here in zip(before, poses, strict=True))
    return contacts, poses


def _fill_steps(old: Array, here: Array, at: Array) -> Array:
    """Repeat old (b, ·) for each step, with here (s, p, ·) at the places (p,): (s, b, ·)."""
    whole = np.repeat(old[None], len(here), axis=0)
    whole[:, at] = here
    whole.setflags(write=False)
    return whole


def release(state: State) -> None:
    """Remove bodies that have left from the tables, where they are silent and nothing under way names them."""
    stays = np.isin(state.body, state.present)
    stays |= ~(bank.silent(state.ringing) & propagation.silent(state.path, state.travelling))
    stays[state.pairs.pair["body"][state.pairs.active[: state.pairs.count[0]]]] = True
    for first, stop in state.window.step["row"].tolist():
        stays[state.window.row["body"][first:stop]] = True
    stays[[grain.body for grain in state.grains]] = True
    if state.space is not None:
        stays |= ~state.space.silent()
    stays[[body for low, high, _ in state.rubs for body in (low, high)]] = True
    if not stays.all():
        state.separations = sum_separations(state, np.flatnonzero(~stays))
        subset(state, np.flatnonzero(stays))


def sum_separations(state: State, who: Array | None = None) -> dict[str, tuple[int, int]]:
    """Count, by name of each body so far, the steps that it rang on contacts, and those with contact separation.

    The second is an upper bound: Σ|F| of the modes, each where it separates first, exceeded the load. who: of the
    tables, None: all of them, beside those that have left.
    """
    found = dict(state.separations)
    for b in range(len(state.support_state)) if who is None else who.tolist():
        rang, beyond = int(state.support_state["steps"][b]), int(state.support_state["separated"][b])
        if rang:
            before = found.get(state.resonators[b].body.name, (0, 0))
            found[state.resonators[b].body.name] = before[0] + rang, before[1] + beyond
    return found


def subset(state: State, keep: Array) -> None:
    """Keep only the bodies ``keep`` (k,), ascending; nothing under way names another."""
    number = np.full(len(state.body), -1)
    number[keep] = np.arange(len(keep))
    state.resonators = tuple(state.resonators[i] for i in keep)
    state.voices = tuple(state.voices[i] for i in keep)
    follows = [np.zeros(0, np.int64) if voice is None else voice.follows for voice in state.voices]
    state.table = state.table.subset(keep, list(zip(state.resonators, follows, strict=True)))
    state.bank, state.ringing = bank.subset(state.bank, state.ringing, keep)
    state.support_state = state.support_state[keep]
    state.travelling = propagation.subset(state.path, state.travelling, keep)
    state.window.subset(keep, number)
    for part in (state.space, state.surface, state.directions, state.images):
        if part is not None:
            part.subset(keep)
    state.pairs.subset(number)
    state.grains = tuple(replace(grain, body=int(number[grain.body])) for grain in state.grains)
    state.rubs = {(int(number[low]), int(number[high]), side): one for (low, high, side), one in state.rubs.items()}
    state.has_residual = any(voice is not None for voice in state.voices)
    _name(state, state.body[keep])
    state.present = state.body if len(state.present) == len(state.body) else state.present
    state.scratch = StepScratch()
    state.mark_changed()
