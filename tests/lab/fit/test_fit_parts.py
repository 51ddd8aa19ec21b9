"""The parts of a fit against closed forms: shared lines to their Cramér-Rao bound, Rayleigh's pair, the distance."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.apps.report.plots.fit_plot import circle
from sonic_bullet.lab.fit.pairing import _rings, mark_heaped
from sonic_bullet.lab.fit.prediction_of_lines import damped_sum
from sonic_bullet.lab.fit.rayleigh import rayleigh
from sonic_bullet.lab.lines.joint_lines import Lines, joint_lines
from sonic_bullet.signal.log_spectral import log_spectral_db, noise_floor_db, white, with_noise

BRIEF_RATIO = 25.0


@pytest.mark.slow
def test_shared_lines_to_their_spreads() -> None:
    rng = np.random.default_rng(5)
    freq = np.array([210.0, 995.0, 1003.0, 2500.0, 4100.0, 6700.0, 9000.0, 9040.0])
    decay = np.array([3.0, 5.0, 6.0, 12.0, 20.0, 45.0, 90.0, 70.0])
    z = []
    for _ in range(4):
        amplitude = rng.normal(size=(3, 8)) + 1j * rng.normal(size=(3, 8))
        signals = np.array(
            [damped_sum(freq, decay, a, 22_050, 22_050) + 0.02 * rng.standard_normal(22_050) for a in amplitude]
        )
        found = joint_lines(signals, 22_050, band_hz=(20, 10_000))
        assert len(found.freq_hz) == 8  # each found, none invented
        z += [(found.freq_hz - freq) / found.freq_sd_hz, (found.decay_per_s - decay) / found.decay_sd_per_s]
    assert 0.7 < np.concatenate(z).std() < 1.35


def test_rayleigh_pair_is_exact_on_two_lines_and_unsaid_on_one() -> None:
    lam = np.array([1e7, 4e8])
    decay = (3.0 + 2e-7 * lam) / 2
    found = rayleigh(lam, decay, 1e-4 * decay, (1.0, 1e-7))
    assert (found.alpha_per_s, found.beta_s) == (pytest.approx(3.0, rel=1e-9), pytest.approx(2e-7, rel=1e-9))
    assert found.said == ()
    one = rayleigh(lam[:1], decay[:1], 1e-4 * decay[:1], (1.0, 1e-7))
    assert one.said == ("alpha", "beta")
    assert (one.alpha_per_s + one.beta_s * lam[0]) / 2 == pytest.approx(decay[0])  # what it does say is kept


def test_scatter_is_told_from_spread() -> None:
    lam = np.geomspace(1e7, 1e10, 40)
    rng = np.random.default_rng(0)
    decay = (3.0 + 1e-8 * lam) / 2
    true = rayleigh(lam, decay * (1 + 0.001 * rng.standard_normal(40)), 0.001 * decay, (1.0, 1e-7))
    loose = rayleigh(lam, decay * (1 + 0.2 * rng.standard_normal(40)), 0.001 * decay, (1.0, 1e-7))
    assert true.scatter == 0
    assert 0.1 < loose.scatter < 0.4
    assert loose.covariance[0, 0] > 100 * true.covariance[0, 0]


def test_what_a_fixture_has_left_of_decays_is_as_sure_as_the_decays() -> None:
    """A fixture takes ten times the law's part of every second line, and is known to 5 %: nothing may be left of a
    line, which says nothing of the law.
    """
    lam = np.geomspace(1e7, 1e10, 24)
    law = (20.0 + 1e-8 * lam) / 2
    part = np.where(np.arange(24) % 2, 10 * law, 0.05 * law)
    off = 1 + 0.05 * np.random.default_rng(2).standard_normal(24)
    whole = law + part
    left, sd = np.maximum(whole - off * part - 0.06 * part, 1e-3 * whole), 0.001 * whole + 0.02 * part
    found = rayleigh(lam, left, sd, (20.0, 1e-8), whole)
    assert found.alpha_per_s == pytest.approx(20.0, rel=0.1)
    assert found.beta_s == pytest.approx(1e-8, rel=0.1)
    of_the_rest = rayleigh(lam, left, sd, (20.0, 1e-8))
    assert of_the_rest.scatter > 3 * found.scatter, "a hundredth that is left is no hundredfold certainty"


def test_a_law_that_most_lines_obey_is_told_whatever_the_others_do() -> None:
    """Three of eleven fall far too slowly: the law that is nearest to all of them, by a third, is no one's.

    Where no law is anyone's, all lines tell one.
    """
    lam = (2 * np.pi * np.array([1346, 3676, 4352, 5133, 7108, 8000, 9200, 10885, 11542, 15693, 16889.0])) ** 2
    decay = 0.5 * (1.45 + 1.34e-8 * lam) * (1 + 0.004 * np.array([1, -1, 1, 1, -1, -1, 1, -1, 0, 0, 0]))
    decay[8:] = [22.0, 27.0, 23.0]
    sd = 0.02 * decay
    found = rayleigh(lam, decay, sd, (1.0, 1e-8))
    assert (found.alpha_per_s, found.beta_s) == (pytest.approx(1.45, rel=0.03), pytest.approx(1.34e-8, rel=0.02))
    hysteretic = 0.002 * np.sqrt(lam)
    all_of_them = rayleigh(lam, hysteretic, 0.02 * hysteretic, (1.0, 1e-8))
    assert np.abs(0.5 * (all_of_them.alpha_per_s + all_of_them.beta_s * lam) / hysteretic - 1).max() < 0.5


@pytest.mark.parametrize("long", [5e-3, 0.05])
@pytest.mark.parametrize(("lines", "others"), [(24, [17, 22]), (6, [5])])
def test_lines_that_ring_far_too_long_hold_no_law_down(long: float, lines: int, others: list[int]) -> None:
    """Some lines are another's, and the rest scatter by some percent: the law is within that of the true one."""
    rng = np.random.default_rng(4)
    lam = (2 * np.pi * np.linspace(700, 12000, lines)) ** 2
    true = 0.5 * (43.0 + 8.4e-7 * lam)
    decay = true * (1 + 0.03 * rng.standard_normal(lines))
    decay[others] = long * true[others]
    found = rayleigh(lam, decay, 1e-3 * decay, (1.0, 1e-8))
    assert 0.5 * (found.alpha_per_s + found.beta_s * lam) == pytest.approx(true, rel=0.03)


def test_what_loses_as_much_a_cycle_is_no_click() -> None:
    """A bar's low mode rings for seconds: at ten times its frequency a mode with its loss factor may end ten times
    sooner, a click a hundred times.
    """
    freq = np.array([1300.0, 13000.0, 13100.0])
    none = np.zeros(3)

    def worth(decay: float) -> list[float]:
        lines = Lines(
            freq,
            np.array([1.2, decay, 1.2]),
            np.ones((2, 3)) + 0j,
            none,
            none,
            np.zeros((2, 3)),
            np.ones(2),
            np.array([1.0, 0.01, 0.01]),
            True,
        )
        return _rings(lines).tolist()

    assert worth(1.2 * BRIEF_RATIO * 9) == [1.0, 1.0, 1.0]
    assert worth(1.2 * BRIEF_RATIO * 20)[1] == pytest.approx(0.5)


def test_distance_of_a_gain_and_of_nothing() -> None:
    tone = damped_sum(np.array([1000.0]), np.array([5.0]), np.array([1.0 + 0j]), 20_000, 22_050)
    floor = white(1e-4)
    assert log_spectral_db(tone, tone, floor) == 0
    assert log_spectral_db(2 * tone, tone, floor) == pytest.approx(6.02, abs=0.02)
    assert np.isnan(log_spectral_db(np.zeros(20_000), np.zeros(20_000), floor))
    assert with_noise(np.zeros(20_000), floor, 1).std() == pytest.approx(1e-4, rel=0.03)


def test_few_cells_do_not_speak_for_a_window() -> None:
    """A sound that hardly stands above the noise: by the widest window in a handful of cells, in one of which noise may
    cancel it.
    """
    t = np.arange(48_000) / 48_000
    sound, floor = 2e-3 * np.exp(-100 * t) * np.sin(2 * np.pi * 3000 * t), white(1e-4)
    least = [noise_floor_db(sound, floor, seeds=(2 * k, 2 * k + 1)) for k in range(12)]
    assert max(least) < 2.0
    alone = [noise_floor_db(sound, floor, seeds=(2 * k, 2 * k + 1), windows=(8192,)) for k in range(12)]
    assert max(alone) > max(least) + 1  # which had said as much as all others together
    assert np.isfinite(alone).any()  # and still speaks where nothing else does


def test_lines_that_cancel_one_another_hold_more_than_all_do() -> None:
    """A burst that no damped sinusoid is takes several, each far above it; twins that beat are what they are."""
    freq, decay = (
        np.array([400.0, 900.0, 900.4, 3000.0, 3004.0, 3008.0]),
        np.array([5.0, 8.0, 8.0, 900.0, 940.0, 980.0]),
    )
    amplitude = np.array([[1.0, 1.0, -0.9, 500.0, -1000.0, 500.2], [0.3, 0.5, 0.6, 200.0, -400.0, 200.1]]) + 0j
    none = np.zeros(6)
    lines = Lines(freq, decay, amplitude, none, none, np.zeros((2, 6)), np.ones(2), np.ones(6), True)
    assert mark_heaped(lines).tolist() == [False, False, False, True, True, True]


def test_circle_is_equation_8() -> None:
    freq = np.array([100.0, 5000.0])
    d = circle(freq, 4.0, 1e-6)
    lam = (2 * np.pi * freq) ** 2 + d**2
    assert d == pytest.approx((4.0 + 1e-6 * lam) / 2, rel=1e-12)
