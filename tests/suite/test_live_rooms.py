"""A session in a room as it is: its hum goes on from take to take, its cases declare no onset."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

from benchmarks.suite import cases, live_rooms, objects, plans
from benchmarks.suite.cases import Plan, make_case
from benchmarks.suite.tables import by_room
from sonic_bullet.files.cases import read_case

RATE = 16_000


def test_hum_is_one_for_all_takes_and_the_levels_are_as_drawn() -> None:
    room = live_rooms.drawn(np.random.default_rng(2), RATE, 4, 0.5)
    for which in range(4):
        hum = room.hum(4 * RATE, which)
        t = room.begin_s[which] + np.arange(len(hum)) / RATE
        first = 2 * np.mean(hum * np.exp(-2j * np.pi * room.hum_hz * t))
        assert np.abs(first) == pytest.approx(room.hum_amplitude[0], rel=0.03)
        assert np.angle(first * np.exp(-1j * room.hum_phase[0])) == pytest.approx(0.0, abs=0.05)
    rms = np.sqrt((room.hum_amplitude**2).sum() / 2)
    assert all(45 <= -20 * np.log10(x / 0.5) <= 60 for x in (rms, room.floor_rms))
    assert room.floor(np.random.default_rng(1), 4 * RATE).std() == pytest.approx(room.floor_rms, rel=0.1)


def test_recorded_quiet_is_the_floor(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    quiet = 1e-3 * np.sin(2 * np.pi * 700 * np.arange(3 * RATE) / RATE) + 1e-3 * rng.standard_normal(3 * RATE)
    loud = np.exp(-np.arange(RATE) / 2000) * rng.standard_normal(RATE)
    soundfile.write(tmp_path / "take.wav", np.concatenate([quiet, 0.3 * loud]), RATE, subtype="FLOAT")
    (stretch,) = live_rooms.quiet_stretches(tmp_path, RATE)
    assert 2.5 * RATE < len(stretch) <= 3 * RATE
    room = live_rooms.drawn(np.random.default_rng(2), RATE, 2, 0.5, tmp_path)
    floor = room.floor(np.random.default_rng(1), 4 * RATE)
    assert floor.std() == pytest.approx(room.floor_rms, rel=0.1)
    power = np.abs(np.fft.rfft(floor)) ** 2
    assert 695 < np.argmax(power) / 4 < 705


def test_a_live_case_declares_no_onset_and_every_second_no_impulse(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    bar = objects.Recipe("small", "steel", (10, 2, 1), lambda u: (u - 0.5) * np.array([0.16, 0.02, 0.008]))
    monkeypatch.setitem(cases.RECIPES, "small", bar)
    plan = Plan("one-live", "small", (), 3, seconds=0.5, live=True, impulses=False)
    truth = make_case(tmp_path, plan, tmp_path / "modes")
    case = read_case(tmp_path / "one-live")
    assert case.onset_s is None
    assert all(r.impulse_n_s is None and r.position_m is not None for r in case.recordings)
    for r, lead in zip(case.recordings, truth["live_room"]["lead_s"], strict=True):
        sound, rate = soundfile.read(str(r.file))
        start = round(lead * rate)
        assert len(sound) == start + round(0.5 * rate)
        assert np.abs(sound[:start]).max() < 0.2 * np.abs(sound).max()


def test_half_of_a_draw_is_live_and_the_report_tells_them_apart() -> None:
    for kind in plans.kinds(7)[:4]:
        assert sum(p.live for p in kind) == len(kind) // 2
        assert all(p.live == p.name.endswith("-live") for p in kind)
    assert 0 < sum(p.live for p in plans.quick(7)) < 20
    assert {p.impulses for p in plans.whole(7) if p.live} == {True, False}
    row = {"verdict": "none", "cpu_s": 30.0, "true": [], "found": []}
    named = {"verdict": "explained", "true": ["room"], "found": ["room"], "case": "single-room-weak-0-live"}
    gap = {"errors": {"before": {"holdout": 9.0}, "after": {"holdout": 3.0}, "floor": 1.0}}
    made = [
        row | {"case": "null-00"},
        row | {"case": "null-01-live", "verdict": "unexplained", "cpu_s": 50.0},
        row | named | gap,
    ]
    live, still = by_room(json.loads(json.dumps(made))).splitlines()[1:]
    assert "null 0/1" in live and "single 1/1" in live and "0.75, 0.75" in live and "50 s" in live
    assert "null 1/1" in still and "30 s" in still
