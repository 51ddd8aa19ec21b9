"""Transfer of a residual: it is mapped as the source's modal spectrogram is onto the target's.

[Ren, Yeh, Lin 2013, eq. 28-29, algorithm 1]

    (1) shift     the pixel at f_s goes to f_t:
        f_s^i -> f_t^j, and midpoints between modes -> midpoints, linear between
    (2) stretch   P''(t) = P(t d_t/d_s)                                       within the neighbourhood of each pair
    (3) scale     A(f) = Σ_k a_t,k² h_k(f) / Σ_k a_s,k² h_k(f),  h_k = 1/(1 + (f - f_s,k)²/b_k²)
    P_t(f_t, t) = A(f_s) P_s(f_s, t d_t/d_s) |df_s/df_t|

At a mode the shift is the paper's Δf. Towards the midpoints the paper shifts by the same Δf and cuts or doubles what
does not fit; here a neighbourhood fills its new one, so bands of a body twice the size lie at half the frequencies, and
|df_s/df_t| keeps their energy relative to the modes'. After (2) source and target mode decay alike, so the ratio of
their spectrograms, pixel by pixel, no longer depends on time. h_k is a mode's skirt, b_k 7 % of its neighbourhood: a
mode that is not struck reduces its neighbourhood by 20 dB, and its neighbours' skirts meet without a step. Below the
lowest and above the highest pair frequencies keep their ratio to that pair's. m, p modes, pairs; b bands, n frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet._engine import move_power, power_ratios
from sonic_bullet.records import Array, Residual, frozen_array
from sonic_bullet.records.errors import AudioError
from sonic_bullet.signal.spectrogram import Power

DOMINANT_PAIRS = 24  # most pairs where the shapes differ: the N_dominant of the paper's section 6.2.1
FAINT_POWER = 1e-6
LEAST_DECAY_PER_S = 0.1
TINY_POWER = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class StruckModes:
    """Modes (m,) as one strike starts them.

    freq_hz ascending, decay_per_s, amplitude ≥ 0 at the onset, in any one unit.
    """

    freq_hz: Array
    decay_per_s: Array
    amplitude: Array

    def __post_init__(self) -> None:
        """Check shapes, order and signs."""
        m = len(np.atleast_1d(self.freq_hz))
        for name in ("freq_hz", "decay_per_s", "amplitude"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), np.float64, (m,), f"modes' {name}"))
        if (
            m == 0
            or not (self.freq_hz > 0).all()
            or (np.diff(self.freq_hz) < 0).any()
            or (self.amplitude < 0).any()
            or (self.decay_per_s < 0).any()
        ):
            raise AudioError(
                "modes that are none, do not ascend or are below zero",
                "give frequencies in ascending order, decays and amplitudes of at least zero",
            )

    @property
    def energy(self) -> Array:
        """Energy (m,) a²/4d that each mode emits in all."""
        return np.asarray(self.amplitude**2 / (4 * np.maximum(self.decay_per_s, LEAST_DECAY_PER_S)))


@dataclass(frozen=True, slots=True, eq=False)
class ModePairs:
    """Pairs (p,) of modes, ascending on both sides.

    Attributes
    ----------
    source_hz, target_hz : (p,)
    rate : (p,) d_t/d_s
    source, target : (p,) index of each mode
    natural : whether the bodies are one shape scaled, so that the pairs are the same modes
    group : (m,) the target's pair that each of its modes counts to, -1: none
    """

    source_hz: Array
    target_hz: Array
    rate: Array
    source: Array
    target: Array
    natural: bool
    group: Array


def source_modes(residual: Residual) -> StruckModes:
    """Return the modes with which a residual was measured."""
    return StruckModes(residual.mode_freq_hz, residual.mode_decay_per_s, residual.mode_amplitude)


def source_power(residual: Residual) -> Power:
    """Return a residual's noise."""
    return Power(residual.freq_hz, residual.time_s, residual.power_per_hz)


def merge_modes(modes: StruckModes) -> tuple[StruckModes, Array]:
    """Merge modes closer than `one_mode`: powers add, frequency and decay are the mean by power.

    Also returns (m,) which of them each is.
    """
    one_mode = 1e-3  # Modes closer than this, relative, count as one: an analysis finds one line
    group = np.concatenate([[0], np.cumsum(np.diff(modes.freq_hz) > one_mode * modes.freq_hz[1:])]).astype(np.int64)
    weight = modes.amplitude**2 + 1e-12 * float((modes.amplitude**2).max()) + TINY_POWER
    total = np.bincount(group, weight)
    freq, decay = (np.bincount(group, weight * value) / total for value in (modes.freq_hz, modes.decay_per_s))
    return StruckModes(freq, decay, np.sqrt(np.bincount(group, modes.amplitude**2))), group


def pair(source: StruckModes, target: StruckModes, dominant: int = DOMINANT_PAIRS) -> ModePairs:
    """Pair the modes of source and target.

    Natural pairs where the target is the source's shape at some scale, else the ``dominant`` strongest of both sides,
    from low to high.
    """
    fastest_time = 1e3
    a, _ = merge_modes(source)
    b, group = merge_modes(target)
    i, j = _natural(a, b)
    natural = len(i) > 0
    if not natural:
        count = min(dominant, int((a.amplitude > 0).sum()), max(int((b.amplitude > 0).sum()), 1))
        i, j = (np.sort(np.argsort(-x.energy, kind="stable")[: max(count, 1)]) for x in (a, b))
    rate = np.clip(
        np.maximum(b.decay_per_s[j], LEAST_DECAY_PER_S) / np.maximum(a.decay_per_s[i], LEAST_DECAY_PER_S),
        1 / fastest_time,
        fastest_time,
    )
    of_pair = np.full(len(b.freq_hz), -1)
    of_pair[j] = np.arange(len(j))
    return ModePairs(a.freq_hz[i], b.freq_hz[j], rate, i, j, natural, of_pair[group])


def _natural(a: StruckModes, b: StruckModes) -> tuple[Array, Array]:
    """Match modes of a and b that are the same of one scaled shape; none where the lowest do not agree.

    The scale is searched among ratios of the lowest.
    """
    alike = 0.02  # Frequencies that agree so well after scaling are of the same mode of a scaled body
    alike_count = 12
    count = min(alike_count, len(a.freq_hz), len(b.freq_hz))
    none = np.zeros(0, np.int64)
    if count < min(3, len(a.freq_hz)):
        return none, none
    low = a.freq_hz[:count]
    ratio = (b.freq_hz[:4, None] / low[None, :2]).ravel()
    wanted = ratio[:, None] * low
    off = np.sort(np.abs(_nearest(b.freq_hz, wanted)[1] / wanted - 1), axis=1)[:, max(0, int(0.8 * count) - 1)]
    at = int(np.argmin(off))
    if off[at] > alike:
        return none, none
    scale = ratio[at]
    near, there = _nearest(b.freq_hz, scale * a.freq_hz)
    back, _ = _nearest(scale * a.freq_hz, b.freq_hz)
    good = (np.abs(there / (scale * a.freq_hz) - 1) < 2 * alike) & (back[near] == np.arange(len(near)))
    return np.flatnonzero(good), near[good]


def _nearest(values: Array, to: Array) -> tuple[Array, Array]:
    """Find the index into ascending ``values``, and the value, nearest to each of ``to``."""
    at = np.searchsorted((values[1:] + values[:-1]) / 2, to)
    return at, values[at]


def neighbourhood(centre_hz: Array, freq_hz: Array) -> Array:
    """Return in whose neighbourhood each frequency (k,) lies, between the midpoints of centres (p,)."""
    return np.searchsorted((centre_hz[1:] + centre_hz[:-1]) / 2, freq_hz)


def _knots(centre_hz: Array) -> Array:
    middle = (centre_hz[1:] + centre_hz[:-1]) / 2
    inner = np.empty(2 * len(centre_hz) - 1)
    inner[0::2], inner[1::2] = centre_hz, middle
    return np.concatenate([[0.0], inner, [1e3 * centre_hz[-1]]])


def shifted_hz(pairs: ModePairs, freq_hz: Array) -> Array:
    """Map source frequencies (k,) to the target."""
    return np.asarray(np.interp(freq_hz, _knots(pairs.source_hz), _knots(pairs.target_hz)))


def come_from(pairs: ModePairs, freq_hz: Array) -> tuple[Array, Array, Array]:
    """Compute source frequency, |df_s/df_t| and d_t/d_s (k,) of target frequencies (k,)."""
    there, here = _knots(pairs.target_hz), _knots(pairs.source_hz)
    piece = np.clip(np.searchsorted(there, freq_hz, "right") - 1, 0, len(there) - 2)
    slope = (np.diff(here) / np.diff(there))[piece]
    return here[piece] + (freq_hz - there[piece]) * slope, slope, pairs.rate[neighbourhood(pairs.target_hz, freq_hz)]


def scale(pairs: ModePairs, source_power: Array, target_power: Array, freq_hz: Array) -> Array:
    """Compute A (k,) at source frequencies (k,), from a² (p,) of both sides of the pairs."""
    skirt = 0.07
    edge = np.concatenate([[0.0], (pairs.source_hz[1:] + pairs.source_hz[:-1]) / 2])
    width = np.append(np.diff(edge), 2 * max(float(pairs.source_hz[-1] - edge[-1]), 1.0))
    out = np.empty(len(freq_hz))
    power_ratios(
        np.ascontiguousarray(freq_hz, float),
        pairs.source_hz,
        skirt * width,
        source_power + FAINT_POWER * float(source_power.max()) + TINY_POWER,
        target_power,
        out,
    )
    return out


def paired_power(pairs: ModePairs, target: StruckModes) -> Array:
    """Sum a² of the target's modes into its pairs (p,)."""
    mine = pairs.group >= 0
    return np.bincount(pairs.group[mine], target.amplitude[mine] ** 2, len(pairs.target_hz))


def transfer(
    residual: Power,
    source: StruckModes,
    target: StruckModes,
    freq_hz: Array,
    time_s: Array,
    *,
    pairs: ModePairs | None = None,
) -> Array:
    """Compute P_t (k, n) at target frequencies (k,) and times (n,) from the onset on.

    The residual was measured with modes ``source`` and is played with modes ``target``.
    """
    pairs = pairs or pair(source, target)
    merged_source, _ = merge_modes(source)
    here, slope, rate = come_from(pairs, freq_hz)
    level = slope * scale(pairs, merged_source.amplitude[pairs.source] ** 2, paired_power(pairs, target), here)
    return scale_power(residual, here, level, rate, time_s)


def scale_power(residual: Power, come_from_hz: Array, level: Array, rate: Array, time_s: Array) -> Array:
    """Compute level·P(come_from_hz, rate·t) (k, n)."""
    out = np.zeros((len(come_from_hz), len(time_s)))
    at_s, row = np.ascontiguousarray(time_s, float), np.empty(len(residual.time_s))
    move_power(residual.freq_hz, residual.time_s, residual.per_hz, come_from_hz, level, rate, at_s, row, out)
    return out


@dataclass(frozen=True, slots=True, eq=False)
class ResidualLines:
    """Damped sinusoids (l,) of a transferred residual.

    ratio (l,): their amplitude over that of the mode they follow; follows (l,): its pair.
    """

    freq_hz: Array
    decay_per_s: Array
    ratio: Array
    follows: Array


def transfer_lines(residual: Residual, pairs: ModePairs) -> ResidualLines:
    """Move and stretch the residual's lines, each struck as the mode in whose neighbourhood it lies."""
    source, _ = merge_modes(source_modes(residual))
    follows = neighbourhood(pairs.source_hz, residual.line_freq_hz)
    below = scale(
        pairs,
        np.ones(len(pairs.source)),
        source.amplitude[pairs.source] ** 2 + FAINT_POWER * float((source.amplitude**2).max()),
        residual.line_freq_hz,
    )
    decay = residual.line_decay_per_s * pairs.rate[follows]
    return ResidualLines(
        shifted_hz(pairs, residual.line_freq_hz), decay, residual.line_amplitude / np.sqrt(below), follows
    )
