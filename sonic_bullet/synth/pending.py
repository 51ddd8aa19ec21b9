"""Strikes under way: how the bank keeps a force pulse until the last of it has acted.

    nodes u_j = u_0 + jδ, impulses J_j:   at each sample n the driven state gains   r_n Σ J_j D^(last - j)   over the nodes in (n-1, n]
    D = e^{sδ},   r_n = g (1 + i d/ω) e^{s(n - u_last)},   r_{n+1} = r_n e^{s(1 - kδ)},   k = nodes in (n, n+1] = ⌊1/δ⌋ or one more

so each mode needs four phasors (r, D and the two turns of r), computed once, and no exponential at run time. Times in samples, s per sample.
j strikes, L lanes of all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sonic_bullet.errors import AudioError
from sonic_bullet.records import Array

FLUSH = 1e-30
LONGEST_SPACING = 16.0

_SCALARS = {"body": np.int64, "start": float, "count": np.int64, "whole": np.int64, "delta": float, "phase": float, "upcoming": np.int64, "first": np.int64}


@dataclass(frozen=True, slots=True, eq=False)
class Strike:
    """A finite force pulse on one body: impulses at equidistant times, one participation vector.

    start: absolute time of the first node in samples (any fraction). spacing: of the nodes, in samples (0 … 16).
    impulse_n_s (k,): impulse of each node. gain (m,): φᵀf̂ of the body's modes in 1/√kg.
    """

    body: int
    start: float
    spacing: float
    impulse_n_s: Array
    gain: Array


@dataclass(slots=True, eq=False)
class Pending:
    """Strikes sorted by body and start. body, start, count (of nodes), whole (⌊1/δ⌋), delta (δ), phase (n - u_last), upcoming (next node; before
    the first sample: nodes up to it), first (that sample): (j,). impulse, from impulse_at (j,) on, zeros behind each; rows (8, L): phasors, from rows_at (j,) on.
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
        return cls(**scalars, impulse=np.zeros(0), impulse_at=np.zeros(0, np.int64), rows=np.zeros((8, 0)), rows_at=np.zeros(0, np.int64))

    def copy(self) -> Pending:
        """Pending strikes of its own."""
        return Pending(**{name: getattr(self, name).copy() for name in self.__slots__})


def flushed(values: Array) -> Array:
    """Values with what lies below 1e-30 set to zero: no product of theirs becomes subnormal."""
    return np.asarray(np.where(np.abs(values) < FLUSH, 0, values))


def padded_gain(offset: Array, count: Array, body: int, gain: Array, what: str) -> Array:
    """Gain (m,) on the body's lanes, zero behind. Raises AudioError on an unknown body, a wrong shape, or NaN."""
    if not 0 <= body < len(count):
        raise AudioError(f"a {what} on body {body} of {len(count)}", "append the body first")
    m = int(count[body])
    if np.shape(gain) != (m,) or not np.isfinite(gain).all():
        raise AudioError(f"a {what} on body {body}: gain of shape {np.shape(gain)}", f"give {m} finite numbers")
    out = np.zeros(int(offset[body + 1] - offset[body]))
    out[:m] = flushed(gain)
    return out


def with_strikes(pending: Pending, strikes: Sequence[Strike], at: int, offset: Array, count: Array, log_pole: Array, quadrature: Array) -> Pending:
    """The strikes under way and new ones, none before sample ``at``. offset, count, log_pole, quadrature: the bank's.

    Raises AudioError on wrong shapes, NaN, a spacing beyond 16 samples, or a strike whose time has passed.
    """
    if not strikes:
        return pending
    modes = len(quadrature)
    scalars: dict[str, list[float]] = {name: [] for name in _SCALARS}
    impulses, gains, lanes = [pending.impulse], [], []
    for strike in strikes:
        gains.append(padded_gain(offset, count, strike.body, strike.gain, "strike"))
        impulse = flushed(np.asarray(strike.impulse_n_s, float))
        k = impulse.size
        delta = float(strike.spacing) if k > 1 else 1.0
        if impulse.ndim != 1 or k == 0 or not (np.isfinite(impulse).all() and np.isfinite(strike.start) and 0 < delta <= LONGEST_SPACING):
            raise AudioError(f"a strike on body {strike.body} of {k} nodes, {strike.spacing} samples apart, at {strike.start}", "give finite impulses less than 16 samples apart")
        first = int(np.ceil(strike.start))
        if first < at:
            raise AudioError(f"a strike at sample {strike.start:.2f}, but {at} samples have sounded", "pass strikes before their time has sounded")
        within, whole = int(np.floor((first - strike.start) / delta)), int(np.floor(1.0 / delta))
        phase = max((first - strike.start) - within * delta, 0.0)
        for name, value in zip(_SCALARS, (strike.body, strike.start, k, whole, delta, phase, within + 1, first), strict=True):
            scalars[name].append(value)
        impulses += [impulse, np.zeros(max(whole, within) + 2)]
        lanes.append(np.arange(offset[strike.body], offset[strike.body + 1]))
    new = {name: np.array(values, _SCALARS[name]) for name, values in scalars.items()}
    size = np.array([len(x) for x in lanes])
    lane = np.concatenate(lanes)
    gain = np.concatenate(gains)
    re, im = log_pole[lane], log_pole[modes + lane]
    delta, whole = new["delta"].repeat(size), new["whole"].repeat(size)
    r = _turned(re, im, new["phase"].repeat(size))
    rows = [gain * (r[0] - quadrature[lane] * r[1]), gain * (r[1] + quadrature[lane] * r[0])]
    for time in (delta, 1.0 - whole * delta, 1.0 - (whole + 1) * delta):
        rows += _turned(re, im, time)
    impulse_size = [len(a) + len(b) for a, b in zip(impulses[1::2], impulses[2::2], strict=True)]
    joined = Pending(
        **{name: np.concatenate([getattr(pending, name), values]) for name, values in new.items()},
        impulse=np.concatenate(impulses),
        impulse_at=np.concatenate([pending.impulse_at, len(pending.impulse) + _starts(impulse_size)]),
        rows=np.concatenate([pending.rows, np.stack(rows)], axis=1),
        rows_at=np.concatenate([pending.rows_at, pending.rows.shape[1] + _starts(size)]),
    )
    return _chosen(joined, np.lexsort((joined.start, joined.body)))


def without(pending: Pending, done: Array, offset: Array) -> Pending:
    """The strikes that are not done (j,), and only their share of the flat arrays."""
    if not done.any():
        return pending
    kept = _chosen(pending, np.flatnonzero(~done))
    if not len(kept.body):
        return Pending.none()
    impulse_size, size = kept.count + np.maximum(kept.whole, 0) + 2, np.diff(offset)[kept.body]
    impulse_size = np.minimum(impulse_size, len(kept.impulse) - kept.impulse_at)
    kept.impulse = np.concatenate([pending.impulse[a : a + k] for a, k in zip(kept.impulse_at, impulse_size, strict=True)])
    kept.rows = np.concatenate([pending.rows[:, a : a + k] for a, k in zip(kept.rows_at, size, strict=True)], axis=1)
    kept.impulse_at, kept.rows_at = _starts(impulse_size), _starts(size)
    return kept


def _turned(re: Array, im: Array, time: Array) -> list[Array]:
    """Real and imaginary part of e^{(re + i im) time}."""
    size = np.exp(re * time)
    return [size * np.cos(im * time), size * np.sin(im * time)]


def _starts(sizes: Sequence[int] | Array) -> Array:
    return (np.cumsum(sizes) - sizes).astype(np.int64)


def _chosen(pending: Pending, order: Array) -> Pending:
    """The strikes ``order``; flat arrays as they are."""
    scalars = {name: getattr(pending, name)[order] for name in _SCALARS}
    return Pending(**scalars, impulse=pending.impulse, impulse_at=pending.impulse_at[order], rows=pending.rows, rows_at=pending.rows_at[order])
