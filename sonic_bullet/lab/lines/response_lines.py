"""Frequency responses at several places -> the modes that they share: one fit of all, exactly as many as there are.

    V_s(ω) = Σ_k ½ [A_sk/(iω − p_k) + A_sk*/(iω − p_k*)] + Σ_m c_sm (iω)^m + noise,   p = −d + iω_k
                                                                                              [Ewins 2000, ch. 2.4]
    c           what modes below the band (m = −1) and above it (m = 0 … 3) leave in it
    noise       σ_s(f): what no polynomial follows, then what the modes leave, by the median of a neighbourhood
    candidates  a common denominator in z = e^{iωT} by least squares, of several orders; a mode is a pole of each, what
                noise puts there is not: stabilisation     [LSCF: Guillaume, Verboven, Vanlanduit 1998; as sdypy-EMA and
                pyEMA do, where a person picks from the diagram]
    modes       the candidate that takes most, while it takes more than its unknowns are worth, Δχ² > m ln n of m
                unknowns and n samples     [Bayes' criterion: Schwarz 1978], each time at the maximum of the likelihood,
                A and c projected out     [Golub & Pereyra 1973; Kaufman 1975]
    spread      inverse of the information matrix at the end, the Cramér-Rao bound            [Kay 1993, ch. 3.9]

Lines of recordings come from samples (joint_lines.py). Samples of a response that was measured over frequency begin
with what the band's edge rings and end with what wraps around: neither decays, and noise in them becomes lines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.lab.lines.line_values import Lines
from sonic_bullet.lab.lines.pole_refinement import refine_poles
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError

RESIDUAL_POWERS = (-1, 0, 1, 2, 3)
FEWEST_STEPS = 3  # above zero: a mode of fewer periods in a record is its drift


@dataclass(frozen=True, slots=True, eq=False)
class _Responses:
    """Responses (s, n) at angular frequencies (n,), over their noise scale (s, 1) · colour (n,), per real number."""

    omega: Array
    value: Array
    scale: Array
    colour: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    """Amplitudes (s, k) over the scale at given poles, what is left (s, n), its sum of squares.

    matrix (2k, 2k), gradient (2k,): of a step of Gauss and Newton in Re p and Im p.
    amplitude_sd (k,): per unit of noise.
    """

    amplitude: Array
    left: Array
    cost: float
    matrix: Array
    gradient: Array
    amplitude_sd: Array


@one_thread()
def response_lines(value: Array, at_hz: Array, sr: int) -> Lines:
    """Find the lines of frequency responses.

    Parameters
    ----------
    value : (s, n) complex array
        Transforms ∫ x_s e^{−iωt} dt of responses to an impulse, x_s(t) = Re Σ_k A_sk e^{p_k t}.
    at_hz : (n,) array
        Where: above zero, in even steps.
    sr : int
        Rate of the recordings in Hz, for energy and noise, which lines state per sample.

    Returns
    -------
    Lines
        Amplitudes at the impulse, in units of x.

    Raises
    ------
    AudioError
        There are too few spectral lines, or nothing but zeros.
    """
    fewest, rounds = 32, 12
    if value.shape[1] < fewest:
        raise AudioError(f"a response has {value.shape[1]} spectral lines", f"export {fewest} or more")
    if not (np.abs(value).max(axis=1) > 0).all():
        raise AudioError("a response is zero throughout", "leave it out of the case")
    seen, pole = _over_noise(value, at_hz, _unpredictable(value)), np.zeros(0, complex)
    more = np.concatenate([_stable_poles(seen), _outside(seen)])
    for _ in range(rounds):
        before = pole
        pole = _drop_needless(seen, *_select_poles(seen, pole, more))
        left = _solve_amplitudes(seen, pole).left
        seen = _over_noise(value, at_hz, left * seen.scale * seen.colour)
        more = _peaks(seen, _solve_amplitudes(seen, pole).left)
        if not len(more) or (len(pole) == len(before) and np.allclose(pole, before, rtol=1e-6)):
            break
    return _lines(seen, _drop_needless(seen, *_refine_poles(seen, pole)), at_hz, sr)


def _unpredictable(value: Array) -> Array:
    """Return what no polynomial through a sample's neighbours follows (s, n), in units of the noise's own size."""
    order = 6  # of the difference: ten steps from a resonance 10^-6 of it are left
    binomial = np.array([1, -6, 15, -20, 15, -6, 1], float)
    left = np.apply_along_axis(np.convolve, 1, value, binomial, "valid") / np.sqrt((binomial**2).sum())
    return np.pad(left, ((0, 0), (order // 2, order // 2)), mode="reflect")


def _over_noise(value: Array, at_hz: Array, left: Array) -> _Responses:
    """Responses over the noise that is left (s, n), whose colour all places share."""
    from scipy.ndimage import median_filter

    near = max(25, value.shape[1] // 30)  # lines of a neighbourhood
    # of the largest value, below any analyser's noise: ten times what samples in single precision round, which is not
    # noise of one level
    rounding = 1e-8
    # noise of an integrated response goes with a power of the frequency, steep where a neighbourhood spans octaves
    seen = np.log(np.maximum(np.abs(left).mean(axis=0), 1e-300))
    law = at_hz ** np.polyfit(np.log(at_hz), seen, 1)[0]
    power = median_filter(np.abs(left / law) ** 2, (1, near), mode="reflect") / (2 * np.log(2))
    level = np.log(np.maximum(law * np.sqrt(power), rounding * np.abs(value).max(axis=1, keepdims=True)))
    size = np.median(level, axis=1, keepdims=True)
    colour = np.exp((level - size).mean(axis=0))
    scale = np.exp(size)
    return _Responses(2 * np.pi * at_hz, value / (scale * colour), scale, colour)


def _outside(seen: _Responses) -> Array:
    """Poles (k,) beside the band, whose modes no polynomial follows near its edges."""
    above, below, loss = (1.02, 1.06, 1.15, 1.3, 1.6, 2.2), (0.95, 0.8, 0.5), 0.01
    low = seen.omega[0] if seen.omega[0] > FEWEST_STEPS * (seen.omega[1] - seen.omega[0]) else 0.0
    centre = np.concatenate([seen.omega[-1] * np.array(above), low * np.array(below if low else ())])
    return np.asarray((1j - loss) * centre)


def _stable_poles(seen: _Responses) -> Array:
    """Poles (k,) in 1/s that common denominators of three orders have in common."""
    most, lines_a_pole, fewer = 120, 8, (0, 8, 20)  # of the order; steps down from it
    stable = 0.5  # of its decay that a pole may move from order to order
    order = int(min(most, len(seen.omega) // lines_a_pole))
    pole, *others = _denominator_poles(seen, [max(order - less, 4) for less in fewer])
    for other in others:
        off = np.abs(pole[:, None] - other).min(axis=1, initial=np.inf)
        pole = pole[off < -stable * pole.real]
    return pole


def _peaks(seen: _Responses, left: Array) -> Array:
    """Poles (k,) whose response stands out of what is left (s, n), as a matched filter sees it.

    T(ω, d) = Σ_s |Σ e* r_s|²/Σ |e|², e = 1/((i(ω' − ω) + d) colour(ω'))                      [Kay 1998, ch. 7.6]
    """
    from scipy.signal import fftconvolve

    from sonic_bullet.signal.peaks import local_peaks

    widths = 0.5 * 2.0 ** np.arange(8)  # decays, in steps
    step = seen.omega[1] - seen.omega[0]
    n = len(seen.omega)
    gap = step * np.arange(-n + 1, n)
    score = np.empty((len(widths), n))
    for row, width in zip(score, widths, strict=True):
        kernel = 1 / (1j * gap + width * step)
        moment = fftconvolve(left / seen.colour, kernel[None, :], mode="same", axes=1)
        power = fftconvolve(1 / seen.colour**2, np.abs(kernel) ** 2, mode="same")
        row[:] = (np.abs(moment) ** 2).sum(axis=0) / power
    best = score.max(axis=0)
    peak = local_peaks(best)
    peak = peak[best[peak] > _worth(seen)]
    peak = peak[np.argsort(-best[peak], kind="stable")][: len(widths)]
    return np.asarray(-widths[score[:, peak].argmax(axis=0)] * step + 1j * seen.omega[peak])


def _worth(seen: _Responses) -> float:
    """Least Δχ² of a mode: what its unknowns, a pole and an amplitude a place, are worth by Bayes' criterion."""
    return float((2 * len(seen.value) + 2) * np.log(2 * seen.value.size))


def _denominator_poles(seen: _Responses, orders: list[int]) -> list[Array]:
    """Poles that decay and lie in the band, of common denominators of these orders."""
    span = 1.02  # of the highest frequency, which is half a turn
    step = np.pi / (span * seen.omega[-1])  # s
    most = max(orders)
    turn = np.exp(1j * np.outer(np.arange(most + 1), seen.omega * step)) / seen.colour  # (m, n) basis of numerators
    plain = (turn @ turn.conj().T).real
    weighted = turn * seen.colour
    parts = []
    for row in seen.value:
        mixed = -(turn.conj() @ (weighted * row).T).real
        square = ((weighted * row) @ (weighted * row).conj().T).real
        parts.append((mixed, square))
    found = []
    for order in orders:
        size = order + 1
        whole = np.zeros((size, size))
        lifted = plain[:size, :size] + 1e-12 * np.trace(plain[:size, :size]) / size * np.eye(size)
        for mixed, square in parts:
            cross = mixed[:size, :size]
            whole += square[:size, :size] - cross.T @ np.linalg.solve(lifted, cross)
        # the lowest coefficient is one: what noise asks for then grows, and only modes decay  [Cauberghe 2004, ch. 5]
        answer = np.linalg.lstsq(whole[1:, 1:], -whole[1:, 0], rcond=1e-15)[0]
        root = np.roots(np.concatenate([answer[::-1], [1.0]]))
        pole = np.log(root[np.abs(root) > 1e-6].astype(complex)) / step
        inside = (pole.real < 0) & (pole.imag > seen.omega[0]) & (pole.imag < seen.omega[-1])
        found.append(pole[inside])
    return found


def _select_poles(seen: _Responses, start: Array, free: Array) -> tuple[Array, _Solution]:
    """Poles with those of the free ones that take more than they are worth, the strongest first; all refined."""
    refinements, worth = 3, _worth(seen)
    pole, now = _refine_poles(seen, start)
    while len(free):
        gain = _worth_of_poles(seen, pole, now.left, free)
        k = int(gain.argmax())
        if gain[k] < worth:
            break
        trial, found = _refine_poles(seen, np.append(pole, free[k]), refinements)
        free = np.delete(free, k)
        if now.cost - found.cost > worth and _are_distinct(trial):
            pole, now = trial, found
    return _refine_poles(seen, pole)


def _are_distinct(pole: Array) -> bool:
    """Whether no two poles are one."""
    gap = np.abs(pole[:, None] - pole) + np.diag(np.full(len(pole), np.inf))
    return bool((gap > 1e-3 * -pole.real).all())


def _worth_of_poles(seen: _Responses, pole: Array, left: Array, free: Array) -> Array:
    """Return what each of the free poles (k,) would take of what is left, next to those that are there."""
    base = _orthonormal(_columns(seen, pole))
    taken = np.zeros(len(free))
    flat = _real(left)
    for i, p in enumerate(free):
        pair = _pole_columns(seen, np.array([p]), 1)
        pair = pair - base @ (base.T @ pair)
        taken[i] = ((_orthonormal(pair).T @ flat) ** 2).sum()
    return taken


def _drop_needless(seen: _Responses, pole: Array, now: _Solution) -> Array:
    """Poles without those that grow, stand at the bottom of the record, or take less than they are worth."""
    worth, bottom = _worth(seen), FEWEST_STEPS * (seen.omega[1] - seen.omega[0])
    while len(pole):
        power = np.abs(now.amplitude / now.amplitude_sd) ** 2
        gain = np.where((pole.real < 0) & (pole.imag > bottom), power.sum(axis=0), -1.0)
        k = int(gain.argmin())
        if gain[k] >= worth:
            break
        pole, now = _refine_poles(seen, np.delete(pole, k))
    return pole


def _refine_poles(seen: _Responses, pole: Array, steps: int = 30) -> tuple[Array, _Solution]:
    """Poles at the least sum of squares near them."""
    return refine_poles(lambda p: _solve_amplitudes(seen, p), pole, (1.0, 1j), steps=steps, slack=0.0)


def _real(value: Array) -> Array:
    """Real and imaginary parts below one another (2n, s) of values (s, n)."""
    return np.concatenate([value.real, value.imag], axis=1).T


def _pole_columns(seen: _Responses, pole: Array, power: int) -> Array:
    """Columns (2n, 2k) for Re A and Im A of ½ [A/(iω − p)^power + conj. at p*], over the colour."""
    one = 0.5 / (1j * seen.omega[:, None] - pole) ** power
    other = 0.5 / (1j * seen.omega[:, None] - pole.conj()) ** power
    whole = np.concatenate([one + other, 1j * (one - other)], axis=1) / seen.colour[:, None]
    return np.concatenate([whole.real, whole.imag])


def _columns(seen: _Responses, pole: Array) -> Array:
    """All linear columns (2n, 2k + m): of poles, then of what lies outside the band."""
    beyond = (1j * seen.omega[:, None] / seen.omega[-1]) ** np.array(RESIDUAL_POWERS) / seen.colour[:, None]
    return np.concatenate([_pole_columns(seen, pole, 1), np.concatenate([beyond.real, beyond.imag])], axis=1)


def _orthonormal(columns: Array) -> Array:
    return np.asarray(np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0])


def _solve_amplitudes(seen: _Responses, pole: Array) -> _Solution:
    """Solve for the amplitudes at poles (k,)."""
    k = len(pole)
    columns, wanted = _columns(seen, pole), _real(seen.value)
    size = np.linalg.norm(columns, axis=0)
    q, r = np.linalg.qr(columns / size)
    inverse = np.linalg.pinv(r, rcond=1e-13) / size[:, None]
    seen_by = q.T @ wanted
    answer = inverse @ seen_by
    left = wanted - q @ seen_by
    amplitude = (answer[:k] + 1j * answer[k : 2 * k]).T
    # ∂/∂p of A/(iω − p) is A/(iω − p)²: the same columns, squared
    slope = _pole_columns(seen, pole, 2)
    slope = slope - q @ (q.T @ slope)
    gram, moment = slope.T @ slope, slope.T @ left
    matrix, gradient = np.zeros((2 * k, 2 * k)), np.zeros(2 * k)
    for a, m in zip(amplitude, moment.T, strict=True):
        turn = np.block([[np.diag(a.real), np.diag(-a.imag)], [np.diag(a.imag), np.diag(a.real)]])
        matrix += turn.T @ gram @ turn
        gradient += turn.T @ m
    spread = np.sqrt((inverse**2).sum(axis=1))
    n = len(seen.omega)
    return _Solution(
        amplitude,
        (left[:n] + 1j * left[n:]).T,
        float((left**2).sum()),
        matrix,
        gradient,
        np.maximum(spread[:k], spread[k : 2 * k]),
    )


def _lines(seen: _Responses, pole: Array, at_hz: Array, sr: int) -> Lines:
    """Lines at poles within the band, by frequency, with their spreads."""
    pole = pole[np.argsort(pole.imag)]
    found = _solve_amplitudes(seen, pole)
    spread = np.sqrt(np.abs(np.diag(np.linalg.pinv(found.matrix, hermitian=True)))) if len(pole) else np.zeros(0)
    inside = (pole.imag > seen.omega[0]) & (pole.imag < seen.omega[-1])
    amplitude, amplitude_sd = (seen.scale * part for part in (found.amplitude, found.amplitude_sd))
    # noise of σ a real number and spectral line is of rms σ √(2 lines) √2 Δf in samples of one period
    rms = 2 * seen.scale[:, 0] * np.sqrt((seen.colour**2).sum()) * (at_hz[1] - at_hz[0])
    energy = ((np.abs(amplitude) / rms[:, None]) ** 2).sum(axis=0) * sr / (4 * -pole.real)
    return Lines(
        pole.imag[inside] / (2 * np.pi),
        -pole.real[inside],
        amplitude[:, inside],
        spread[len(pole) :][inside] / (2 * np.pi),
        spread[: len(pole)][inside],
        amplitude_sd[:, inside],
        rms,
        energy[inside],
        True,
    )
