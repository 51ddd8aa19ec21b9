"""How `radiation` is looked for.

Identified by the decays above Rayleigh's: the difference grows with ka, then flattens, and goes with each mode's own
area A. The decays give the order of ka, too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.effects.radiation import AIR_IMPEDANCE, RADIATION_ORDERS, RADIATION_SCATTER, Radiation, areas
from sonic_bullet.lab.effects.common.fitting import search_number
from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence
from sonic_bullet.signal.robust import fit_nonnegative


def propose_radiation(evidence: Evidence) -> Radiation | None:
    """Fit radius, order and strength to the decays and the tilt to the levels; None where none is identified."""
    fewest_lines, fewest_lines_again = 6, 4  # lines: to look for it, and to fit it again to a part of them
    again = 2.0  # times smaller or larger, where it is fitted again
    clearer = 0.45  # twice the ln likelihood, a line, that a tilt must be worth
    better = 14.0
    observed = max(evidence.observed, key=lambda h: len(h.freq_hz) if h.model is not None else 0)
    with_decay = int((~np.isposinf(observed.decay_sd_per_s)).sum())  # in a room some lines tell no decay
    if (
        observed.model is None
        or with_decay < (fewest_lines if evidence.known is None else fewest_lines_again)
        or not np.isfinite(observed.decay_per_s).all()
    ):
        return None
    area = areas(observed.model)
    # of modes that share a line, the louder is observed: a plate's own plane hardly moves the air
    loud = (np.abs(observed.push) ** 2).sum(axis=0) + 1e-300
    mine = np.array([np.average(area[m], weights=loud[m]) for m in observed.mode])
    decay, w2 = observed.decay_per_s, observed.omega**2
    sd = np.hypot(observed.decay_sd_per_s, RADIATION_SCATTER * decay) + 1e-3
    across = float(np.linalg.norm(np.ptp(observed.model.vertex_m[np.unique(observed.model.face)], axis=0)))
    rayleigh = [np.full(len(w2), 0.5), 0.5 * w2]
    plain = float(fit_nonnegative(decay, sd, np.stack(rayleigh, axis=1))[1].sum())
    radii = np.geomspace(0.02 * across, across, 40)
    # a part of the lines may leave the knee anywhere below the band: it is this one that is fitted again
    if isinstance(evidence.known, Radiation):
        # by either law: which one, a pulse or a filter may have hidden
        radii = evidence.known.radius_m * np.geomspace(1 / again, again, 21)

    def fit(radius: float, order: int, tilt: float | None) -> tuple[float, Radiation]:
        """Fit the strength at a radius to the decays, and compare the levels with a tilt where there is one."""
        one = Radiation(radius, 1.0, order=order)
        lost = 0.5 * AIR_IMPEDANCE * one.efficiency(observed.freq_hz) * mine
        x, rest = fit_nonnegative(decay, sd, np.stack([*rayleigh, lost], axis=1))
        levels = 0.0 if tilt is None else _level_cost(observed, one, tilt)
        return float(rest.sum()) + levels, replace(one, strength=float(x[2]), tilt=0.0 if tilt is None else tilt)

    def search(tilt: float | None) -> tuple[float, Radiation]:
        ends: list[tuple[float, Radiation]] = []
        for order in RADIATION_ORDERS:

            def misfit(radius: float, order: int = order) -> float:
                return fit(radius, order, tilt)[0]

            ends.append(fit(search_number(misfit, radii)[1], order, tilt))
        return min(ends, key=lambda one: one[0])

    left, best = search(None)
    if not best.strength:
        return None
    if evidence.known is None and (not plain - left > better + 2 * np.log(len(w2)) or left > 0.5 * plain):
        return None
    least, tilted = search(0.5)  # what radiates is observed: levels tell the knee, too
    level = fit(best.radius_m, best.order, 0.0)[0] - clearer * len(w2)
    return tilted if tilted.strength and least < level else best


def _level_cost(observed: ObjectEvidence, made: Radiation, tilt: float) -> float:
    """Compute twice the negative log likelihood (Cauchy) of the levels' misfit: lines of other modes lie far off.

    Misfit: ln of a line's level over the expected one, median of the strikes, less tilt and common gain.
    """
    ratio = np.log(np.maximum(np.abs(observed.amplitude), 1e-300) / np.maximum(np.abs(observed.expected), 1e-300))
    off = np.median(ratio, axis=0) - tilt * np.log(made.efficiency(observed.freq_hz))
    return float(2 * np.log1p(((off - np.median(off)) / RADIATION_SCATTER) ** 2).sum())
