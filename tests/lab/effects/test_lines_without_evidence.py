"""Lines that tell nothing are no evidence, and no crash."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.effects.support_damping import SupportDamping
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import shapeless
from sonic_bullet.lab.effects.searches import propose
from sonic_bullet.lab.fit.case_fit import CaseFit
from sonic_bullet.signal.robust import fit_nonnegative
from tests.made.body import recorded, truth

BAND = (50.0, 7_500.0)


def test_decays_of_no_line_tell_no_law_and_nothing_that_radiates_or_rubs() -> None:
    """As in a room that drowns all of them."""
    evidence = evidence_of(truth(), (recorded(),), BAND)
    observed = evidence.observed[0]
    drowned = replace(evidence, observed=(replace(observed, decay_sd_per_s=np.full(len(observed.freq_hz), np.inf)),))
    for kind in (DampingLaw, Radiation, SupportDamping):
        assert propose(kind, drowned) is None


def test_least_squares_say_nothing_where_nothing_is_told() -> None:
    y, columns = np.array([1.0, 2.0, 3.0]), np.stack([np.ones(3), np.arange(3.0)], axis=1)
    found, left = fit_nonnegative(y, np.full(3, np.inf), columns)
    assert found.tolist() == [0.0, 0.0]
    assert left.tolist() == [0.0, 0.0, 0.0]
    found, _ = fit_nonnegative(y, np.full(3, 0.1), columns)
    assert np.allclose(found, [1.0, 1.0])


def test_lines_without_a_mesh_are_modes_in_the_order_of_their_undamped_frequencies() -> None:
    """A tone that is gone at once may lie below another and have the higher undamped frequency."""
    mine = recorded().recorded
    assert mine is not None
    decay = mine.lines.decay_per_s.copy()
    freq = mine.lines.freq_hz.copy()
    freq[5], freq[6], decay[5], decay[6] = 1400.0, 1400.3, 270.0, 10.0
    lines = replace(mine.lines, freq_hz=freq, decay_per_s=decay)
    found = cast(CaseFit, SimpleNamespace(case=SimpleNamespace(recordings=mine.recordings, band_hz=BAND)))
    body = shapeless(found, replace(mine, lines=lines))
    assert (np.diff(body.model.freq_hz) > 0).all()
    assert 2 * np.pi * body.model.freq_hz == pytest.approx(np.hypot(2 * np.pi * freq, decay)[body.line])
