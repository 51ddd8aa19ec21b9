"""How `added-mass` is looked for."""

from __future__ import annotations

import numpy as np

from sonic_bullet.effects.added_mass import AddedMass
from sonic_bullet.lab.effects.added_mass.mass_search import PAIRING_WIDTHS, MassFit, Scored
from sonic_bullet.lab.effects.common.line_assignment import Assignment, patterns
from sonic_bullet.lab.effects.common.points import spread_out
from sonic_bullet.lab.effects.evidence import Evidence
from sonic_bullet.machine.parallel import parallel_map
from sonic_bullet.records import Array, ModalModel

POINTS = 100

SEARCH_RESTARTS = 6


def propose_added_mass(evidence: Evidence) -> AddedMass | None:
    """Search the surface for the mass that explains the lines best; None where the bare body does as well."""
    shares = (0.002, 0.006, 0.015, 0.03, 0.055, 0.1, 0.16)  # of the body's mass
    yields = (0.0, 1.0, 4.0)  # of what modes above the band may yield, to begin with
    better = (1.5, 0.12)  # in price: as much as a strong line and a half, paired well; and of the bare body's own
    far_off = 0.015  # of ln f: more than pairs alone find
    observed = max(evidence.observed, key=lambda h: len(h.freq_hz) if h.plain is not None else 0)
    if observed.plain is None or len(observed.freq_hz) + len(observed.foreign_hz) < 8 or not observed.plain.mass_kg:
        return None
    trial = MassFit.of(observed)
    x = observed.plain
    if isinstance(evidence.known, AddedMass):
        known = evidence.known
        near = int(np.argmin(((x.vertex_m - known.position_m) ** 2).sum(axis=1)))
        up, side = (float(y * np.exp(2 * known.stretch)) for y in known.yield_m_n)
        ratio = known.poisson_ratio
        if observed.poisson is None and ratio is not None:
            return known  # beside what moves modes too, no other ν is at hand
        start = (0.0, near, known.mass_kg, (up, side), known.stretch, trial.fitted if ratio is None else ratio)
        return _at(x, trial.refine_mass(start, PAIRING_WIDTHS[-1:]), observed.poisson is not None)
    plain = patterns(observed, x.shape[observed.places])
    none = min(
        (trial.pair(x.freq_hz, plain, s, PAIRING_WIDTHS[-1], 2) for s in trial.shifts(x.freq_hz, plain)),
        key=lambda one: one[0].price,
    )
    if _in_place(trial.line, trial.size, x.freq_hz, *none):
        return None

    def at(vertex: int) -> list[Scored]:
        up, side = trial.rest(vertex)
        return [
            one
            for s in shares
            for y in yields
            for one in trial.score_shifts(vertex, s * x.mass_kg, (y * up, y * side), PAIRING_WIDTHS[0])
        ]

    found = sorted(one for some in parallel_map(at, spread_out(x, POINTS).tolist()) for one in some)
    first: dict[bool, dict[tuple[int, bool], Scored]] = {False: {}, True: {}}
    # one light and one heavy start a vertex, where the baseline's scale may be right and where it is wrong
    for one in found:
        first[abs(one[4]) > far_off].setdefault((one[1], one[2] > 0.02 * x.mass_kg), one)
    best = min(
        parallel_map(
            trial.refine_mass, [start for some in first.values() for start in list(some.values())[:SEARCH_RESTARTS]]
        )
    )
    # round bodies: as heavy, elsewhere
    again = sorted(trial.score_mass(int(v), *best[2:], PAIRING_WIDTHS[1]) for v in spread_out(x, 3 * POINTS))
    best = min(
        best,
        *parallel_map(lambda start: trial.refine_mass(start, PAIRING_WIDTHS[1:]), again[: SEARCH_RESTARTS // 2]),
    )
    bare = none[0].price + trial.unlikely(trial.fitted)
    # of the body's: what is lighter moves no mode by 1 % (Δf/f = −2 m/M at a bar's end), so a mesh or the
    # body's own imperfection may be what it stands for
    lightest = 0.005
    if best[0] > bare - max(better[0], better[1] * abs(bare)) or best[2] < lightest * x.mass_kg:
        return None
    return _at(x, best, observed.poisson is not None)


def _at(x: ModalModel, found: Scored, poisson_identified: bool) -> AddedMass:
    """Build the effect from what a search found; poisson_identified: whether ν was."""
    _, vertex, mass_kg, along, shift, ratio = found
    place = x.vertex_m[vertex]
    up, side = (float(y * np.exp(-2 * shift)) for y in along)
    return AddedMass(
        (float(place[0]), float(place[1]), float(place[2])),
        float(mass_kg),
        (up, side),
        float(shift),
        float(ratio) if poisson_identified else None,
    )


def _in_place(line_hz: Array, size: Array, mode_hz: Array, pairs: Assignment, shift: float) -> bool:
    """Decide whether the bare body's modes, or most of the lines' strength (s, k), are where the lines are.

    A mass leaves few modes in place, and something else splits or bends the others. Of degenerate modes a mass leaves
    one, which has a node at it, so only modes without a degenerate partner count.
    """
    matched, moved = 0.8, 2.5e-3  # share of lines, and how far nine in ten of them may lie off: a mesh's error
    # of the lines' strength; of ln f, between modes of which a mass leaves one where it was
    stayed, degenerate = 0.6, 1e-3
    off = np.abs(np.log(line_hz[pairs.line] / mode_hz[pairs.mode]) - shift)
    if len(off) > matched * len(line_hz) and float(np.quantile(off, 0.9)) < moved:
        return True
    off = np.abs(np.log(line_hz)[:, None] - np.log(mode_hz) - shift)
    gap = np.diff(np.log(mode_hz), prepend=-np.inf, append=np.inf)
    loud = np.nan_to_num(size).max(axis=0) * (np.minimum(gap[1:], gap[:-1]) > degenerate)[off.argmin(axis=1)]
    return bool(loud[off.min(axis=1) < moved].sum() > stayed * loud.sum() > 0)
