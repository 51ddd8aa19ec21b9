"""What rings beside the body, once it is named, is nobody else's evidence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.effects.foreign_mode import ForeignMode
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import _nearest, evidence_of, find_resonator_lines
from sonic_bullet.lab.diagnosis.prediction.prediction import predict
from sonic_bullet.lab.effects.foreign_mode import _alone, propose_foreign_mode
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import recorded, truth

STAND = ForeignMode((790.0, 2310.0), (12.0, 30.0), (1.0, 0.8), (0.3, -1.0))
OTHER = ForeignMode((4000.0,), (15.0,), (1.0,), (0.0,))


def test_lines_that_are_named_are_no_other_effects() -> None:
    body = recorded(STAND, OTHER)
    before, after = (
        evidence_of(replace(fitted(body), effects=effects), (body,), BAND).observed[0] for effects in ((), (STAND,))
    )

    def near(freq_hz: np.ndarray, effect: ForeignMode) -> list[bool]:
        return [bool((np.abs(freq_hz / f - 1) < 1e-3).any()) for f in effect.freq_hz]

    assert near(before.foreign_hz, STAND) == [True, True]
    assert near(after.foreign_hz, STAND) == [False, False]
    assert near(before.foreign_hz, OTHER) == near(after.foreign_hz, OTHER) == [True], (
        "what nobody has named is still to be told"
    )
    assert (after.freq_hz == before.freq_hz).all()
    again = propose_foreign_mode(evidence_of(replace(fitted(body), effects=(STAND,)), (body,), BAND))
    assert again is not None and near(np.array(again.freq_hz), STAND) == [False, False]


def test_nor_are_they_paired_with_modes_that_an_effect_has_moved() -> None:
    """Modes are paired anew there, with every line that is near."""
    body = recorded()
    assert body.recorded is not None
    p = predict(truth(), body)
    every = _nearest(p, np.zeros(len(body.recorded.lines.freq_hz), bool))[0]
    k = int(every[3])
    rest = _nearest(p, np.arange(len(body.recorded.lines.freq_hz)) == k)[0]
    assert k not in rest and set(rest) == set(every) - {k}


def test_a_line_of_another_decay_is_not_named() -> None:
    body = recorded(STAND)
    assert body.recorded is not None
    lines = body.recorded.lines
    k = int(np.argmin(np.abs(lines.freq_hz - 790.0)))
    short = replace(lines, decay_per_s=np.where(np.arange(len(lines.freq_hz)) == k, 60.0, lines.decay_per_s))
    h = replace(fitted(body), effects=(STAND,))
    assert find_resonator_lines(h, lines)[k] and not find_resonator_lines(h, short)[k]
    assert not find_resonator_lines(fitted(body), lines).any()


def test_in_a_room_a_line_is_suppressed_by_one_that_stands_not_by_one_that_fell() -> None:
    """840 Hz stands for 770, which is within a short frame's width of it; 700 is not, and stands for itself."""
    freq = np.array([700.0, 770.0, 840.0, 2000.0])
    assert _alone(freq, np.array([0.8, 0.9, 1.0, 0.1])).tolist() == [True, False, True, True]
    assert _alone(freq, np.array([0.8, 1.0, 0.9, 0.1])).tolist() == [False, True, False, True]
    assert _alone(freq[:0], freq[:0]).tolist() == []
