"""Strikes under way: how the bank keeps a force pulse until the last of it has acted.

    nodes u_j = u_0 + jδ, impulses J_j:   at each sample n the driven state gains   r_n Σ J_j D^(last - j)
        over the nodes in (n-1, n]
    D = e^{sδ},   r_n = g (1 + i d/ω) e^{s(n - u_last)},   r_{n+1} = r_n e^{s(1 - kδ)},
        k = nodes in (n, n+1] = ⌊1/δ⌋ or one more

so each mode needs four phasors (r, D and the two turns of r), computed once, and no exponential at run time. Times in
samples, s per sample. j strikes, L lanes of all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError

FLUSH = 1e-30
LONGEST_SPACING = 16.0

_SCALARS = {
    "body": np.int64,
    "start": float,
    "count": np.int64,
    "whole": np.int64,
    "delta": float,
    "phase": float,
    "upcoming": np.int64,
    "first": np.int64,
}


@dataclass(frozen=True, slots=True, eq=False)
class Strike:
    """A finite force pulse on one body: impulses at equidistant times, one participation vector.

    start: absolute time of the first node in samples (any fraction). spacing: of the nodes, in samples (0 … 16).
    impulse_n_s (k,): impulse of each node. gain (m,): φᵀf̂ of the body's modes in 1/√kg. On `held` modes each node's
    impulse acts evenly over the spacing round it (a factor sinh(sδ/2)/(sδ/2), exact for samples where no node is under
    way), not at once.
    """

    body: int
    start: float
    spacing: float
    impulse_n_s: Array
    gain: Array


@dataclass(slots=True, eq=False)
class Pending:
    """Strikes sorted by body and start. body, start, count (of nodes), whole (⌊1/δ⌋), delta (δ), phase (n - u_last),
    upcoming (next node; before the first sample: nodes up to it), first (that sample): (j,). impulse, from impulse_at
    (j,) on, zeros behind each; rows (8, L): phasors, from rows_at (j,) on.
    """

    body: Array
    start: Array
    count: Array
    whole: Array
    delta: Array
    phase: Array
    upcoming: Array
    first: Array
    impulse: Array
    impulse_at: Array
    rows: Array
    rows_at: Array

    @classmethod
    def none(cls) -> Pending:
        scalars = {name: np.zeros(0, kind) for name, kind in _SCALARS.items()}
        return cls(
            **scalars,
            impulse=np.zeros(0),
            impulse_at=np.zeros(0, np.int64),
            rows=np.zeros((8, 0)),
            rows_at=np.zeros(0, np.int64),
        )

    def copy(self) -> Pending:
        """Pending strikes of its own."""
        return Pending(**{name: getattr(self, name).copy() for name in self.__slots__})


def flushed(values: Array) -> Array:
    """Values with what lies below 1e-30 set to zero: no product of theirs becomes subnormal."""
    return np.asarray(np.where(np.abs(values) < FLUSH, 0, values))


def padded_gains(
    offset: Array, count: Array, bodies: Sequence[int], gains: Sequence[Array], what: str
) -> tuple[Array, Array]:
    """All gains (m,) on their bodies' lanes, zeros behind, in one flat array, and where each begins.

    Raises AudioError on an unknown body, a wrong shape, or NaN.
    """
    for body, gain in zip(bodies, gains, strict=True):
        if not 0 <= body < len(count):
            raise AudioError(f"a {what} on body {body} of {len(count)}", "append the body first")
        if np.shape(gain) != (count[body],):
            raise AudioError(f"a {what} on body {body}: gain of shape {np.shape(gain)}", f"give {count[body]} numbers")
    index = np.asarray(bodies, np.int64)
    starts = _starts(offset[index + 1] - offset[index])
    flat = np.zeros(int((offset[index + 1] - offset[index]).sum()))
    for start, gain in zip(starts, gains, strict=True):
        flat[start : start + len(gain)] = gain
    if not np.isfinite(flat).all():
        raise AudioError(f"a {what} whose gain is not finite", "look at the mode shapes and the contact's direction")
    return flushed(flat), starts


def with_strikes(
    pending: Pending,
    strikes: Sequence[Strike],
    at: int,
    offset: Array,
    count: Array,
    log_pole: Array,
    quadrature: Array,
    held: Array,
) -> Pending:
    """The strikes under way and new ones, none before sample ``at``. offset, count, log_pole, quadrature, held: the
    bank's.

    Raises AudioError on wrong shapes, NaN, a spacing beyond 16 samples, or a strike whose time has passed.
    """
    if not strikes:
        return pending
    scalars: dict[str, list[float]] = {name: [] for name in _SCALARS}
    gain, rows_at = padded_gains(
        offset, count, [strike.body for strike in strikes], [strike.gain for strike in strikes], "strike"
    )
    impulses = [pending.impulse]
    for strike in strikes:
        impulse = flushed(np.asarray(strike.impulse_n_s, float))
        k = impulse.size
        delta = float(strike.spacing) if k > 1 else 1.0
        if (
            impulse.ndim != 1
            or k == 0
            or not (np.isfinite(impulse).all() and np.isfinite(strike.start) and 0 < delta <= LONGEST_SPACING)
        ):
            raise AudioError(
                f"a strike on body {strike.body} of {k} nodes, {strike.spacing} samples apart, at {strike.start}",
                "give finite impulses less than 16 samples apart",
            )
        first = int(np.ceil(strike.start))
        if first < at:
            raise AudioError(
                f"a strike at sample {strike.start:.2f}, but {at} samples have sounded",
                "pass strikes before their time has sounded",
            )
        within, whole = int(np.floor((first - strike.start) / delta)), int(np.floor(1.0 / delta))
        phase = max((first - strike.start) - within * delta, 0.0)
        for name, value in zip(
            _SCALARS, (strike.body, strike.start, k, whole, delta, phase, within + 1, first), strict=True
        ):
            scalars[name].append(value)
        impulses.append(np.concatenate([impulse, np.zeros(whole + 2)]))
    new = {name: np.array(values, _SCALARS[name]) for name, values in scalars.items()}
    rows = np.empty((8, len(gain)))
    _fill_rows(
        rows, rows_at, new["body"], offset, log_pole, quadrature, gain, new["phase"], new["delta"], new["whole"], held
    )
    joined = Pending(
        **{name: np.concatenate([getattr(pending, name), values]) for name, values in new.items()},
        impulse=np.concatenate(impulses),
        impulse_at=np.concatenate(
            [pending.impulse_at, len(pending.impulse) + _starts(new["count"] + new["whole"] + 2)]
        ),
        rows=np.concatenate([pending.rows, rows], axis=1),
        rows_at=np.concatenate([pending.rows_at, pending.rows.shape[1] + rows_at]),
    )
    return _chosen(joined, np.lexsort((joined.start, joined.body)))


def without(pending: Pending, done: Array, offset: Array) -> Pending:
    """The strikes that are not done (j,), and only their share of the flat arrays."""
    if not done.any():
        return pending
    kept = _chosen(pending, np.flatnonzero(~done))
    if not len(kept.body):
        return Pending.none()
    impulse_size, size = kept.count + kept.whole + 2, np.diff(offset)[kept.body]
    kept.impulse = np.concatenate(
        [pending.impulse[a : a + k] for a, k in zip(kept.impulse_at, impulse_size, strict=True)]
    )
    kept.rows = np.concatenate([pending.rows[:, a : a + k] for a, k in zip(kept.rows_at, size, strict=True)], axis=1)
    kept.impulse_at, kept.rows_at = _starts(impulse_size), _starts(size)
    return kept


@njit(nogil=True)
def _fill_rows(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    rows, rows_at, body, offset, log_pole, quadrature, gain, phase, delta, whole, held
):
    """The phasors r, D, E0 = e^{s(1 - whole δ)}, E1 = E0/D of each strike, real and imaginary rows in turn."""
    modes = len(quadrature)
    for j in range(len(body)):
        for k in range(offset[body[j] + 1] - offset[body[j]]):
            lane, at = offset[body[j]] + k, rows_at[j] + k
            s = complex(log_pole[lane], log_pole[modes + lane])
            r = gain[at] * complex(1.0, quadrature[lane]) * np.exp(s * phase[j])
            # spread over the spacing; quadrature and weight hold what a force spread over a sample needs
            if held[lane]:
                half = 0.5 * delta[j] * s
                r *= (np.exp(half) - np.exp(-half)) / (2 * half) * s / (np.exp(s) - 1.0)
            turn = np.exp(s * delta[j])
            stay = np.exp(s * (1.0 - whole[j] * delta[j]))
            less = stay / turn
            rows[0, at], rows[1, at], rows[2, at], rows[3, at] = r.real, r.imag, turn.real, turn.imag
            rows[4, at], rows[5, at], rows[6, at], rows[7, at] = stay.real, stay.imag, less.real, less.imag


def _starts(sizes: Sequence[int] | Array) -> Array:
    return (np.cumsum(sizes) - sizes).astype(np.int64)


def _chosen(pending: Pending, order: Array) -> Pending:
    """The strikes ``order``; flat arrays as they are."""
    scalars = {name: getattr(pending, name)[order] for name in _SCALARS}
    return Pending(
        **scalars,
        impulse=pending.impulse,
        impulse_at=pending.impulse_at[order],
        rows=pending.rows,
        rows_at=pending.rows_at[order],
    )
