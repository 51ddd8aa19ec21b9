"""Strikes that bounce: how often and how hard is told by all strikes at once, and lines are what is left once it is
over.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.effects import Effect
from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.effects.protocol import Impact
from sonic_bullet.effects.rebound import Rebound
from sonic_bullet.effects.room import Room
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import evidence_of
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.effects.rebound import SAID_BY_SECOND_HIT, _of_all, _sum_hits, propose_rebound
from sonic_bullet.lab.effects.rebound.later_hits import second_hit, third_hit
from sonic_bullet.lab.lines import joint_lines as line_fit
from sonic_bullet.lab.lines.line_values import struck_lines
from tests.few_cases import parametrize_few
from tests.lab.diagnosis.test_found_again import BAND, fitted
from tests.made.body import SR, recorded


@pytest.mark.slow
@parametrize_few("hits", [2, 3, 8], (1,))
def test_restitution_gap_and_hits_are_told(hits: int) -> None:
    """A train cut short is not a longer one of less restitution."""
    true = Rebound(0.0131, 0.016, 0.6, 0.0, 0.6, hits)
    body = recorded(true)
    found = propose_rebound(evidence_of(refit_material(fitted(body), (body,)), (body,), BAND))
    assert found is not None
    assert found.restitution == pytest.approx(0.6, rel=0.03)
    assert found.gap_s == pytest.approx(0.0131, abs=0.2 / SR)
    share = 0.6 ** np.arange(found.hits)
    # what is weaker than the model's own error is not counted
    assert (share[hits:] < 0.14).all() and found.hits >= min(hits, 4)


@pytest.mark.slow
@parametrize_few("exponent", [0.0, 0.5, 1.0, -0.2], 1)
def test_all_strikes_at_once_tell_a_second_hit(exponent: float) -> None:
    """Its gap, and how that goes with strength, whatever delays each strike alone would be as content with."""
    body = recorded(Rebound(0.0197, 0.016, 0.25, exponent, 0.25, 2))
    observed = evidence_of(refit_material(fitted(body), (body,)), (body,), BAND).observed[0]
    said, gap, told = max(second_hit(observed, observed.impulse_n_s / 0.016))
    assert told == exponent and said > SAID_BY_SECOND_HIT
    assert gap == pytest.approx(0.0197, abs=1.5 / SR)
    found = _of_all(observed)
    assert found is not None and found.hits == 2
    assert found.restitution == pytest.approx(0.25, rel=0.05)


@parametrize_few("lacks", [(), (AmplitudePitch(0.02, "velocity"),), (Room(0.9, 0.8, 11),)], 1)
def test_all_strikes_at_once_tell_no_hit_that_is_not_there(lacks: tuple[Effect, ...]) -> None:
    body = recorded(*lacks)
    assert _of_all(evidence_of(refit_material(fitted(body), (body,)), (body,), BAND).observed[0]) is None


@pytest.mark.slow
def test_strikes_of_one_strength_tell_no_hit_from_what_beats() -> None:
    """All exponents say the same of them, known strengths or none."""
    body = recorded(Rebound(0.0197, 0.016, 0.25, 0.0, 0.25, 2))
    observed = evidence_of(refit_material(fitted(body), (body,)), (body,), BAND).observed[0]
    assert _of_all(observed) is not None
    for level in (np.full(len(observed.impulse_n_s), 0.016), np.full(len(observed.impulse_n_s), np.nan)):
        assert _of_all(replace(observed, impulse_n_s=level)) is None


@parametrize_few("e", [0.31, 0.437, 0.72], (1,))
def test_a_restitution_between_the_tried_ones_is_found_by_the_third_hits_phases(e: float) -> None:
    n, gap = 6_000, np.array([0.0131, 0.0262])
    t = np.arange(n) / SR
    sound = sum(
        a * np.exp(-20 * t) * np.cos(2 * np.pi * f * t) for f, a in ((1_130.0, 1.0), (2_710.0, 0.8), (3_890.0, 0.6))
    )
    x = np.stack([sound, 2 * sound])
    freq, hit = np.fft.rfftfreq(2 * n, 1 / SR), np.fft.rfft(x, 2 * n)
    late = np.stack([np.zeros(2), gap, gap * (1 + e)], axis=1)
    y = sum(hit * share * np.exp(-2j * np.pi * freq * late[:, k, None]) for k, share in enumerate((1, e, e * e)))
    found = third_hit(gap, np.conj(hit) * y, np.abs(hit) ** 2 + 0j, (np.abs(y) ** 2).sum(axis=1), SR, 0.0)
    assert found == pytest.approx(e, abs=0.25 / 3_890 / gap.max())


@pytest.mark.slow
def test_long_gaps_that_hardly_shrink() -> None:
    """Hits that ring on beyond what is looked at count for what is inside: to 0.1 % by the lines of single hits."""
    body, single = recorded(Rebound(0.15, 0.016, 0.6, 0.0, 0.9, 4)), recorded()
    evidence = evidence_of(refit_material(fitted(single), (single,)), (single,), BAND)
    bounced = evidence_of(refit_material(fitted(body), (body,)), (body,), BAND).observed[0]
    found = propose_rebound(replace(evidence, observed=(replace(evidence.observed[0], signal=bounced.signal),)))
    assert found is not None and found.shrink is not None
    assert found.restitution == pytest.approx(0.6, rel=1e-3)
    assert found.shrink == pytest.approx(0.9, rel=1e-3)


def test_a_bounce_that_is_not_there_is_not_found_again() -> None:
    body = recorded()
    told = evidence_of(refit_material(fitted(body), (body,)), (body,), BAND)
    assert propose_rebound(replace(told, known=Rebound(0.2, 0.016, 0.6, 0.0, 1.0, 8))) is None


@pytest.mark.slow
def test_lines_of_a_bouncing_strike_are_no_louder_than_the_strike(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hits that come after the onset take lines that would have begun far above it; they are none, and the modes are
    told once all is over.
    """
    monkeypatch.setattr(line_fit, "CROWD_RATIO", np.inf)  # too few to be a crowd
    rng = np.random.default_rng(3)
    freq, t = np.array([952.0, 1310.0, 2093.0, 2740.0, 4095.0, 5410.0]), np.arange(2 * SR) / SR
    decay = 5 + 1.17e-7 * (2 * np.pi * freq) ** 2
    signals = []
    for impulse in (0.005, 0.01, 0.02, 0.03, 0.04):
        size, out = rng.uniform(0.3, 1.0, len(freq)) * impulse, np.zeros(len(t))
        for share, delay in ((1.0, 0.0), (0.25, 0.855 * impulse), (0.06, 1.06 * impulse)):
            late = np.maximum(t - delay, 0)
            out += share * (
                (t >= delay) * (size @ (np.exp(-decay[:, None] * late) * np.sin(2 * np.pi * freq[:, None] * late)))
            )
        signals.append(out + 2e-6 * rng.standard_normal(len(t)))
    found = line_fit.joint_lines(np.stack(signals), SR, band_hz=(50.0, 7_500.0), modes=8)
    assert len(found.freq_hz) < 2 * len(freq)
    assert (np.abs(found.amplitude) < 10 * np.abs(np.stack(signals)).max(axis=1, keepdims=True)).all()
    for f, d in zip(freq[:-1], decay[:-1], strict=True):  # the last has died away before the last strike's last hit
        near = int(np.argmin(np.abs(found.freq_hz - f)))
        assert found.freq_hz[near] == pytest.approx(f, rel=1e-4)
        assert found.decay_per_s[near] == pytest.approx(d, rel=0.02)


@pytest.mark.slow
def test_what_began_late_is_not_taken_back_to_the_onset(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines told once a crowd is over: one that would have died long before is a late burst's, and at the onset it
    would have been louder than anything.
    """
    monkeypatch.setattr(line_fit, "CROWD_RATIO", 0.0)
    monkeypatch.setattr(line_fit, "LATE_LINES_SHARE", np.inf)
    t = np.arange(2 * SR) / SR
    freq, late = np.array([952.0, 2093.0, 4095.0]), line_fit.LATE_S[0]
    ring = np.exp(-np.array([[6.0], [11.0], [20.0]]) * t) * np.sin(2 * np.pi * freq[:, None] * t)
    burst = (t >= late) * np.exp(-900 * np.maximum(t - late, 0)) * np.sin(2 * np.pi * 3000 * t)
    rng = np.random.default_rng(4)
    signals = np.stack(
        [size @ ring + 0.05 * burst + 1e-5 * rng.standard_normal(len(t)) for size in rng.uniform(0.05, 0.2, (4, 3))]
    )
    found = line_fit.joint_lines(signals, SR, band_hz=(50.0, 7_500.0), modes=3)
    assert found.freq_hz == pytest.approx(freq, rel=1e-4)
    assert (np.abs(found.amplitude) < 1).all()


def test_turns_in_half_the_digits_are_the_sum_of_the_hits() -> None:
    """At a quarter of a second and 20 kHz a phase is 31 000 radians: whole turns go before digits do."""
    freq = np.linspace(20.0, 20_000.0, 3001)
    impact = Impact(0.02, np.array([0.0, 0.011, 0.02, 0.25]), np.array([1.0, 0.7, 0.5, 0.3]))
    want = (impact.share[:, None] * np.exp(-(8.0 + 2j * np.pi * freq) * impact.delay_s[:, None])).sum(axis=0)
    assert np.abs(_sum_hits(impact, freq, 8.0) - want).max() < 1e-6


def test_no_line_begins_far_above_all_there_is() -> None:
    """Of an echo that arrives late and is soon over, a hit at the onset would have had to be thousands of times louder
    than all that was recorded.
    """
    late, time = round(0.03 * SR), np.arange(SR) / SR
    after = np.maximum(time - late / SR, 0)
    ring = np.exp(-9 * time) * np.cos(2 * np.pi * 700 * time)
    echo = (time >= late / SR) * np.exp(-270 * after) * np.cos(2 * np.pi * 1930 * after)
    sound = np.stack([ring, 0.5 * ring]) + 0.3 * echo + 1e-5 * np.random.default_rng(4).standard_normal((2, SR))
    back = line_fit._from(late, sound, SR, BAND, True)
    assert back is not None
    assert (np.abs(back.amplitude) > 100).any()
    kept = struck_lines(back, sound, 10.0)
    assert kept.freq_hz == pytest.approx([700.0], rel=1e-4)
    assert np.abs(kept.amplitude[:, 0]) == pytest.approx([1.0, 0.5], rel=1e-2)
