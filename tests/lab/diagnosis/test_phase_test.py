"""Names that spectra in dB cannot tell apart: the phases of lines do, whatever the delay and the gain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects import Effect
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.measurement_chain import MeasurementChain
from sonic_bullet.effects.mode_splitting import ModeSplitting
from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.effects.rebound import Rebound
from sonic_bullet.effects.room import Room
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate
from sonic_bullet.lab.diagnosis.selection.exchange import phases_for
from sonic_bullet.lab.diagnosis.selection.phase_test import misfit
from sonic_bullet.lab.diagnosis.selection.simplest import simplest
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.effects.contact_time import propose_contact_time
from sonic_bullet.lab.effects.searches import propose
from tests.few_cases import parametrize_few
from tests.made.body import recorded, truth

BAND = (50.0, 7_500.0)
PULSE = ContactTime(1.6e-4, 0.016, 0.0, "raised-cosine")
LOW = MeasurementChain(low_pass_hz=5000.0, low_order=2)


def identified_from(effect: Effect) -> list[Candidate]:
    """A pulse and a low-pass as each is found from a recording of one of them, as if strikes spoke for both alike."""
    body = recorded(effect)
    plain = refit_material(truth(), (body,))
    evidence = evidence_of(plain, (body,), BAND)
    made: list[Candidate] = []
    for kind, other in ((ContactTime, PULSE), (MeasurementChain, LOW)):
        found = propose(kind, evidence) or other
        h = refit_material(replace(plain, effects=(found,)), (body,), evidence.observed)
        made.append(Candidate(kind.id, found, h, np.array([2.0, 2.1, 1.9, 2.0, 2.05]), 2.01, 0.0, {}))
    return made


@pytest.mark.slow
@pytest.mark.parametrize("effect", [PULSE, LOW], ids=lambda e: e.id)
def test_a_pulse_and_a_low_pass_are_told_apart(effect: Effect) -> None:
    body = recorded(effect)
    both = identified_from(effect)
    assert both[0].effect.freedom() == both[1].effect.freedom()
    told = evidence_of(truth(), (body,), BAND)
    assert simplest(both, (body,), told).id == effect.id
    assert simplest(both[::-1], (body,), told).id == effect.id


@pytest.mark.slow
@pytest.mark.parametrize("effect", [ContactTime(1.2e-4, 0.016, -0.2, "half-sine"), LOW], ids=lambda e: e.id)
def test_phases_speak_though_every_strike_says_a_little_more_for_the_other(effect: Effect) -> None:
    """A pulse in few samples, or a filter between two, has magnitudes that are off by a little at all strikes alike;
    phases are off by a turn.
    """
    body = recorded(effect)
    both = [replace(c, drop_db=c.drop_db * (0.9 if c.id == effect.id else 1.0)) for c in identified_from(effect)]
    assert (
        simplest(sorted(both, key=lambda c: -c.mean_db), (body,), evidence_of(truth(), (body,), BAND)).id == effect.id
    )


@parametrize_few(
    "effect",
    [Radiation(0.03, 9.0), DampingLaw("relaxation", 5e-3, strength=0.045, tau_s=1.2e-4)],
    ids=lambda e: e.id,
)
def test_of_two_that_only_change_decays_the_decays_tell(effect: Effect) -> None:
    """Strikes say a little more for the other one; the law asks for fewer numbers."""
    body = recorded(effect)
    plain = refit_material(truth(), (body,))
    evidence = evidence_of(plain, (body,), BAND)
    both = []
    for kind, other in (
        (Radiation, Radiation(0.03, 2.0)),
        (DampingLaw, DampingLaw("relaxation", 5e-3, strength=0.045, tau_s=4e-5)),
    ):
        found = propose(kind, evidence) or other
        h = refit_material(replace(plain, effects=(found,)), (body,), evidence.observed)
        both.append(
            Candidate(
                kind.id,
                found,
                h,
                np.array([2.0, 2.1, 1.9, 2.0, 2.05]) * (0.95 if kind.id == effect.id else 1.0),
                2.0,
                0.0,
                {},
            )
        )
    assert simplest(sorted(both, key=lambda c: -c.mean_db), (body,), evidence).id == effect.id


def test_what_lines_alone_have_named_needs_no_strike_to_speak_for_it() -> None:
    """Beside a room: none of the strikes gains by the law, and it is the only one to choose from."""
    one = replace(identified_from(LOW)[1], drop_db=np.array([-0.2, -0.1, 0.0, -0.3, -0.1]), lines=30.0)
    assert simplest([one], (recorded(LOW),), evidence_of(truth(), (recorded(LOW),), BAND)) is one


@pytest.mark.slow
@parametrize_few("exponent", [-0.2, 0.0], 1)
def test_whether_a_pulse_goes_with_the_blow_is_told_by_its_middle(exponent: float) -> None:
    """Of a pulse so short that hardly anything rolls off: longer for a soft blow, or not; and files may begin a little
    late, all alike.
    """
    body = recorded(ContactTime(1.4e-4, 0.016, exponent, "raised-cosine"))
    h = refit_material(truth(), (body,))
    observed = evidence_of(h, (body,), BAND).observed[0]
    late = replace(observed, amplitude=observed.amplitude * np.exp(-2j * np.pi * observed.freq_hz * 1.1e-5))
    for one in (observed, late):
        found = propose_contact_time(replace(evidence_of(h, (body,), BAND), observed=(one,)))
        assert found is not None
        assert found.exponent == exponent
        assert found.tau_s == pytest.approx(1.4e-4, rel=0.2)  # a shorter one of another shape rolls off alike


def test_neither_gain_nor_delay_is_a_misfit() -> None:
    body = recorded(PULSE)
    h = truth(PULSE)
    assert misfit(replace(h, gain=1.7 * h.gain), (body,)) == pytest.approx(misfit(h, (body,)), abs=0.5)
    assert body.recorded is not None
    lines = body.recorded.lines
    late = replace(lines, amplitude=lines.amplitude * np.exp(-2j * np.pi * lines.freq_hz * 1.2e-4))
    moved = replace(body, recorded=replace(body.recorded, lines=late))
    assert misfit(h, (moved,)) == pytest.approx(misfit(h, (body,)), abs=3.0)
    assert misfit(truth(), (body,)) > misfit(h, (body,)) + 20


@pytest.mark.slow
def test_a_name_that_phases_speak_for_is_not_left_for_one_that_strikes_hardly_prefer() -> None:
    """Either way; of two that move modes phases say nothing."""
    for effect in (PULSE, LOW):
        body = recorded(effect)
        pulse, low = (c.hypothesis for c in identified_from(effect))
        own, other = (pulse, low) if effect is PULSE else (low, pulse)
        assert phases_for(own, other, (body,)) > RULES.strong_evidence
        assert phases_for(other, own, (body,)) < -RULES.strong_evidence
        split = replace(own, effects=(*own.effects, ModeSplitting((600.0,), (0.01,), (0.0,))))
        assert phases_for(split, other, (body,)) == 0


@pytest.mark.slow
def test_phases_speak_against_nobody_of_whom_they_say_nothing() -> None:
    """Of several hits they tell nothing, and in a room lines are other lines."""
    train = Rebound(0.0131, 0.016, 0.4, 0.0, 0.4, 3)
    body = recorded(train)
    pulse, hits, room = (refit_material(truth(e), (body,)) for e in (PULSE, train, Room(0.5, 0.3, 3)))
    assert not np.isfinite(misfit(hits, (body,)))
    assert phases_for(pulse, hits, (body,)) == phases_for(hits, pulse, (body,)) == 0
    assert phases_for(pulse, room, (body,)) == phases_for(room, pulse, (body,)) == 0
