"""How much of what is heard no linear body plays: lines whose phase differs from strike to strike.

    A_ks = J_s Φ_k(x_s) e^{iθ_k}, real but for one phase a line:   |Σ_s A²| / Σ_s |A|² = 1        [reciprocity; Ewins 2000, §2.2]

Whatever a mesh gets wrong, and whatever a room or a dashpot does, a mode's line keeps its phase but for a sign, wherever and however hard a body is struck. A level that swings, a part that
rattles or an echo that moves makes lines of its own, side by side with the modes', that the fit tells and that do not.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.diagnosis.judge import Judged, Take
from sonic_bullet.estimator.distance import log_spectral_db, with_noise
from sonic_bullet.estimator.lines import Lines
from sonic_bullet.records import Array

IN_PHASE = 0.8  # of a line's energy, where 1 has one phase but for signs


def out_of_phase(lines: Lines) -> Array:
    """Which lines (k,) have phases that differ between strikes by more than a sign; none where onsets are not known, or of one strike."""
    energy = (np.abs(lines.amplitude) ** 2).sum(axis=0)
    noise = (lines.amplitude_sd**2).sum(axis=0)
    same = np.abs((lines.amplitude**2).sum(axis=0))
    return np.asarray((same < IN_PHASE * (energy - noise)) & lines.signed)


def of_no_body(takes: Sequence[Judged]) -> float:
    """What lines that are out of phase say of the strikes, in dB of the distance: of all lines played, how much farther off without them."""
    more = []
    for take in takes:
        if not isinstance(take, Take):
            continue
        gathered, strike = take.place
        odd = out_of_phase(gathered.lines)
        if odd.any():
            more.append(_off(take, gathered.lines, strike, ~odd) - _off(take, gathered.lines, strike, odd | True))
        else:
            more.append(0.0)
    return float(np.nanmean(more)) if more else 0.0


def _off(take: Take, lines: Lines, strike: int, use: Array) -> float:
    """D of a take and its lines (k,) alone."""
    t = np.arange(len(take.sample)) / take.sr
    made = np.zeros(len(t))
    for a, pole in zip(lines.amplitude[strike, use], lines.pole[use], strict=True):
        made += (a * np.exp(pole * t)).real
    return log_spectral_db(take.sample, with_noise(made, take.floor, take.strike), take.floor)
