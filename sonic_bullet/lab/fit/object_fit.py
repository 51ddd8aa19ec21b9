"""One object's modes under a material: frequencies, decays, patterns as the sensor hears them; and σ.

(γ, ν) -> modes of the family -> λ, d = ½(α + βλ) + Δd, f = √(λ − d²)/2π
    [Ren, Yeh, Lin 2013, eq. 6, 7; Δd: radiation_share.py]
A_sj = σ J_s ψ_sj                                                          [eq. 11, 13; observation.py]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.files.cases import CaseObject
from sonic_bullet.lab.effects.common.line_likelihood import fit_gain
from sonic_bullet.lab.fit.case_fit import CaseFit, ObjectFit
from sonic_bullet.lab.fit.observation import Observation
from sonic_bullet.lab.fit.pairing import Pairs, group_modes, has_phases
from sonic_bullet.lab.fit.radiation_share import GroupRadiation, in_air, without_radiation
from sonic_bullet.lab.fit.rayleigh import RayleighFit
from sonic_bullet.lab.fit.recorded import RecordedObject
from sonic_bullet.lab.lines.joint_lines import Lines
from sonic_bullet.modal.isotropic_family import Family
from sonic_bullet.records import Material


def fitted_object(
    e: RecordedObject,
    pairs: Pairs,
    air: GroupRadiation | None,
    damping: RayleighFit,
    band_hz: tuple[float, float],
    *,
    taken_off: bool = False,
) -> ObjectFit:
    """Return an object's modes under the material, corrected where a line says.

    taken_off: damping is the material's own, and radiation comes on top.
    """
    assert e.family is not None and e.seen is not None
    group = group_modes(e.family, e.seen, pairs.log_gamma, pairs.poisson)
    air = air or without_radiation(group)
    extra = np.nan_to_num(air.extra_per_s) if taken_off else np.zeros(len(group.freq_hz))
    lam = (2 * np.pi * group.freq_hz) ** 2
    ratio = np.ones(len(lam))
    line = np.full(len(lam), -1)
    line[pairs.mode] = pairs.line
    measured = np.where(line >= 0, e.lines.freq_hz[line], np.nan) if len(e.lines.freq_hz) else np.full(len(lam), np.nan)
    measured_decay = (
        np.where(line >= 0, e.lines.decay_per_s[line], np.nan) if len(e.lines.freq_hz) else np.full(len(lam), np.nan)
    )
    undamped = np.sqrt((2 * np.pi * measured) ** 2 + np.nan_to_num(measured_decay) ** 2) / (2 * np.pi)
    good = np.isfinite(undamped)
    shape_correction = 0.01
    ratio[good] = np.clip(undamped[good] / group.freq_hz[good], 1 - shape_correction, 1 + shape_correction)
    true_lam = lam * ratio**2
    decay = (damping.alpha_per_s + damping.beta_s * true_lam) / 2 + extra
    alive = decay**2 < 0.98 * np.minimum(lam, true_lam)
    model, freq = (np.sqrt(np.maximum(x - decay**2, 0)) / (2 * np.pi) for x in (lam, true_lam))
    use = np.flatnonzero(alive & (freq >= band_hz[0]) & (freq <= band_hz[1]))
    weight = np.nan_to_num(air.weight[use]) if e.seen.kind == "pressure" else np.ones(len(use))
    kept = (
        freq[use],
        model[use],
        decay[use],
        group.pattern[:, use] * weight,
        line[use],
        measured[use],
        measured_decay[use],
        weight,
    )
    return ObjectFit(e, *kept, tuple(group.member[i] for i in use))


def gain_of(objects: tuple[ObjectFit, ...]) -> tuple[float, float, float]:
    """Fit σ, its spread and the relative scatter of amplitudes about σψ, over all strikes whose place is known.

    NaN where none is. An amplitude counts as known to its spread and to 2 % of the mode's strongest ψ, the shapes' own
    error.
    """
    observed, turned, predicted, spread, rough = [], [], [], [], []
    # a strike without an impulse counts as 1 N·s: it tells no gain beside those that have one
    levelled = any(
        o.evidence.seen is not None and (o.evidence.seen.level & o.evidence.seen.known).any() for o in objects
    )
    for o in objects:
        e, mode = o.evidence, np.flatnonzero(o.line >= 0)
        line = o.line[mode]
        use = (
            e.seen.known & (e.seen.level | (not levelled)) & np.isfinite(e.lines.amplitude[:, line]).all(axis=1)
            if e.seen is not None
            else np.zeros(1, bool)
        )
        if e.seen is None or not len(mode) or not use.any():
            continue
        a, p = e.lines.amplitude[use][:, line], o.pattern[use][:, mode]
        own = np.zeros(len(line))
        if has_phases(e.lines, e.seen):
            a = a / e.seen.start(e.lines.freq_hz[line], np.nan_to_num(e.lines.decay_per_s[line]))
            # a finite contact turns all strikes of a mode alike: that is amiss, but no matter of gain
            own = np.angle((p * a).sum(axis=0))
        else:
            a, p = np.abs(a), np.abs(p)
        observed.append(a.ravel())
        turned.append(np.real(a * np.exp(-1j * own)).ravel())
        predicted.append(p.ravel())
        spread.append(e.lines.amplitude_sd[use][:, line].ravel())
        rough.append(np.broadcast_to(0.02 * np.abs(p).max(axis=0) + 1e-150, p.shape).ravel())
    if not observed:
        return np.nan, np.nan, np.nan
    y, z, x, sd, own_error = (np.concatenate(part) for part in (observed, turned, predicted, spread, rough))
    start = float(np.linalg.norm(y)) / max(float(np.linalg.norm(x)), 1e-300)
    found = fit_gain(z, x, sd, own_error, start) if (x * z).sum() > 0 else None
    if found is None or not start > 0:
        return np.nan, np.nan, np.nan
    scatter = float(np.sqrt((np.abs(y / found.gain - x) ** 2).sum() / (x**2).sum()))
    return found.gain, max(found.sd, 1e-6 * found.gain), scatter


def object_of(
    found: CaseFit, thing: CaseObject, guess: Material, body: Family, seen: Observation, known: ObjectFit | None
) -> ObjectFit:
    """Return an object under a fitted material, observed as ``seen``; corrections and paired lines from ``known``."""
    none = np.zeros(0)
    lines = (
        known.evidence.lines
        if known is not None
        else Lines(none, none, np.zeros((1, 0), complex), none, none, np.zeros((1, 0)), none, none, True)
    )
    e = RecordedObject(thing, guess, (), lines, body, seen, None, 0)
    log_gamma, poisson = float(np.log(found.fit.gamma_m2_s2)), found.fit.poisson_ratio
    group = group_modes(body, seen, log_gamma, poisson)
    line = mode = np.zeros(0, int)
    if known is not None:
        place = {int(member[0]): i for i, member in enumerate(group.member)}
        both = [
            (int(known.line[i]), place[int(m[0])])
            for i, m in enumerate(known.member)
            if known.line[i] >= 0 and int(m[0]) in place
        ]
        line, mode = (np.array(side, int) for side in zip(*both, strict=True)) if both else (line, mode)
    damping = RayleighFit(found.fit.alpha_per_s, found.fit.beta_s, np.full((2, 2), np.nan), np.nan, ())
    off = found.radiation == "apart"
    air = in_air(e, log_gamma, poisson, found.case.band_hz[1], off)
    return fitted_object(e, Pairs(log_gamma, poisson, line, mode, 0.0), air, damping, found.case.band_hz, taken_off=off)
