"""Lines of what rings after the attack, for recordings that no sum of damped sinusoids explains from the onset on.

The first milliseconds of a real take hold the striker, slaps and a room, and its modes are not exactly exponential.

    signals (s, n) -> bands of 400 Hz about their centre, decimated, once the band's filter is full: after the attack
    -> poles of a band, of all recordings at once (ESPRIT)           [Roy & Kailath 1989, eq. 3.12-3.17]
    -> the one that takes most, of what is left the next           [Pati, Rezaiifar & Krishnaprasad 1993], while it
         has half of its energy apart from those chosen: what cancels is no line
         stands out of what is left about it while it rings:
             T = Σ_s |<q, r_s>|²/D_s > chance,  D = Σ |r|²|e|²/Σ |e|²             [Kay 1998, ch. 7.6]
    -> poles at the least sum of squares, amplitudes projected out                           (pole_refinement.py)
    -> amplitudes at the onset: A e^{−p t}; what would be louder at the first peak than the recording is its attack's
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from sonic_bullet.lab.lines.line_values import Lines, struck_lines
from sonic_bullet.lab.lines.pole_refinement import refine_poles
from sonic_bullet.lab.lines.subspace import low_pass, shift_poles
from sonic_bullet.machine.parallel import parallel_map
from sonic_bullet.records import Array
from sonic_bullet.signal.exponential_law import mean_by_median
from sonic_bullet.signal.log_spectral import floor_between

WIDTHS_AROUND = 7  # widths, from two on, above and below a line


@dataclass(frozen=True, slots=True, eq=False)
class _Band:
    """Series (s, m) at sr/step about centre_hz, in units of their noise (s,); taps (l,) of the filter before it."""

    low_hz: float
    high_hz: float
    centre_hz: float
    step: int
    taps: Array
    series: Array
    noise: Array


class _Solution(NamedTuple):
    """Amplitudes (s, k), what is left (s, m), the Gram matrix, and the equations of a complex step (k,)."""

    amplitude: Array
    left: Array
    gram: Array
    matrix: Array
    gradient: Array
    cost: float


def ringing_lines(
    signals: Array, sr: int, band_hz: tuple[float, float], *, signed: bool, rise_s: Array | None = None
) -> Lines:
    """Lines of signals (s, n) that start at the onset, ``rise_s`` (s,) before their peaks; none where nothing rings."""
    listened_s = 2.0
    attack_s = 0.005  # and a band's filter, 16 ms: together twice what it lasts in real takes
    false_alarms = 0.05  # of a recording of noise alone
    from scipy.special import chdtri

    late = round(attack_s * sr)
    rest = signals[:, late : late + int(listened_s * sr)]
    least = float(chdtri(2 * len(signals), false_alarms / (1.5 * rest.shape[1])) / 2)
    found = parallel_map(lambda band: _lines_of(band, sr, least), _bands(rest, sr, band_hz))
    pole, amplitude, spread, amplitude_sd, energy = (np.concatenate(part, axis=-1) for part in zip(*found, strict=True))
    order = np.argsort(pole.imag)
    pole, amplitude, spread, amplitude_sd, energy = (
        part[..., order] for part in (pole, amplitude, spread, amplitude_sd, energy)
    )
    back = np.exp(-pole * late / sr)
    rise_s = np.zeros(len(signals)) if rise_s is None else rise_s
    sd, amplitude_sd = spread / (2 * np.pi), amplitude_sd * np.abs(back)
    freq, none = pole.imag / (2 * np.pi), np.zeros(len(signals))
    lines = Lines(freq, -pole.real, amplitude * back, sd, spread, amplitude_sd, none, energy, signed, rise_s)
    lines = struck_lines(lines, signals, 1.0)  # they stand apart: of joint lines, which may cancel, ten times
    left = rest.copy()
    for p, a in zip(lines.pole, (lines.amplitude * np.exp(lines.pole * late / sr)).T, strict=True):
        left -= np.real(a[:, None] * _rings(np.array([p / sr]), rest.shape[1])[:, 0])
    return replace(lines, noise=np.sqrt((left**2).mean(axis=1)))


def _bands(signals: Array, sr: int, band_hz: tuple[float, float]) -> list[_Band]:
    """Cut the bands of signals (s, n), each from the sample on at which its filter is full."""
    stop_db = 100.0
    from scipy.fft import fft, ifft, next_fast_len

    # of a band's width from its centre; rate over width
    width_hz, pass_widths, stop_widths, oversampled = 400.0, 0.5, 1.5, 2.0
    step = max(1, int(sr / (oversampled * width_hz)))
    taps = low_pass(pass_widths * width_hz / sr, stop_widths * width_hz / sr, stop_db)
    count = max(0, -(-(signals.shape[1] - len(taps) + 1) // step))
    points = next_fast_len(-(-(signals.shape[1] + len(taps)) // step))
    whole = points * step
    spectrum = fft(signals, whole, axis=1)
    weight = fft(np.roll(np.pad(taps, (0, whole - len(taps))), 1 - len(taps))) / step  # its first sample is a full one
    floors = [floor_between([signal]).variance for signal in signals]
    made = []
    for low in np.arange(band_hz[0], band_hz[1], width_hz):
        at = round((low + width_hz / 2) / sr * whole)
        band = np.roll(spectrum, -at, axis=1) * weight  # every step-th sample: what lies a rate apart adds up
        series = ifft(band.reshape(len(band), step, points).sum(axis=1), axis=1)[:, :count]
        place = np.linspace(low, low + width_hz, 16) / (sr / 2)
        noise = np.array([np.interp(place, np.linspace(0, 1, len(floor)), floor).mean() for floor in floors])
        noise = np.sqrt(noise * (taps**2).sum())
        high = min(low + width_hz, band_hz[1])
        made.append(_Band(low, high, at * sr / whole, step, taps, series / noise[:, None], noise))
    return made


def _lines_of(band: _Band, sr: int, least: float) -> tuple[Array, Array, Array, Array, Array]:
    """Poles (k,) in 1/s, amplitudes (s, k) and their spreads, spreads (k,), energies (k,) of a band's lines."""
    fewest_cycles = 3.0  # in which it falls by e
    y, pole = band.series, _candidates(band.series)
    pole = pole[pole.real < 0]
    pole = pole[_select_poles(y, pole, least)]  # about the band, per sample; its neighbours' too
    for _ in range(3):
        pole = refine_poles(
            lambda p: _solve_amplitudes(y, p), pole, (1.0,), bound=_bound_growth, relative=1e-6, slack=1e-3
        )[0]
        size = len(pole)
        pole = pole[_select_poles(y, pole, least)]
        if len(pole) == size:
            break
    amplitude, left, gram, matrix, _, _ = _solve_amplitudes(y, pole)
    if len(pole):
        ring = np.abs(_rings(pole, y.shape[1])) ** 2
        level = (np.abs(left) ** 2) @ ring / ring.sum(axis=0)  # (s, k): what is left about each
        energy = (np.abs(amplitude) ** 2).sum(axis=0) * ring.sum(axis=0)
        spread = np.sqrt(np.abs(np.diag(np.linalg.pinv(matrix, hermitian=True))) / 2 * level.mean(axis=0))
        amplitude_sd = np.sqrt(np.abs(np.diag(np.linalg.pinv(gram, hermitian=True))) / 2 * level)
    else:
        spread, amplitude_sd, energy = np.zeros(0), np.zeros((len(y), 0)), np.zeros(0)
    lag = np.arange(len(band.taps))
    # y(m) = Σ_j h(j) ½ A w^{mD + l − 1 − j}
    gain = np.exp(np.outer(pole / band.step, len(lag) - 1 - lag)) @ band.taps / 2
    exact = pole / band.step * sr + 2j * np.pi * band.centre_hz
    freq, decay = exact.imag / (2 * np.pi), -exact.real
    inside = (freq >= band.low_hz) & (freq < band.high_hz) & (freq > fewest_cycles * decay)
    scale = band.noise[:, None] / gain
    return (
        exact[inside],
        (amplitude * scale)[:, inside],
        (spread / band.step * sr)[inside],
        np.abs(amplitude_sd * scale)[:, inside],
        energy[inside],
    )


def _candidates(y: Array) -> Array:
    """Poles (k,) per sample of series (s, m)."""
    matrix_rows, matrix_columns, most_poles = 240, 800, 40  # of a band's data matrix; poles looked for
    from scipy.linalg import eigh
    from scipy.linalg.blas import zherk

    m = y.shape[1]
    rows = min(matrix_rows, m // 3)
    if rows < 8:
        return np.zeros(0, complex)
    data = np.concatenate([sliding_window_view(row, rows)[:: 1 + (m - rows) // matrix_columns] for row in y])
    most = min(most_poles, rows // 2)
    gram = zherk(1.0, data.T, lower=1)
    vector = eigh(gram, subset_by_index=(rows - most, rows - 1), check_finite=False)[1]
    return shift_poles(vector)


def _select_poles(y: Array, pole: Array, least: float) -> Array:
    """Which poles (k,) are lines of series (s, m), in the order in which they take most."""
    if not len(pole):
        return np.zeros(0, int)
    ring = _rings(pole, y.shape[1])
    whole, moment = ring.conj().T @ ring, y @ ring.conj()
    own = np.diag(whole).real
    alive = np.abs(ring) ** 2 / own
    free, found = np.ones(len(pole), bool), list[int]()

    own_share = 0.5

    def strongest(gram: Array, seen: Array, among: Array) -> tuple[int, Array, Array, Array]:
        """Its number or -1, what it takes (s,); Gram matrix and moments without it. All are apart from those chosen."""
        new = np.diag(gram).real
        taken = np.abs(seen) ** 2 / np.maximum(new, 1e-300)
        worth = np.where(among & (new > own_share * own), taken.sum(axis=0), -1.0)
        k = int(worth.argmax())
        if worth[k] < least:
            return -1, taken[:, k], gram, seen
        turned = gram[:, k] / np.sqrt(new[k])
        less = seen - np.outer(seen[:, k], turned) / np.sqrt(new[k])
        return k, taken[:, k], gram - np.outer(turned, turned.conj()), less

    def stands(k: int, taken: Array, left: Array) -> bool:
        level = np.abs(left) ** 2 @ alive[:, k]
        if (taken / level).sum() < least:  # what lies beside it costs most, and can only raise the level
            return False
        level = np.maximum(level, _level_around(left, ring[:, k], pole[k]))
        return bool((taken / level).sum() >= least)

    def without(chosen: list[int]) -> Array:
        return np.asarray(y - (ring[:, chosen] @ np.linalg.solve(whole[np.ix_(chosen, chosen)], moment[:, chosen].T)).T)

    gram, seen = whole, moment
    while free.any():
        k, taken, *rest = strongest(gram, seen, free)
        if k < 0:
            break
        free[k] = False
        chosen = [k]
        if not stands(k, taken, without([*found, k])):  # two close ones may, each beside the other
            near = free & (np.abs(pole.imag - pole[k].imag) < WIDTHS_AROUND * _width(pole[k], len(ring)))
            second, more, *rest = strongest(rest[0], rest[1], near)
            if second < 0:
                continue
            chosen.append(second)
            left = without([*found, *chosen])
            if not stands(k, taken, left) or not stands(second, more, left):
                continue
            free[second] = False
        found += chosen
        gram, seen = rest
    return np.array(found, int)


def _rings(pole: Array, count: int) -> Array:
    """e^{p t} (count, k) of poles (k,) per sample."""
    return np.vander(np.exp(pole), count, increasing=True).T


def _width(pole: complex, samples: int) -> float:
    """Of a line in the spectrum of so many samples, in radians a sample."""
    return float(np.hypot(-pole.real, np.pi / samples))


def _level_around(left: Array, ring: Array, pole: complex) -> Array:
    """Power (s,) of what is left beside a line's frequency while it rings, as its energy's square root's variance."""
    turn = np.exp(1j * _width(pole, len(ring)) * np.arange(len(ring)))
    once = left * ring.conj()
    powers = np.empty((WIDTHS_AROUND - 1, len(ring)), complex)
    powers[0] = turn * turn
    for k in range(1, len(powers)):
        np.multiply(powers[k - 1], turn, out=powers[k])
    moment = np.concatenate([once @ powers.T, once @ powers.conj().T], axis=1)
    power = np.abs(moment) ** 2 / (np.abs(ring) ** 2).sum()
    return mean_by_median(power, 1)


def _bound_growth(pole: Array) -> Array:
    """Keep poles from growing."""
    return np.asarray(np.minimum(pole.real, -1e-6) + 1j * pole.imag)


def _solve_amplitudes(y: Array, pole: Array) -> _Solution:
    """Solve for the amplitudes at poles (k,) per sample."""
    ring = _rings(pole, y.shape[1])
    slope = np.arange(y.shape[1])[:, None] * ring
    gram = ring.conj().T @ ring
    inverse = np.linalg.pinv(gram, hermitian=True)
    amplitude = y @ ring.conj() @ inverse.T
    left = y - amplitude @ ring.T
    cross = ring.conj().T @ slope
    apart = slope.conj().T @ slope - cross.conj().T @ inverse @ cross
    matrix = apart * (amplitude.conj().T @ amplitude)
    gradient = (amplitude.conj() * (left @ slope.conj())).sum(axis=0)
    return _Solution(amplitude, left, gram, matrix, gradient, float((np.abs(left) ** 2).sum()))
