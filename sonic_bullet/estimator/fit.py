"""Recordings -> material: which mode each line is, γ and ν from the frequencies, α and β from the decays, σ from the amplitudes.

    Evidence per object -> pairs (pairing.py), all objects at one (γ, ν) -> ln γ, ν: weighted least squares on ln λ
                        -> d = ½(α + βλ) (rayleigh.py)   [Ren, Yeh, Lin 2013, eq. 6]
                        -> A_sj = σ J_s ψ_sj             [eq. 11, 13; observe.py]
    -> MaterialFit, one correction a mode (the mesh's error, at most 1 %), and a verdict

The lines are maximum-likelihood estimates with their Cramér-Rao spreads, so least squares on them loses nothing against a fit of the samples.
E and ρ come apart only by a mass or a known gain: ρ is the guess's, E = γρ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.errors import AudioError, FileError
from sonic_bullet.estimator.evidence import Evidence, gather
from sonic_bullet.estimator.lines import Lines
from sonic_bullet.estimator.observe import Observation, pressure_weight
from sonic_bullet.estimator.pairing import GAMMA_REACH, MESH_SD, Group, Pairs, assign, grouped, paired, phased, sift, solve
from sonic_bullet.estimator.rayleigh import Damping, rayleigh
from sonic_bullet.estimator.values import MaterialFit
from sonic_bullet.files.cases import Case, CaseObject
from sonic_bullet.modal.cache import Place
from sonic_bullet.modal.reduced import Family
from sonic_bullet.records import Array, Material

POISSON_SD = 0.04  # of a guess
CORRECTION = 0.01
POISSON_TOLD = 0.03  # a spread of ν above this says nothing that the guess did not


@dataclass(frozen=True, slots=True, eq=False)
class ObjectFit:
    """One object under the fitted material. m groups of modes in the band, ascending: freq_hz with, model_hz without their correction (m,); decay_per_s (m,).

    pattern (s, m): J ψ; line (m,): the line that each is, or -1; measured_hz, measured_decay_per_s (m,) NaN where none. sensor_weight (m,): of a microphone, else 1.
    """

    evidence: Evidence
    freq_hz: Array
    model_hz: Array
    decay_per_s: Array
    pattern: Array
    line: Array
    measured_hz: Array
    measured_decay_per_s: Array
    sensor_weight: Array
    member: tuple[Array, ...]

    @property
    def correction(self) -> Array:
        """freq_hz/model_hz - 1 (m,): what the mesh's error was taken to be."""
        return np.asarray(self.freq_hz / self.model_hz - 1)


@dataclass(frozen=True, slots=True, eq=False)
class CaseFit:
    """A fit and what it rests on. youngs_pa = γρ with ρ of the guess. damping_scatter: relative, of decays about the law.

    amplitude_scatter: relative, of amplitudes about σψ. foreign_hz: strong lines that are no mode. assumed: what was taken from the guess. warnings: one line each.
    """

    case: Case
    fit: MaterialFit
    objects: tuple[ObjectFit, ...]
    youngs_pa: float
    density_kg_m3: float
    gain_sd: float
    damping_scatter: float
    frequency_scatter: float
    amplitude_scatter: float
    foreign_hz: Array
    assumed: tuple[str, ...]
    warnings: tuple[str, ...]


def fit_case(case: Case, *, cache: Place = "default", check_mesh: bool = True, progress: Callable[[str], None] | None = None) -> CaseFit:
    """The material of a case, from its 'fit' strikes alone.

    Raises SonicBulletError where a file, mesh or number makes a fit impossible; what the recordings do not say stands in the verdict instead.
    """
    evidence = gather(case, cache=cache, progress=progress)
    return fit_evidence(case, evidence, check_mesh=check_mesh, progress=progress)


def fit_evidence(case: Case, evidence: tuple[Evidence, ...], *, check_mesh: bool = True, progress: Callable[[str], None] | None = None) -> CaseFit:
    """`fit_case` on evidence already gathered. Raises SonicBulletError."""
    from sonic_bullet.estimator.verdict import finished

    if len({e.guess.name for e in evidence}) > 1:
        raise FileError("the 'fit' strikes are of objects of several materials", "give a case for each material")
    if not any(len(e.lines.freq_hz) for e in evidence):
        raise AudioError("no damped sinusoid stands above the noise", "record a louder strike, nearer, in a quieter place")
    shaped = tuple(e for e in evidence if e.family is not None)
    guess = evidence[0].guess
    if shaped:
        pairs, information, scatter = _placed(shaped, case.band_hz)
        log_gamma, poisson = pairs[0].log_gamma, pairs[0].poisson
    else:
        pairs, information, scatter = (), np.zeros((2, 2)), np.nan
        log_gamma, poisson = float(np.log(guess.youngs_pa / guess.density_kg_m3)), guess.poisson
    lam, decay, decay_sd = _decays(evidence, pairs)
    start = (guess.alpha_per_s or 1.0, guess.beta_s or 1.0 / (float(np.median(lam)) if len(lam) else 1e8))
    damping = rayleigh(lam, decay, decay_sd, start)
    objects = tuple(_object(e, p, log_gamma, poisson, damping, case.band_hz) for e, p in zip(shaped, pairs, strict=True))
    gain, gain_sd, amplitude_scatter = gain_of(objects)
    return finished(
        case,
        evidence,
        objects,
        (log_gamma, poisson, information, scatter),
        damping,
        (gain, gain_sd, amplitude_scatter),
        check_mesh=check_mesh,
        progress=progress,
    )


def _placed(shaped: tuple[Evidence, ...], band_hz: tuple[float, float]) -> tuple[tuple[Pairs, ...], Array, float]:
    """Pairs of every object at one common (ln γ, ν), information (2, 2) of the lines on it, relative scatter of frequencies."""
    guess = shaped[0].guess
    centre = float(np.log(guess.youngs_pa / guess.density_kg_m3))
    starts = []
    for e in shaped:
        if e.family is not None and e.seen is not None and len(e.lines.freq_hz):
            starts += sift(e.family, e.lines, e.seen, centre, guess.poisson, band_hz, GAMMA_REACH)
    starts = starts or [(centre, guess.poisson)]
    ends = []
    for start in starts:
        common, best = start, None
        for e in shaped:  # one object after another leads to the common place, then all from there
            if e.family is not None and e.seen is not None and len(e.lines.freq_hz):
                p = paired(e.family, e.lines, e.seen, common, guess.poisson, POISSON_SD)
                common = (p.log_gamma, p.poisson)
        best = _together(shaped, common, guess.poisson)
        ends.append((sum(p.cost for p in best[0]), best))
    return min(ends, key=lambda end: end[0])[1]


def _together(shaped: tuple[Evidence, ...], start: tuple[float, float], guess_poisson: float) -> tuple[tuple[Pairs, ...], Array, float]:
    """Assign and solve for all objects at once until nothing moves; what the modes scatter is then learnt, in place of `MESH_SD`."""
    log_gamma, poisson = start
    information, scatter, mesh_sd = np.zeros((2, 2)), np.nan, MESH_SD
    pairs: list[Pairs] = []
    for turn in range(12):
        pairs, information, pull, offs = [], np.zeros((2, 2)), np.zeros(2), []
        for e in shaped:
            if e.family is None or e.seen is None:
                continue
            group = grouped(e.family, e.seen, log_gamma, poisson)
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
        told = np.linalg.det(information) > 0 and np.linalg.inv(information)[1, 1] < POISSON_TOLD**2
        prior = np.diag([1e-12, 0.0 if told else POISSON_SD**-2])
        step = np.linalg.solve(information + prior, pull - prior @ (0.0, poisson - guess_poisson))
        log_gamma += float(np.clip(step[0], -0.05, 0.05))
        poisson = float(np.clip(poisson + np.clip(step[1], -0.02, 0.02), -0.45, 0.48))
        pairs = [replace(p, log_gamma=log_gamma, poisson=poisson) for p in pairs]
        if turn >= 3:
            mesh_sd = float(np.clip(scatter, 1e-7, 4 * MESH_SD)) if len(off) > 3 else MESH_SD
            if np.abs(step).max() < 1e-9:
                break
    return tuple(pairs), information, scatter


def _undamped_hz(e: Evidence, line: Array) -> Array:
    return np.asarray(np.hypot(2 * np.pi * e.lines.freq_hz[line], np.nan_to_num(e.lines.decay_per_s[line])) / (2 * np.pi))


def _decays(evidence: tuple[Evidence, ...], pairs: tuple[Pairs, ...]) -> tuple[Array, Array, Array]:
    """λ, d and its spread of the lines that are modes; of all lines where there is no shape."""
    found, at = [], 0
    for e in evidence:
        which = np.arange(len(e.lines.freq_hz))
        if e.family is not None:
            which = pairs[at].line
            at += 1
        d = e.lines.decay_per_s[which]
        found.append(np.stack([(2 * np.pi * e.lines.freq_hz[which]) ** 2 + np.nan_to_num(d) ** 2, d, e.lines.decay_sd_per_s[which]]))
    lam, decay, decay_sd = np.concatenate(found, axis=1)
    return lam, decay, decay_sd


def _object(e: Evidence, pairs: Pairs, log_gamma: float, poisson: float, damping: Damping, band_hz: tuple[float, float]) -> ObjectFit:
    """An object's modes under the material, corrected where a line says."""
    assert e.family is not None and e.seen is not None
    group = grouped(e.family, e.seen, log_gamma, poisson)
    lam = (2 * np.pi * group.freq_hz) ** 2
    decay = (damping.alpha_per_s + damping.beta_s * lam) / 2
    ratio = np.ones(len(lam))
    line = np.full(len(lam), -1)
    line[pairs.mode] = pairs.line
    measured = np.where(line >= 0, e.lines.freq_hz[line], np.nan) if len(e.lines.freq_hz) else np.full(len(lam), np.nan)
    measured_decay = np.where(line >= 0, e.lines.decay_per_s[line], np.nan) if len(e.lines.freq_hz) else np.full(len(lam), np.nan)
    undamped = np.sqrt((2 * np.pi * measured) ** 2 + np.nan_to_num(measured_decay) ** 2) / (2 * np.pi)
    good = np.isfinite(undamped)
    ratio[good] = np.clip(undamped[good] / group.freq_hz[good], 1 - CORRECTION, 1 + CORRECTION)
    true_lam = lam * ratio**2
    decay = (damping.alpha_per_s + damping.beta_s * true_lam) / 2
    alive = decay**2 < 0.98 * np.minimum(lam, true_lam)
    model, freq = (np.sqrt(np.maximum(x - decay**2, 0)) / (2 * np.pi) for x in (lam, true_lam))
    use = np.flatnonzero(alive & (freq >= band_hz[0]) & (freq <= band_hz[1]))
    weight = _weight(e, group, log_gamma, poisson, freq, decay, use)
    kept = (freq[use], model[use], decay[use], group.pattern[:, use] * weight, line[use], measured[use], measured_decay[use], weight)
    return ObjectFit(e, *kept, tuple(group.member[i] for i in use))


def _weight(e: Evidence, group: Group, log_gamma: float, poisson: float, freq: Array, decay: Array, use: Array) -> Array:
    """What a microphone makes of each group: radiation of its members; 1 for other sensors."""
    if e.seen is None or e.family is None or e.seen.kind != "pressure" or not len(use):
        return np.ones(len(use))
    _, vector = e.family.modes(1.0, poisson)
    first = np.array([group.member[i][0] for i in use])
    return pressure_weight(e.family, e.guess.density_kg_m3, freq[use], decay[use], vector[:, first])


def gain_of(objects: tuple[ObjectFit, ...]) -> tuple[float, float, float]:
    """σ, its spread and the relative scatter of amplitudes about σψ, over all strikes whose place is known; NaN where none is.

    Least squares with Cauchy's weights; an amplitude counts as known to its spread and to 2 % of the mode's strongest ψ, the shapes' own error.
    """
    heard, turned, told, loose = [], [], [], []
    for o in objects:
        e, mode = o.evidence, np.flatnonzero(o.line >= 0)
        line = o.line[mode]
        use = e.seen.known & np.isfinite(e.lines.amplitude[:, line]).all(axis=1) if e.seen is not None else np.zeros(1, bool)
        if e.seen is None or not len(mode) or not use.any():
            continue
        a, p = e.lines.amplitude[use][:, line], o.pattern[use][:, mode]
        own = np.zeros(len(line))
        if phased(e.lines, e.seen):
            a = a / e.seen.start(e.lines.freq_hz[line], np.nan_to_num(e.lines.decay_per_s[line]))
            own = np.angle((p * a).sum(axis=0))  # a finite contact turns all strikes of a mode alike: that is amiss, but no matter of gain
        else:
            a, p = np.abs(a), np.abs(p)
        rough = float(np.linalg.norm(a)) / max(float(np.linalg.norm(p)), 1e-300)
        heard.append(a.ravel())
        turned.append(np.real(a * np.exp(-1j * own)).ravel())
        told.append(p.ravel())
        loose.append(np.hypot(e.lines.amplitude_sd[use][:, line] / rough, 0.02 * np.abs(p).max(axis=0, keepdims=True) + 1e-300).ravel())
    if not heard:
        return np.nan, np.nan, np.nan
    y, z, x, s = (np.concatenate(part) for part in (heard, turned, told, loose))
    weight, gain = np.ones(len(y)), 0.0
    for _ in range(30):
        gain = float((weight * x * z / s**2).sum() / max(float((weight * x**2 / s**2).sum()), 1e-300))
        if not gain > 0:
            return np.nan, np.nan, np.nan
        off = (z / gain - x) / s
        weight = 1 / (1 + (off / 2.5) ** 2)
    scatter = float(np.sqrt((np.abs(y / gain - x) ** 2).sum() / (x**2).sum()))
    spread = gain * float(np.sqrt((weight * off**2).sum() / max(len(y) - 1, 1) / (weight * x**2 / s**2).sum()))
    return gain, max(spread, 1e-6 * gain), scatter


def object_of(found: CaseFit, thing: CaseObject, guess: Material, body: Family, seen: Observation, known: ObjectFit | None) -> ObjectFit:
    """An object under a fitted material, heard as ``seen``; corrections and paired lines from ``known``."""
    none = np.zeros(0)
    lines = known.evidence.lines if known is not None else Lines(none, none, np.zeros((1, 0), complex), none, none, np.zeros((1, 0)), none, none, True)
    e = Evidence(thing, guess, (), lines, body, seen, None, 0)
    log_gamma, poisson = float(np.log(found.fit.gamma_m2_s2)), found.fit.poisson_ratio
    group = grouped(body, seen, log_gamma, poisson)
    line = mode = np.zeros(0, int)
    if known is not None:
        place = {int(member[0]): i for i, member in enumerate(group.member)}
        both = [(int(known.line[i]), place[int(m[0])]) for i, m in enumerate(known.member) if known.line[i] >= 0 and int(m[0]) in place]
        line, mode = (np.array(side, int) for side in zip(*both, strict=True)) if both else (line, mode)
    damping = Damping(found.fit.alpha_per_s, found.fit.beta_s, np.full((2, 2), np.nan), np.nan, ())
    return _object(e, Pairs(log_gamma, poisson, line, mode, 0.0), log_gamma, poisson, damping, found.case.band_hz)
