"""What the study of simulated and recorded sounds sees: falls of bands, lines, cuts, and shares of bodies."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.records import Array
from studies.sim_to_real.__main__ import balanced, body_shares, heard
from studies.sim_to_real.features import (
    BANDS,
    HOP_S,
    SR,
    cut_at_random,
    decays_of,
    lines_of,
    losses_of,
    picture_of,
    ringing_of,
)


def ringing(freq_hz: float, t60_s: float, seconds: float = 1.5) -> Array:
    at_s = np.arange(round(seconds * SR)) / SR
    return np.asarray(np.sin(2 * np.pi * freq_hz * at_s) * np.exp(-np.log(1000) / t60_s * at_s))


@pytest.mark.parametrize("t60_s", [0.3, 1.0])
@pytest.mark.parametrize("seconds", [0.3, 1.5])
def test_a_fall_is_sixty_db_over_t60_and_no_matter_where_the_take_ends(t60_s: float, seconds: float) -> None:
    picture = picture_of(ringing(1000.0, t60_s, seconds), SR)
    band = int(picture[:, 0].argmax())
    fall_db_s = 10 ** decays_of(picture)[-BANDS:][band] / HOP_S
    assert fall_db_s == pytest.approx(60 / t60_s, rel=0.15)


def test_lines_are_counted_and_the_lowest_is_found() -> None:
    sound = sum(ringing(freq_hz, 1.0) for freq_hz in (400.0, 1100.0, 3000.0))
    lines = lines_of(np.asarray(sound), SR)
    assert lines[:3].tolist() == [3, 3, 3]
    assert np.exp(lines[5]) == pytest.approx(400, abs=2)


@pytest.mark.parametrize(("loss", "freq_hz"), [(1e-3, 6000.0), (5e-3, 1500.0), (0.02, 400.0)])
@pytest.mark.parametrize("seconds", [0.5, 1.5])
def test_a_line_has_its_loss_wherever_the_take_ends(loss: float, freq_hz: float, seconds: float) -> None:
    sound = ringing(freq_hz, 2.2 / (loss * freq_hz), seconds)
    heard = sound + 1e-5 * np.random.default_rng(1).normal(size=len(sound))
    freq, level, found, _ = ringing_of(heard, SR)
    assert level[0] == 0 and freq[0] == pytest.approx(freq_hz, abs=2.5)
    assert found[0] == pytest.approx(loss, rel=0.15)
    assert losses_of(heard, SR)[5] == pytest.approx(np.log10(loss), abs=0.06)


def test_what_rings_not_has_no_loss_and_no_lines() -> None:
    thud = np.zeros(SR)
    thud[100] = 1.0
    found = losses_of(thud + 1e-9 * np.random.default_rng(1).normal(size=SR), SR)
    assert len(found) == 31 and np.isfinite(found[-1])


def test_cuts_lie_behind_the_peak_and_differ() -> None:
    sound = ringing(500.0, 1.0, 3.0)
    lengths = {len(cut_at_random(sound, SR, seed)) for seed in range(50)}
    assert min(lengths) >= 0.25 * SR and len(lengths) == 50 and max(lengths) > 1.5 * SR


def test_bodies_count_alike_within_their_class() -> None:
    takes = [(ringing(800.0, 0.5), SR, of, name) for of, name in (("metal", "a"), ("metal", "a"), ("metal", "b"))]
    shares = body_shares(np.array(["metal", "wood", "metal"]), heard(takes))
    assert shares["metal"].tolist() == [0.5, 1.0] and balanced(shares) == 0.75
