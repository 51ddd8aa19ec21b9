"""Whether a take is one impact: its sound begins with its most, and falls; speech, rain and noise do not.

    F = energy of the first three tenths of a take over all, E = energy that its lines describe, both over the noise
    no impact: F < 0.75 and E < 0.8, or more than 0.6 of the energy before the onset

What falls has F ≥ 0.3. Long beats and long rings have little more; lines describe them.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.fit.prediction_of_lines import lines_sound
from sonic_bullet.lab.lines.line_values import Lines
from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError
from sonic_bullet.signal.log_spectral import floor_between

# shares of the energy of an impact: of its first part, or of its lines, as of `features`. Takes of 22 measured objects
# have 0.97 of one or the other; speech and rain 0.45 and 0.62
FRONT_SHARE = 0.3
LEAST_FRONT_ENERGY = 0.75
LEAST_DESCRIBED_ENERGY = 0.8


def describe_no_impact(signal: Array, lines: Lines, take: int, sr: int, before: float) -> str:
    """Say why a take (n,) of some lines is no single impact; nothing where it may be one.

    before: part of the energy that lies before its loudest rise.
    """
    least_energy = 0.05  # of a take's energy, over the noise: of less nothing is said
    most_before = 0.6  # of measured takes 0.43 at most, of speech whose last syllable is the loudest 0.67 and more
    if before > most_before:
        return f"{100 * before:.0f} % of its energy lies before its loudest rise, and does not decay from there"
    noise = _lasting_noise(signal)
    n, front = len(signal), int(FRONT_SHARE * len(signal))
    whole, first = (float(x @ x) - noise * len(x) for x in (signal, signal[:front]))
    if whole < least_energy * float(signal @ signal):
        return ""
    peak = round(lines.rise_s[take] * sr)  # from which lines were read: those that cancel there need not before
    rest = (signal - lines_sound(lines, take, n, sr))[peak:]
    described = 1 - max(float(rest @ rest) - noise * n, 0.0) / whole
    if first / whole < LEAST_FRONT_ENERGY and described < LEAST_DESCRIBED_ENERGY:
        return (
            f"{100 * max(first / whole, 0.0):.0f} % of its energy is in its first third, and lines that decay describe "
            f"{100 * max(described, 0.0):.0f} % of it"
        )
    return ""


def _lasting_noise(signal: Array) -> float:
    """Measure the mean square of a take's noise: its floor's, or of its quietest tenth where that has less than half.

    Rain and speech are a floor's themselves, and what of them would stand over it cannot be described.
    """
    floor = float(floor_between([signal]).variance.mean())
    quietest = min(float((part @ part) / len(part)) for part in np.array_split(signal, 10))
    return quietest if quietest < 0.5 * floor else floor


def describe_no_impacts(signals: Array, lines: Lines, sr: int, before: list[float], names: list[str]) -> list[str]:
    """Say of each take (s, n) why it is no impact, by name; nothing of one that is. Raises AudioError where none is."""
    said = [describe_no_impact(x, lines, i, sr, before[i]) for i, x in enumerate(signals)]
    odd = [f"no impact found: {name}: {words}" if words else "" for name, words in zip(names, said, strict=True)]
    if all(odd):
        raise AudioError(odd[0], "record one impact: a fit of this would be of no object")
    return odd
