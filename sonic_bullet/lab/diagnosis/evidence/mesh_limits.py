"""Errors of a mesh: how much of an unexplained distance may be theirs.

    modes moved at random as much as the others are off           -> what that adds                    (of_the_mesh)
    lines of no mode, that have a mode's pattern and lie FAR_FOR_MESH from it at most, where waves are short: modes put
        there     -> what is left   (with_unmatched_modes_moved)
    modes FAR_FOR_MESH below the band's edge at most, of which nothing is recorded: modes put
        outside   -> the same

A correction is 1 % at most and part of the baseline; finite elements of a coarse mesh err by more in the upper modes,
with h⁴ of quadratic ones [Hughes 2000, ch. 7]. That is no effect to be named, so a verdict takes it into account; the
sounds before and after do not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.lab.diagnosis.evidence.degenerate_pairs import LEAST_PATTERN_STRIKES, SAME_PATTERN_COSINE, like
from sonic_bullet.lab.diagnosis.evidence.refit import ROUGH_LINES, refit_material
from sonic_bullet.lab.diagnosis.prediction.diagnosis_problem import DiagnosisProblem
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import Prediction, predict
from sonic_bullet.lab.diagnosis.prediction.score import AudioObservation, Comparable, mean_db, predict_takes
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.fit.pairing import degenerate_runs
from sonic_bullet.records import Array
from sonic_bullet.signal.log_spectral import with_noise

MESH = 1e-3  # of a frequency: what a good mesh gets wrong
FAR_FOR_MESH = 0.03  # of a frequency: what a coarse one does, in modes of few elements a wavelength


def with_unmatched_modes_moved(h: Hypothesis, problem: DiagnosisProblem) -> tuple[Hypothesis, float]:
    """Move unmatched modes to lines of their pattern, or outside the band.

    Returns
    -------
    Hypothesis, float
        With these corrections, and the largest move, relative: 0 where there was none.
    """
    start, most, learnt = h, 0.0, h.correction or {}
    fitted = [b for b in problem.bodies if b.recorded is not None and b.family is not None]
    # modes of another tensor have no lines yet
    mine = [b for b in fitted if len(b.fitted) >= LEAST_PATTERN_STRIKES and len(learnt.get(b.name, ())) == len(b.line)]
    for body in mine:
        found, off = _match_modes(predict(h, body))
        if off:
            h, most = replace(h, correction={**(h.correction or {}), body.name: found}), max(most, off)
    h = refit_material(h, problem.bodies) if most else h
    for body in mine:
        h, off = _outside(start, h, body, problem)
        most = max(most, off)
    return h, most


def finer_mesh_db(h: Hypothesis, problem: DiagnosisProblem) -> Array:
    """Compute how much nearer a finer mesh would come (s,), in dB, at each strike: what moved modes take away."""
    far, most = with_unmatched_modes_moved(h, problem)
    if not most:
        return np.zeros(len(problem.takes))
    now, then = problem.predict(h), problem.predict(far)
    return np.array([max(t.distance(now[t.body]) - t.distance(then[t.body]), 0.0) for t in problem.takes])


def _outside(start: Hypothesis, h: Hypothesis, body: StruckBody, problem: DiagnosisProblem) -> tuple[Hypothesis, float]:
    """Move a body's modes near the band's upper edge outside it, from the top, where strikes are nearer so."""
    nearer_db = 0.05  # without a mode, that ought to be silent
    p = predict(h, body)
    model, order = p.model, p.order
    old, most, top = (start.correction or {})[body.name], 0.0, body.band_hz[1]
    group = degenerate_runs(model.freq_hz)
    free = (body.line[order] < 0) & (old[order] == (h.correction or {})[body.name][order])
    near = free & (model.freq_hz <= top) & (model.freq_hz * (1 + FAR_FOR_MESH) > top)
    if not near.any():
        return h, most
    now = problem.distance_db(h)
    for g in np.unique(group[near])[::-1]:
        who = np.flatnonzero((group == g) & near)
        step = float(top / model.freq_hz[who].min() * (1 + MESH) - 1)
        other = (h.correction or {})[body.name].copy()
        other[order[who]] = (1 + other[order[who]]) * (1 + step) - 1
        silent = replace(h, correction={**(h.correction or {}), body.name: other})
        far = problem.distance_db(silent)
        if far < now - nearer_db:
            h, now, most = silent, far, max(most, step)
    return h, most


def _match_modes(p: Prediction) -> tuple[Array, float]:
    """Compute corrections (m,) that move a body's unmatched modes to their lines, the loudest first; largest step."""
    body, model, order = p.body, p.model, p.order
    assert body.recorded is not None and p.hypothesis.correction is not None
    lines, correction = body.recorded.lines, p.hypothesis.correction[body.name]
    observed = np.abs(lines.amplitude)
    row = p.pattern()[body.fitted[: len(observed)]]
    matched = body.line[order] >= 0
    upper = np.median(model.freq_hz[matched]) if matched.any() else np.inf
    group = degenerate_runs(model.freq_hz)
    found, most = correction.copy(), 0.0
    for k in sorted(
        set(range(len(lines.freq_hz))) - set(body.line.tolist()), key=lambda k: -float(observed[:, k].max())
    ):
        if lines.freq_hz[k] < upper:
            continue
        near = np.unique(group[~matched & (np.abs(np.log(model.freq_hz / lines.freq_hz[k])) < FAR_FOR_MESH)])
        members = [np.flatnonzero(group == g) for g in near]
        alike = [like(lines.amplitude[:, k], row[:, who]) if not matched[who].any() else 0.0 for who in members]
        if not alike or max(alike) < SAME_PATTERN_COSINE:
            continue
        who = members[int(np.argmax(alike))]
        step = float(lines.freq_hz[k] / model.freq_hz[who].mean() - 1)
        matched[who], most = True, max(most, abs(step))
        found[order[who]] = (1 + found[order[who]]) * (1 + step) - 1
    return found, most


def of_the_mesh(h: Hypothesis, problem: DiagnosisProblem) -> float:
    """Estimate what a mesh's errors would add to the distance, in dB.

    Modes that no line could correct are moved at random by as much as the others were corrected, and every shape at the
    strikes by ROUGH of its strongest there.
    """
    rng = np.random.default_rng([problem.seed, 5])
    moved, other = dict(h.correction or {}), {}
    for body in problem.bodies:
        mine = moved.get(body.name)
        if mine is None or body.recorded is None or len(mine) != len(body.line):
            continue
        paired = body.line >= 0
        size = float(np.sqrt((mine[paired] ** 2).mean())) if paired.any() else 0.0
        moved[body.name] = np.where(paired, mine, mine + max(size, MESH) * rng.standard_normal(len(mine)))
        model = body.model if h.poisson is None or body.other is None else body.other(h.poisson)
        other[body.name] = _roughen_shapes(replace(body, model=model, other=None), rng)
    far = replace(h, correction=moved)
    takes = [t for t in problem.takes if isinstance(t, AudioObservation)]
    if not takes:
        return 0.0  # lists of lines are held against frequencies alone, and corrected by them
    made = predict_takes(h, takes)
    twice = [replace(t, sample=with_noise(t.synthesize(made[t.body]), t.floor, 1000 + t.strike)) for t in takes]
    rough = [replace(t, body=other.get(t.body.name, t.body)) for t in twice]
    moved_db = mean_db(Comparable(tuple(rough)), predict_takes(far, rough))
    return moved_db - mean_db(Comparable(tuple(twice)), made)


def _roughen_shapes(body: StruckBody, rng: np.random.Generator) -> StruckBody:
    """Change shapes at a body's strikes at random by ROUGH of each mode's strongest there."""
    shape = body.model.shape.copy()
    at = slice(body.surface_count(), len(shape) - 1)
    most = np.abs(np.einsum("sxm,sx->sm", shape[at], body.direction[:-1])).max(axis=0)
    shape[at] += (
        ROUGH_LINES * most * rng.standard_normal((body.strikes, 1, len(most))) * body.direction[:-1, :, None]
    ).astype(np.float32)
    return replace(body, model=replace(body.model, shape=shape))
