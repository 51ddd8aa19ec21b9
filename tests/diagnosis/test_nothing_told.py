"""Lines that tell nothing are no evidence, and no crash."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from made_body import recorded, truth

from sonic_bullet.diagnosis.evidence import evidence_of
from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.effects.points import solved
from sonic_bullet.effects.radiation import Radiation
from sonic_bullet.effects.support_damping import SupportDamping

BAND = (50.0, 7_500.0)


def test_decays_of_no_line_tell_no_law_and_nothing_that_radiates_or_rubs() -> None:
    """As in a room that drowns all of them."""
    evidence = evidence_of(truth(), (recorded(),), BAND)
    heard = evidence.heard[0]
    drowned = replace(evidence, heard=(replace(heard, decay_sd_per_s=np.full(len(heard.freq_hz), np.inf)),))
    for kind in (DampingLaw, Radiation, SupportDamping):
        assert kind.propose(drowned) is None


def test_least_squares_say_nothing_where_nothing_is_told() -> None:
    y, columns = np.array([1.0, 2.0, 3.0]), np.stack([np.ones(3), np.arange(3.0)], axis=1)
    found, left = solved(y, np.full(3, np.inf), columns)
    assert found.tolist() == [0.0, 0.0]
    assert left.tolist() == [0.0, 0.0, 0.0]
    found, _ = solved(y, np.full(3, 0.1), columns)
    assert np.allclose(found, [1.0, 1.0])
