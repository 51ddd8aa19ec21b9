"""Strikes: closed forms, conservation, and what a mode gets from the micro-impulses."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from sonic_bullet.records.errors import RecordError
from sonic_bullet.synth import pulse


def test_effective_mass_of_closed_forms() -> None:
    ball = 0.4 * 2.0 * 0.1**2 * np.eye(3)
    zero, arm = np.zeros((1, 3)), np.array([[0.0, 0.1, 0.0]])
    up, across = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 1.0, 0.0]])

    def mass(normal: np.ndarray, r: np.ndarray, mass_b: float) -> float:
        return float(
            pulse.effective_mass_kg(np.array([2.0]), ball[None], r, np.array([mass_b]), ball[None], zero, normal)[0]
        )

    assert mass(across, arm, 0.0) == pytest.approx(2.0)  # through the centre, against a wall
    assert mass(across, arm, 2.0) == pytest.approx(1.0)  # two equal masses
    assert mass(up, arm, 0.0) == pytest.approx(2.0 / 3.5)  # tangential on a sphere: m/(1 + 5/2)
    with pytest.raises(RecordError, match="cannot move"):
        pulse.effective_mass_kg(np.zeros(1), ball[None], arm, np.zeros(1), ball[None], zero, up)


def test_contact_times_of_closed_forms() -> None:
    tau, flat = pulse.contact_time_s(
        np.array([0.0329]), np.array([4.98e10]), np.array([100.0]), np.array([0.0]), np.array([1.0])
    )
    assert tau[0] == pytest.approx(96.7e-6, rel=1e-3)
    assert not flat[0]
    assert pulse.contact_modulus_pa(np.array([1e11]), np.array([np.inf]))[0] == pytest.approx(1e11)
    speed = np.array([0.1, 3.2])
    tau, _ = pulse.contact_time_s(0.0329, 4.98e10, 100.0, 0.0, speed)
    assert tau[0] / tau[1] == pytest.approx(2.0)  # v^(-1/5)
    tau, flat = pulse.contact_time_s(0.5, 1e9, -3.0, 1e-4, speed)
    assert flat.all()
    assert tau == pytest.approx(np.pi * np.sqrt(0.5 / (2e9 * np.sqrt(1e-4 / np.pi))))


def test_contact_times_stay_finite_at_every_edge() -> None:
    grid = np.array(
        np.meshgrid([1e-9, 1.0, np.inf], [1e-3, 1e11, np.inf], [-1.0, 0.0, 1e3], [0.0, 1e-4], [-1.0, 0.0, 1e-300, 1e3])
    ).reshape(5, -1)
    tau, _ = pulse.contact_time_s(*grid)
    assert np.isfinite(tau).all()
    assert tau.min() >= pulse.SHORTEST_S
    assert tau.max() <= pulse.LONGEST_S


@pytest.mark.parametrize(("flat", "half_power", "zero"), [(False, 0.67, 1.8), (True, 0.594, 1.5)])
def test_spectrum_has_its_half_power_point_and_first_zero(flat: bool, half_power: float, zero: float) -> None:
    f_tau = np.linspace(0, 2, 2001)
    spectrum = pulse.pulse_spectrum(f_tau, flat=flat)
    assert f_tau[np.argmax(spectrum < np.sqrt(0.5))] == pytest.approx(half_power, abs=0.005)
    assert f_tau[np.argmax(np.diff(spectrum) > 0)] == pytest.approx(zero, abs=0.02)
    if flat:
        off = np.abs(f_tau - 0.5) > 0.01
        closed = np.abs(np.cos(np.pi * f_tau[off]) / (1 - 4 * f_tau[off] ** 2))
        assert np.abs(spectrum[off] - closed).max() < 1e-6


def test_hertz_pulse_solves_its_equation() -> None:
    """Half the contact time in units of (δmax, v): τ = 2.9432 δmax/v [Johnson 1985, eq. 11.24], and Q(s) + Q(1-s) =
    1.
    """
    s = np.linspace(0, 1, 501)
    q = pulse.cumulated_force(s)
    assert np.abs(q + q[::-1] - 1).max() < 1e-12
    assert (np.diff(q) >= 0).all()
    # F = dQ/ds must satisfy energy: with δ' = 1 - 2Q, δ = ∫δ', F ∝ δ^1.5
    depth = np.cumsum(1 - 2 * (q[1:] + q[:-1]) / 2) * (s[1] - s[0])
    force = np.gradient(q, s)[1:]
    middle = slice(100, 400)
    ratio = force[middle] / depth[middle] ** 1.5
    assert ratio.std() / ratio.mean() < 1e-4
    assert 1 / depth.max() == pytest.approx(2.9432, rel=1e-3)


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("tau_s", [20e-6, 97e-6, 250e-6, 1.3e-3, 50e-3])
def test_nodes_give_modes_what_the_pulse_gives(tau_s: float, flat: bool) -> None:
    offset, spacing, weight = pulse.pulse_nodes(tau_s, 48000, flat=flat)
    assert weight.sum() == pytest.approx(1, abs=1e-14)
    assert spacing <= min(tau_s / 16, 1 / 96000) * (1 + 1e-12)
    f = np.linspace(0, 20000, 41)
    nodes = np.exp(-2j * np.pi * np.outer(f, offset + spacing * np.arange(len(weight)))) @ weight
    edge = np.linspace(0, 1, 20001)
    mass = np.diff(pulse.cumulated_force(edge, flat=flat))
    truth = np.array([np.exp(-2j * np.pi * x * tau_s * (edge[1:] + edge[:-1]) / 2) @ mass for x in f])
    assert np.abs(nodes - truth).max() < 1e-3


def test_jerk_misses_no_pulse_and_any_split_gives_the_same_bits() -> None:
    rng = np.random.default_rng(1)
    k, n, sr = 40, 4000, 48000
    strikes = (
        rng.integers(0, 3, k),
        rng.uniform(0.001, 0.02, k),
        np.geomspace(20e-6, 5e-3, k),
        rng.random(k) < 0.5,
        rng.normal(size=(k, 3)),
    )
    whole = np.zeros((3, 3, n))
    pulse.add_jerk(whole, *strikes, sr, 0)
    parts, cut = [], [0, 1, 2, 17, 500, 501, 1300, n]
    for start, stop in itertools.pairwise(cut):
        part = np.zeros((3, 3, stop - start))
        pulse.add_jerk(part, *strikes, sr, start)
        parts.append(part)
    assert np.concatenate(parts, axis=2).tobytes() == whole.tobytes()
    scale = np.abs(whole).max()
    assert np.abs(whole.sum(2)).max() < 1e-9 * scale  # the force ends where it began
    impulse = np.zeros((3, 3))
    np.add.at(impulse, strikes[0], strikes[4])
    assert np.cumsum(np.cumsum(whole, 2), 2)[..., -1] / sr**2 == pytest.approx(impulse, abs=1e-9)


@pytest.mark.parametrize("flat", [False, True])
def test_a_blow_gives_modes_no_more_energy_than_it_has(flat: bool) -> None:
    """E = Σ (g s j |F̂|)²/2 stays below m*v²/2·((1+e)/2)² however many and light the modes are; without modes the whole
    impulse acts.
    """
    rng = np.random.default_rng(3)
    mass, speed, bounce, tau = 0.2, 1.5, 0.6, 4e-4
    impulse = (1 + bounce) * mass * speed
    checked = 0
    for count in (0, 1, 10, 300):
        for scale in (0.01, 1.0, 30.0):
            freq = np.sort(rng.uniform(50, 20_000, count))
            gain = scale * rng.normal(size=count)
            share = pulse.compliant_share(mass, impulse, [(freq, gain * impulse)], tau, flat)
            energy = 0.5 * np.sum((share * impulse * gain * pulse.pulse_spectrum(freq * tau, flat=flat)) ** 2)
            assert energy <= 0.5 * mass * speed**2 * ((1 + bounce) / 2) ** 2 * (1 + 1e-6)
            assert 0 < share <= 1
            assert count or share == 1
            checked += 1
    assert checked == 12


def test_an_impulse_too_small_to_square_shares_nothing() -> None:
    assert pulse.compliant_share(1.0, 1e-200, [(np.array([900.0]), np.array([1e-190]))], 1e-3, False) == 1.0
