"""Times of later hits of a strike, by correlation of a recording with the sound of one hit.

strike by strike: matching pursuit over delays                          [Mallat & Zhang 1993]
all strikes at once, by the exponent with which gaps go with strength: gain of a second hit over the first
    [Pati, Rezaiifar & Krishnaprasad 1993]
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from sonic_bullet.effects.rebound import MOST_HITS
from sonic_bullet.lab.effects.common.ringing import direct_as_expected
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.records import Array
from sonic_bullet.signal.short_time import filter_circular

LATER_HIT_SPAN_S = (1.2e-3, 0.25)
LEAST_OWN_ENERGY = 0.02  # of a later hit: what the first does not say as well, at least
LEAST_LATER_SHARE = 0.06  # of the first hit's
REBOUND_EXPONENTS = (0.0, 1.0, 0.5, -0.2)


def second_hit(h: ObjectEvidence, level: Array) -> list[tuple[float, float, float]]:
    """Find by exponent the second hit that explains most of what one hit leaves of the strikes, on average.

    Parameters
    ----------
    h : ObjectEvidence
        The object.
    level : (s,)
        The strikes' strengths, relative.

    Returns
    -------
    list of (explained, gap_s, exponent)
        Explained fraction of energy, and the gap at level 1.

    References
    ----------
    <r, x_τ>²/(|x_τ|² − <x, x_τ>²/|x|²)/|r|², r what the best multiple of x leaves: orthogonal matching pursuit [Pati,
    Rezaiifar & Krishnaprasad 1993].
    """
    assert h.signal is not None
    sound = direct_as_expected(h)
    n = min(h.signal.shape[1], 3 * int(LATER_HIT_SPAN_S[1] * h.sr))
    reach, size = min(n, int(LATER_HIT_SPAN_S[1] * h.sr)), 2 * n
    x, y = sound[:, :n], h.signal[:, :n]
    energy = np.maximum((x**2).sum(axis=1, keepdims=True), 1e-300)
    left = y - np.maximum((x * y).sum(axis=1, keepdims=True) / energy, 0.0) * x
    spectrum = np.fft.rfft(x, size, axis=1)
    both = np.fft.irfft(np.conj(spectrum) * np.fft.rfft(left, size, axis=1), size, axis=1)[:, :reach]
    own = np.fft.irfft(np.abs(spectrum) ** 2, size, axis=1)[:, :reach]
    inside = energy - np.concatenate([np.zeros((len(x), 1)), np.cumsum((x**2)[:, ::-1], axis=1)], axis=1)[:, :reach]
    says = (
        np.maximum(both, 0.0) ** 2
        / np.maximum(inside - own**2 / energy, LEAST_OWN_ENERGY * energy)
        / np.maximum((left**2).sum(axis=1, keepdims=True), 1e-300)
    )
    says[:, : int(LATER_HIT_SPAN_S[0] * h.sr)] = 0.0
    lag, found = np.arange(reach), []
    for exponent in REBOUND_EXPONENTS:
        mean = np.mean(
            [
                np.interp(lag * j**exponent, lag, np.minimum(one, 1.0), 0.0, 0.0)
                for one, j in zip(says, level, strict=True)
            ],
            axis=0,
        )
        found.append((float(mean.max()), float(mean.argmax()) / h.sr, exponent))
    return found


def third_hit(gap_s: Array, both: Array, own: Array, total: Array, sr: int, fade: float) -> float:
    """Find the restitution, which is the gaps' ratio too, of three hits that explain most of all strikes.

    Σ_s |<y, m>|²/<m, m> by correlations at every lag: a search from a ratio that is off by half a period of the loudest
    modes does not converge, so all are tried.

    Parameters
    ----------
    gap_s : (s,)
        First gaps.
    both : (s, f) complex
        Spectra of the recordings against one hit's sound.
    own : (s, f)
        Power spectra of one hit's sound.
    total : (s,)
        Energies of the recordings.
    sr : int
        Sampling rate in Hz.
    fade : float
        Rate in 1/s of the exponential by which both are weighted.
    """
    finer, lowest = 4, 0.15  # lags to a sample; restitution
    size = 2 * (both.shape[1] - 1)
    cross, auto = (np.fft.irfft(x, finer * size, axis=1) * (finer * size / 2) for x in (both, own))
    e = np.arange(lowest, 1.0, 1 / (finer * sr * gap_s.max()))
    said = np.zeros(len(e))
    for c, a, g, energy in zip(cross, auto, gap_s, total, strict=True):
        late = g * (1 + e)
        second, third = e * np.exp(-fade * g), e**2 * np.exp(-fade * late)
        c_2, c_3, a_2, a_3, a_23 = (
            _read_lags(x, np.rint(t * sr * finer).astype(int))
            for x, t in ((c, g), (c, late), (a, g), (a, late), (a, late - g))
        )
        product = c[0] + second * c_2 + third * c_3
        cost = a[0] * (1 + second**2 + third**2) + 2 * (second * a_2 + third * a_3 + second * third * a_23)
        said += np.maximum(product, 0.0) ** 2 / np.maximum(cost, 1e-300) / energy
    return float(e[int(said.argmax())])


def _read_lags(x: Array, lag: Array) -> Array:
    """Return a correlation at some lags; 0 beyond the recording, where the transform holds negative ones."""
    return np.where(lag < len(x) // 2, x[np.minimum(lag, len(x) - 1)], 0.0)


def hits_by_strike(h: ObjectEvidence) -> list[list[tuple[float, float]]]:
    """Find per strike the delays in s and shares of the hits after the first, by their time.

    References
    ----------
    Matching pursuit [Mallat & Zhang 1993]: the sound of one hit, by the lines and the model, is sought later in what is
    left; after every find all shares are solved together.
    """
    gain = 0.02  # of what is left must go with another hit
    assert h.signal is not None
    sound = direct_as_expected(h)
    reach = min(int(LATER_HIT_SPAN_S[1] * h.sr), h.signal.shape[1])
    n = min(h.signal.shape[1], 3 * reach)
    found = []
    for x, y in zip(sound[:, :n], h.signal[:, :n], strict=True):
        lags = [0.0]
        share, left = _fit_shares(x, y, lags, h.sr)
        for _ in range(MOST_HITS - 1):
            lag, strength = _search_delay(x, y - left, h.sr, reach)
            if lag is None or strength < LEAST_LATER_SHARE * max(share[0], 1e-300):
                break
            trial = [*lags, lag]
            new, made = _fit_shares(x, y, trial, h.sr)
            before, after = ((y - left) ** 2).sum(), ((y - made) ** 2).sum()
            if after > (1 - gain) * before or new[-1] < LEAST_LATER_SHARE * new[0]:
                break
            lags, share, left = trial, new, made
        rest = sorted(
            (t, r / share[0])
            for t, r in zip(lags[1:], share[1:], strict=True)
            if share[0] > 0 and LEAST_LATER_SHARE < r / share[0] < 1.0
        )
        found.append(rest)
    return found


def _delay_signal(x: Array, lag_s: float, sr: int) -> Array:
    """Delay x (n,) by lag_s, between samples too, by the phase of its spectrum."""
    n = len(x)
    size = 2 * n
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(size, 1 / sr) * lag_s)
    return filter_circular(x, turn, size)[:n]


def _fit_shares(x: Array, y: Array, lags: list[float], sr: int) -> tuple[Array, Array]:
    """Fit shares (h,) by least squares, and return them with their sum of hits (n,)."""
    columns = np.stack([_delay_signal(x, lag, sr) for lag in lags], axis=1)
    share = np.linalg.lstsq(columns, y, rcond=None)[0]
    return share, columns @ share


def _search_delay(x: Array, rest: Array, sr: int, reach: int) -> tuple[float | None, float]:
    """Find the delay at which x explains most of what is left, to a sixteenth of a sample, and its strength."""
    size = 2 * len(x)
    both = np.conj(np.fft.rfft(x, size)) * np.fft.rfft(rest, size)
    cross = np.fft.irfft(both, size)[:reach]
    energy = np.cumsum((x**2)[::-1])[::-1]  # of what of x is still inside, once delayed
    inside = energy[0] - np.concatenate([[0.0], np.cumsum((x**2)[::-1])])[:reach]
    if not energy[0] > 0:
        return None, 0.0
    strength = cross / np.maximum(inside, 1e-3 * energy[0])
    first = int(LATER_HIT_SPAN_S[0] * sr)
    gain = np.where(strength > 0, strength**2 * inside, 0.0)
    gain[:first] = 0.0
    i = int(gain.argmax())
    if gain[i] <= 0:
        return None, 0.0
    between, turn = _subsample_shifts(size)
    # <x later by (i + between)/sr, rest>
    fine = (turn @ (both * np.exp(2j * np.pi * np.arange(len(both)) * i / size))).real * 2 / size
    at = int(fine.argmax())
    return (i + float(between[at])) / sr, float(fine[at]) / max(float(inside[i]), 1e-300)


@lru_cache(maxsize=1)
def _subsample_shifts(size: int) -> tuple[Array, Array]:
    """Return fractions of a sample (33,), and the phase factors (33, b) that shift a spectrum by each."""
    between = np.linspace(-1, 1, 33)
    return between, np.exp(2j * np.pi * np.outer(between, np.arange(size // 2 + 1)) / size)
