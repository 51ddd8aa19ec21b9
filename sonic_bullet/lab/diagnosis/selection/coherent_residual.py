"""Part of an open distance that no body of real modes explains: no sum of lines with one phase each at all strikes.

    A_ks = J_s Φ_k(x_s) |F̂_s| e^{iθ_k − 2πi f_k D_s}, but for its sign:    |Σ_s a²|/Σ_s |a|² = 1,   a = A e^{2πi f
        D_s}/|A_s|      [real modes: Ewins 2000, ch. 2]

One phase a line and one delay a strike, the middle of its pulse. Whatever the errors of a mesh, that stays so, wherever
and however hard a body is struck once. A level that swings, a part that rattles or an echo that moves makes lines of
its own, near the modes', that the fit identifies and that are out of phase, and a mode that depends on its level is no
line at all. The same holds of pairs too near each other to be separated, of modes that dashpots couple, and of a room's
modes: a verdict uses this only before it attributes to a mesh what nothing explains.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.lab.diagnosis.prediction.prediction import Predictions
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation, ScoredObservation
from sonic_bullet.lab.fit.prediction_of_lines import damped_sum
from sonic_bullet.lab.fit.recorded import RecordedObject as Recorded
from sonic_bullet.lab.lines.joint_lines import Lines, lines_of, noise_rms
from sonic_bullet.records import Array

DELAY_S = np.linspace(-2.5e-4, 2.5e-4, 101)  # between the middles of a soft impact's pulse and a hard one's


def out_of_phase(lines: Lines) -> Array:
    """Find the lines (k,) whose phases differ between strikes by more than a sign and a delay.

    None where onsets are not known, or of one strike.
    """
    in_phase = 0.8  # of a line's energy, where 1 has one phase but for signs
    loud = np.linalg.norm(lines.amplitude, axis=1, keepdims=True)
    a = lines.amplitude / np.maximum(loud, 1e-300)  # every strike has as much to say, however soft
    noise = 2 * ((lines.amplitude_sd / np.maximum(loud, 1e-300)) ** 2).sum(axis=0)
    a = _in_time(a, lines.freq_hz)
    return np.asarray((np.abs((a**2).sum(axis=0)) < in_phase * ((np.abs(a) ** 2).sum(axis=0) - noise)) & lines.signed)


def _in_time(a: Array, freq_hz: Array) -> Array:
    """Remove one delay a strike from amplitudes (s, k), found by all lines: each against the others, in turns."""
    sweeps = 3
    turn = np.exp(4j * np.pi * np.outer(DELAY_S, freq_hz))  # of a²
    for _ in range(sweeps):
        for s in range(len(a)):
            common = (a**2).sum(axis=0) - a[s] ** 2
            best = int((turn @ (a[s] ** 2 * np.conj(common) / np.maximum(np.abs(common), 1e-300))).real.argmax())
            a = np.concatenate([a[:s], (a[s] * np.exp(2j * np.pi * freq_hz * DELAY_S[best]))[None], a[s + 1 :]])
    return a


def incoherent_fraction(takes: Sequence[ScoredObservation], made: Predictions) -> float:
    """Compute the fraction, 0 to 1, of the squared distance over noise that the strikes' lines in phase leave."""
    observed = [take for take in takes if isinstance(take, AudioObservation)]
    played = {id(g): _synthesize_coherent(g) for g in {id(t.place[0]): t.place[0] for t in observed}.values()}
    left, gap = 0.0, 0.0
    for take in observed:
        (recorded, strike), p = take.place, made[take.body]
        mine, off, least = _off(take, played[id(recorded)][strike]), take.distance(p), take.least(p)
        left, gap = left + max(mine**2 - least**2, 0.0), gap + max(off**2 - least**2, 0.0)
    return float(min(left / gap, 1.0)) if gap > 0 else 0.0


def _synthesize_coherent(g: Recorded) -> Array:
    """Synthesize the lines that are in phase (s, n), identified without the others where there are others."""
    assert g.signals is not None
    odd = out_of_phase(g.lines)
    lines = (
        lines_of(g.signals, noise_rms(g.signals, g.sr), g.lines.pole[~odd], g.sr, g.lines.signed)
        if odd.any()
        else g.lines
    )
    count = g.signals.shape[1]
    return np.stack([damped_sum(lines.freq_hz, lines.decay_per_s, row, count, g.sr) for row in lines.amplitude])


def _off(take: AudioObservation, made: Array) -> float:
    """Compute D of a take and a synthesis."""
    n = len(take.sample)
    return take.apart_db(np.pad(made, (0, max(n - len(made), 0)))[:n])
