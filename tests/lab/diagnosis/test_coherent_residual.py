"""A mode's line has one phase but for signs, wherever a body is struck; what swings, each strike in its own time, makes
lines that have not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects import Effect
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.room import Room
from sonic_bullet.lab.diagnosis.evidence.baseline import takes_of
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.lab.diagnosis.prediction.score import Score
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.diagnosis.selection import stepwise as loop
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate
from sonic_bullet.lab.diagnosis.selection.coherent_residual import incoherent_fraction, out_of_phase
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.diagnosis.unexplained import describe_unexplained
from sonic_bullet.lab.lines.joint_lines import joint_lines
from tests.few_cases import parametrize_few
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import SR, plate, recorded, struck
from tests.made.problems import posed


def swung(depth: float, rate_hz: float = 9.0) -> StruckBody:
    """The plate turning before its microphone: every strike at another moment of the turn."""
    observed = recorded().recorded
    assert observed is not None and observed.signals is not None
    n, s = observed.signals.shape[1], len(observed.signals)
    turn = np.arange(s)[:, None] * 2.4
    signals = observed.signals * (1 + depth * np.sin(2 * np.pi * rate_hz * np.arange(n) / SR + turn))
    return struck(plate(), joint_lines(signals, SR, band_hz=BAND), signals)


def test_modes_are_in_phase_and_sidebands_are_not() -> None:
    still, turning = recorded(), swung(0.8)
    assert still.recorded is not None and turning.recorded is not None
    assert not out_of_phase(still.recorded.lines).any()
    off = replace(fitted(still), correction={"plate": np.full(18, 1e-3)})
    assert incoherent_fraction(takes_of((still,)), {still: predict(off, still)}) < 0.05
    assert out_of_phase(turning.recorded.lines).any()
    assert incoherent_fraction(takes_of((turning,)), {turning: predict(fitted(turning), turning)}) > 0.7


@parametrize_few(
    "effect",
    [
        ContactTime(2.6e-4, 0.016, -0.2, "hertz"),
        ContactTime(1.5e-4, 0.016, 0.5, "hertz"),
        DampingLaw("constant-loss", 6e-3),
    ],
    (1,),
    ids=["pulse", "pulses of many lengths", "law"],
)
def test_what_leaves_modes_real_leaves_them_in_phase(effect: Effect) -> None:
    """But for a delay a strike: of a pulse it is the middle, and soft blows last longer."""
    body = recorded(effect)
    assert body.recorded is not None
    mine = np.unique(body.line[body.line >= 0])
    assert len(mine) > 8
    assert not out_of_phase(body.recorded.lines)[mine].any()


def test_every_strike_has_as_much_to_say() -> None:
    """A line in phase at the loudest of five, a hundred times as loud, and at no other; all others are in phase."""
    turn = np.exp(1j * np.array([[0.0, 0.0], [2.4, 0.0], [4.8, 0.0], [0.9, 0.0], [3.3, 0.0]]))
    loud = np.array([100.0, 1.0, 1.0, 1.0, 1.0])[:, None]
    observed = recorded().recorded
    assert observed is not None
    amplitude = loud * np.concatenate([turn, np.ones((5, 14))], axis=1)
    count = amplitude.shape[1]
    lines = replace(
        observed.lines,
        freq_hz=np.linspace(300, 7000, count),
        amplitude=amplitude,
        amplitude_sd=1e-6 * np.ones((5, count)),
        signed=True,
    )
    assert out_of_phase(lines).tolist() == [True] + [False] * (count - 1)


def test_phases_are_not_asked_where_no_onset_is_known() -> None:
    turning = swung(0.8).recorded
    assert turning is not None
    assert not out_of_phase(replace(turning.lines, signed=False)).any()


@pytest.mark.slow
@pytest.mark.parametrize(("depth", "verdict"), [(0.0, "none"), (0.8, "unexplained")])
def test_a_swing_is_no_meshs_however_wrong_a_mesh_is(
    monkeypatch: pytest.MonkeyPatch, depth: float, verdict: str
) -> None:
    """Either plate is played 0.1 % too high, and what a mesh may get wrong is without limit: phases alone decide."""
    monkeypatch.setattr(loop, "of_the_mesh", lambda *_: np.inf)
    body = swung(depth)
    off = replace(fitted(body), correction={"plate": np.full(18, 1e-3)})
    monkeypatch.setattr(loop, "refit_material", lambda h, _: h)
    monkeypatch.setattr(loop, "with_unmatched_modes_moved", lambda h, *_: (h, 0.0))
    end = loop.select_effects(off, (body,), takes_of((body,)), (), BAND)
    assert end.before_db - end.floor_db > RULES.suffices_db
    assert end.verdict == verdict
    if depth > 0:
        assert "do not play it" in describe_unexplained(end, takes_of((body,)))["words"]


@parametrize_few(
    ("left_db", "gain_db", "verdict"),
    [(4.5, None, "explained"), (9.0, None, "unexplained"), (4.5, 4.0, "explained"), (9.0, 4.0, "unexplained")],
    (0, 3),
)
def test_a_room_leaves_little_whatever_is_beside_it(
    monkeypatch: pytest.MonkeyPatch, left_db: float, gain_db: float | None, verdict: str
) -> None:
    """Its response takes more than half of a rattle's noise, too; with much left beside it, the other name would be a
    guess, and no mesh is to blame: a response takes up its errors.
    """
    monkeypatch.setattr(loop, "of_the_mesh", lambda *_: np.inf)
    monkeypatch.setattr(loop, "with_unmatched_modes_moved", lambda h, _: (h, 0.0))
    body, room, law = recorded(), Room(0.5, 0.4, 1), DampingLaw("constant-loss", 6e-3)
    named: list[tuple[Effect, float]] = [(room, 10.0)] + ([(law, gain_db)] if gain_db is not None else [])
    h = replace(fitted(body), effects=tuple(e for e, _ in named))
    added = [Candidate(e.id, e, h, np.full(5, gain), gain, 0.0, {}) for e, gain in named]
    problem = posed((body,), takes_of((body,)))
    assert loop._verdict(fitted(body), h, added, 20.0, Score(left_db + 1.0, 1.0), problem)[0] == verdict
    dry = replace(h, effects=(law,))
    assert (
        loop._verdict(fitted(body), dry, added[1:] or added, 20.0, Score(left_db + 1.0, 1.0), problem)[0] == "explained"
    ), "where there is no room, a mesh may be to blame"
