"""Baseline fitted again with effects: α, β, σ and the corrections, from the same lines.

    d − Δd(effects) = ½(α + βλ)         (estimator.rayleigh)
    |A_sk| = σ |J ψ F̂|                  (line_likelihood.py, 2 % of a mode's strongest for the shapes' own error)

A correction is the mesh's error alone: a mode that an effect moves keeps only what is left of it, within 1 %.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.effects.protocol import BaselineChange, ChangesBaseline, Dereverberates, Effect, SplitsPairs, Stage
from sonic_bullet.lab.diagnosis.evidence.air_factor import air_factor
from sonic_bullet.lab.diagnosis.evidence.amplitude_dependence import TURNS_RAD, fallen, turns_rad
from sonic_bullet.lab.diagnosis.evidence.effect_evidence import (
    noise_of,
    object_evidence,
    outside,
    pair_lines_with_modes,
    path_response,
)
from sonic_bullet.lab.diagnosis.evidence.small_amplitude import at_rest
from sonic_bullet.lab.diagnosis.evidence.unmatched_modes import MOST_CORRECTION, can_tell, search_corrections
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis, bends, moves
from sonic_bullet.lab.diagnosis.prediction.prediction import (
    Prediction,
    impact_of,
    predict,
    predict_fitted,
    undamped_model,
)
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.effects.common.line_likelihood import fit_gain
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.lab.effects.searches import identified_from
from sonic_bullet.lab.fit.pairing import DEGENERATE_SPLIT, MESHED_SPLIT_RATIO, degenerate_runs
from sonic_bullet.lab.fit.rayleigh import rayleigh
from sonic_bullet.records import Array, ModalModel
from sonic_bullet.signal.robust import weighted_median

ROUGH_LINES = 0.02


def refit_material(
    h: Hypothesis,
    bodies: tuple[StruckBody, ...],
    observed: tuple[ObjectEvidence, ...] | None = None,
    *,
    anew: bool = False,
) -> Hypothesis:
    """Fit α, β and σ again with a hypothesis' effects.

    Parameters
    ----------
    h : Hypothesis
        The hypothesis.
    bodies : tuple of StruckBody
        The objects.
    observed : tuple of ObjectEvidence
        Evidence to fit to, thinned or whole, of all bodies or some; all where None.
    anew : bool
        Pair lines and learn corrections again, as with effects that move modes.
    """
    moved = anew or moves(h)
    if moved:
        h = correct_modes(h, bodies, anew=anew)
    if observed is None or moved:
        bare = replace(h, effects=tuple(e for e in h.effects if e.stage is not Stage.SOUND))
        observed = tuple(object_evidence(p, sounds=False, anew=anew) for p in predict_fitted(bare, bodies).values())
    observed = tuple(outside(h, one, foreign=False) for one in observed)  # a refit asks no others of what is dry
    if bends(h):
        observed = tuple(fallen(predict(h, _whose(one, bodies)), one) for one in observed)
    h = _refit_gain(_refit_damping(h, bodies, observed), bodies, observed)
    return at_rest(h, bodies, observed) if bends(h) else h


def reidentify_room(
    h: Hypothesis,
    bodies: tuple[StruckBody, ...],
    observed: tuple[ObjectEvidence, ...] | None = None,
    *,
    fully: bool = False,
) -> Hypothesis:
    """Identify a room's response again, with all other effects.

    Parameters
    ----------
    h : Hypothesis
        The hypothesis.
    bodies : tuple of StruckBody
        The objects.
    observed : tuple of ObjectEvidence
        The strikes it is identified from; all where None.
    fully : bool
        Iterate to convergence.
    """
    # lists of lines say nothing of a response
    fitted = [b for b in bodies if b.recorded is not None and b.recorded.signals is not None]
    if observed is not None:
        fitted = [b for b in fitted if any(one.source is b.recorded for one in observed)]
    if not fitted:
        return h
    body = max(fitted, key=lambda b: len(np.unique(b.line[b.line >= 0])))  # most lines that are modes
    for room in (e for e in h.effects if isinstance(e, Dereverberates)):
        g = body.recorded
        assert g is not None and g.signals is not None
        mine = (
            list(range(len(g.signals)))
            if observed is None
            else next(list(one.strike) for one in observed if one.source is g)
        )
        signal = g.signals[mine]
        bare = replace(h, effects=tuple(e for e in h.effects if e is not room))
        sound = predict(bare, body).sounds([body.fitted[i] for i in mine], signal.shape[1], g.sr)
        again = identified_from(room, signal, sound, noise_of(g)[1], g.sr, fully=fully)
        h = replace(h, effects=tuple(again if e is room else e for e in h.effects))
    return h


def baseline_changes(h: Hypothesis) -> list[BaselineChange]:
    """Return the changes of the baseline that its effects have found, in their order."""
    return [e.baseline_change() for e in h.effects if isinstance(e, ChangesBaseline)]


def _whose(one: ObjectEvidence, bodies: tuple[StruckBody, ...]) -> StruckBody:
    """Find the body of an object's evidence."""
    return next(body for body in bodies if body.recorded is one.source)


def with_effects(h: Hypothesis, effects: tuple[Effect, ...], bodies: tuple[StruckBody, ...]) -> Hypothesis:
    """Replace the effects of a hypothesis, without a refit.

    Where none moves modes any more, or bends them otherwise, corrections are the baseline's again.
    """
    made = replace(h, effects=effects)
    return (
        made
        if moves(made) or not (moves(h) or bends(h))
        else replace(made, stretch=0.0, poisson=None, correction={b.name: b.correction for b in bodies})
    )


def correct_modes(h: Hypothesis, bodies: tuple[StruckBody, ...], *, anew: bool = False) -> Hypothesis:
    """Learn E/ρ and corrections on the hypothesis' own modes; anew: see `refit_material`.

    From where its effects have found E/ρ and ν (``stretch``, ``poisson_ratio``).
    """
    changes = baseline_changes(h)
    known = [c.poisson_ratio for c in changes if c.poisson_ratio is not None]
    h = replace(
        h, correction=None, stretch=float(sum(c.stretch for c in changes)), poisson=known[-1] if known else None
    )
    for _ in range(3):
        off = np.concatenate(
            [_off(predict(h, body), anew)[1] for body in bodies if body.recorded is not None] or [np.zeros(0)]
        )
        if len(off):
            h = replace(h, stretch=h.stretch + float(np.median(off)))
    found: dict[str, Array] = {}
    for body in bodies:
        if body.recorded is None:
            continue
        own_hz = undamped_model(h, body).freq_hz
        # lines of degenerate modes go to their own: half a split off, either would do
        for e in (e for e in h.effects if isinstance(e, SplitsPairs)):
            found[body.name] = np.clip(
                e.observed_correction(own_hz * np.exp(h.stretch)), -MOST_CORRECTION, MOST_CORRECTION
            )
        for _ in range(2):
            place, off = _off(predict(replace(h, correction=found), body), anew)
            ratio = np.array(found.get(body.name, np.zeros(len(own_hz))), float)
            step = np.zeros(len(ratio))
            step[place] = np.expm1(off)
            found[body.name] = np.clip((1 + ratio) * (1 + step) - 1, -MOST_CORRECTION, MOST_CORRECTION)
            if not moves(h) or any(isinstance(e, SplitsPairs) for e in h.effects):
                found[body.name] = _alike(own_hz, found[body.name])
        if can_tell(body):
            now = predict(replace(h, correction=found), body)
            groups = [now.order[who] for who in pair_lines_with_modes(now, anew=anew)[1]]
            lone = np.setdiff1d(np.arange(len(ratio)), np.concatenate([*groups, np.zeros(0, int)]))
            shared = np.concatenate([*(g for g in groups if len(g) > 1), np.zeros(0, int)])
            found[body.name] = search_corrections(
                now, np.concatenate([lone, shared]), alone=np.isin(np.arange(len(ratio)), lone)
            )
    return replace(h, correction=found)


def _alike(freq_hz: Array, correction: Array) -> Array:
    """Average corrections (m,) over each run of degenerate modes, as their splitting is an effect's.

    Otherwise they would change places.
    """
    run = degenerate_runs(freq_hz, DEGENERATE_SPLIT * MESHED_SPLIT_RATIO)
    return np.asarray((np.bincount(run, correction) / np.maximum(np.bincount(run), 1))[run])


def _off(p: Prediction, anew: bool) -> tuple[Array, Array]:
    """Return the uncorrected modes (p,) of a body that have lines, and ln f of the lines over their own (p,)."""
    assert p.body.recorded is not None
    line, mode = pair_lines_with_modes(p, anew=anew)
    place = np.concatenate([p.order[who] for who in mode]) if mode else np.zeros(0, int)
    lines = p.body.recorded.lines.freq_hz
    off = np.concatenate(
        [
            np.full(len(who), np.log(lines[one] / p.model.freq_hz[who].mean()))
            for one, who in zip(line, mode, strict=True)
        ]
        or [np.zeros(0)]
    )
    return place, off


def _refit_damping(h: Hypothesis, bodies: tuple[StruckBody, ...], observed: tuple[ObjectEvidence, ...]) -> Hypothesis:
    """Fit α and β with the effects' own decay."""
    if any(e.traits.replaces_rayleigh for e in h.effects):
        return h
    known = [
        (c.alpha_per_s, c.beta_s) for c in baseline_changes(h) if c.alpha_per_s is not None and c.beta_s is not None
    ]
    if known:
        return replace(h, alpha_per_s=known[-1][0], beta_s=known[-1][1])
    bare = replace(h, alpha_per_s=0.0, beta_s=0.0)
    lam, left, sd, all_of_it, air = [], [], [], [], []
    for one in observed:
        if not len(one.freq_hz):
            continue
        extra = radiated = np.zeros(len(one.freq_hz))
        if moves(h):  # ``one`` is of h itself, and its lines are paired anew
            extra = np.maximum(one.expected_decay_per_s - (h.alpha_per_s + h.beta_s * one.omega**2) / 2, 0.0)
        elif h.at(Stage.MODES) or h.air:
            extra = _predict_decays(predict(bare, _whose(one, bodies)), one)
            if h.air:
                radiated = np.maximum(
                    extra - _predict_decays(predict(replace(bare, air=0.0), _whose(one, bodies)), one), 0.0
                )
        lam.append(one.omega**2)
        left.append(one.decay_per_s - extra)
        air.append(radiated)
        sd.append(np.hypot(one.decay_sd_per_s, 0.02 * extra))
        all_of_it.append(one.decay_per_s)
    if not lam:
        return h
    guess = (max(h.alpha_per_s, 1e-3), max(h.beta_s, 1e-12))
    lines, rest, spread, whole_decay, lost = (np.concatenate(many) for many in (lam, left, sd, all_of_it, air))
    if h.air and lost.any():
        factor = air_factor(lines, rest + lost, np.hypot(spread, ROUGH_LINES * whole_decay), lost / h.air)
        h, rest = replace(h, air=factor), rest + (1 - factor / h.air) * lost
    rest = np.maximum(rest, 1e-3 * whole_decay)
    found = rayleigh(lines, rest, spread, guess, whole_decay)
    return replace(h, alpha_per_s=found.alpha_per_s, beta_s=found.beta_s)


def _predict_decays(bare: Prediction, one: ObjectEvidence) -> Array:
    """Compute the decays (k,) of the lines' modes by a prediction."""
    return np.array([bare.model.decay_per_s[who].mean() for who in _members(one, bare.model)])


def _members(one: ObjectEvidence, model: ModalModel) -> list[Array]:
    """Find the modes of each line, by index, in a model whose modes have hardly moved: about the nearest one."""
    near = model.freq_hz[np.abs(np.subtract.outer(one.freq_hz, model.freq_hz)).argmin(axis=1)]
    return [
        np.argsort(np.abs(model.freq_hz - f), kind="stable")[: len(who)] for f, who in zip(near, one.mode, strict=True)
    ]


def _participation(p: Prediction, one: ObjectEvidence) -> Array:
    """Compute Jψ (s, k) of the lines under effects that leave modes where they were."""
    row = p.pattern()[p.strikes_of(one)]
    return np.stack([row[:, who].sum(axis=1) for who in _members(one, p.model)], axis=1)


def whole(one: ObjectEvidence) -> Array:
    """Add to amplitudes (s, k) those of lines so near that they may be the same mode, bent or split.

    At the onset they add up to the excitation.
    """
    if one.dry or not len(one.foreign_hz) or not len(one.freq_hz):
        return one.amplitude  # in a room what rings close by is mostly the room
    gap = np.abs(np.log(one.foreign_hz[:, None] / one.freq_hz[None, :]))
    near_lines, alike_decays = 5e-3, 1.6  # of ln f and ln d: lines of one mode
    # clicks are no part of a mode
    alike = (
        np.abs(np.log(np.maximum(one.foreign_decay_per_s[:, None], 1e-3) / np.maximum(one.decay_per_s, 1e-3)))
        < alike_decays
    )
    mine = (gap.argmin(axis=1)[:, None] == np.arange(len(one.freq_hz))) & (gap < near_lines) & alike
    return np.asarray(one.amplitude + one.foreign_amplitude @ mine)


def _middle(ratio: Array, weight: Array) -> float:
    """Compute a weighted median, weights within 100 to 1, from which an iteration of weights may start."""
    return weighted_median(ratio, np.clip(weight, weight.max() / 100, None))


def _refit_gain(h: Hypothesis, bodies: tuple[StruckBody, ...], observed: tuple[ObjectEvidence, ...]) -> Hypothesis:
    """Fit σ to the amplitudes, times the gains of effects that hide them from the lines."""
    louder = float(np.prod([c.onset_gain for c in baseline_changes(h)]))
    modeled, seen, spread = [], [], []
    others = bool(h.at(Stage.MODES)) and not moves(h)  # participations than the evidence's own
    for one in observed:
        lines_play = _whose(one, bodies).own_decay_per_s is not None and not h.effects  # as loud as `fit` plays them
        if not len(one.freq_hz) or one.signal is None or lines_play:
            continue
        p = predict(h, _whose(one, bodies)) if others or bends(h) else None
        direct = np.abs(path_response(h, one.freq_hz, one.sr))
        factor = np.empty(one.pattern.shape)
        for i, level in enumerate(one.impulse_n_s):
            impact = impact_of(float(level), h.at(Stage.FORCE))
            hits = np.abs(
                (
                    impact.share[:, None]
                    * np.exp((one.decay_per_s - 2j * np.pi * one.freq_hz) * impact.delay_s[:, None])
                ).sum(axis=0)
            )
            factor[i] = np.abs(impact.spectrum(one.freq_hz)) * direct * hits
        expected = np.abs(_participation(p, one) if p and others else one.pattern) * factor
        if p and bends(h) and not (dependent := turns_rad(p, one) > TURNS_RAD).all():
            expected = np.where(dependent, np.nan, expected)  # of an amplitude-dependent mode a linear fit takes a part
        modeled.append(expected.ravel())
        seen.append(np.abs(whole(one)).ravel())
        rough = np.broadcast_to(ROUGH_LINES * np.nan_to_num(expected).max(axis=0, keepdims=True), expected.shape)
        spread.append(np.stack([one.amplitude_sd.ravel(), rough.ravel()]))
    if not modeled:
        return h
    x, y, s = np.concatenate(modeled), np.concatenate(seen), np.concatenate(spread, axis=1)
    good = np.isfinite(x) & np.isfinite(y) & np.isfinite(s).all(axis=0)
    x, y, s = x[good], y[good], s[:, good]
    if not (x > 0).any():
        return h
    if any(one.dry for one in observed):  # read through a room, a line is off by a factor of its own
        usable = (x > 0) & (y > 0) & (s[0] > 0)
        return (
            replace(h, gain=_middle(y[usable] / x[usable], (y / np.maximum(s[0], 1e-300))[usable]))
            if usable.any()
            else h
        )
    start = _middle(y[x > 0] / x[x > 0], x[x > 0] / (s[0] + s[1])[x > 0])
    gain = fit_gain(y, x, s[0], s[1] + 1e-150, max(start, 1e-12)).gain
    return replace(h, gain=gain * louder) if gain > 0 and np.isfinite(gain) else h
