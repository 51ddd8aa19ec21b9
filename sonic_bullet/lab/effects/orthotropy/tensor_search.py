"""Search for an elastic tensor over symmetries, starts, and pairs of lines and modes.

    p = (ln E₁₂₃, n₂₃ n₁₃ n₁₂, ln G₂₃ G₁₃ G₁₂), per density;  n_ij = ν_ij √(E_j/E_i),  S = D^{-1/2} (n) D^{-1/2}
        [Bodig & Jayne 1982, eq. 3.8]
    pairs: by ln f and likeness of patterns over the strikes (line_assignment.py)
    step:
        least squares on ln f, ∂ ln λ/∂C by Hellmann-Feynman, Cauchy's weights, a weak prior about isotropy, w from 5 %
        down
    BIC = n ln(mean min((ln f_k − ln f_j)², CAP²)) + n(s − 1) ln(mean min(1 − c², 1 − 1/s)) + q ln n, means by worth
        [Schwarz 1978]

q: 2 isotropic, 3 cubic, 5 hexagonal about x, y or z (transversely isotropic), 9 orthorhombic (orthotropic). Axes are
the mesh's. Not by a simplex as other effects (fitting.py): of 24 starts on the made planks of its tests these steps end
12 at the tensor in 1 s, 200 trials of a simplex on the BIC none in 10 s, as pairs at one width hold a start in place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sonic_bullet.effects.orthotropy import SYMMETRIES
from sonic_bullet.lab.effects.evidence import Elastic, Evidence
from sonic_bullet.lab.effects.orthotropy.tensor_lines import (
    LINE_CAP,
    BodyLines,
    Seen,
    body_lines_of,
    pair_modes,
    seen_by,
)
from sonic_bullet.lab.effects.orthotropy.tensors import (
    DECIDING_LINES,
    ENDS_HOPPED_FROM,
    FREED_FROM,
    HINTED_BIC,
    HOP_BIC,
    LEAST_SPREAD,
    MOST_HOPS,
    NAMES,
    RATIOS,
    SIEVE_REACH,
    SIEVE_WIDTH,
    TENSOR_STARTS,
    TENSOR_STARTS_BLIND,
    TENSOR_WIDTHS,
    bricks,
    constants,
    cubes,
    expand_numbers,
    isotropic_shear,
    reduce_numbers,
    sound,
    stiffness,
)
from sonic_bullet.machine.parallel import parallel_map
from sonic_bullet.records import Array
from sonic_bullet.signal.peaks import local_peaks
from sonic_bullet.signal.robust import fit_linear

TENSOR_STEP = np.array([0.3] * 3 + [0.08] * 3 + [0.3] * 3)


@dataclass(frozen=True, slots=True, eq=False)
class Tensor:
    """A fitted elasticity.

    Attributes
    ----------
    symmetry : str
        One of SYMMETRIES.
    p : (9,)
        Its numbers, as in the module's first equation.
    bic : float
        Bayes information criterion.
    scatter : float
        Rms of ln f of the lines that fit.
    matched : float
        Their fraction.
    held : tuple of str
        Those of NAMES that the prior holds.
    off : float
        Rms of ln f of all lines, those beyond CAP counted at it.
    """

    symmetry: str
    p: Array
    bic: float
    scatter: float
    matched: float
    held: tuple[str, ...] = ()
    off: float = LINE_CAP

    @property
    def stiffness_m2_s2(self) -> Array:
        """Return C/ρ (6, 6)."""
        return stiffness(self.p)


def search(evidence: Evidence) -> tuple[Tensor, Tensor] | None:
    """Fit (isotropic, best) by BIC; None where there are too few lines. Takes seconds."""
    bodies = body_lines_of(evidence)
    if not bodies:
        return None
    start = isotropic_p(bodies[0].elastic)
    plain = fit_tensor(bodies, "isotropic", start, start)
    blind = all(
        t.amplitude is None for t in bodies
    )  # without patterns some start or other says more by chance, the likelier the softer it is: modes are denser there
    mild = (0.16, 0.4, 1.0, 2.5, 6.0)
    sifted = [("cubic", s) for s in _select_starts(bodies, cubes(start))] + [
        ("orthorhombic", s) for s in _select_starts(bodies, bricks(start, mild if blind else RATIOS))
    ]
    ends = parallel_map(lambda one: fit_tensor(bodies, *one, start), sifted)
    best = min((e for e in ends if e.symmetry == "orthorhombic"), key=lambda e: e.bic)
    round_axes = ("hexagonal-x", "hexagonal-y", "hexagonal-z")
    ends += parallel_map(
        lambda symmetry: fit_tensor(bodies, symmetry, best.p, start, TENSOR_WIDTHS[3:]), ("cubic", *round_axes)
    )
    cube = min((e for e in ends if e.symmetry == "cubic"), key=lambda e: e.bic)
    ends += parallel_map(
        lambda symmetry: fit_tensor(bodies, symmetry, cube.p, start, TENSOR_WIDTHS[4:]),
        (*round_axes, "orthorhombic"),
    )
    near = min(ends, key=lambda e: e.bic)
    ends += parallel_map(lambda k: fit_tensor(bodies, "orthorhombic", near.p, start, TENSOR_WIDTHS[k:]), FREED_FROM)
    if plain.bic - min(e.bic for e in ends) > HINTED_BIC and not blind:
        ends += [
            _search_neighbours(bodies, e, start)
            for e in sorted((e for e in ends if e.symmetry == "orthorhombic"), key=lambda e: e.bic)[:ENDS_HOPPED_FROM]
        ]
        near = min(ends, key=lambda e: e.bic)
        ends += parallel_map(
            lambda symmetry: fit_tensor(bodies, symmetry, near.p, start, TENSOR_WIDTHS[4:]), ("cubic", *round_axes)
        )
    return plain, min(ends, key=lambda e: e.bic)


def _search_neighbours(bodies: Sequence[BodyLines], best: Tensor, guess: Array) -> Tensor:
    """Search on from an orthorhombic end: each number a step to either side, fitted again, while an end is better.

    Wrong pairs of upper lines and modes support one another where the low ones hardly decide [iterated local search:
    Lourenço, Martin & Stützle 2003].
    """
    for _ in range(MOST_HOPS):
        sides = [p for p in (best.p + sign * one for one in np.diag(TENSOR_STEP) for sign in (-1, 1)) if sound(p)]
        end = min(
            parallel_map(
                lambda p: fit_tensor(bodies, "orthorhombic", p, guess, TENSOR_WIDTHS[FREED_FROM[-1] :]),
                sides,
            ),
            key=lambda e: e.bic,
        )
        if end.bic > best.bic - HOP_BIC:
            break
        best = end
    return best


def isotropic_p(elastic: Elastic) -> Array:
    """Return p (9,) of the isotropic material that a body has in the baseline."""
    m = elastic.material
    return expand_numbers("isotropic", np.array([np.log(m.youngs_pa / m.density_kg_m3), m.poisson]))


def _select_starts(bodies: Sequence[BodyLines], starts: list[Array]) -> list[Array]:
    """Select the best few starts, each with all its moduli scaled so that its modes agree best with the lines.

    By correlation of the two spectra on a logarithmic axis.
    """
    peaks = 2
    shift = np.arange(-SIEVE_REACH, SIEVE_REACH + 1e-9, SIEVE_WIDTH / 2)
    most = max(bodies, key=lambda t: float(t.worth.sum()))
    blind = most.amplitude is None
    first = 1 / (1 + (np.arange(len(most.log_hz)) / DECIDING_LINES) ** 2) if blind else np.ones(len(most.log_hz))

    def scored(p: Array) -> list[tuple[float, Array]]:
        score = _agreement(most, seen_by(most, p), first, shift)
        moved = np.array([1.0] * 3 + [0.0] * 3 + [1.0] * 3)
        return [(float(score[best]), p + shift[best] * moved) for best in _peaks(score)[: peaks if blind else 1]]

    found = sorted((one for some in parallel_map(scored, starts) for one in some), key=lambda s: -s[0])
    return [p for _, p in found[: TENSOR_STARTS_BLIND if blind else TENSOR_STARTS]]


def _agreement(lines: BodyLines, seen: Seen, first: Array, shift: Array) -> Array:
    """Correlate lines, each weighted by first (k,), and modes whose ln λ is shifted (n,): (n,)."""
    nil = 5.0  # of SIEVE_WIDTH: farther off nothing is in common
    place = seen.log_hz + shift[:, None] / 2
    worth = np.interp(place, lines.log_hz, first, 0.0, 0.0)  # (n, m)
    weight = lines.worth[:, None] * first[:, None] * seen.alike**2
    gap = lines.log_hz[:, None] - seen.log_hz[None, :]
    step = (shift[1] - shift[0]) / 2
    # (k, m, a few)
    at = np.rint((gap - shift[0] / 2) / step).astype(int)[..., None] + np.arange(
        -round(nil * SIEVE_WIDTH / step), round(nil * SIEVE_WIDTH / step) + 1
    )
    near = weight[..., None] * np.exp(-0.5 * ((gap[..., None] - shift[0] / 2 - at * step) / SIEVE_WIDTH) ** 2)
    here = (at >= 0) & (at < len(shift))
    cell = (at * len(seen.log_hz) + np.arange(len(seen.log_hz))[:, None])[here]
    shared = np.bincount(cell, near[here], worth.size).reshape(worth.shape)
    own = np.exp(-0.5 * ((seen.log_hz[:, None] - seen.log_hz[None, :]) / SIEVE_WIDTH) ** 2)
    return np.asarray((shared * worth).sum(axis=1) / np.sqrt(np.maximum(((worth @ own) * worth).sum(axis=1), 1.0)))


def _peaks(score: Array) -> list[int]:
    """Return the indices of a curve's peaks, the highest first."""
    inner = local_peaks(score)
    return [int(i) for i in inner[np.argsort(-score[inner])]] or [int(np.argmax(score))]


def fit_tensor(
    bodies: Sequence[BodyLines],
    symmetry: str,
    start: Array,
    guess: Array,
    widths: Sequence[float] = TENSOR_WIDTHS,
) -> Tensor:
    """Fit the tensor of a symmetry from a start.

    Parameters
    ----------
    bodies : sequence of BodyLines
        Lines of each body.
    symmetry : str
        One of SYMMETRIES.
    start : (9,)
        p to start from.
    guess : (9,)
        p of the isotropic material, about which the prior lies.
    widths : sequence of float
        Widths w of ln f, one step of the fit each.
    """
    largest_n = 0.46
    q = reduce_numbers(symmetry, start)
    p = expand_numbers(symmetry, q)
    for width in widths:
        modes = [seen_by(t, p) for t in bodies]
        found = [pair_modes(t, s, width, _few(t, width)) for t, s in zip(bodies, modes, strict=True)]
        pairs = [(t, s, one.line, one.mode) for t, s, one in zip(bodies, modes, found, strict=True)]
        step = _step(pairs, symmetry, q, guess, width)
        for _ in range(6):
            trial = expand_numbers(symmetry, q + step)
            if sound(trial) and np.abs(trial[3:6]).max() < largest_n:
                break
            step = step / 2
        else:
            step = np.zeros(len(q))
        q = q + step
        p = expand_numbers(symmetry, q)
    return _judge_tensor(bodies, symmetry, q, guess)


def _few(lines: BodyLines, width: float) -> int | None:
    """Return the number of lowest lines to start with where patterns do not distinguish modes; None for all.

    Low modes lie farther from each other than a start is wrong.
    """
    return (
        None
        if lines.amplitude is not None or width <= TENSOR_WIDTHS[-1]
        else max(DECIDING_LINES, round(len(lines.log_hz) * TENSOR_WIDTHS[-1] / width * 2))
    )


def _jacobian(symmetry: str, q: Array, of: Callable[[Array], Array]) -> Array:
    """Compute ∂ of(p(q))/∂q (n, q), by central differences."""
    h = 1e-5
    return np.stack(
        [
            (of(expand_numbers(symmetry, q + h * e)) - of(expand_numbers(symmetry, q - h * e))) / (2 * h)
            for e in np.eye(len(q))
        ],
        axis=1,
    )


def _prior(guess: Array) -> Callable[[Array], Array]:
    """Return the function of p that gives the prior's six residuals, in spreads."""
    prior_n, prior_g = 0.1, 0.7  # of n about the guess' ν, of ln G about √(E_i E_j)/2(1+n)

    def of(p: Array) -> Array:
        return np.concatenate([(p[3:6] - guess[3:6]) / prior_n, (p[6:] - isotropic_shear(p)) / prior_g])

    return of


def _step(
    pairs: list[tuple[BodyLines, Seen, Array, Array]], symmetry: str, q: Array, guess: Array, width: float
) -> Array:
    """Compute one step of the least squares of the module's docstring, at most TENSOR_STEP."""
    prior = _prior(guess)
    own, bent = prior(expand_numbers(symmetry, q)), _jacobian(symmetry, q, prior)
    turn = _jacobian(symmetry, q, constants)
    off = np.concatenate([t.log_hz[line] - s.log_hz[mode] for t, s, line, mode in pairs])
    slope = np.concatenate([0.5 * s.slope(mode).T @ turn for t, s, line, mode in pairs])
    worth = np.concatenate([t.worth[line] / np.hypot(t.sd[line] / (width / 2), 1.0) for t, s, line, mode in pairs])
    if len(off) < 2:
        return np.zeros(len(q))
    sd = np.full(len(off), width / 2)
    step = fit_linear(off, slope, sd, bent.T @ bent, -bent.T @ own, weight=worth, scale=2.0)[0]
    most = np.abs(expand_numbers(symmetry, q + step) - expand_numbers(symmetry, q)) / TENSOR_STEP
    return np.asarray(step / max(1.0, float(most.max())))


def _judge_tensor(bodies: Sequence[BodyLines], symmetry: str, q: Array, guess: Array) -> Tensor:
    """Compute the BIC of a tensor, and which constants the lines leave to the prior."""
    rough = 0.02  # of 1 − c²: shapes' own error
    p = expand_numbers(symmetry, q)
    off, unlike, numbers, slopes = [], [], 0, []
    turn = _jacobian(symmetry, q, constants)
    for t in bodies:
        s = seen_by(t, p)
        pairs = pair_modes(t, s, LINE_CAP / 3)
        line, mode = pairs.line, pairs.mode
        mine = np.full(len(t.log_hz), LINE_CAP)
        mine[line] = np.clip(np.abs(t.log_hz[line] - s.log_hz[mode]), 0, LINE_CAP)
        off.append(mine)
        strikes = 1 if t.amplitude is None or (s.alike == 1).all() else len(t.amplitude)
        other = np.full(len(t.log_hz), 1 - 1 / strikes)  # of patterns that have nothing to do with each other
        other[line] = np.clip(1 - s.alike[line, mode] ** 2, 0, 1 - 1 / strikes)
        unlike.append(other + rough)
        numbers += (strikes - 1) * len(t.log_hz)
        slopes.append(0.5 * s.slope(mode).T @ turn)
    left, worth = np.concatenate(off), np.concatenate([t.worth for t in bodies])
    inside, n = left < LINE_CAP, len(left)
    square = float(np.average(np.maximum(left, LEAST_SPREAD) ** 2, weights=worth))
    bic = (
        n * np.log(square)
        + numbers * np.log(np.average(np.concatenate(unlike), weights=worth))
        + SYMMETRIES[symmetry] * np.log(n)
    )
    scatter = float(np.sqrt(np.mean(left[inside] ** 2))) if inside.any() else LINE_CAP
    held = _name_prior_constants(np.concatenate(slopes), symmetry, q, guess, max(scatter, LEAST_SPREAD))
    return Tensor(symmetry, p, float(bic), scatter, float(inside.mean()), held, float(np.sqrt(square)))


def _name_prior_constants(slope: Array, symmetry: str, q: Array, guess: Array, sd: float) -> tuple[str, ...]:
    """Name the constants that the prior determines more than the lines do: it halves their spread, or more."""
    if symmetry == "isotropic":
        return ()
    bent = _jacobian(symmetry, q, _prior(guess))
    lines, both = slope.T @ slope / sd**2, slope.T @ slope / sd**2 + bent.T @ bent
    own = _jacobian(symmetry, q, lambda p: p)
    loose = np.sqrt(np.einsum("pq,qr,pr->p", own, np.linalg.pinv(lines + 1e-9 * np.eye(len(q))), own))
    tight = np.sqrt(np.einsum("pq,qr,pr->p", own, np.linalg.inv(both + 1e-9 * np.eye(len(q))), own))
    return tuple(name for name, a, b in zip(NAMES, loose, tight, strict=True) if a > 2 * b)
