"""The one measurement that would decide what a fit leaves open, in a sentence: the first that applies.

one take, an attack that lines do not describe, lines within each other's widths, no shape, no place, few lines that are
modes, no force, ν, β
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from sonic_bullet.lab.fit.case_fit import CaseFit
from sonic_bullet.lab.fit.prediction_of_lines import lines_sound
from sonic_bullet.lab.fit.recorded import RecordedObject
from sonic_bullet.lab.fit.typical_strike import select_ringing
from sonic_bullet.lab.lines.extraction import ATTACK_S
from sonic_bullet.lab.lines.line_values import lines_at


def next_measurement(found: CaseFit) -> str:
    """Say which one measurement would decide; empty where nothing is open."""
    return next(_open(found), "")


def _open(found: CaseFit) -> Iterator[str]:
    """Say what would decide each thing that is open, the first things first."""
    recorded = [e for e in found.evidence if e.signals is not None]
    if recorded:
        most = max(recorded, key=lambda one: len(one.recordings))
        yield from _open_of_takes(most)
        modes = [o.evidence.lines.freq_hz[o.line[o.line >= 0]] for o in found.objects if o.evidence is most]
        # a nodal line is a shape's: lines that no mode of one explains have none that anybody could strike
        if modes and (pair := _within_widths(most)) and np.isin(pair, modes[0]).all():
            yield (
                f"strike at another point, on a nodal line of one of the modes at {pair[0]:.1f} and {pair[1]:.1f} Hz: "
                "they lie within each other's widths, and here both sound"
            )
    strikes = [r for e in recorded for r in e.recordings]
    sd = np.diag(found.fit.covariance)
    if not found.objects:
        yield "measure the shape and weigh it (--mesh, --material): lines alone tell no E and no other strike"
    if strikes and all(r.position_m is None for r in strikes):
        yield "mark where it is struck (strike.position): one known place tells how loud each mode is elsewhere"
    if np.isnan(sd[2]):
        yield "measure the dimensions and the mass again: too few lines are modes of this shape to tell E/ρ"
    if strikes and all(r.impulse_n_s is None for r in strikes):
        yield "record the hammer's force (case new --force-channel): without it no level is known, and no gain"
    if np.isnan(sd[4]):
        yield "strike a corner, off all axes of symmetry: so far lines go with ν as with E/ρ, modes in torsion do not"
    if np.isnan(sd[:2]).any():
        yield "strike it hung on threads, nearer the microphone: decays of high and low modes together tell α and β"


def _open_of_takes(e: RecordedObject) -> Iterator[str]:
    """Say what the takes of an object leave open by themselves."""
    if len(e.recordings) == 1:
        yield "strike the same place again, three times or more: of one take nothing is held out, no spread is known"
    not_modal = 0.5  # of the energy within ATTACK_S, that lines which ring do not describe
    if _attack_left(e) > not_modal:
        yield (
            "record the hammer's force with the sound (case new --force-channel): most of the first "
            f"{1000 * ATTACK_S:.0f} ms is no mode, and the force tells what of it is the contact"
        )


def _attack_left(e: RecordedObject) -> float:
    """Part of the takes' energy within ATTACK_S that lines which ring do not describe, the median over takes."""
    assert e.signals is not None
    rings, n = lines_at(e.lines, select_ringing(e.lines)), max(1, round(ATTACK_S * e.sr))
    left = []
    for i, signal in enumerate(e.signals):
        rest = signal[:n] - lines_sound(rings, i, n, e.sr)[:n]
        left.append(float(rest @ rest) / max(float(signal[:n] @ signal[:n]), 1e-300))
    return float(np.median(left))


def _within_widths(e: RecordedObject) -> tuple[float, float] | None:
    """Return the strongest neighbours of the lines that ring which lie within half the widths d/π of both."""
    strong = 1e-2  # of the strongest line's energy: a line worth another strike
    keep = select_ringing(e.lines)
    energy = np.nan_to_num(e.lines.energy)
    keep = keep[energy[keep] >= strong * energy[keep].max(initial=0)]
    found = [
        (float(min(energy[a], energy[b])), float(e.lines.freq_hz[a]), float(e.lines.freq_hz[b]))
        for a, b in pairwise(keep)
        if e.lines.freq_hz[b] - e.lines.freq_hz[a] < (e.lines.decay_per_s[a] + e.lines.decay_per_s[b]) / (2 * np.pi)
    ]
    return max(found)[1:] if found else None
