"""Does the level below a body's first mode depend on how many modes were solved, and what would mend it?

    python studies/below_first_mode.py [--modes 160] [--pulse-ms 0.3]

r2d2's wheel of plastic, whose first mode is at 4.4 kHz, is struck at eight places along its axis by a half sine. With
s = −d + iω, g = φ·f/|f| and a pressure weight w, a mode sounds as Re(w z) (src/bank):

    ż = s z + g (1 + i d/ω) F        far below ω: z = i g F/ω, and so p = −Im(w) g F/ω                           (1)

The pulse itself, at any frequency. What radiates as its acceleration does, Im(w) < 0, should send q̈/ω instead, which
is (1) and a direct term, and goes with the square of frequency:

    q̈/ω = g F/ω − ω q − 2 d q̇/ω      p = Re(w z) + Im(w) g F/ω                                                   (2)

Octave levels in dB, of energy, means of eight places; first as the bank has it, then with (2).
"""

from __future__ import annotations

import argparse

import numpy as np

from sonic_bullet.modal import analyse
from sonic_bullet.radiation.radiated import radiation_of
from sonic_bullet.records import Air, Array, Shape
from sonic_bullet.session.arguments import as_material

WHEEL = Shape("cylinder", size_m=np.array([0.035, 0.1, 0.0]))
OCTAVES_HZ = (63, 125, 250, 500, 1000, 2000, 4000, 8000)
PLACES = 8


def transfer(omega: Array, decay: Array, weight: Array, gain: Array, angular: Array, *, direct: bool) -> Array:
    """Compute pressure over force at angular frequencies (k,) of modes (m,), of which gain (m,) is φ·f/|f|."""
    s = -decay + 1j * omega
    part = weight * (1 + 1j * decay / omega) * gain
    lower, upper = (1j * angular[:, None] - one for one in (s, s.conj()))
    moved = (part / lower + part.conj() / upper).sum(axis=1) / 2
    return np.asarray(moved + (weight.imag * gain / omega).sum() * direct)


def half_sine(angular: Array, length_s: float) -> Array:
    """Compute the spectrum of a half sine of that length and of impulse 1."""
    x = angular * length_s / 2
    return np.asarray(np.cos(x) * (np.pi / 2) ** 2 / ((np.pi / 2) ** 2 - x**2))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--modes", type=int, default=160)
    parser.add_argument("--pulse-ms", type=float, default=0.3)
    asked = parser.parse_args()
    model = analyse((WHEEL,), as_material("plastic"), count=asked.modes)
    weight, radiated = radiation_of(model, Air())
    omega, decay = 2 * np.pi * model.freq_hz, model.decay_per_s + radiated
    angular = 2 * np.pi * np.geomspace(40, 12_000, 4000)
    force = half_sine(angular, asked.pulse_ms * 1e-3)
    places = np.linspace(0, len(model.vertex_m) - 1, PLACES).astype(int)
    print("modes    to Hz", "".join(f"{octave:>8}" for octave in OCTAVES_HZ))
    for count in (n for n in (20, 40, 80, 160, 320) if n <= model.mode_count):
        for direct in (False, True):
            power = np.zeros(len(angular))
            for place in places:
                few = (part[:count] for part in (omega, decay, weight, model.shape[place, 2].astype(float)))
                power += np.abs(transfer(*few, angular, direct=direct) * force) ** 2 / PLACES
            inside = [np.abs(np.log2(angular / (2 * np.pi * octave))) < 0.5 for octave in OCTAVES_HZ]
            level = [10 * np.log10(np.trapezoid(power[one], angular[one])) for one in inside]
            name = "  + (2) " if direct else f"{count:5}   "
            print(name, f"{model.freq_hz[count - 1]:6.0f}", "".join(f"{one:8.1f}" for one in level))


if __name__ == "__main__":
    main()
