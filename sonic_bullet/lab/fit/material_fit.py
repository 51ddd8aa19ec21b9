"""Recordings -> material: each line's mode, γ and ν from frequencies, α and β from decays, σ from amplitudes.

    Evidence per object -> lines, of two kinds (choose_lines)
                        -> pairs (pairing.py), all objects at one (γ, ν) -> ln γ, ν: weighted least squares on ln λ
                        -> d − Δd = ½(α + βλ) (rayleigh.py)   [Ren, Yeh, Lin 2013, eq. 6; Δd: radiation_share.py]
                        -> A_sj = σ J_s ψ_sj             [eq. 11, 13; observation.py]
    -> MaterialFit, one correction a mode (the mesh's error, at most 1 %), and a verdict

The lines are maximum-likelihood estimates with their Cramér-Rao spreads, so least squares on them loses nothing against
a fit of the samples. E and ρ come apart only by a mass or a known gain: ρ is the guess's, E = γρ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from sonic_bullet.files.cases import Case
from sonic_bullet.files.storage.cache import Place
from sonic_bullet.lab.effects.common.hum import without_hum
from sonic_bullet.lab.fit.case_fit import POISSON_GUESS_SD, POISSON_IDENTIFIED_SD, CaseFit, ObjectFit
from sonic_bullet.lab.fit.chance_pairs import paired_by_chance
from sonic_bullet.lab.fit.dimension_tolerance import poisson_sd_of_dimensions
from sonic_bullet.lab.fit.fit_verdict import build_fit
from sonic_bullet.lab.fit.held_out_takes import judged_by_takes
from sonic_bullet.lab.fit.object_fit import fitted_object, gain_of, object_of
from sonic_bullet.lab.fit.pairing import (
    MESH_SD,
    Pairs,
    assign,
    best_pairs,
    group_modes,
    learnt_mesh_sd,
    pair_lines,
    solve,
)
from sonic_bullet.lab.fit.radiation_share import GroupRadiation, in_air, radiation_in
from sonic_bullet.lab.fit.rayleigh import rayleigh
from sonic_bullet.lab.fit.recorded import RecordedObject, gather
from sonic_bullet.lab.lines.after_attack import ringing_lines
from sonic_bullet.lab.lines.joint_lines import HIGHEST_OF_RATE, RINGING_LINES, Lines, noise_rms
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.machine.progress import report_progress, show_progress
from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError, FileError

__all__ = [
    "CaseFit",
    "ObjectFit",
    "choose_lines",
    "fit_case",
    "fit_evidence",
    "gain_of",
    "object_of",
]


@one_thread()
def fit_case(case: Case, *, cache: Place = "default", progress: Callable[[str], None] | None = None) -> CaseFit:
    """Fit the material of a case, from its 'fit' strikes alone.

    Raises SonicBulletError where a file, mesh or number makes a fit impossible; what the recordings do not say stands
    in the verdict instead.
    """
    with show_progress(progress):
        evidence = choose_lines(case, gather(case, cache=cache))
        return judged_by_takes(fit_evidence(case, evidence, cache=cache))


@one_thread()
def choose_lines(case: Case, evidence: tuple[RecordedObject, ...]) -> tuple[RecordedObject, ...]:
    """Return the evidence with lines from the onset on, or of what rings after the attack.

    The latter where the former find no more modes of their shapes than by chance, and they do. A real take's attack is
    no sum of lines: hundreds describe it, and hide the few that are modes. Where no shape is known lines are only
    played again, and those from the onset on predict other takes better.
    """
    shaped = tuple(e for e in evidence if e.family is not None and e.signals is not None and len(e.lines.freq_hz))
    if not shaped or not _by_chance(shaped, case.band_hz):
        return evidence
    after = tuple(replace(e, lines=_lines_after_attack(case, e), ringing=True) for e in shaped)
    if any(len(e.lines.freq_hz) < RINGING_LINES for e in after):
        return evidence
    if _by_chance(after, case.band_hz):
        return evidence
    chosen = {id(e): other for e, other in zip(shaped, after, strict=True)}
    return tuple(chosen.get(id(e), e) for e in evidence)


def _lines_after_attack(case: Case, e: RecordedObject) -> Lines:
    assert e.signals is not None
    still = without_hum(e.signals, noise_rms(e.signals, e.sr), e.sr)
    band_hz = case.band_hz[0], min(case.band_hz[1], HIGHEST_OF_RATE * e.sr)
    return ringing_lines(still, e.sr, band_hz, signed=e.lines.signed, rise_s=e.lines.rise_s)


@lru_cache(maxsize=2)  # of all lines, and of those after the attack
def _by_chance(shaped: tuple[RecordedObject, ...], band_hz: tuple[float, float]) -> bool:
    """Whether lines find no more modes of their shapes than by chance; who chooses lines and who fits them ask."""
    return paired_by_chance(shaped, _pair_objects(shaped, band_hz)[0], lambda moved: _pair_objects(moved, band_hz)[0])


@one_thread()
def fit_evidence(
    case: Case,
    evidence: tuple[RecordedObject, ...],
    *,
    cache: Place = "default",
) -> CaseFit:
    """`fit_case` on evidence already gathered. Raises SonicBulletError."""
    if len({e.guess.name for e in evidence}) > 1:
        raise FileError("the 'fit' strikes are of objects of several materials", "give a case for each material")
    if not any(len(e.lines.freq_hz) for e in evidence):
        raise AudioError(
            "no damped sinusoid stands above the noise", "record a louder strike, nearer, in a quieter place"
        )
    shaped = tuple(e for e in evidence if e.family is not None)
    guess = evidence[0].guess
    chance = False
    if shaped:
        pairs, information, scatter = _pair_objects(shaped, case.band_hz)
        chance = _by_chance(shaped, case.band_hz)
        log_gamma, poisson = pairs[0].log_gamma, pairs[0].poisson
    else:
        pairs, information, scatter = (), np.zeros((2, 2)), np.nan
        log_gamma, poisson = float(np.log(guess.youngs_pa / guess.density_kg_m3)), guess.poisson
    radiation = radiation_in(case, evidence)
    apart = radiation == "apart"
    if apart:
        report_progress("how its modes radiate")
    air = tuple(in_air(e, log_gamma, poisson, case.band_hz[1], apart) for e in shaped)
    lam, decay, decay_sd, extra = _decays(evidence, pairs, air if apart else (None,) * len(air))
    start = (guess.alpha_per_s or 1.0, guess.beta_s or 1.0 / (float(np.median(lam)) if len(lam) else 1e8))
    known_share = 0.02  # relative: what radiation theory and mesh leave open of a mode's Δd
    damping = rayleigh(lam, decay - extra, np.hypot(decay_sd, known_share * extra), start, decay)
    objects = tuple(
        fitted_object(e, p, a, damping, case.band_hz, taken_off=apart)
        for e, p, a in zip(shaped, pairs, air, strict=True)
    )
    gain, gain_sd, amplitude_scatter = gain_of(objects)
    return build_fit(
        case,
        evidence,
        objects,
        (log_gamma, poisson, information, scatter),
        damping,
        (gain, gain_sd, amplitude_scatter),
        radiation=radiation,
        by_chance=chance,
        poisson_sd=poisson_sd_of_dimensions(shaped, pairs, scatter) if shaped else 0.0,
    )


def _pair_objects(
    shaped: tuple[RecordedObject, ...], band_hz: tuple[float, float]
) -> tuple[tuple[Pairs, ...], Array, float]:
    """Pair every object at one common (ln γ, ν); information (2, 2) of the lines on it, scatter of frequencies."""
    guess = shaped[0].guess
    centre = float(np.log(guess.youngs_pa / guess.density_kg_m3))
    starts = []
    gamma_reach = 0.65  # of ln γ: E and ρ both wrong by 30 %
    for e in shaped:
        if e.family is not None and e.seen is not None and len(e.lines.freq_hz):
            starts += best_pairs(e.family, e.lines, e.seen, centre, guess.poisson, band_hz, gamma_reach)
    starts = starts or [(centre, guess.poisson)]
    ends = []
    for start in starts:
        common, best = start, None
        for e in shaped:  # one object after another leads to the common place, then all from there
            if e.family is not None and e.seen is not None and len(e.lines.freq_hz):
                p = pair_lines(e.family, e.lines, e.seen, common, guess.poisson, POISSON_GUESS_SD)
                common = (p.log_gamma, p.poisson)
        best = _together(shaped, common, guess.poisson)
        ends.append((sum(p.cost for p in best[0]), best))
    return min(ends, key=lambda end: end[0])[1]


def _together(
    shaped: tuple[RecordedObject, ...], start: tuple[float, float], guess_poisson: float
) -> tuple[tuple[Pairs, ...], Array, float]:
    """Assign and solve for all objects at once until nothing moves.

    What the modes scatter is then learnt, in place of `MESH_SD`.
    """
    log_gamma, poisson = start
    information, scatter, mesh_sd = np.zeros((2, 2)), np.nan, MESH_SD
    pairs: list[Pairs] = []
    for turn in range(12):
        pairs, information, pull, offs = [], np.zeros((2, 2)), np.zeros(2), []
        for e in shaped:
            if e.family is None or e.seen is None:
                continue
            group = group_modes(e.family, e.seen, log_gamma, poisson)
            line, mode, cost = assign(group, e.lines, e.seen, MESH_SD)
            pairs.append(Pairs(log_gamma, poisson, line, mode, cost))
            if len(line) == 0:
                continue
            step, own, weight = solve(e.lines, group, line, mode, 0.0, 1e6, mesh_sd)
            information += own
            pull += own @ step
            offs.append(np.stack([weight, np.log(_undamped_hz(e, line) / group.freq_hz[mode])]))
        if not offs:
            break
        weight, off = np.concatenate(offs, axis=1)
        scatter = float(np.sqrt((weight * off**2).sum() / max(weight.sum() - 2, 1)))
        known = np.linalg.det(information) > 0
        poisson_identified = known and np.linalg.inv(information)[1, 1] < POISSON_IDENTIFIED_SD**2
        prior = np.diag([1e-12, 0.0 if poisson_identified else POISSON_GUESS_SD**-2])
        step = np.linalg.solve(information + prior, pull - prior @ (0.0, poisson - guess_poisson))
        log_gamma += float(np.clip(step[0], -0.05, 0.05))
        poisson = float(np.clip(poisson + np.clip(step[1], -0.02, 0.02), -0.45, 0.48))
        pairs = [replace(p, log_gamma=log_gamma, poisson=poisson) for p in pairs]
        if turn >= 3:
            mesh_sd = learnt_mesh_sd(scatter, len(off))
            if np.abs(step).max() < 1e-9:
                break
    return tuple(pairs), information, scatter


def _undamped_hz(e: RecordedObject, line: Array) -> Array:
    return np.asarray(
        np.hypot(2 * np.pi * e.lines.freq_hz[line], np.nan_to_num(e.lines.decay_per_s[line])) / (2 * np.pi)
    )


def _decays(
    evidence: tuple[RecordedObject, ...], pairs: tuple[Pairs, ...], air: tuple[GroupRadiation | None, ...]
) -> tuple[Array, Array, Array, Array]:
    """Return λ, d, its spread and what of it is radiation, of the lines that are modes; of all without a shape."""
    found, at = [], 0
    for e in evidence:
        which = np.arange(len(e.lines.freq_hz))
        extra = np.zeros(len(which))
        if e.family is not None:
            which, mine = pairs[at].line, air[at]
            extra = np.zeros(len(which)) if mine is None else mine.extra_per_s[pairs[at].mode]
            at += 1
        d = e.lines.decay_per_s[which]
        found.append(
            np.stack(
                [
                    (2 * np.pi * e.lines.freq_hz[which]) ** 2 + np.nan_to_num(d) ** 2,
                    d,
                    e.lines.identified_sd_per_s[which],
                    extra,
                ]
            )
        )
    lam, decay, decay_sd, radiated = np.concatenate(found, axis=1)
    return lam, decay, decay_sd, radiated
