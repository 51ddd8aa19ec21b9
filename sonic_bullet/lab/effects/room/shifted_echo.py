"""Lines that recur at one ratio of frequencies: an echo of something that moves.

    x(t) + r x((1 + ε)t − T):  every line (f, d) again at ((1 + ε)f, (1 + ε)d), and as loud against the first in every
        strike    [Doppler; Pierce 1989, ch. 9]

No room does that: a linear system at rest adds no frequency. No body does, where its modes' patterns differ: struck at
one place alone all lines are alike, and pairs split by one ratio would be taken for echoes.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array

# of |ln(1 + ε)|: closer ones are degenerate modes; 14 m/s of a reflector
LEAST_ECHO_SHIFT = 2e-3
MOST_ECHO_SHIFT = 0.08
# pairs; of all lines, in pairs: what comes late is no sum of modes, and leaves other lines besides
FEWEST_ECHO_PAIRS = 5
LEAST_ECHO_SHARE = 0.2
MOST_ALIKE_SHARE = 0.5  # of all two lines: where more are alike, strikes tell none apart


def find_copy_ratio(freq_hz: Array, decay_per_s: Array, amplitude: Array) -> float | None:
    """Find the ratio 1 + ε > 1 at which many lines recur.

    Parameters
    ----------
    freq_hz, decay_per_s : (k,)
        The lines.
    amplitude : (s, k)
        Their amplitudes in two strikes or more.

    Returns
    -------
    float or None
        None where fewer than LEAST_ECHO_SHARE of all lines recur.
    """
    nearby = 3e-4  # of ln f: echoes that agree
    alike, decay = 0.97, 0.1  # cosine over the strikes; of ln d
    chance = 1e-6  # that so many agree on any ratio, of pairs that fall anywhere
    from scipy.special import gammainc

    good = np.isfinite(amplitude).all(axis=0) & (decay_per_s > 0)
    f, d, size = freq_hz[good], decay_per_s[good], amplitude[:, good]
    if len(size) < 2 or len(f) < 2 * FEWEST_ECHO_PAIRS:
        return None
    size = size / np.maximum(np.linalg.norm(size, axis=0), 1e-300)
    up, slower = np.log(f[None, :] / f[:, None]), np.log(d[None, :] / d[:, None])
    like = np.abs(size.conj().T @ size) > alike
    if like.mean() > MOST_ALIKE_SHARE:
        return None
    lower, upper = np.nonzero((up > LEAST_ECHO_SHIFT) & (up < MOST_ECHO_SHIFT) & (np.abs(slower - up) < decay) & like)
    ratio = up[lower, upper]
    near = np.abs(ratio[:, None] - ratio) < nearby
    pairs = [min(len(np.unique(lower[row])), len(np.unique(upper[row]))) for row in near]
    many = max(pairs, default=0)
    wide = 2 * nearby / (MOST_ECHO_SHIFT - LEAST_ECHO_SHIFT)
    if (
        many < FEWEST_ECHO_PAIRS
        or 2 * many < LEAST_ECHO_SHARE * len(f)
        or gammainc(many, (len(ratio) - many) * wide) > chance * wide  # Poisson's P(N ≥ many), DLMF 8.4
    ):
        return None
    return float(np.exp(np.median(ratio[near[int(np.argmax(pairs))]])))
