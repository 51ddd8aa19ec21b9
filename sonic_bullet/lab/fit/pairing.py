"""Which line is which mode, with E wrong by a third and ν by a twentieth.

    sift     every (γ, ν) of a grid: agreement of the lines with the modes, as two spectra on a logarithmic axis
             Q = Σ_kj K(ln f_k − ln f_j) c_kj √(|A_k||p_j|) / √(Σ_kk' … Σ_jj' …),
                 c = |<A_k, p_j>|/(|A_k||p_j|) over the strikes
    assign   Σ (ln f_k − ln f_j)²/2s² + (1 − c_kj)/w → min
        [Kuhn 1955; Crouse 2016], unpaired at a price
    solve    ln γ and ν by least squares on ln λ, outliers down-weighted
        [Cauchy's weight: Holland & Welsch 1977]

Modes closer than `DEGENERATE_SPLIT` are one: their shapes within the pair are anyone's, the sum over the pair
is not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.lab.effects.common.line_assignment import assign_lines, cosines, weight_by_level
from sonic_bullet.lab.fit.observation import Observation
from sonic_bullet.lab.lines.joint_lines import PINNED, Lines
from sonic_bullet.lab.lines.shared_poles import FASTEST_PER_S
from sonic_bullet.machine.identity_cache import WhileAlive
from sonic_bullet.modal.isotropic_family import Family
from sonic_bullet.records import Array
from sonic_bullet.signal.peaks import local_peaks
from sonic_bullet.signal.robust import fit_linear

DEGENERATE_SPLIT = 6e-4  # of a frequency, relative
MESHED_SPLIT_RATIO = 2.5  # times as far apart where elements have split them
MESH_SD = 2.5e-3  # of a mode's frequency, the mesh's and the shape's own error


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Modes of a family at (γ, ν), degenerate modes as one.

    freq_hz (m,) undamped, pattern (s, m) real, share (m,) ∂ ln λ/∂ν; member: each group's modes.
    """

    freq_hz: Array
    pattern: Array
    slope: Array
    member: tuple[Array, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """line (p,) and mode (p,) paired up at ln γ and ν, with the price that was paid."""

    log_gamma: float
    poisson: float
    line: Array
    mode: Array
    cost: float


def group_modes(family: Family, seen: Observation, log_gamma: float, poisson: float) -> Group:
    """Return the family's modes as lines at (γ, ν)."""
    value, vector = family.modes(1.0, poisson)
    freq = np.sqrt(value) / (2 * np.pi)
    cut = np.flatnonzero(np.diff(np.log(freq)) > DEGENERATE_SPLIT * (MESHED_SPLIT_RATIO if family.meshed else 1.0)) + 1
    member = tuple(np.split(np.arange(len(freq)), cut))
    sums = np.zeros((len(freq), len(member)))
    for g, who in enumerate(member):
        sums[who, g] = 1
    count = sums.sum(axis=0)
    pattern = seen.transfer(vector) @ sums
    freq_g = np.exp(np.log(freq) @ sums / count)
    return Group(freq_g * np.exp(log_gamma / 2), pattern, family.slope(poisson, vector) @ sums / count, member)


def _line_patterns(lines: Lines, seen: Observation) -> Array:
    """Return line patterns (s, k): complex where phases are true, else magnitudes.

    A finite contact turns all strikes of a mode by one common phase.
    """
    return lines.amplitude if has_phases(lines, seen) else np.abs(lines.amplitude)


def has_phases(lines: Lines, seen: Observation) -> bool:
    """Whether the lines' phases can be held against the model's."""
    return lines.signed and seen.kind in ("velocity", "sum")


def _usable(lines: Lines, seen: Observation) -> Array:
    """Return the strikes (s,) whose place is known; all-false where patterns say nothing."""
    return (
        np.asarray(seen.known & np.isfinite(lines.amplitude).all(axis=1))
        if lines.amplitude.shape[1]
        else seen.known & False
    )


def _patterns(lines: Lines, seen: Observation, modes: Array) -> tuple[Array, Array, Array]:
    """Line strengths (k,), mode strengths (m,), and how alike their patterns are (k, m)."""
    use = _usable(lines, seen)
    k, m = len(lines.freq_hz), modes.shape[1]
    if not use.any():
        return np.ones(k), np.ones(m), np.ones((k, m))
    a, p = _line_patterns(lines, seen)[use] * _rings(lines), modes[use]
    if not has_phases(lines, seen):
        p = np.abs(p)
    size, strength = np.linalg.norm(a, axis=0), np.linalg.norm(p, axis=0)
    alike = cosines(a, p) if use.sum() > 1 else np.ones((k, m))
    return size / size.max(initial=1e-300), strength / strength.max(initial=1e-300), alike


@WhileAlive
def _rings(lines: Lines) -> Array:
    """Weigh by its decay how much each line (k,) may be a mode: 1, less where it is over far too soon.

    Lines at the fastest decay there is come in heaps that cancel one another, so their strengths say nothing; no more
    do those of other heaps.
    """
    never = 0.02
    decay, energy = np.nan_to_num(lines.decay_per_s), np.nan_to_num(lines.energy)
    piled = mark_heaped(lines)
    energy = np.where((decay > PINNED * FASTEST_PER_S) | piled, 0.0, energy)
    if not (energy > 0).any() or not (decay > 0).any():
        return np.ones(len(decay))
    order = np.argsort(decay)
    share = np.cumsum(energy[order])
    middle = order[np.searchsorted(share, share[-1] / 2)]
    # what loses as much a cycle ends sooner
    typical = max(float(decay[middle]), 1.0) * np.maximum(lines.freq_hz / lines.freq_hz[middle], 1.0)
    # times the decay that holds half of the energy, higher up times its loss factor: clicks, filters' and rooms' first
    # milliseconds are made of such lines, bodies' modes seldom
    brief_ratio = 25.0
    rings = np.clip(brief_ratio * typical / np.maximum(decay, 1e-9), never, 1.0)
    return np.asarray(np.where(piled, 0.0, np.where(decay > PINNED * FASTEST_PER_S, np.minimum(rings, never), rings)))


def mark_heaped(lines: Lines) -> Array:
    """Say which lines (k,) are mostly cancelled by others: alone they would hold ten times the energy of all.

    ∫ |Σ A e^{pt}|² dt = −Σ_jk A_j Ā_k/(p_j + p̄_k)
    """
    pole, a = lines.pole, lines.amplitude
    if not len(pole) or not np.isfinite(a).all() or not (lines.decay_per_s > 0).all():
        return np.zeros(len(pole), bool)
    shared = -1 / (pole[:, None] + pole.conj())
    together = np.maximum(np.einsum("sj,jk,sk->s", a, shared, a.conj()).real, 0)
    alone = np.abs(a) ** 2 / (2 * lines.decay_per_s)
    cancelled_ratio = 10.0  # times the energy of all lines: what none can hold that is not cancelled
    return np.asarray((alone > cancelled_ratio * together[:, None]).any(axis=0))


def _overlap(a: Array, b: Array, width: float) -> Array:
    return np.asarray(np.exp(-(((a[:, None] - b[None, :]) / width) ** 2) / 2))


def best_pairs(
    family: Family,
    lines: Lines,
    seen: Observation,
    log_gamma: float,
    poisson: float,
    band_hz: tuple[float, float],
    reach: float,
) -> list[tuple[float, float]]:
    """Return the best few (ln γ, ν) of the grid, best first."""
    poisson_reach = 0.05
    candidates = 8
    width = 0.006
    step, tails = 0.004, 5.0  # of ln γ; × width, beyond which lines and modes have nothing in common
    grid = log_gamma + np.arange(-reach, reach + 1e-9, step)
    nearby = np.arange(-int(2 * tails * width / step), int(2 * tails * width / step) + 1)
    observed, rings = np.log(lines.freq_hz), _rings(lines)
    found: list[tuple[float, float, float]] = []
    for nu in np.clip(poisson + np.linspace(-poisson_reach, poisson_reach, 9), -0.4, 0.48):
        group = group_modes(family, seen, 0.0, float(nu))
        size, strength, alike = _patterns(lines, seen, group.pattern)
        root, force = np.sqrt(size) * rings, np.sqrt(strength)
        own = np.sqrt(root @ _overlap(observed, observed, width) @ root)
        place = np.log(group.freq_hz)
        both = np.zeros((len(place) + 1, len(place) + 1))
        both[1:, 1:] = (force[:, None] * force * _overlap(place, place, width)).cumsum(axis=0).cumsum(axis=1)
        weight = root[:, None] * force * alike**2
        # modes ascend: those in the band at each γ, from first to last
        first, last = np.searchsorted(place, np.log(band_hz)[:, None] - grid / 2)
        total = np.sqrt(np.maximum(both[last, last] - both[first, last] - both[last, first] + both[first, first], 0))
        # a line and a mode meet at few γ of the grid
        gap = observed[:, None] - place
        at = np.rint((2 * gap - grid[0]) / step).astype(int)[..., None] + nearby
        met = np.clip(at, 0, len(grid) - 1)
        mode = np.arange(len(place))[:, None]
        inside = (at == met) & (mode >= first[met]) & (mode < last[met])
        share = weight[..., None] * np.exp(-(((gap[..., None] - grid[met] / 2) / width) ** 2) / 2)
        score = np.bincount(met[inside], share[inside], len(grid)) / np.where(total > 0, own * total, np.inf)
        peak = local_peaks(score)
        found += [(float(score[i]), float(grid[i]), float(nu)) for i in peak]
    found.sort(reverse=True)
    chosen: list[tuple[float, float]] = []
    for _, g, nu in found:
        if all(abs(g - h) > 0.006 or abs(nu - mu) > 0.02 for h, mu in chosen):
            chosen.append((g, nu))
        if len(chosen) == candidates:
            break
    return chosen


def degenerate_runs(freq_hz: Array, split: float = DEGENERATE_SPLIT) -> Array:
    """Count the runs (m,) of ascending modes that lie no farther apart than degenerate ones, in ln f."""
    return np.asarray(np.cumsum(np.diff(np.log(freq_hz), prepend=-np.inf) > split))


def assign(group: Group, lines: Lines, seen: Observation, width: float) -> tuple[Array, Array, float]:
    """Lines and modes paired at the least price: (p,), (p,), price. width: of ln f."""
    per_decade = 0.12  # lines that recordings share are seldom another body's, however faint
    size, strength, alike = _patterns(lines, seen, group.pattern)
    line_weight = weight_by_level(size, per_decade=per_decade) * _rings(lines)
    weight = line_weight[:, None] * weight_by_level(strength, per_decade=per_decade)
    pairs = assign_lines(np.log(lines.freq_hz), np.log(group.freq_hz), width, likeness=alike, weight=weight)
    missed = 0.0
    # where no pattern tells modes apart, those between the lines that nobody observed count against
    if not _usable(lines, seen).any():
        between = (group.freq_hz > lines.freq_hz.min() * 0.98) & (group.freq_hz < lines.freq_hz.max() * 1.02)
        missed = float((between & ~np.isin(np.arange(len(between)), pairs.mode)).sum())
    return pairs.line, pairs.mode, float(line_weight.sum()) + pairs.price + missed


def pair_lines(
    family: Family, lines: Lines, seen: Observation, start: tuple[float, float], guess_poisson: float, poisson_sd: float
) -> Pairs:
    """Pairs from a start, narrowing down from 1.2 % to three times the mesh's error."""
    log_gamma, poisson = start
    best = Pairs(log_gamma, poisson, np.zeros(0, int), np.zeros(0, int), np.inf)
    for width in (0.006, 0.005, 0.004, 0.003, 0.0025, 0.0025):
        group = group_modes(family, seen, log_gamma, poisson)
        line, mode, cost = assign(group, lines, seen, width)
        best = Pairs(log_gamma, poisson, line, mode, cost)
        if len(line) == 0:
            break
        step = solve(lines, group, line, mode, poisson - guess_poisson, poisson_sd)[0]
        log_gamma += float(np.clip(step[0], -0.05, 0.05))
        poisson = float(np.clip(poisson + np.clip(step[1], -0.02, 0.02), -0.45, 0.48))
    return best


def solve(
    lines: Lines,
    group: Group,
    line: Array,
    mode: Array,
    poisson_off: float,
    poisson_sd: float,
    mesh_sd: float = MESH_SD,
) -> tuple[Array, Array, Array]:
    """Step (2,) of ln γ and ν, information (2, 2) of the lines alone, and the weights (p,) left by outliers.

    poisson_sd: of the guess.
    """
    freq, decay = lines.freq_hz[line], lines.decay_per_s[line]
    off = np.log((2 * np.pi * freq) ** 2 + np.nan_to_num(decay) ** 2) - 2 * np.log(2 * np.pi * group.freq_hz[mode])
    sd = known_to(lines, line, mesh_sd)
    slope = np.stack([np.ones(len(line)), group.slope[mode]], axis=1)
    prior = np.diag([1e-12, poisson_sd**-2])
    return fit_linear(off, slope, sd, prior, -prior @ (0.0, poisson_off))


def known_to(lines: Lines, line: Array, mesh_sd: float) -> Array:
    """Return the standard errors of ln λ (p,) that lines as modes of a mesh have."""
    lowest = 0.2  # of mesh_sd, in the lowest modes
    freq = lines.freq_hz[line]
    # a mesh's error grows with the modes: the low ones tell γ and ν best
    rough = np.hypot(lowest, freq / freq.max(initial=1e-9))
    return np.asarray(2 * np.hypot(np.nan_to_num(lines.freq_sd_hz[line]) / freq, mesh_sd * rough))


def learnt_mesh_sd(scatter: float, count: int) -> float:
    """Return what modes scatter: as these do, where they are enough to say."""
    return float(np.clip(scatter, 1e-7, 4 * MESH_SD)) if count > 3 else MESH_SD
