"""Does the level below a body's first mode depend on how many modes were solved, and how much should it be?

    python studies/below_first_mode.py [--body wheel] [--modes 160] [--pulse-ms 0.3]

r2d2's wheel of plastic, whose first mode is at 4.4 kHz (or a board, or a bar), is struck by a half sine at eight places
along its surface's axis z. With s = −d + iω, g = φ·f/|f| and a pressure weight w, a mode's state is (src/bank)

    ż = s z + g (1 + i d/ω) F        far below ω: z = i g F/ω, and so Re(w z) = −Im(w) g F/ω                      (1)

The pulse itself, at any frequency. The engine sends p = Re(w z) + Im(w) g F/ω, which is

    p = Re(w) q̇ + Im(w) (q̈ + d q̇)/ω                                                                              (2)

so that what lasts sends nothing. w is how the mode's shape radiates at its own frequency; at another it is W(f), from
boundary elements at f, each of 256 directions by itself:   p = Σ W(f) q̇, mean square over directions           (3)

Octave levels in dB, of energy, means of eight places: (1) as the engine was until November 2026, (2), and (3),
this one at two frequencies an octave, which miss the tops of lines.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from sonic_bullet.modal import analyse
from sonic_bullet.radiation.far_field import SurfaceTerms, spread_directions, surface_pressure, surface_terms
from sonic_bullet.radiation.radiated import radiation_of
from sonic_bullet.records import Air, Array, ModalModel, Shape
from sonic_bullet.session.arguments import as_material

BODIES = {
    "wheel": (Shape("cylinder", size_m=np.array([0.035, 0.1, 0.0])), "plastic"),
    "board": (Shape("box", size_m=np.array([0.3, 0.2, 0.01])), "made-spruce"),
    "bar": (Shape("box", size_m=np.array([0.12, 0.005, 0.005])), "steel"),
}
OCTAVES_HZ = (63, 125, 250, 500, 1000, 2000, 4000, 8000)
PLACES = 8
A_PART = 2  # of an octave: frequencies at which W is computed


def velocity(omega: Array, decay: Array, gain: Array, angular: Array) -> Array:
    """Compute q̇/F (k, m) at angular frequencies (k,) of modes (m,), of which gain (m,) is φ·f/|f|."""
    i = 1j * angular[:, None]
    return np.asarray(i * gain / ((i + decay) ** 2 + omega**2))


def half_sine(angular: Array, length_s: float) -> Array:
    """Compute the spectrum of a half sine of that length and of impulse 1."""
    x = angular * length_s / 2
    return np.asarray(np.cos(x) * (np.pi / 2) ** 2 / ((np.pi / 2) ** 2 - x**2))


def weights_at(model: ModalModel, air: Air, freq_hz: float) -> Array:
    """Compute W (m, directions) of a model's shapes at one frequency."""
    terms = surface_terms(replace(model, freq_hz=np.full(model.mode_count, freq_hz)), air)
    assert isinstance(terms, SurfaceTerms), "a body without a near field"
    return surface_pressure(terms, air, spread_directions(128)[0], np.arange(model.mode_count))[0]


def octave_levels(power: Array, angular: Array) -> list[float]:
    """Sum power (k,) over octaves, in dB."""
    inside = [np.abs(np.log2(angular / (2 * np.pi * octave))) < 0.5 for octave in OCTAVES_HZ]
    return [10 * float(np.log10(power[one].mean() * octave)) for one, octave in zip(inside, OCTAVES_HZ, strict=True)]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--body", choices=BODIES, default="wheel")
    parser.add_argument("--modes", type=int, default=160)
    parser.add_argument("--pulse-ms", type=float, default=0.3)
    asked = parser.parse_args()
    (shape, material), air = BODIES[asked.body], Air()
    model = analyse((shape,), as_material(material), count=asked.modes)
    weight, radiated = radiation_of(model, air)
    omega, decay = 2 * np.pi * model.freq_hz, model.decay_per_s + radiated
    places = np.linspace(0, len(model.vertex_m) - 1, PLACES).astype(int)
    gains = model.shape[places, 2].astype(float)
    print("modes    to Hz", "".join(f"{octave:>8}" for octave in OCTAVES_HZ))

    def say(name: str, last: int, power: Array, angular: Array) -> None:
        levels = "".join(f"{one:8.1f}" for one in octave_levels(power, angular))
        print(f"{name:9} {model.freq_hz[last]:6.0f}", levels)

    def powers(count: int, angular: Array) -> Array:
        """Compute the power of (1) and (2), (2, k), of that many modes."""
        force, some, total = half_sine(angular, asked.pulse_ms * 1e-3), slice(0, count), np.zeros((2, len(angular)))
        ahead = weight.imag[some] / omega[some]
        for gain in gains[:, some]:
            moved = velocity(omega[some], decay[some], gain, angular)
            sent = moved @ weight.real[some] + (moved * (1j * angular[:, None] + decay[some])) @ ahead
            total += np.abs(np.stack([sent - ahead @ gain, sent]) * force) ** 2 / PLACES
        return total

    fine = 2 * np.pi * OCTAVES_HZ[0] / 2**0.5 * 2.0 ** (np.arange(500 * len(OCTAVES_HZ)) / 500)
    for count in (n for n in (20, 40, 80, 160, 320) if n <= model.mode_count):
        for name, power in zip((f"{count:5} (1)", "      (2)"), powers(count, fine), strict=True):
            say(name, count - 1, power, fine)
    coarse = 2 * np.pi * OCTAVES_HZ[0] / 2**0.5 * 2.0 ** ((np.arange(A_PART * len(OCTAVES_HZ)) + 0.5) / A_PART)
    true = np.zeros(len(coarse))
    for k in range(len(coarse)):
        w, here = weights_at(model, air, float(coarse[k] / (2 * np.pi))), coarse[k : k + 1]
        for gain in gains:
            sent = velocity(omega, decay, gain, here)[0] @ w * half_sine(here, asked.pulse_ms * 1e-3)
            true[k] += (np.abs(sent) ** 2).mean() / PLACES
    say("      (3)", -1, true, coarse)
    below, above = coarse < 0.7 * omega[0], coarse > 0.9 * omega[0]
    for name, power in zip(("(1)", "(2)"), powers(model.mode_count, coarse), strict=True):
        error = 10 * np.log10(power / true)
        low, rms = np.median(error[below]), np.sqrt((error[above] ** 2).mean())
        print(f"{name} over (3), dB: below the first mode {low:.0f} (median), from it on {rms:.1f} (rms)")


if __name__ == "__main__":
    main()
