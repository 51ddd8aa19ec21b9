"""Exponents of speed: of a wheel on a rail and of a small body on a board, by one rule, from their own surfaces.

    F(f) = h(v/f) g(v/f) |(K + iωc) ω²m/(K - ω²m + iωc)|    the oscillator of a contact that is not left, in closed form
    g = (1 - c)(1 + a/λ)^(-1/2) + c (1 + π/4 (2πa/λ)³)^(-1/2)           c: what part of the patch touches

Measured: some 30 dB a decade of a wheel on a rail [Thompson 2009, Railway Noise and Vibration, sec. 2.2], 10 to 19 of
small rough bodies.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from sonic_bullet._engine import UNIT_RMS, slope_squared
from sonic_bullet.records import Array
from sonic_bullet.records.roughness import WAVE_M
from tests.made.surfaces import advance, octave_heights, surface_pairs

SR, STEP = 48_000, 200
ISO_3095_M = [0.1, 0.04, 0.0315, 0.001]
ISO_3095_DB = [4.9, -3.2, -5.0, -14.0]
"""Limit spectrum of ISO 3095:2013 in third octaves re 1 µm: corners of its straight lines over lg λ."""


def rail_octaves_m() -> Array:
    """Rms heights of the octaves, down to 1 mm, where the standard ends."""
    third = WAVE_M[:, None] * 2.0 ** (np.arange(-1, 2) / 3)
    level = np.interp(np.log(third), np.log(ISO_3095_M[::-1]), ISO_3095_DB[::-1])
    level += np.maximum(0, 20 * np.log10(third / 0.1))
    return np.asarray(np.where(WAVE_M >= 1e-3, 1e-6 * np.sqrt((10 ** (level / 10)).sum(axis=1)), 0.0))


def exponents(pair: Array, load_n: float, speeds_m_s: Array, band_hz: tuple[float, float]) -> tuple[float, float]:
    """dB a decade of speed of the force in a band: as simulated, and in closed form."""
    power, closed = [], []
    for speed in speeds_m_s:
        pairs, out = np.repeat(pair, 6), list[Array]()
        pairs["seed"] = 1 + 7919 * np.arange(12).reshape(6, 2)
        load, sweep = np.full((2, 6), load_n), np.zeros((2, 6, 2))
        sweep[:, :, 1] = speed
        for _ in range(120):
            out.append(advance(pairs, load, sweep, np.arange(STEP) / STEP, SR))
        force = np.concatenate(out, axis=1)[:, 4800:]
        assert (force > -load_n).all(), "it leaves the ground"
        spectrum = (np.abs(np.fft.rfft(force * np.hanning(force.shape[1]), axis=1)) ** 2).mean(axis=0)
        f = np.fft.rfftfreq(force.shape[1], 1 / SR)
        heard = (f >= band_hz[0]) & (f < band_hz[1])
        power.append(float(spectrum[heard].sum()))
        closed.append(_closed_form(pair[0], load_n, float(speed), f[heard]))
    return tuple(float(np.polyfit(np.log10(speeds_m_s), 10 * np.log10(x), 1)[0]) for x in (power, closed))  # type: ignore[return-value]


def _closed_form(pair: Array, load_n: float, speed_m_s: float, f: Array) -> float:
    radius, modulus, mass = float(pair["radius_m"]), float(pair["modulus_pa"]), float(pair["mass_kg"])
    patch = (0.75 * load_n * radius / modulus) ** (1 / 3)
    stiff, omega = 2 * modulus * patch, 2 * np.pi * f
    spring = stiff + 2j * 0.25 * omega * np.sqrt(stiff * mass)
    moved = spring * omega**2 * mass / (spring - omega**2 * mass)
    touching = 0.0
    if pair["slope"] > 0:
        touching = math.erf(np.sqrt(np.pi) * load_n / (np.pi * patch**2) / (modulus * float(pair["slope"])))
    wave = speed_m_s / f
    smooth = (1 + np.pi / 4 * (2 * np.pi * patch / wave) ** 3) ** -0.5
    gain = (1 - touching) * (1 + patch / wave) ** -0.5 + touching * smooth
    sigma = pair["height_m"][1] / UNIT_RMS
    with np.errstate(divide="ignore"):
        density = np.interp(np.log(wave), np.log(WAVE_M[::-1]), np.log(sigma * np.sqrt(WAVE_M))[::-1])  # √S(q)
    height = np.exp(density) / np.sqrt(speed_m_s)
    return float((np.abs(height * gain * moved) ** 2).sum())


def test_a_wheel_on_a_rail_gains_thirty_decibels_a_decade() -> None:
    """A wheel of 600 kg and 0.46 m on a rail of 0.3 m crown, 50 kN, 50 to 180 km/h, 0.8 to 5 kHz."""
    pair = surface_pairs(*(np.array([x]) for x in (600.0, 1.15e11, 0.36, 0.25)), np.zeros((1, 2)), np.full((1, 2), 0.7),
                         np.zeros((1, 2)))  # fmt: skip
    octaves = rail_octaves_m()
    pair["height_m"][0, 1] = octaves * UNIT_RMS
    pair["slope"] = np.sqrt(2 * 2 * slope_squared(octaves * UNIT_RMS))  # the wheel is as rough
    found, closed = exponents(pair, 5e4, np.geomspace(14, 49, 5), (800, 5000))
    print(f"wheel on rail: {found:.1f} dB a decade, in closed form {closed:.1f}")
    assert 27 <= found <= 33
    assert found == pytest.approx(closed, abs=2)


@pytest.mark.parametrize("hurst", [0.6, 0.7])
def test_a_small_ball_on_a_board_gains_half_of_it(hurst: float) -> None:
    """A steel ball of 2 cm on wood, so smooth that it does not fly, 0.2 to 1.6 m/s."""
    pair = surface_pairs(*(np.array([x]) for x in (0.26, 1e10, 0.02, 0.25)), np.zeros((1, 2)), np.full((1, 2), hurst),
                         np.zeros((1, 2)))  # fmt: skip
    pair["height_m"][0, 1] = octave_heights(2e-8, hurst)
    found, closed = exponents(pair, 2.55, np.geomspace(0.2, 1.6, 5), (300, 8000))
    print(f"ball on board, H = {hurst}: {found:.1f} dB a decade, in closed form {closed:.1f}")
    assert 10 <= found <= 19
    assert found == pytest.approx(closed, abs=2)
