"""Strikes: closed forms, conservation, what a mode gets from the micro-impulses and what it takes of a strike."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet._engine import compliance
from sonic_bullet.engine.contact import pulse_shape as pulse
from tests.made.pulses import cumulated_force, pulse_nodes


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
    q = cumulated_force(s)
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
    start, spacing, weight = pulse_nodes(0.3, tau_s, 48000, flat=flat)
    offset, spacing = (start - 0.3) / 48000, spacing / 48000
    assert weight.sum() == pytest.approx(1, abs=1e-14)
    assert spacing <= min(tau_s / 16, 1 / 96000) * (1 + 1e-12)
    f = np.linspace(0, 20000, 41)
    nodes = np.exp(-2j * np.pi * np.outer(f, offset + spacing * np.arange(len(weight)))) @ weight
    edge = np.linspace(0, 1, 20001)
    mass = np.diff(cumulated_force(edge, flat=flat))
    truth = np.array([np.exp(-2j * np.pi * x * tau_s * (edge[1:] + edge[:-1]) / 2) @ mass for x in f])
    assert np.abs(nodes - truth).max() < 1e-3


@pytest.mark.parametrize("flat", [False, True])
def test_the_whole_impulse_is_handed_over_at_last(flat: bool) -> None:
    """Q is the integral of the table's force, from 0 to 1, and where it rises the force is."""
    s = np.linspace(0, 1, 4097)
    q, middle = cumulated_force(s, flat=flat), (s[1:] + s[:-1]) / 2
    hertz = np.interp(middle, np.linspace(0, 1, 1025), pulse.pulse_table()[1])
    force = np.pi / 2 * np.sin(np.pi * middle) if flat else hertz
    assert cumulated_force(np.array([-0.5, 0.0, 1.0, 1.5]), flat=flat).tolist() == [0, 0, 1, 1]
    assert np.abs(np.diff(q) * 4096 - force).max() < 1e-4


@pytest.mark.parametrize("flat", [False, True])
def test_a_strike_gives_modes_no_more_energy_than_it_has(flat: bool) -> None:
    """E = Σ (g s j |F̂|)²/2 stays below m*v²/2·((1+e)/2)² however many and light the modes are; without modes the whole
    impulse acts. s = 1/(1 + m*/j² Σ (g j |F̂|)²).
    """
    rng = np.random.default_rng(3)
    mass, speed, bounce, tau = 0.2, 1.5, 0.6, 4e-4
    impulse = (1 + bounce) * mass * speed
    checked = 0
    for count in (0, 1, 10, 300):
        for scale in (0.01, 1.0, 30.0):
            freq = np.sort(rng.uniform(50, 20_000, count))
            gain = scale * rng.normal(size=count)
            spectrum, exact = pulse.spectrum_table()[int(flat)], pulse.pulse_spectrum(freq * tau, flat=flat)
            given = compliance(gain * impulse, freq, tau, spectrum)
            assert given == pytest.approx(np.sum((gain * impulse * exact) ** 2), rel=5e-3)
            share = 1 / (1 + mass * given / impulse**2)
            energy = 0.5 * np.sum((share * impulse * gain * exact) ** 2)
            assert energy <= 0.5 * mass * speed**2 * ((1 + bounce) / 2) ** 2 * (1 + 1e-6)
            assert 0 < share <= 1
            assert count or share == 1
            checked += 1
    assert checked == 12
