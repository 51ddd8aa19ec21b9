"""What a diagnosis that names something still has to say: what is left beside it, and which places are one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects.contact_time import ContactTime
from sonic_bullet.effects.support_damping import SupportDamping
from sonic_bullet.lab.diagnosis.deciding_measurement import _open
from sonic_bullet.lab.diagnosis.prediction.score import Comparable, take_of
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.diagnosis.unexplained import describe_unexplained, indistinct_places, pitch_of_strikes
from tests.lab.diagnosis.test_separating_strike import ended
from tests.made.body import SIDE_M


@pytest.mark.parametrize("left_db", [0.5 * RULES.suffices_db, 5.4])
def test_explained_says_what_is_left_beside_the_name(left_db: float) -> None:
    end = ended(ContactTime(4e-4, 0.02))
    end = replace(end, before_db=12.0, after_db=end.floor_db + left_db)
    told = describe_unexplained(end, end.judged)  # type: ignore[arg-type]
    assert bool(told) == (left_db > RULES.suffices_db)
    if told:
        assert told["left_db"] == pytest.approx(left_db) and told["words"].startswith("5.4 dB beside what is named")


@pytest.mark.parametrize("known", [5, 3, 2, 0])
def test_strength_is_spoken_of_where_impulses_are_known(known: int) -> None:
    """A slope needs three points; levels by ear are the played sound's own, and no impulses."""
    end = ended(ContactTime(4e-4, 0.02))
    (body,) = {take.body for take in end.judged}
    some = np.where(np.arange(body.strikes) < known, body.impulse_n_s, np.nan)
    heard = replace(body, impulse_n_s=some, relative=body.impulse_n_s)
    takes = tuple(replace(take, body=heard) for take in end.judged)
    end = replace(end, verdict="unexplained", judged=Comparable(takes))
    told = describe_unexplained(end, takes)  # type: ignore[arg-type]
    assert ("with the strike" in told["words"]) == (known > 2) == (told["slope_against_impulse"] is not None)
    measured = list(_open(end, told))
    assert known > 2 or not any("strength" in one for one in measured)


def test_places_that_move_alike_are_named_once() -> None:
    a, b = SIDE_M
    place = (5 * a / 22, 4 * b / 14, 0.0)
    image = (a - place[0], b - place[1], 0.0)
    for effect in (SupportDamping((place,), (1.0,)), SupportDamping((place, image), (0.2, 0.8))):
        (told,) = indistinct_places(ended(effect))
        assert f"({image[0]:.3g}, {image[1]:.3g}, 0) m" in told and "divided between them" in told
    assert indistinct_places(ended(SupportDamping(((a / 2, b / 2, 0.0),), (1.0,)))) == []
    assert indistinct_places(ended(ContactTime(4e-4, 0.02))) == []


@pytest.mark.parametrize("drift", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.006, -0.012, 0.004)])
def test_strikes_of_a_pitch_each_are_told_from_strikes_of_one(drift: tuple[float, ...]) -> None:
    rng, sr, modes = np.random.default_rng(4), 16_000, ((410.0, 3.0), (1130.0, 5.0), (2215.0, 9.0), (3650.0, 14.0))
    t = np.arange(sr) / sr
    heard = [
        sum(rng.uniform(0.3, 1) * np.exp(-d * t) * np.sin(2 * np.pi * f * (1 + off) * t) for f, d in modes)
        + 1e-3 * rng.standard_normal(sr)
        for off in drift
    ]
    end = ended(ContactTime(4e-4, 0.02))
    (body,) = {take.body for take in end.judged}
    takes = [take_of(replace(body, recorded=None), 0, np.asarray(x), sr) for x in heard]
    found = pitch_of_strikes(takes)
    if not any(drift):
        assert found is None
    else:
        assert found == pytest.approx(1 + np.array(drift), abs=3e-4)
