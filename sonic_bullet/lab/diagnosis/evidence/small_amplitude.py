"""Frequencies of modes at small amplitude, under an effect by which they depend on their level.

    line k of strike s, shifted to 0 Hz: recorded z(t), synthesized z'(t)      δ_k -> argmax Σ_s |Σ_t w z z'* / |z z'|
        e^{−2πi δ t}|      f_k -> f_k + δ_k

A linear fit finds such a mode at its frequency while it is loud, and the mesh's correction was learnt on that: with the
effect it would shift from the wrong end. The sign and size of the shift stay the effect's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.lab.diagnosis.evidence.amplitude_dependence import amplitude_dependent
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import object_evidence
from sonic_bullet.lab.diagnosis.evidence.unmatched_modes import MOST_CORRECTION
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import Prediction, predict
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.effects.common.envelope import Envelopes, alone, extract_envelopes
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.records import Array


def at_rest(
    h: Hypothesis, bodies: tuple[StruckBody, ...], observed: tuple[ObjectEvidence, ...], *, every: bool = False
) -> Hypothesis:
    """Learn the corrections of amplitude-dependent modes on their frequencies at small amplitude.

    Parameters
    ----------
    h : Hypothesis
        The hypothesis.
    bodies : tuple of StruckBody
        The objects.
    observed : tuple of ObjectEvidence
        The strikes to learn from.
    every : bool
        Correct all isolated modes.
    """
    found = dict(h.correction or {})
    for body in bodies:
        mine = next((one for one in observed if body.recorded is not None and one.source is body.recorded), None)
        if mine is not None and mine.signal is not None and not mine.dry:  # in a room no line is one mode's alone
            found[body.name] = _correct_at_rest(predict(h, body), mine.strike, every)
    return replace(h, correction=found)


def _correct_at_rest(p: Prediction, strike: tuple[int, ...], every: bool) -> Array:
    """Compute the corrections (m,) of a body."""
    halfway = 0.5  # to the next mode
    body, modes, count = p.body, p.model, p.base.mode_count
    assert body.recorded is not None and body.recorded.signals is not None
    correction = np.array((p.hypothesis.correction or {}).get(body.name, np.zeros(count)), float)
    one = replace(object_evidence(p, sounds=False), strike=strike)
    dependent = np.ones(len(one.freq_hz), bool) if every else amplitude_dependent(p, one)
    selected, window = alone(one)
    # degenerate modes shift each by its own level, and beat
    kept = [q for q, k in enumerate(selected) if dependent[k] and len(one.mode[k]) == 1]
    if not kept or len(correction) != count:
        return correction
    selected, window = [selected[q] for q in kept], [window[q] for q in kept]
    signal = body.recorded.signals[list(strike)]
    played = p.sounds(p.strikes_of(one), signal.shape[1], body.recorded.sr)
    rows = replace(one, noise=one.noise[list(strike)], impulse_n_s=one.impulse_n_s[list(strike)])
    recorded, model = (
        extract_envelopes(rows, signal, selected, window),
        extract_envelopes(rows, played, selected, window),
    )
    for q, k in enumerate(selected):
        # or it would be taken for its neighbour
        next_hz = np.abs(np.delete(modes.freq_hz, one.mode[k]) - modes.freq_hz[one.mode[k]]).min(initial=np.inf)
        ratio = 1 + _off_hz(
            recorded, model, q, min(MOST_CORRECTION * float(one.freq_hz[k]), halfway * float(next_hz))
        ) / float(one.freq_hz[k])
        who = p.order[one.mode[k]]
        correction[who] = np.clip((1 + correction[who]) * ratio - 1, -MOST_CORRECTION, MOST_CORRECTION)
    return correction


def _off_hz(recorded: Envelopes, model: Envelopes, q: int, most_hz: float) -> float:
    """Compute δ of a line in Hz."""
    least_frames = 8  # frames
    rows = []
    for s in range(len(recorded.z)):
        use = recorded.good[s, q] & (np.abs(model.z[s, q]) > 0)
        if use.sum() < least_frames:
            continue
        both = recorded.z[s, q, use] * np.conj(model.z[s, q, use])
        rows.append((recorded.time_s[q, use], recorded.worth(s, q)[use] * both / np.abs(both)))
    if not rows:
        return 0.0
    longest = max(float(np.ptp(t)) for t, _ in rows)
    frame = min(float(np.median(np.diff(t))) for t, _ in rows)
    delta_step = 0.1  # of 1/duration: steps of δ
    step, reach = delta_step / longest, min(most_hz, 0.4 / frame)

    def agree(delta: Array) -> Array:
        return np.asarray(np.sum([np.abs(u @ np.exp(-2j * np.pi * np.outer(t, delta))) for t, u in rows], axis=0))

    coarse = step * np.arange(-int(reach / step), int(reach / step) + 1)
    score = agree(coarse)
    best = int(score.argmax())
    agreeing = 0.5  # of all frames' worth, once shifted: what is played is what was recorded
    if best in (0, len(coarse) - 1) or score[best] < agreeing * sum(float(np.abs(u).sum()) for _, u in rows):
        return 0.0  # its best is elsewhere, or nowhere
    fine = coarse[best] + step * np.linspace(-1, 1, 41)
    return float(fine[int(agree(fine).argmax())])
