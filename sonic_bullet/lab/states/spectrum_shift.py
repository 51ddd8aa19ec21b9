"""Whether a thing's spectrum stayed where it was or went by one factor: levels of its first periods over ln f.

    L_N(f) = 10 lg |Σ_t w(t) x(t) e^{−2πi f t}|²,  w: Hann's over N periods of f from the onset   [Brown 1991]
    x = L less its mean over an octave and a third: a striker, a microphone and radiation are smooth
    r(s) = Σ_f u(ln f) v(ln f + s)/√m(s),   u = x − c x′, v = x′ − c x, c their correlation: what both share at their
        own frequencies, as a room's echoes in both, is taken off
    chance: the same of the second spectrum cut into pieces, each turned or not, in another order
    stays: correlation of x and x′ by the louder's amplitude, over that of such pieces

Size, and stiffness over mass, move all modes by one factor, and their widths with them where the loss factor is the
material's: over ln f the spectrum goes as it is, whether or not its lines can be told apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.lab.states.recorded_states import RecordedState
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.records import Array

PERIODS = (24, 48)
"""N: of wood, whose loss factor is 0.01, a mode falls by 20 and 40 dB in so many; a room has hardly begun to sound."""
PER_OCTAVE = 48
LOWEST_HZ = 150.0
FARTHEST = float(np.log(4.4))
"""Of ln f: from the slowest to the fastest of what rings, soft wood and plastic 1.2 km/s, glass 5.3 [Cremer & Heckl
1988]; walls of one material differ by less."""
NEAREST = 1.44 / max(PERIODS)
"""Of ln f, half the power's width of the longer window: less is for the lines to say."""
APART = -0.2
"""Correlation of what is loud, below which it is elsewhere: measured, see `left`."""
DRAWS = 999
MOST_TAKES = 8


@dataclass(frozen=True, slots=True)
class SpectrumShift:
    """How the second state's spectrum lies to the first's.

    log_factor: s, of ln f, that makes most of it agree; chance: probability that other spectra agree as well at any s.
    stay_chance: that other spectra agree as well where they are. agreement, unmoved: correlations at s and at 0, by
    loudness.
    """

    log_factor: float
    chance: float
    stay_chance: float
    agreement: float
    unmoved: float

    def moved(self, certain: float) -> bool:
        """Say whether all went by one factor."""
        return self.chance <= certain and self.agreement > self.unmoved

    def stayed(self, certain: float) -> bool:
        """Say whether most of what is loud is where it was, and not by chance."""
        most = 0.5
        return self.stay_chance <= certain and self.unmoved > most and not self.moved(certain)

    @property
    def left(self) -> bool:
        """Whether nothing loud is where it was, as no other place of the same modes makes it."""
        return self.unmoved < APART


@one_thread()
def find_shift(before: RecordedState, after: RecordedState) -> SpectrumShift | None:
    """Find how one state's spectrum lies to the other's; None where two octaves are not recorded."""
    if 0.45 * before.sr < 4 * LOWEST_HZ:
        return None
    freq = LOWEST_HZ * 2 ** (np.arange(int(np.log2(0.45 * before.sr / LOWEST_HZ) * PER_OCTAVE)) / PER_OCTAVE)
    level = np.array([[_mean_level(state, freq, periods) for periods in PERIODS] for state in (before, after)])
    smooth = np.apply_along_axis(_smooth, -1, level)
    rough_db = np.clip(level - smooth, -10.0, 20.0)  # below a line there is noise, or a room
    amplitude = 10 ** ((level - level.max(axis=-1, keepdims=True)) / 20)
    pieces = _shuffled(len(freq))
    here = _loud_agreement(rough_db[0], rough_db[1], amplitude[0], amplitude[1])
    elsewhere = _loud_agreement(
        rough_db[0][:, None], rough_db[1][:, pieces], amplitude[0][:, None], amplitude[1][:, pieces]
    )
    bins, shift, found, by_chance = _best_shift(rough_db[0], rough_db[1], pieces)
    a, b = slice(max(0, -bins), len(freq) - max(0, bins)), slice(max(0, bins), len(freq) - max(0, -bins))
    there = _loud_agreement(rough_db[0][:, a], rough_db[1][:, b], amplitude[0][:, a], amplitude[1][:, b])
    return SpectrumShift(
        shift,
        float((1 + (by_chance >= found).sum()) / (1 + DRAWS)),
        float((1 + (elsewhere >= here).sum()) / (1 + DRAWS)),
        float(there),
        float(here),
    )


def _mean_level(state: RecordedState, freq: Array, periods: int) -> Array:
    """Mean level (f,) in dB of takes in their first periods."""
    takes = [take.signal for take in state.takes[:MOST_TAKES]]
    power = np.empty((len(freq), len(takes)))
    for k, f in enumerate(freq):
        count = int(periods * state.sr / f)
        turn = np.hanning(count + 2)[1:-1] * np.exp(-2j * np.pi * f / state.sr * np.arange(count))
        power[k] = [np.abs(take[:count] @ turn[: len(take)]) ** 2 / count for take in takes]
    return np.asarray((10 * np.log10(power + 1e-20)).mean(axis=1))


def _smooth(level: Array) -> Array:
    """Mean over an octave and a third under Hann's window."""
    window = np.hanning(2 * int(2 / 3 * PER_OCTAVE) + 3)[1:-1]
    return np.asarray(np.convolve(level, window, "same") / np.convolve(np.ones(len(level)), window, "same"))


def _shuffled(count: int) -> Array:
    """Orders (DRAWS, count) of pieces of a third of an octave at the mean, each turned or not."""
    random = np.random.default_rng(0)
    orders = []
    for _ in range(DRAWS):
        cuts = np.sort(random.choice(np.arange(1, count), max(2, 3 * count // PER_OCTAVE - 1), replace=False))
        parts = np.split(np.arange(count), cuts)
        orders.append(np.concatenate([parts[k][:: random.choice([-1, 1])] for k in random.permutation(len(parts))]))
    return np.array(orders)


def _loud_agreement(x: Array, y: Array, x_loud: Array, y_loud: Array) -> Array:
    """Correlation of spectra (N, ..., f) by the louder's amplitude, mean over N."""
    weight = np.maximum(x_loud, y_loud)
    weight = weight / weight.sum(axis=-1, keepdims=True)
    a = x - (weight * x).sum(axis=-1, keepdims=True)
    b = y - (weight * y).sum(axis=-1, keepdims=True)
    of = np.sqrt((weight * a**2).sum(axis=-1) * (weight * b**2).sum(axis=-1))
    return np.asarray(((weight * a * b).sum(axis=-1) / np.maximum(of, 1e-12)).mean(axis=0))


def _best_shift(x: Array, y: Array, pieces: Array) -> tuple[int, float, float, Array]:
    """Bins and ln of the factor at which spectra (N, f) agree most, how much, and how much by chance (draws,)."""
    count = x.shape[1]
    lag = np.arange(-(count - 1), count)
    overlap = count - np.abs(lag)
    shift = lag / PER_OCTAVE * np.log(2)
    allowed = (np.abs(shift) <= FARTHEST) & (np.abs(shift) >= NEAREST) & (overlap >= count / 2)
    size = 2 * count
    x, y = (
        (one - one.mean(axis=1, keepdims=True)) / np.maximum(one.std(axis=1, keepdims=True), 1e-12) for one in (x, y)
    )
    shared = (x * y).mean(axis=1, keepdims=True)
    own, other = x - shared * y, y - shared * x
    own, other = (one / np.maximum(one.std(axis=1, keepdims=True), 1e-12) for one in (own, other))

    def agreement(second: Array) -> Array:
        made = np.fft.irfft(np.conj(np.fft.rfft(own, size))[:, None] * np.fft.rfft(second, size), size)
        made = np.concatenate([made[..., size - count + 1 :], made[..., :count]], axis=-1)
        return np.asarray((made / np.sqrt(overlap)).mean(axis=0))

    found = agreement(other[:, None])[0]
    best = int(np.where(allowed, found, -np.inf).argmax())
    before, peak, after = found[best - 1 : best + 2]
    off = 0.5 * (before - after) / min(before - 2 * peak + after, -1e-12)
    exact = shift[best] + float(np.clip(off, -0.5, 0.5)) * np.log(2) / PER_OCTAVE
    by_chance = np.where(allowed, agreement(other[:, pieces]), -np.inf).max(axis=1)
    return int(lag[best]), float(exact), float(peak), by_chance
