"""A transferred residual as one clip, beside modes whose amplitudes are known: what the run time plays of one strike, without a scene.

Residual + Modes (a complex) -> Voice -> lines, each a quarter turn from the mode it follows; a grain of noise -> samples
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array, Residual
from sonic_bullet.residual.compute import damped
from sonic_bullet.residual.grains import filtered, make_voice, mixed_number, response, varied
from sonic_bullet.residual.transfer import Modes, paired_power

LONGEST_S = 1.0


def residual_sound(residual: Residual, freq_hz: Array, decay_per_s: Array, amplitude: Array, n: int, sr: int, seed: int = 0) -> Array:
    """(n,) what the residual adds to modes (m,) of complex amplitude at the onset, in their unit."""
    order = np.argsort(freq_hz, kind="stable")
    freq, decay, start = freq_hz[order], decay_per_s[order], np.asarray(amplitude, complex)[order]
    if not len(freq) or not np.abs(start).max() > 0:
        return np.zeros(n)
    target = Modes(freq, decay, np.abs(start))
    voice = make_voice(residual, target, sr, LONGEST_S)
    power = paired_power(voice.pairs, target)
    lead = np.zeros(len(power), complex)
    for k in np.argsort(np.abs(start), kind="stable"):
        if voice.pairs.group[k] >= 0:
            lead[voice.pairs.group[k]] = start[k] / max(abs(start[k]), 1e-300)
    lines = voice.lines
    heard = lines.freq_hz < sr / 2
    turned = 1j * lead[lines.follows] * lines.ratio * np.sqrt(power[lines.follows])
    out = damped(lines.freq_hz[heard], lines.decay_per_s[heard], turned[heard], n, sr)
    grain = varied(filtered(voice, response(voice, power)), 1.0, mixed_number(seed)) if not voice.silent else np.zeros(0)
    count = min(n, len(grain))
    out[:count] += grain[:count]
    return out
