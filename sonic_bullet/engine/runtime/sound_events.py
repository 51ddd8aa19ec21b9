"""Sound events: impacts, rolling and sliding as the run time plays them, and silent contacts, with the reason.

    ContactLog -> render_per_body, step by step -> EventObserver: PULSE (accepted strikes), drives (friction), PAIR
        -> one impact of all pulses of a strike; steps of one kind -> one span -> SoundEvent
        + the sound of each alone (own_sound.py) -> level at the first microphone

Table, cues, overlay and picture show this one list.

Nothing is judged here a second time: an impact is a pulse that the run time plays (contact.strike_forces), a roll or a
slide a pair whose contact oscillator makes a force (contact.friction). Slip decides which of both: a contact slides
where it slips faster than the least audible sweep, and than half of its own. What carries load and does neither is
support; a load that leaps and is not accepted is a strike without a cause.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np

from sonic_bullet._engine import SWEEP_FLOOR_M_S, TAPS
from sonic_bullet.engine.contact.load_splitting import NOW, SPAN
from sonic_bullet.engine.runtime.body_stems import render_per_body
from sonic_bullet.engine.runtime.own_sound import OwnSound
from sonic_bullet.engine.runtime.synthesis_state import State
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array, Microphone
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.cues import Cue
from sonic_bullet.records.units import REFERENCE_PRESSURE_PA
from sonic_bullet.simulators.animated import matrices

EventKind = Literal["impact", "roll", "slide", "support", "uncaused strike"]


@dataclass(frozen=True, slots=True, eq=False)
class SoundEvent:
    """A contact of two bodies, from start_s to end_s (of an impact the start of its last pulse), physics time.

    Attributes
    ----------
    low, high : indices into the log's bodies
    place_m : (3,) world frame, where it begins
    impulse_n_s : of an impact the magnitude that the run time plays, else the load's time integral
    speed_m_s : of an impact the approach, of a slide the slip, of a roll the sweep, means by load
        0 of an impact that a struck neighbour transmits through bodies that touch already.
    arrival_s : when its first sound is at the first microphone
    level_db : re 20 µPa there, of this event alone (`own_sound`), without what else its bodies ring with
        The peak within 50 ms of an impact, the rms of a roll or slide; None where it is silent, or no pressure.
    reason : why it is silent, empty where it sounds
    """

    kind: EventKind
    start_s: float
    end_s: float
    low: int
    high: int
    place_m: Array
    impulse_n_s: float
    speed_m_s: float
    arrival_s: float
    level_db: float | None = None
    reason: str = ""


class _Touch(NamedTuple):
    """Where a pair touches in a step (world), how fast, and its load there."""

    place_m: tuple[float, float, float]
    slip_m_s: float
    sweep_m_s: float
    approach_m_s: float
    load_n_s: float


class _Moment(NamedTuple):
    """A pair in a step, or a pulse of it."""

    low: int
    high: int
    step: int
    start_s: float
    end_s: float
    kind: EventKind
    touch: _Touch
    impulse_n_s: float
    speed_m_s: float
    reason: str = ""
    own: float = 0.0
    """Of a pulse the peak in Pa of its strike so far, of a step of friction the sum of p² over its samples."""


@dataclass(slots=True)
class _Run:
    """Steps of a pair and a kind, from the first on.

    step: the last of `steps`; travel: sum of speeds times loads; own: sum of p².
    """

    first: _Moment
    step: int
    end_s: float
    steps: int
    load_n_s: float
    travel: float
    own: float

    @classmethod
    def of(cls, one: _Moment) -> _Run:
        travel = (one.impulse_n_s + 1e-300) * one.speed_m_s
        return cls(one, one.step, one.end_s, 1, one.impulse_n_s, travel, one.own)

    def add(self, other: _Run) -> None:
        """Append the next run."""
        self.step, self.end_s, self.steps = other.step, other.end_s, self.steps + other.steps
        self.load_n_s, self.travel = self.load_n_s + other.load_n_s, self.travel + other.travel
        self.own += other.own


class EventObserver:
    """Observer of every step of a log's run; `events` are what it observed."""

    def __init__(self, log: ContactLog) -> None:
        self._log, self._steps, self._sr = log, iter(log.steps), log.sr
        self._known: dict[int, Mapping[tuple[int, int], _Touch]] = {}
        self._seen: list[_Moment] = []
        self._runs: dict[tuple[int, int], list[_Run]] = {}  # grown in place: a rest may last for hours
        self._struck: dict[tuple[int, int], int] = {}
        first = log.sensors[0] if log.sensors else None
        self._own = OwnSound(first, log.air.sound_speed_m_s) if isinstance(first, Microphone) else None
        self._strike: dict[tuple[int, int], tuple[int, float, Array]] = {}  # step, start, pressure of a pair's last

    def __call__(self, state: State, number: int, step: Array, found: int, drives: int) -> None:
        """Take in the pulses and drives of step ``number``, and which pairs carry load without them."""
        no_touch = _Touch((0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
        self._sr = state.bank.sr
        here, there = self._touching_pairs(number), self._touching_pairs(number + 1)
        begin_s, after_s = float(step["begin_s"]), float(step["after_s"])
        for at, pulse in enumerate(state.scratch.pulse[:found]):
            low, high = (int(state.body[i]) for i in pulse["body"])
            ahead = int(pulse["ahead"])
            of, start_s = (there, after_s) if ahead else (here, begin_s)
            start_s += float(pulse["start_s"])
            touch = of.get((low, high)) or here.get((low, high)) or no_touch
            self._struck[low, high] = number + ahead
            impulse = float(np.linalg.norm(pulse["impulse_n_s"]))
            own = self._peak_pa(state, number + ahead, start_s, at, (low, high))
            self._seen.append(
                _Moment(
                    low, high, number + ahead, start_s, start_s, "impact", touch, impulse,
                    self._approach_m_s(number + ahead, (low, high)), own=own,
                )
            )  # fmt: skip
        active = state.pairs.active[: state.pairs.count[0]]
        pair, driven = state.pairs.pair[active], np.isin(active, state.scratch.slot[:drives])
        force, before, used = pair["force_n"][:, NOW], pair["force_n"][:, NOW - 1], pair["struck_n"][:, NOW]
        leaps, carries = (force > before) & (used > 0), (pair["support_n"][:, 1] > 0) & (force > 0)
        table = state.table.bodies
        frames = int(step["count"])
        rubs = {} if self._own is None else self._own.friction_pa2(state, number, drives, frames)
        mute = (table["modes"] + table["rigid"] == 0)[pair["body"]].all(axis=1)
        bodies = state.body[pair["body"]].tolist()
        carries_weight = "it carries weight: nothing strikes, and no surface sweeps past"
        no_cause = "nothing approached faster than gravity brings it while it rests"
        no_voice = "neither body has modes, nor moves freely"
        kind: EventKind
        for i in np.flatnonzero(driven | leaps | carries).tolist():
            who = bodies[i][0], bodies[i][1]
            touch = there.get(who) or here.get(who) or no_touch
            load, speed = float(force[i]) * (after_s - begin_s), touch.sweep_m_s
            if driven[i]:
                slides = touch.slip_m_s > max(SWEEP_FLOOR_M_S, 0.5 * speed)
                kind, speed, reason = ("slide", touch.slip_m_s, "") if slides else ("roll", speed, "")
            elif leaps[i] and number - self._struck.get(who, -SPAN) >= SPAN:
                kind, speed, reason = "uncaused strike", max(touch.approach_m_s, 0), no_cause
            elif carries[i]:
                kind, reason = "support", carries_weight
            else:
                continue
            reason = no_voice if mute[i] else reason
            own = rubs.get(int(active[i]), 0.0)
            moment = _Moment(*who, number, begin_s, after_s, kind, touch, load, speed, reason, own)
            if kind == "uncaused strike":
                self._seen.append(moment)
                continue
            runs = self._runs.setdefault(who, [])
            if runs and runs[-1].first.kind == kind and number - runs[-1].step <= SPAN:
                runs[-1].add(_Run.of(moment))
            else:
                runs.append(_Run.of(moment))

    def _approach_m_s(self, number: int, who: tuple[int, int]) -> float:
        """Find the fastest approach in the steps that one strike takes: while its load rises (load_splitting.hpp)."""
        fastest_m_s = load_n_s = 0.0
        for step in range(number, number + SPAN - 1):
            touch = self._touching_pairs(step).get(who)
            if touch is None or touch.load_n_s < load_n_s:
                break
            fastest_m_s, load_n_s = max(fastest_m_s, touch.approach_m_s), touch.load_n_s
        return fastest_m_s

    def _peak_pa(self, state: State, number: int, start_s: float, at: int, who: tuple[int, int]) -> float:
        """Compute the peak of the strike that has this pulse, as far as it is known; later pulses are added to it."""
        if self._own is None:
            return 0.0
        sr = state.bank.sr
        # time after an impact's arrival in which its peak is searched: the ear's integration time for loudness is of
        # that order, and the latest mode's first swing is over
        level_s = 0.05
        sound = self._own.strike_pa(state, number, at, max(round(level_s * sr), 1))
        step, first_s, before = self._strike.get(who, (-SPAN, 0.0, sound))
        if 0 <= number - step <= 1:
            late = min(max(round((start_s - first_s) * sr), 0), len(sound))
            joined = before.copy()
            joined[late:] += sound[: len(sound) - late]
            sound, start_s = joined, first_s
        self._strike[who] = (number, start_s, sound)
        return float(np.abs(sound).max())

    def _touching_pairs(self, number: int) -> Mapping[tuple[int, int], _Touch]:
        """Return the pairs that touch in a step of the log; none after its last."""
        while number not in self._known:
            step, at = next(self._steps, None), max(self._known, default=-1) + 1
            self._known = {k: v for k, v in self._known.items() if k >= at - SPAN} | {at: touching_pairs(step)}
        return self._known[number]

    def events(self) -> tuple[SoundEvent, ...]:
        """Return all events in the order of their times, with their levels."""
        order = sorted(self._seen, key=lambda one: (one.low, one.high, one.step, one.start_s))
        found: list[SoundEvent] = []
        for _, mine in groupby(order, key=lambda one: one[:2]):
            moments = list(mine)
            for kind, apart in (("impact", 1), ("uncaused strike", SPAN)):
                found += [self._impact(group) for group in _strikes([x for x in moments if x.kind == kind], apart)]
        found += [self._span(run) for runs in self._runs.values() for run in _spans(runs)]
        return tuple(sorted(found, key=lambda one: (one.start_s, one.low, one.high, one.kind)))

    def _impact(self, pulses: list[_Moment]) -> SoundEvent:
        first = pulses[0]
        impulse = sum(one.impulse_n_s for one in pulses)
        peak_pa = pulses[-1].own
        return self._event(first, pulses[-1].end_s, impulse, max(one.speed_m_s for one in pulses), peak_pa)

    def _span(self, run: _Run) -> SoundEvent:
        speed_m_s = run.travel / (run.load_n_s + run.steps * 1e-300)
        rms_pa = float(np.sqrt(run.own / max((run.end_s - run.first.start_s) * self._sr, 1.0)))
        return self._event(run.first, run.end_s, run.load_n_s, speed_m_s, rms_pa)

    def _event(self, first: _Moment, end_s: float, impulse_n_s: float, speed_m_s: float, own_pa: float) -> SoundEvent:
        log, late_s, place_m = self._log, 0.0, np.array(first.touch.place_m)
        if log.sensors and isinstance(log.sensors[0], Microphone):
            away = float(np.linalg.norm(place_m - log.sensors[0].position_m))
            late_s = max(away / log.air.sound_speed_m_s, TAPS / 2 / log.sr)
        return SoundEvent(
            first.kind, first.start_s, end_s, first.low, first.high, place_m, impulse_n_s, speed_m_s,
            first.start_s + late_s, level_db(own_pa) if not first.reason and own_pa > 0 else None, first.reason,
        )  # fmt: skip


def touching_pairs(step: Step | None) -> Mapping[tuple[int, int], _Touch]:
    """Merge each pair's contacts of a step: means by load."""
    if step is None or not len(step.contacts.row):
        return {}
    row = step.contacts.row
    load = np.abs(np.einsum("ki,ki->k", row["impulse_n_s"], row["normal"])) + 1e-300
    at = np.searchsorted(step.body, row["a"])
    place = step.position_m[at] + np.einsum("kij,kj->ki", matrices(step.quaternion_xyzw[at]), row["point_a_m"])
    slip, sweep = np.linalg.norm(row["slip_m_s"], axis=1), row["sweep_m_s"].max(axis=1)
    pair, which = np.unique(np.sort(np.stack([row["a"], row["b"]], 1), axis=1), axis=0, return_inverse=True)
    total = np.bincount(which.ravel(), load)
    x, y, z, slip, sweep = (
        (np.bincount(which.ravel(), load * value) / total).tolist() for value in (*place.T, slip, sweep)
    )
    approach = np.full(len(pair), -np.inf)
    np.maximum.at(approach, which.ravel(), row["approach_m_s"])
    return {
        (low, high): _Touch((x[i], y[i], z[i]), slip[i], sweep[i], float(approach[i]), float(total[i]))
        for i, (low, high) in enumerate(pair.tolist())
    }


def _strikes(pulses: list[_Moment], apart: int) -> list[list[_Moment]]:
    """Group the pulses of one pair by strike: what a strike lacks when it is found follows a step later.

    apart: steps within which one belongs to the one before.
    """
    groups: list[list[_Moment]] = []
    for one in pulses:
        if groups and one.step - groups[-1][-1].step <= apart:
            groups[-1].append(one)
        else:
            groups.append([one])
    return groups


def _spans(runs: Sequence[_Run]) -> list[_Run]:
    """Merge runs of one pair to spans of one kind.

    A kind that lasts less than `SPAN` steps, as manifolds flicker, belongs to the span before it, and a gap as short
    ends none.
    """
    spans: list[_Run] = []
    for run in runs:
        last = spans[-1] if spans else None
        if last is not None and run.first.step - last.step <= SPAN and (
            run.steps < SPAN or last.first.kind == run.first.kind
        ):  # fmt: skip
            last.add(run)
        else:
            spans.append(replace(run))
    return spans


def level_db(pressure_pa: float) -> float:
    """Compute the level re 20 µPa."""
    return 20 * float(np.log10(pressure_pa / REFERENCE_PRESSURE_PA))


def find_sound_events(log: ContactLog, *, sr: int | None = None) -> tuple[SoundEvent, ...]:
    """Find all events of a log, whose sound is rendered for it and not kept.

    Arguments, errors: as of `render_per_body`.
    """
    observer = EventObserver(log)
    for _ in render_per_body(log, sr=sr, observer=observer):
        pass
    return observer.events()


def cues_of(
    events: Sequence[SoundEvent], log: ContactLog, sr: int, frames: int, body: int | None = None
) -> tuple[Cue, ...]:
    """Make cue points where events are heard, of one body or all; those after the end of the sound are left out."""
    return tuple(
        Cue(
            at,
            0 if one.kind == "impact" else round((one.end_s - one.start_s) * sr),
            f"{one.kind} {name_pair(one, log)} {_size(one)}",
        )
        for one in events
        if one.kind in ("impact", "roll", "slide") and not one.reason and (body is None or body in (one.low, one.high))
        if (at := round(one.arrival_s * sr)) < frames
    )


def name_pair(event: SoundEvent, log: ContactLog) -> str:
    """Join both bodies' names."""
    return f"{log.bodies[event.low].name} - {log.bodies[event.high].name}"


def _size(event: SoundEvent) -> str:
    """Format an event's size in letters that every reader of RIFF knows."""
    return f"{event.impulse_n_s * 1e3:.3g} mN s" if event.kind == "impact" else f"{event.speed_m_s:.3g} m/s"
