"""A mode's line has one phase but for signs, wherever a body is struck; what swings, each strike in its own time, makes lines that have not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_body import SR, plate, recorded, struck
from test_found_again import BAND, fitted

from sonic_bullet.diagnosis import loop
from sonic_bullet.diagnosis.baseline import takes_of
from sonic_bullet.diagnosis.bodies import Struck
from sonic_bullet.diagnosis.in_phase import of_no_body, out_of_phase
from sonic_bullet.diagnosis.unexplained import remainder
from sonic_bullet.effects.room import Room
from sonic_bullet.estimator.lines import joint_lines


def swung(depth: float, rate_hz: float = 9.0) -> Struck:
    """The plate turning before its microphone: every strike at another moment of the turn."""
    heard = recorded().gathered
    assert heard is not None and heard.signals is not None
    n, s = heard.signals.shape[1], len(heard.signals)
    turn = np.arange(s)[:, None] * 2.4
    signals = heard.signals * (1 + depth * np.sin(2 * np.pi * rate_hz * np.arange(n) / SR + turn))
    return struck(plate(), joint_lines(signals, SR, band_hz=BAND), signals)


def test_modes_are_in_phase_and_sidebands_are_not() -> None:
    still, turning = recorded(), swung(0.8)
    assert still.gathered is not None and turning.gathered is not None
    assert not out_of_phase(still.gathered.lines).any()
    assert of_no_body(takes_of((still,))) == 0
    assert out_of_phase(turning.gathered.lines).any()
    assert of_no_body(takes_of((turning,))) > 2


def test_phases_are_not_asked_where_no_onset_is_known() -> None:
    turning = swung(0.8).gathered
    assert turning is not None
    assert not out_of_phase(replace(turning.lines, signed=False)).any()


@pytest.mark.parametrize(("depth", "verdict"), [(0.0, "none"), (0.8, "unexplained")])
def test_a_swing_is_no_meshs_however_wrong_a_mesh_is(monkeypatch: pytest.MonkeyPatch, depth: float, verdict: str) -> None:
    """Either plate is played 0.8 % too high, and what a mesh may get wrong is without limit: phases alone decide."""
    monkeypatch.setattr(loop, "of_the_mesh", lambda *_: np.inf)
    body = swung(depth)
    off = replace(fitted(body), correction={"plate": np.full(18, 0.008)})
    monkeypatch.setattr(loop, "refitted", lambda h, _: h)
    monkeypatch.setattr(loop, "beyond", lambda h, _: (h, 0.0))
    end = loop.closed(off, (body,), takes_of((body,)), (), BAND)
    assert end.before_db - end.floor_db > loop.SUFFICES_DB
    assert end.verdict == verdict
    told = remainder(end, takes_of((body,)))
    assert ("phase differs from strike to strike" in told.get("words", "")) == (depth > 0)


@pytest.mark.parametrize(("left_db", "verdict"), [(5.0, "explained"), (9.0, "unexplained")])
def test_a_room_leaves_little(monkeypatch: pytest.MonkeyPatch, left_db: float, verdict: str) -> None:
    """Its response takes more than half of a rattle's noise, too."""
    monkeypatch.setattr(loop, "of_the_mesh", lambda *_: 0.0)
    body = recorded()
    h = replace(fitted(body), effects=(Room(0.5, 0.4, 1),))
    assert loop._verdict(h, [None], 20.0, left_db + 1.0, 1.0, (body,), takes_of((body,)), 0) == verdict  # type: ignore[list-item]
