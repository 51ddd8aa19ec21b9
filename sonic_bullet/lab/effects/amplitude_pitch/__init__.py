"""How `amplitude-pitch` is looked for.

Identified by the phase of single modes: θ(t) = θ₀ + δ t + b a₀² ω (1 − e^{−2dt})/2d, θ₀ each strike's own, δ the
mode's, b common to all; by modes without a degenerate partner, where enough of them are certain, else by all, pairs
about their own axes (degenerate_pitch.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.effects.amplitude_pitch import AmplitudePitch
from sonic_bullet.lab.effects.amplitude_pitch.degenerate_pitch import BEND_FACTORS, axes_of, bend_with_axes
from sonic_bullet.lab.effects.common.axes import degenerate
from sonic_bullet.lab.effects.common.envelope import Envelopes, envelopes, falls, levels
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.records import Array
from sonic_bullet.signal.robust import cauchy_weight, weighted_median


@dataclass(frozen=True, slots=True)
class Slope:
    """Fit of b to the phases of several modes.

    Attributes
    ----------
    bend : float
        b per level².
    sd : float
        Its spread.
    share : float
        Fraction of the phases' misfit that b explains, in modes that it would move.
    modes : float
        Explained misfit in numbers of modes.
    single : bool
        Whether modes without a degenerate partner alone identify it.
    """

    bend: float
    sd: float
    share: float
    modes: float
    single: bool


def propose_amplitude_pitch(evidence: Evidence) -> AmplitudePitch | None:
    """Fit a common bend to the phases of each object's modes; None where no object's modes agree on one."""
    best: tuple[float, AmplitudePitch] | None = None
    known = evidence.known if isinstance(evidence.known, AmplitudePitch) else None
    for h in evidence.observed:
        e = envelopes(h)
        for name, b in (_slopes(e, h, known) if e is not None else {}).items():
            if best is None or b.modes > best[0]:
                assert e is not None
                best = (b.modes, _with_axes(e, h, name, b, known, evidence.held_out))
    return best[1] if best is not None else None


def _with_axes(
    e: Envelopes, h: ObjectEvidence, measure: str, b: Slope, known: AmplitudePitch | None, held: bool
) -> AmplitudePitch:
    """Build the effect with the axes of degenerate modes, those of `known` if held.

    Where nearly all modes have a degenerate partner, the bend is fitted with the axes.
    """
    if h.model is None or measure == "impulse":
        return AmplitudePitch(b.bend, measure)
    bend = b.bend
    if not b.single:
        factors = BEND_FACTORS if known is None else np.geomspace(0.93, 1.07, 5)
        bend = bend_with_axes(e, h, measure, bend if known is None else known.bend, factors)
    if held and known is not None:
        return AmplitudePitch(bend, measure, known.freq_hz, known.turn_rad)
    return AmplitudePitch(bend, measure, *axes_of(e, h, measure, bend))


def _slopes(e: Envelopes, h: ObjectEvidence, known: AmplitudePitch | None) -> dict[str, Slope]:
    """Fit b by every measure that is certain: by modes without a degenerate partner, where enough are, else by all.

    known is the effect found in the whole evidence.
    """
    enough = 3  # modes without a degenerate partner, to be asked alone
    # the frequencies of degenerate modes drift each by its own level
    single = np.array([not degenerate(h, k) for k in e.line.tolist()], bool)
    rows = {
        name: np.array(
            [one or (0.0, 0.0, 0.0) for one in (_moments(e, h, level[:, e.line], q) for q in range(len(e.line)))]
        ).reshape(-1, 3)
        for name, level in levels(h).items()
        if known is None or name == known.measure
    }
    for alone in (True, False):
        found: dict[str, Slope] = {}
        for name, row in rows.items():
            good = (row[:, 0] > 0) & (row[:, 2] > 0) & (single if alone else True)
            b = _combine_slopes(row[good], alone)
            if good.sum() >= (enough if alone else 1) and _significant(b, known):
                found[name] = b
        if found:
            break
    return found


def _significant(b: Slope, known: AmplitudePitch | None) -> bool:
    """Decide whether b is certain; with fewer strikes, whether it is above its spread with the known sign."""
    better = 0.5  # of the phases' misfit must go, in modes that b would move
    standard_errors = 5.0  # spreads that b must stand off zero
    if known is None:
        return abs(b.bend) > standard_errors * b.sd and b.share > better
    return b.bend * np.sign(known.bend) > b.sd and b.share > 0


def _combine_slopes(table: Array, single: bool) -> Slope:
    """Combine the modes' own slopes (n, 3), each weighted by its phase under a bend over its misfit.

    The spread is that of their scatter [White 1980].
    """
    fewest_modes = 1.5  # of such modes
    if not len(table):
        return Slope(0.0, np.inf, 0.0, 0.0, single)
    xx, xy, yy = table.T
    value, weight = xy / xx, xx / yy
    centre = weighted_median(value, weight)
    for _ in range(10):
        off = np.abs(value - centre)
        near = cauchy_weight((off / (2 * weighted_median(off, weight) + 1e-12 * abs(centre) + 1e-200)) ** 2)
        centre = float((weight * near * value).sum() / (weight * near).sum())
    # of a mode's misfit, as much as a bend would be of it: the others have no say
    says = np.minimum(centre**2 * weight, 1.0)
    gone = np.maximum((2 * centre * xy - centre**2 * xx) / yy, -1.0)
    sd = float(np.sqrt(((says * (value - centre)) ** 2).sum()) / max(says.sum(), 1e-300))
    alone = says.sum() ** 2 / max(float((says**2).sum()), 1e-300) < fewest_modes
    return Slope(
        centre,
        np.inf if alone else max(sd, 1e-300),
        float((says * gone).sum() / max(says.sum(), 1e-300)),
        float(gone.sum()),
        single,
    )


def _moments(e: Envelopes, h: ObjectEvidence, level: Array, q: int) -> tuple[float, float, float] | None:
    """Compute Σ x², Σ xy, Σ y² of a mode; None where too little is clear.

    y are its strikes' phases without their means and the common slope, x those of b = 1.
    """
    decay, omega = falls(e, q, float(h.decay_per_s[e.line[q]])), 2 * np.pi * float(h.freq_hz[e.line[q]])
    rows, sides, weights, ramps = [], [], [], []
    for s in range(len(e.z)):
        use = e.good[s, q]
        if use.sum() < 8:
            continue
        t, phase = e.time_s[q, use], e.phase[s, q, use]
        w = e.worth(s, q)[use]
        curve = level[s, q] ** 2 * omega * -np.expm1(-2 * decay * t) / (2 * decay)
        rows.append(phase - np.average(phase, weights=w))
        sides.append(curve - np.average(curve, weights=w))
        ramps.append(t - np.average(t, weights=w))
        weights.append(w)
    if len(rows) < 2 and not (rows and len(rows[0]) > 30):
        return None
    y, x, t, w = (np.concatenate(part) for part in (rows, sides, ramps, weights))
    y, x = y - t * (w * t * y).sum() / (w * t * t).sum(), x - t * (w * t * x).sum() / (w * t * t).sum()
    return float((w * x * x).sum()), float((w * x * y).sum()), float((w * y * y).sum())
