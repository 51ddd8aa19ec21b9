"""Two effects at once: what hides each other one by one is found together, and one effect is not found as two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects import Effect
from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.measurement_chain import MeasurementChain
from sonic_bullet.effects.room import Room
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation
from sonic_bullet.lab.diagnosis.selection import pairwise as pairs
from sonic_bullet.lab.diagnosis.selection.acceptance import Candidate
from sonic_bullet.lab.diagnosis.selection.pairwise import in_a_room, pairwise
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.effects.room import propose_room
from sonic_bullet.lab.effects.searches import propose
from sonic_bullet.signal.log_spectral import floor_between
from tests.made.body import SR, recorded, truth
from tests.made.problems import posed

BAND = (50.0, 7_500.0)
PULSE = ContactTime(3e-4, 0.016, -0.2)
LAW = DampingLaw("power", 0.02, exponent=0.3)
ROOM = Room(1.2, 0.8, seed=4)
MASS = AddedMass((0.0477, 0.0371, 0.0), 0.06)


def tried(
    *effects: Effect, kinds: tuple[type[Effect], ...]
) -> tuple[list[Candidate], tuple[Hypothesis, list[Candidate]] | None]:
    """A first round of candidates that were not cross-validated, and what two at once make of them."""
    body = recorded(*effects)
    assert body.recorded is not None and body.recorded.signals is not None
    floor = floor_between(list(body.recorded.signals))
    takes = [AudioObservation(body, i, x, SR, floor) for i, x in zip(body.fitted, body.recorded.signals, strict=True)]
    start = refit_material(truth(), (body,))
    told = evidence_of(start, (body,), BAND)
    first = []
    for kind in kinds:
        found = propose(kind, told)
        if found is not None:
            h = refit_material(replace(start, effects=(found,)), (body,), told.observed)
            first.append(Candidate(kind.id, found, h, np.zeros(len(takes)), 0.0, 0.0, {}))
    return first, pairwise(start, first, posed((body,), takes))


@pytest.mark.slow
def test_a_law_and_a_pulse_are_found_at_once_whatever_each_says_alone() -> None:
    """None of the first round's drops are looked at: they are zero here; and the pulse is not taken for the filter,
    which phases tell from it.
    """
    first, two = tried(PULSE, LAW, kinds=(DampingLaw, ContactTime, MeasurementChain))
    assert len(first) == 3
    assert two is not None
    h, added = two
    assert {c.id for c in added} == {"damping-law", "contact-time"} == {e.id for e in h.effects}
    assert all(c.mean_db > 1.0 for c in added)
    found = {e.id: e.parameters() for e in h.effects}
    assert found["contact-time"]["tau_s"] == pytest.approx(3e-4, rel=0.05)


@pytest.mark.slow
def test_one_effect_is_not_found_as_two() -> None:
    first, two = tried(PULSE, kinds=(ContactTime, MeasurementChain, DampingLaw))
    assert first
    assert two is None


def test_one_candidate_alone_makes_no_pair() -> None:
    first, two = tried(PULSE, kinds=(ContactTime,))
    assert len(first) == 1
    assert two is None


def room_anew(planted: tuple[Effect, ...], candidate: Effect) -> tuple[Hypothesis, list[Candidate]] | None:
    """What a room identified anew beside a candidate that moves modes comes to, where the room was found
    first, alone.
    """
    body = recorded(*planted)
    assert body.recorded is not None and body.recorded.signals is not None
    floor = floor_between(list(body.recorded.signals))
    takes = [AudioObservation(body, i, x, SR, floor) for i, x in zip(body.fitted, body.recorded.signals, strict=True)]
    start = refit_material(truth(), (body,))
    told = evidence_of(start, (body,), BAND)
    room = propose_room(told)
    assert room is not None
    h = refit_material(replace(start, effects=(room,)), (body,), told.observed)
    found = [Candidate(candidate.id, candidate, h, np.zeros(len(takes)), 0.0, 0.0, {})]
    return in_a_room(h, found, posed((body,), takes))


@pytest.mark.slow
def test_a_mass_in_a_room_is_heard_with_a_response_of_its_own() -> None:
    """The room found alone plays what the wrong modes lack: with that response the mass made everything worse."""
    two = room_anew((MASS, ROOM), MASS)
    assert two is not None
    h, added = two
    assert {c.id for c in added} == {"added-mass", "room"} == {e.id for e in h.effects}
    assert all(c.mean_db > 1.0 for c in added)
    found = next(e for e in h.effects if isinstance(e, AddedMass))
    assert found.mass_kg == pytest.approx(MASS.mass_kg, rel=0.3)


@pytest.mark.slow
def test_a_room_alone_needs_no_mass(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor by cross-validation alone, were any two that leave less than all let through to it: the room identified again
    without the mass says more.
    """
    assert room_anew((ROOM,), MASS) is None
    monkeypatch.setattr(pairs, "RULES", replace(RULES, little_share=1.0, most_share=1.0))
    assert room_anew((ROOM,), MASS) is None


@pytest.mark.slow
def test_what_moves_no_modes_is_not_tried_so() -> None:
    assert room_anew((PULSE, ROOM), PULSE) is None
