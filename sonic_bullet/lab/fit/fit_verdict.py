"""What a fit may claim: covariance, what is not identifiable, where model or mesh do not do.

fitted | not identifiable: WHICH and why | misfit: WHAT does not hold
    parts joined by "; ", "fitted" alone where nothing is amiss
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.files.cases import Case
from sonic_bullet.lab.fit.case_fit import POISSON_GUESS_SD, POISSON_IDENTIFIED_SD, CaseFit, ObjectFit, RadiationIn
from sonic_bullet.lab.fit.chance_pairs import PAIRED, strong_lines
from sonic_bullet.lab.fit.comparison import log_spectral_of
from sonic_bullet.lab.fit.dimension_tolerance import add_dimension_tolerance, scale_tolerance
from sonic_bullet.lab.fit.pairing import DEGENERATE_SPLIT
from sonic_bullet.lab.fit.rayleigh import RayleighFit
from sonic_bullet.lab.fit.recorded import RecordedObject
from sonic_bullet.lab.lines.line_values import MaterialFit
from sonic_bullet.modal.isotropic_family import Family
from sonic_bullet.records import Array
from sonic_bullet.records.counts import format_count


def build_fit(
    case: Case,
    evidence: tuple[RecordedObject, ...],
    objects: tuple[ObjectFit, ...],
    elastic: tuple[float, float, Array, float],
    damping: RayleighFit,
    gain: tuple[float, float, float],
    *,
    radiation: RadiationIn,
    by_chance: bool,
    poisson_sd: float,
) -> CaseFit:
    """Return the CaseFit of all that was found.

    by_chance: lines would find as many modes of the meshes by chance. poisson_sd: what dimensions bring to ν's spread.
    """
    log_gamma, poisson, information, scatter = elastic
    guess = evidence[0].guess
    covariance = np.full((5, 5), np.nan)
    unsaid: list[str] = []
    for name in damping.said:
        unsaid.append(f"{name} (the decays of {format_count(_decays_seen(evidence), 'line')} do not tell it)")
    covariance[:2, :2] = damping.covariance
    _elastic(covariance, information, unsaid, bool(objects))
    tolerance = scale_tolerance(objects)
    add_dimension_tolerance(covariance, tolerance, poisson_sd)
    if np.isfinite(gain[0]):
        covariance[3, 3] = (gain[1] / gain[0]) ** 2
        if not any(e.seen is not None and (e.seen.level & e.seen.known).any() for e in evidence):
            unsaid.append("sigma (no impulse declared: it stands for gain times impulse)")
    else:
        unsaid.append("sigma (no strike of known place)")
    foreign, share = _find_foreign_lines(evidence, objects)
    # another object, another rate, no impact: nothing that rests on the pairs is known, nor whose decays these are
    if by_chance:
        covariance[:] = np.nan
        unsaid = ["alpha, beta, gamma, poisson_ratio, sigma (as many lines would be modes by chance)"]
    identified = np.isfinite(np.diag(covariance))
    # frequencies, decays and amplitudes are found apart
    covariance[np.outer(identified, identified) & np.isnan(covariance)] = 0.0
    amiss = _amiss(objects, damping, scatter, gain[2], foreign, share, by_chance)
    amplitude = gain[0] if np.isfinite(gain[0]) else 1.0
    verdict = (
        "; ".join(
            [f"misfit: {', '.join(amiss)}"] * bool(amiss) + [f"not identifiable: {', '.join(unsaid)}"] * bool(unsaid)
        )
        or "fitted"
    )
    freq, decay, size = _modes(evidence, objects, amplitude)
    gamma = float(np.exp(log_gamma))
    values = (damping.alpha_per_s, damping.beta_s, gamma, amplitude, poisson)
    found = MaterialFit(*values, covariance, verdict, freq, decay, size)
    density = guess.density_kg_m3
    assumed = ["density (from the guess: modes tell E/ρ alone, and the gain is unknown)"]
    if np.isnan(covariance[4, 4]):
        assumed.append("poisson_ratio (from the guess)")
    if not objects:
        assumed.append("gamma (from the guess: no mesh)")
    elif tolerance and np.isfinite(covariance[2, 2]):
        assumed.append(
            f"dimensions (known to {tolerance:.2%}: they are in the spreads of gamma and of Poisson's ratio)"
        )
    warnings = [note for e in evidence for note in e.notes]
    if objects and objects[0].evidence.family is not None and not np.isnan(covariance[2, 2]):
        warnings += _mesh_warning(objects[0].evidence.family)
    scatters = (damping.scatter, scatter, gain[2])
    return CaseFit(
        case,
        found,
        objects,
        gamma * density,
        density,
        gain[1],
        *scatters,
        foreign,
        tuple(assumed),
        tuple(warnings),
        log_spectral_of(objects, amplitude),
        radiation,
        evidence,
        dimension_tolerance=tolerance,
        poisson_sd_of_dimensions=poisson_sd,
    )


def _mesh_warning(family: Family) -> list[str]:
    """Warn where elements may bend γ by over 1 %, or where that is not known; none without elements."""
    gamma_moves = 0.01  # by elements: what is worth a warning
    if not family.meshed or 2 * family.error <= gamma_moves:
        return []
    if np.isnan(family.error):
        return ["the mesh's error is not known: the size of its elements was given"]
    return [f"the mesh may move gamma by up to {2 * family.error:.1%}: its frequencies are up to half that uncertain"]


def _decays_seen(evidence: tuple[RecordedObject, ...]) -> int:
    return int(sum(np.isfinite(e.lines.decay_per_s).sum() for e in evidence))


def _elastic(covariance: Array, information: Array, unsaid: list[str], shaped: bool) -> None:
    """Fill in ln γ and ν."""
    if not shaped or information[0, 0] <= 0:
        unsaid += ["gamma (no mode of a known shape)", "poisson_ratio"]
        return
    determinant = np.linalg.det(information)
    own = (
        np.linalg.inv(information)
        if determinant > 1e-12 * information[0, 0] * information[1, 1]
        else np.full((2, 2), np.inf)
    )
    if own[1, 1] < POISSON_IDENTIFIED_SD**2:
        covariance[np.ix_([2, 4], [2, 4])] = own
        return
    unsaid.append("poisson_ratio (the lines change with it as with gamma)")
    covariance[2, 2] = np.linalg.inv(information + np.diag([0, POISSON_GUESS_SD**-2]))[0, 0]


def _find_foreign_lines(evidence: tuple[RecordedObject, ...], objects: tuple[ObjectFit, ...]) -> tuple[Array, float]:
    """Frequencies of strong lines that are no mode, and the share of strong lines' worth that are modes."""
    hz: list[float] = []
    good = total = 0.0
    for o in objects:
        lines = o.evidence.lines
        strong = strong_lines(lines)
        taken = np.isin(np.arange(len(lines.freq_hz)), o.line[o.line >= 0])
        double = np.array([f for f, who in zip(o.freq_hz, o.member, strict=True) if len(who) > 1])
        if len(double):  # two lines of modes that count as one
            taken |= np.abs(np.log(lines.freq_hz[:, None] / double)).min(axis=1) < 2 * DEGENERATE_SPLIT
        hz += list(lines.freq_hz[strong & ~taken])
        good, total = good + float((strong & taken).sum()), total + float(strong.sum())
    return np.array(sorted(hz)), good / total if total else np.nan


def _amiss(
    objects: tuple[ObjectFit, ...],
    damping: RayleighFit,
    scatter: float,
    amplitude: float,
    foreign: Array,
    share: float,
    by_chance: bool,
) -> list[str]:
    damping_misfit = 0.03  # relative scatter of decays about the law beyond their spreads
    amplitude_misfit = 0.25
    frequency_misfit = 0.01
    amiss = []
    if objects and len(foreign):
        shown = ", ".join(f"{f:.0f}" for f in foreign[:6]) + (" …" if len(foreign) > 6 else "")
        amiss.append(f"{len(foreign)} strong lines belong to no mode ({shown} Hz)")
    if by_chance:
        amiss.append(
            f"only {share:.0%} of the strong lines are modes of this mesh, as many as by chance (another object's?)"
        )
    elif np.isfinite(share) and share < PAIRED:
        amiss.append(f"only {share:.0%} of the strong lines are modes of this mesh")
    if np.isfinite(scatter) and scatter > frequency_misfit:
        amiss.append(f"frequencies scatter by {scatter:.1%} about an isotropic body's")
    if np.isfinite(damping.scatter) and damping.scatter > damping_misfit:
        amiss.append(f"decays scatter by {damping.scatter:.0%} about Rayleigh's law")
    if np.isfinite(amplitude) and amplitude > amplitude_misfit:
        amiss.append(f"amplitudes scatter by {amplitude:.0%} about the model's")
    return amiss


def _modes(
    evidence: tuple[RecordedObject, ...], objects: tuple[ObjectFit, ...], gain: float
) -> tuple[Array, Array, Array]:
    """Modes of the first object at its first strike; the lines themselves where there is no shape."""
    if objects:
        o = objects[0]
        lines = o.evidence.lines
        pattern = np.abs(o.pattern[0]) * gain
        measured = np.abs(lines.amplitude[0][o.line]) if len(lines.freq_hz) else np.zeros(len(o.line))
        return (
            o.freq_hz,
            o.decay_per_s,
            np.nan_to_num(np.where(np.isfinite(pattern), pattern, np.where(o.line >= 0, measured, 0.0))),
        )
    lines = evidence[0].lines
    return lines.freq_hz, np.nan_to_num(lines.decay_per_s), np.nan_to_num(np.abs(lines.amplitude[0]))
