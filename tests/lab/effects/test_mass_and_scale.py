"""A mass that has bent the first fit of E/ρ is found along with the scale it should have been."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material, with_effects
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation, mean_db, predict_takes
from sonic_bullet.lab.effects import added_mass
from sonic_bullet.lab.effects.added_mass import _in_place, propose_added_mass
from sonic_bullet.lab.effects.common.line_assignment import Assignment
from sonic_bullet.signal.log_spectral import floor_between
from tests.made.body import SR, plate, recorded, truth

BAND = (50.0, 7_500.0)
MASS = AddedMass((0.0477, 0.0371, 0.0), 0.03)


@pytest.mark.slow
def test_a_mass_is_found_beside_the_wrong_elasticity(monkeypatch: pytest.MonkeyPatch) -> None:
    """All of the baseline's modes 10 % low: E/ρ, fitted to what the mass had lowered, went 19 % wrong."""
    monkeypatch.setattr(added_mass, "POINTS", 30)  # of a plate with 18 modes: a start within a wavelength of each
    low = 0.9
    body = recorded(MASS)
    assert body.recorded is not None and body.recorded.signals is not None
    off = replace(
        body, model=replace(body.model, freq_hz=low * body.model.freq_hz), line=np.full(body.model.mode_count, -1)
    )
    base = truth()
    found = propose_added_mass(evidence_of(base, (off,), BAND))
    assert found is not None
    assert found.mass_kg == pytest.approx(0.03, rel=0.1)
    assert found.stretch == pytest.approx(-np.log(low), abs=2e-3)
    h = refit_material(replace(base, effects=(found,)), (off,))
    assert h.stretch == pytest.approx(-np.log(low), abs=2e-3)
    floor = floor_between(list(body.recorded.signals))
    takes = [AudioObservation(off, i, x, SR, floor) for i, x in zip(body.fitted, body.recorded.signals, strict=True)]
    assert mean_db(takes, predict_takes(h, takes)) < 0.3 * mean_db(takes, predict_takes(base, takes))
    again = propose_added_mass(replace(evidence_of(base, (off,), BAND), known=found))
    assert again is not None and again.position_m == found.position_m
    assert (again.mass_kg, again.stretch) == pytest.approx((found.mass_kg, found.stretch), rel=0.02, abs=2e-3)


def test_a_stiffer_body_yields_less_and_all_its_loaded_modes_are_as_much_higher() -> None:
    x = plate()
    high = replace(x, freq_hz=1.2 * x.freq_hz)
    slow, fast = (
        replace(MASS, yield_m_n=(2e-8, 1e-8)).apply(x),
        replace(MASS, yield_m_n=(2e-8 / 1.44, 1e-8 / 1.44)).apply(high),
    )
    assert np.allclose(fast.freq_hz, 1.2 * slow.freq_hz, rtol=1e-9)


def test_no_mass_is_told_where_only_the_scale_is_wrong() -> None:
    body = recorded()
    off = replace(
        body, model=replace(body.model, freq_hz=0.93 * body.model.freq_hz), line=np.full(body.model.mode_count, -1)
    )
    assert propose_added_mass(evidence_of(truth(), (off,), BAND)) is None


def test_without_what_moved_modes_the_baselines_corrections_are_back() -> None:
    body = recorded(MASS)
    h = refit_material(truth(MASS), (body,))
    pulse = ContactTime(1e-4, 0.02)
    bare = with_effects(replace(h, stretch=0.1), (pulse,), (body,))
    assert bare.stretch == 0.0 and bare.effects == (pulse,)
    assert bare.correction is not None and (bare.correction["plate"] == body.correction).all()
    assert with_effects(replace(h, stretch=0.1), (MASS, pulse), (body,)).stretch == 0.1


def test_no_mass_is_looked_for_where_most_of_what_sounds_is_in_place() -> None:
    """Pitch that glides splits loud lines in many; that pairs better with other modes says nothing of a mass."""
    mode = np.geomspace(300.0, 5000.0, 16)
    line = mode.copy()
    line[::2] *= 1.02
    row = np.arange(16)
    loud = np.where(row % 2, 2.0, 1.0)[None, :]
    pairs = Assignment(row, row, 0.0)
    assert _in_place(line, loud, mode, pairs, 0.0)
    assert not _in_place(line, 1 / loud, mode, pairs, 0.0)
    assert _in_place(mode * 1.001, loud, mode, pairs, 0.0)


def test_of_twins_one_stays_under_a_mass() -> None:
    """A point mass on a ring: of each pair one mode has its node there, and half of all that sounds is where it was."""
    pair = np.geomspace(300.0, 5000.0, 8)
    mode = np.sort(np.concatenate([pair, pair * (1 + 1e-6)]))
    line = np.sort(np.concatenate([pair, pair * 0.97]))
    row, column = np.arange(16), np.repeat(np.arange(0, 16, 2), 2)
    loud = np.where(np.isin(line, pair), 2.0, 1.0)[None, :]
    pairs = Assignment(row, column, 0.0)
    assert not _in_place(line, loud, mode, pairs, 0.0)
    # no twins: whatever made those lines left the louder half alone
    apart = np.sort(np.concatenate([pair, pair * 1.02]))
    assert _in_place(line, loud, apart, pairs, 0.0)
