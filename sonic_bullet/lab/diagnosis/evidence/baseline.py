"""Baseline of a case: the fitted model, its bodies, and the hypothesis without effects.

recorded lines -> estimator.fit -> bodies (groups separated, corrections learnt) -> Hypothesis; lines in chains
(recording_chain.py): the same with every chain as one line, where that is nearer to the recordings, or most modes are
chains and it is not clearly farther;
    and with the lines of the softer strikes, whose modes are nearest to linear ones, or of those below a limit, at all
        strikes
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.files.cases import Case
from sonic_bullet.files.storage.cache import Place
from sonic_bullet.lab.diagnosis.evidence.degenerate_pairs import separate_pairs
from sonic_bullet.lab.diagnosis.evidence.recording_chain import LINKS, merge_line_chains, share
from sonic_bullet.lab.diagnosis.evidence.refit import refit_material
from sonic_bullet.lab.diagnosis.evidence.strike_levels import with_levels
from sonic_bullet.lab.diagnosis.evidence.unmatched_modes import place_unmatched
from sonic_bullet.lab.diagnosis.prediction.elastic_bodies import with_elastic
from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.score import (
    AudioObservation,
    ComparableTakes,
    comparable,
    mean_db,
    predict_takes,
    take_of,
)
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody, shapeless, struck_bodies
from sonic_bullet.lab.effects.common.hum import without_hum
from sonic_bullet.lab.effects.measurement_chain import limit_of
from sonic_bullet.lab.fit.case_fit import CaseFit
from sonic_bullet.lab.fit.material_fit import fit_evidence
from sonic_bullet.lab.fit.recorded import RecordedObject as Recorded
from sonic_bullet.lab.lines.joint_lines import Lines, joint_lines, lines_of, noise_rms
from sonic_bullet.machine.progress import report_progress, without_progress
from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError


@dataclass(frozen=True, slots=True, eq=False)
class Baseline:
    """Linear model of a case.

    Attributes
    ----------
    found : CaseFit
        The fit.
    bodies : tuple of StruckBody
        Every object, fitted ones first.
    hypothesis : Hypothesis
        Without effects.
    takes : tuple of Take
        The fitted strikes that have audio.
    """

    found: CaseFit
    bodies: tuple[StruckBody, ...]
    hypothesis: Hypothesis
    takes: tuple[AudioObservation, ...]

    @property
    def doubtful(self) -> bool:
        """Decide whether a body has a shape whose bare modes meet its lines no more than by chance."""
        shaped = [b.recorded for b in self.bodies if b.family is not None and b.recorded is not None]
        return any(one.signals is not None and not self.found.plays_modes(one) for one in shaped)


def baseline(
    case: Case,
    recorded: tuple[Recorded, ...],
    *,
    by_lines: bool = False,
    cache: Place = "default",
) -> Baseline:
    """Fit the linear model to recorded evidence. Raises SonicBulletError.

    Parameters
    ----------
    case : Case
        The case.
    recorded : tuple of RecordedObject
        Its evidence.
    by_lines : bool
        Play bodies whose lines meet their modes no more than by chance by these lines, as `fit` does.
    cache : Place
        Where solved modes are kept.
    """
    # chains, of all modes' lines: no linear body has so many, so one line each it is unless that is clearly worse
    often, mostly = 0.4, 1.05
    nearer = 0.9  # of the distance, where chains are one line each
    plain = _of(case, recorded, cache, by_lines)
    directions = [tuple(_merge_chains(one, link) for one in recorded) for link in LINKS] if plain.takes else []
    directions += (
        [tuple(direction(one, case.band_hz) for one in recorded) for direction in (_soft, _drop_clipped)]
        if directions
        else []
    )
    directions = [faint for faint in directions if any(a is not b for a, b in zip(faint, recorded, strict=True))]
    if not directions:
        return plain
    report_progress(
        "modes that depend on their level, or a limit, leave lines that are no modes: fitting what is left without"
    )
    with without_progress():
        tried = [_of(case, faint, cache, by_lines) for faint in directions]
        off_db = [_off_db(one) for one in tried]
    changed = [one for one, faint in zip(recorded, directions[0], strict=True) if faint is not one]
    most = mostly if all(share(one.lines, LINKS[0]) > often for one in changed) else nearer
    best = int(np.argmin(off_db))
    return tried[best] if off_db[best] < most * _off_db(plain) else plain


def _merge_chains(one: Recorded, link: tuple[float, float, bool]) -> Recorded:
    """Replace each chain of an object's lines by one line."""
    lines = merge_line_chains(one.lines, link) if one.signals is not None else None
    return one if lines is None else replace(one, lines=lines)


def _soft(one: Recorded, band_hz: tuple[float, float]) -> Recorded:
    """Use the lines of the softer strikes alone, each chain of them as one.

    Unchanged where chains are few or no strikes are much softer than the others.
    """
    softer = 0.6  # of the middle strike's impulse at most, of half the strikes: soft enough to differ from it
    if one.signals is None or merge_line_chains(one.lines, LINKS[0]) is None:
        return one
    level = np.array([np.nan if r.impulse_n_s is None else r.impulse_n_s for r in one.recordings])
    order = np.argsort(level)[: len(level) // 2]
    if not (len(order) > 1 and np.isfinite(level).all() and level[order].max() < softer * np.median(level)):
        return one
    lines = _lines_by(one, np.sort(order), band_hz)
    return one if lines is None else replace(one, lines=merge_line_chains(lines, LINKS[0]) or lines)


def _drop_clipped(one: Recorded, band_hz: tuple[float, float]) -> Recorded:
    """Use the lines of the strikes below a limit, at all strikes; unchanged without a limit or two such strikes."""
    if one.signals is None or not (limit := limit_of([one.signals])):
        return one
    below_limit, least_touching = 0.998, 3  # of a limit, and samples that may reach it in a strike that stays below
    below = np.flatnonzero((np.abs(one.signals) > below_limit * limit).sum(axis=1) <= least_touching)
    lines = _lines_by(one, below, band_hz) if 1 < len(below) < len(one.signals) else None
    if lines is None:
        return one
    cut = np.setdiff1d(np.arange(len(one.signals)), below)
    spread = lines.amplitude_sd.copy()
    spread[cut] = np.maximum(spread, np.abs(lines.amplitude))[cut]  # what a limit has cut is no amplitude
    return replace(one, lines=replace(lines, amplitude_sd=spread))


def _lines_by(one: Recorded, strikes: Array, band_hz: tuple[float, float]) -> Lines | None:
    """Identify the lines of some strikes, by index, at all of them.

    None where those are too soft, or the lines are those after the attack.
    """
    least_lines = 4  # of some strikes: fewer are no list
    if one.signals is None or one.ringing:
        return None
    still = without_hum(one.signals, noise_rms(one.signals, one.sr), one.sr)
    if one.responses is not None:
        return None  # what was measured over frequency is an average of strikes: none is softer or cut
    try:
        some = joint_lines(still[strikes], one.sr, band_hz=band_hz, signed=one.lines.signed)
        lines = lines_of(still, noise_rms(still, one.sr), some.pole, one.sr, some.signed)
    except (AudioError, np.linalg.LinAlgError):
        return None
    return lines if len(lines.freq_hz) >= least_lines else None


def _off_db(b: Baseline) -> float:
    """Compute the mean distance of its strikes; ∞ where none can be compared, so that no other fit is farther."""
    h = refit_material(b.hypothesis, b.bodies)
    made = predict_takes(h, b.takes)
    found = comparable(b.takes, made)
    return mean_db(found.takes, made) if isinstance(found, ComparableTakes) else np.inf


def _of(case: Case, recorded: tuple[Recorded, ...], cache: Place, by_lines: bool) -> Baseline:
    """Build the baseline of some evidence."""
    found = fit_evidence(case, recorded)
    lines = {g.thing.name: shapeless(found, g) for g in recorded if not _has_shape_model(found, g, by_lines)}
    shaped = struck_bodies(found, cache=cache) if len(lines) < len(recorded) else ()
    bodies = (*(body for body in shaped if body.name not in lines), *lines.values())
    gain = found.fit.sigma if np.isfinite(found.fit.sigma) and found.fit.sigma > 0 else 1.0
    bodies = tuple(with_levels(separate_pairs(body), gain) for body in bodies)
    bodies = with_elastic(found, bodies, cache=cache)
    base = Hypothesis(found.fit.alpha_per_s, found.fit.beta_s, gain, (), {b.name: b.correction for b in bodies})
    base = replace(base, air=1.0 if found.radiation == "apart" else 0.0)
    bodies = place_unmatched(refit_material(base, bodies), bodies)
    return Baseline(found, bodies, replace(base, correction={b.name: b.correction for b in bodies}), takes_of(bodies))


def _has_shape_model(found: CaseFit, one: Recorded, by_lines: bool) -> bool:
    """Decide whether an object is modelled by the modes of its shape: where strikes have places and the gain is known.

    Bare modes may meet its lines no more than by chance: a mass or a grain moves them. Then `fit` plays lines. For a
    list of lines it is where there is a shape: frequencies depend on stiffness.
    """
    placed = any(r.position_m is not None for r in one.recordings) and bool(np.isfinite(found.gain_sd))
    return one.family is not None and (one.signals is None or (placed and (found.plays_modes(one) or not by_lines)))


def takes_of(bodies: tuple[StruckBody, ...]) -> tuple[AudioObservation, ...]:
    """Return the fitted strikes that have audio."""
    takes: list[AudioObservation] = []
    for body in bodies:
        if body.recorded is None or body.recorded.signals is None:
            continue
        takes += [
            take_of(body, i, sample, body.recorded.sr, body.recorded.floor)
            for i, sample in zip(body.fitted, body.recorded.signals, strict=True)
        ]
    return tuple(takes)
