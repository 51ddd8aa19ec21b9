"""Names that spectra in dB cannot tell apart: the phases of lines do, whatever the delay and the gain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_body import recorded, truth

from sonic_bullet.diagnosis.evidence import evidence_of
from sonic_bullet.diagnosis.loop import simplest
from sonic_bullet.diagnosis.refit import refitted
from sonic_bullet.diagnosis.ties import misfit
from sonic_bullet.diagnosis.trial import Candidate
from sonic_bullet.effects import Effect
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.measurement_chain import MeasurementChain

BAND = (50.0, 7_500.0)
PULSE = ContactTime(1.6e-4, 0.016, 0.0, "raised-cosine")
LOW = MeasurementChain(low_pass_hz=5000.0, low_order=2)


def told_by(effect: Effect) -> list[Candidate]:
    """A pulse and a low-pass as each is told from a recording of one of them, as if strikes spoke for both alike."""
    body = recorded(effect)
    plain = refitted(truth(), (body,))
    evidence = evidence_of(plain, (body,), BAND)
    made: list[Candidate] = []
    for kind, other in ((ContactTime, PULSE), (MeasurementChain, LOW)):
        found = kind.propose(evidence) or other
        h = refitted(replace(plain, effects=(found,)), (body,), evidence.heard)
        made.append(Candidate(kind.id, found, h, np.array([2.0, 2.1, 1.9, 2.0, 2.05]), 2.01, 0.0, {}))
    return made


@pytest.mark.parametrize("effect", [PULSE, LOW], ids=lambda e: e.id)
def test_a_pulse_and_a_low_pass_are_told_apart(effect: Effect) -> None:
    body = recorded(effect)
    both = told_by(effect)
    assert both[0].effect.freedom() == both[1].effect.freedom()
    assert simplest(both, (body,)).id == effect.id
    assert simplest(both[::-1], (body,)).id == effect.id


def test_neither_gain_nor_delay_is_a_misfit() -> None:
    body = recorded(PULSE)
    h = truth(PULSE)
    assert misfit(replace(h, gain=1.7 * h.gain), (body,)) == pytest.approx(misfit(h, (body,)), abs=0.5)
    assert body.gathered is not None
    lines = body.gathered.lines
    late = replace(lines, amplitude=lines.amplitude * np.exp(-2j * np.pi * lines.freq_hz * 1.2e-4))
    moved = replace(body, gathered=replace(body.gathered, lines=late))
    assert misfit(h, (moved,)) == pytest.approx(misfit(h, (body,)), abs=3.0)
    assert misfit(truth(), (body,)) > misfit(h, (body,)) + 20
