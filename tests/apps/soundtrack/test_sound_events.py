"""Events: what the run time plays, when, where, how strong; and why the rest is silent."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.apps.soundtrack.event_tables import EVENT_COLUMNS, write_events
from sonic_bullet.apps.soundtrack.stems import Stem, render_stems
from sonic_bullet.engine.runtime.sound_events import EventObserver, SoundEvent, _Touch, cues_of
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records.units import REFERENCE_PRESSURE_PA
from sonic_bullet.simulators import direct_client, disconnect
from tests.made.models import GLASS, STEEL, WOOD, ball_body, box_model
from tests.made.soundtracks import MICROPHONES, table_log
from tests.made.worlds import ball, box, floor, plate_model

CARRIES_WEIGHT = "it carries weight: nothing strikes, and no surface sweeps past"
NO_CAUSE = "nothing approached faster than gravity brings it while it rests"
NO_VOICE = "neither body has modes, nor moves freely"

RADIUS_M, MASS_KG, HEIGHT_M = 0.02, 0.1, 0.3


def run(setup: Callable[[Any, sb.Listener], object], seconds: float, step_s: float = 1 / 240) -> ContactLog:
    client = direct_client()
    try:
        client.setGravity(0, 0, -9.81)
        client.setTimeStep(step_s)
        listener = sb.attach(client, microphone=MICROPHONES[:1])
        setup(client, listener)
        for _ in range(round(seconds / step_s)):
            client.stepSimulation()
        return listener.contacts
    finally:
        disconnect(client)


def looked(log: ContactLog) -> tuple[tuple[SoundEvent, ...], tuple[Stem, ...]]:
    observer = EventObserver(log)
    stems = render_stems(log, observer=observer)
    return observer.events(), stems


def falling(client: Any, listener: sb.Listener) -> None:
    floor(client)
    body = ball(client, (0.1, 0.2, RADIUS_M + HEIGHT_M), radius=RADIUS_M, mass=MASS_KG)
    listener.add(body, material=GLASS, model=ball_body(RADIUS_M, GLASS).model)


def rolling(client: Any, listener: sb.Listener) -> None:
    floor(client)
    body = ball(client, (0, 0, RADIUS_M))
    client.resetBaseVelocity(body, [0.5, 0, 0], [0, 0.5 / RADIUS_M, 0])
    listener.add(body, material=GLASS, model=ball_body(RADIUS_M, GLASS).model, roughness_m=2e-6)


def sliding(client: Any, listener: sb.Listener) -> None:
    ground = floor(client)
    body = box(client, (0, 0, 0.005), turn=(0, 0, 0))
    for one in (ground, body):
        client.changeDynamics(one, -1, lateralFriction=0.2)
    client.resetBaseVelocity(body, [1.0, 0, 0])
    listener.add(body, material=STEEL, model=plate_model())


def resting(client: Any, listener: sb.Listener) -> None:
    floor(client)
    listener.add(box(client, (0, 0, 0.005), turn=(0, 0, 0)), material=STEEL, model=plate_model())


def test_a_fall_is_an_impact_when_where_and_as_strong_as_it_must() -> None:
    log = run(falling, 0.35)
    events, stems = looked(log)
    (hit,) = [one for one in events if one.kind == "impact"]
    # Bullet's own step: v after n steps is n·g·dt, so a fall of h ends within one of them of √(2h/g)
    assert hit.start_s == pytest.approx(np.sqrt(2 * HEIGHT_M / 9.81), abs=1 / 240)
    assert hit.place_m == pytest.approx([0.1, 0.2, 0.0], abs=2e-3)
    speed = np.sqrt(2 * 9.81 * HEIGHT_M)
    assert hit.speed_m_s == pytest.approx(speed, rel=0.03)
    # momentum: all that the floor gave, but for gravity's share of the steps
    given = np.linalg.norm(log.impulse_on(1).sum(axis=0))
    assert hit.impulse_n_s == pytest.approx(given, rel=0.02)
    assert MASS_KG * speed < hit.impulse_n_s < 2 * MASS_KG * speed * 1.02
    away = float(np.linalg.norm(hit.place_m - MICROPHONES[0].position_m))
    assert hit.arrival_s - hit.start_s == pytest.approx(away / log.air.sound_speed_m_s, rel=1e-12)
    sound = stems[0].sound.samples()[0]
    first = int(np.flatnonzero(np.abs(sound) > 1e-3 * np.abs(sound).max())[0])
    # the ball's own middle is a radius nearer
    assert first / log.sr == pytest.approx(hit.arrival_s, abs=RADIUS_M / 343 + 10 / log.sr)
    # the closed form of one strike: it leaves out where within a sample the pulse begins
    assert hit.level_db == pytest.approx(20 * np.log10(np.abs(sound).max() / REFERENCE_PRESSURE_PA), abs=0.5)


def test_a_strike_has_the_approach_of_the_step_that_made_it() -> None:
    """A load that opens softly, as one that a solver spreads over steps, approaches fastest where it is largest."""
    log = run(falling, 0.35)
    observer = EventObserver(log)
    soft = {
        k: _Touch((0.0, 0.0, 0.0), 0.0, 0.0, v, n) for k, (v, n) in enumerate([(-0.1, 1.0), (2.0, 5.0), (3.0, 2.0)])
    }
    observer._known = {k: {(0, 1): touch} for k, touch in soft.items()} | {3: {}, 4: {}}
    assert observer._approach_m_s(0, (0, 1)) == 2.0  # what comes once the load falls is another's
    assert observer._approach_m_s(2, (0, 1)) == 3.0
    assert observer._approach_m_s(0, (0, 2)) == 0.0


@pytest.mark.parametrize(("setup", "kind", "speed"), [(rolling, "roll", 0.5), (sliding, "slide", 0.9)])
def test_what_rolls_rolls_and_what_slides_slides(setup: Any, kind: str, speed: float) -> None:
    log = run(setup, 0.15)
    events, _ = looked(log)
    lasting = [one for one in events if one.kind in ("roll", "slide") and one.end_s - one.start_s > 0.05]
    assert [one.kind for one in lasting] == [kind]
    assert lasting[0].speed_m_s == pytest.approx(speed, rel=0.1)
    assert lasting[0].level_db is not None
    # what it weighs times how long
    mass = max(body.mass_kg for body in log.bodies)
    lasts = lasting[0].end_s - lasting[0].start_s
    assert lasting[0].impulse_n_s == pytest.approx(mass * 9.81 * lasts, rel=0.1)


def test_what_rests_is_silent_and_said_to_carry_weight() -> None:
    log = run(resting, 0.3)
    events, stems = looked(log)
    # two steps of rocking bring it onto the floor, at 3.7 mm/s; what has come to rest is exactly silent (test_silence)
    assert all(stem.sound.peaks().max(initial=0.0) < REFERENCE_PRESSURE_PA for stem in stems)
    heard = [one for one in events if one.level_db is None or one.level_db > 0]
    assert {one.kind for one in heard} == {"support", "uncaused strike"}
    assert {one.reason for one in heard} <= {CARRIES_WEIGHT, NO_CAUSE}
    assert sum(one.end_s - one.start_s for one in events if one.kind == "support") > 0.2
    assert all(one.level_db is None for one in heard)


def test_who_rests_takes_no_memory_for_it() -> None:
    """An hour of rest is one span that grows, and not a record a step."""
    log = run(resting, 1.0)
    observer = EventObserver(log)
    render_stems(log, observer=observer)
    kept = len(observer._seen) + sum(len(runs) for runs in observer._runs.values())
    assert kept < 0.1 * len(log.steps)
    assert sum(one.end_s - one.start_s for one in observer.events() if one.kind == "support") > 0.8


def test_two_bodies_without_a_voice_are_said_to_have_none() -> None:
    def setup(client: Any, listener: sb.Listener) -> None:
        ground = floor(client)
        thing = box(client, (0, 0, 0.005), turn=(0, 0, 0))
        mute = box_model((0.2, 0.1, 0.01), (), WOOD)
        listener.add(ground, material=WOOD, model=mute)
        assert client.getDynamicsInfo(thing, -1)[0] > 0

    events, _ = looked(run(setup, 0.2))
    assert {one.reason for one in events} == {NO_VOICE}


@pytest.mark.slow
def test_events_are_those_that_the_run_time_plays() -> None:
    """Every pulse is in one impact, and no impact has none."""
    log = table_log()
    seen: list[float] = []

    class Counting(EventObserver):
        def __call__(self, state: Any, number: int, step: Any, found: int, drives: int) -> None:
            super().__call__(state, number, step, found, drives)
            seen.extend(np.linalg.norm(state.scratch.pulse["impulse_n_s"][:found], axis=1).tolist())

    observer = Counting(log)
    render_stems(log, observer=observer)
    events = observer.events()
    hits = [one for one in events if one.kind == "impact"]
    assert len(hits) > 5
    assert sum(one.impulse_n_s for one in hits) == pytest.approx(sum(seen), rel=1e-12)
    assert len(hits) <= len(seen)
    assert [one.start_s for one in events] == sorted(one.start_s for one in events)
    assert {one.kind for one in events if one.reason} <= {"support", "uncaused strike"}
    assert all(0 <= one.start_s <= one.end_s <= log.duration_s + 1e-9 for one in events)


def test_looking_changes_no_bit() -> None:
    log = table_log()
    _, watched = looked(log)
    for one, other in zip(watched, render_stems(log), strict=True):
        assert np.array_equal(one.sound.samples(), other.sound.samples())


def test_tables_hold_what_sounds(tmp_path: Path) -> None:
    log = table_log()
    events, _ = looked(log)
    counts = write_events(tmp_path / "events.json", events, log)
    assert counts == write_events(tmp_path / "events.csv", events, log)
    rows = json.loads((tmp_path / "events.json").read_text())["sounding"]
    with (tmp_path / "events.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert list(lines[0]) == list(rows[0]) == list(EVENT_COLUMNS)
    assert len(lines) == len(rows) == sum(counts.values())
    assert Counter(row["kind"] for row in rows) == counts
    assert set(counts) <= {"impact", "roll", "slide"}
    for row, line in zip(rows, lines, strict=True):
        assert [str(row[name]) if row[name] is not None else "" for name in EVENT_COLUMNS] == list(line.values())


def test_cues_stand_where_events_arrive() -> None:
    log = table_log()
    events, _ = looked(log)
    frames = int(log.duration_s * log.sr)
    cues = cues_of(events, log, log.sr, frames)
    sounding = [
        one for one in events if one.kind in ("impact", "roll", "slide") and round(one.arrival_s * log.sr) < frames
    ]
    assert [cue.sample for cue in cues] == [round(one.arrival_s * log.sr) for one in sounding]
    assert all(cue.samples == 0 for cue, one in zip(cues, sounding, strict=True) if one.kind == "impact")
    marble = next(i for i, body in enumerate(log.bodies) if body.name == "marble")
    own = cues_of(events, log, log.sr, frames, marble)
    assert 0 < len(own) < len(cues)
    assert all("marble" in cue.label for cue in own)


@pytest.mark.parametrize("what", ["later and softer", "a neighbour", "another material"])
def test_a_strike_has_the_level_that_it_has_alone(what: str) -> None:
    """Played together with louder ones that ring on, each has the level of a run in which it is alone."""
    soft = {"later and softer": (0.05, 0.02), "a neighbour": (0.06, 0.03), "another material": (0.04, 0.01)}[what]
    hard, other = GLASS, STEEL if what == "another material" else GLASS

    def drop(client: Any, listener: sb.Listener, falls: list[tuple[float, float, Any]]) -> None:
        floor(client)
        for x_m, height_m, material in falls:
            body = ball(client, (x_m, 0, RADIUS_M + height_m), radius=RADIUS_M, mass=MASS_KG)
            listener.add(body, material=material, model=ball_body(RADIUS_M, material).model)

    both = run(lambda c, x: drop(c, x, [(0.0, 0.02, hard), (0.1, 0.08 + soft[0], other)]), 0.3)
    alone = run(lambda c, x: drop(c, x, [(0.1, 0.08 + soft[0], other)]), 0.3)
    mine = [one for one in looked(both)[0] if one.kind == "impact" and one.place_m[0] > 0.05]
    apart = [one for one in looked(alone)[0] if one.kind == "impact"]
    assert len(mine) == len(apart) > 0
    for one, same in zip(mine, apart, strict=True):
        assert one.level_db == pytest.approx(same.level_db, abs=0.01)


def test_a_roll_is_as_loud_as_its_stem() -> None:
    """A body that only rolls: its stem's rms over that time."""
    log, kind = run(rolling, 0.3), "roll"
    events, stems = looked(log)
    (lasting,) = [one for one in events if one.kind == kind and one.end_s - one.start_s > 0.05]
    late = lasting.arrival_s - lasting.start_s
    sound = stems[0].sound.samples()[0][round(lasting.arrival_s * log.sr) : round((lasting.end_s + late) * log.sr)]
    rms_db = 20 * np.log10(np.sqrt(np.mean(sound**2)) / REFERENCE_PRESSURE_PA)
    struck = [one for one in events if one.kind == "impact"]
    assert not struck
    assert lasting.level_db == pytest.approx(rms_db, abs=1.0)


def test_no_event_is_louder_than_what_its_bodies_send() -> None:
    """By more than strikes that cancel what rang before."""
    log = table_log()
    events, stems = looked(log)
    peak = {stem.index: float(stem.sound.peaks()[0]) for stem in stems}
    sounding = [one for one in events if one.level_db is not None]
    assert len(sounding) > 5
    for one in sounding:
        loudest = sum(peak.get(body, 0.0) for body in (one.low, one.high))
        assert one.level_db is not None and one.level_db < 20 * np.log10(loudest / REFERENCE_PRESSURE_PA) + 3
    levels = [round(one.level_db or 0.0, 3) for one in sounding if one.kind == "impact"]
    assert len(set(levels)) == len(levels)  # none repeats its neighbour's


def test_picture_table_and_cues_show_one_list(tmp_path: Path) -> None:
    from sonic_bullet.apps.report.plots.scene_plot import drawn_events

    log = table_log()
    events, _ = looked(log)
    shown = drawn_events(log, events)
    table = write_events(tmp_path / "events.csv", events, log)
    hits = [one for one in events if one.kind == "impact"]
    assert table["impact"] == len(hits)
    assert sorted(set(shown.strike_s.tolist())) == sorted({one.start_s for one in hits})
    assert shown.bar_kind.count("rolls") == sum(
        sum(log.bodies[i].model is not None for i in (one.low, one.high)) for one in events if one.kind == "roll"
    )
