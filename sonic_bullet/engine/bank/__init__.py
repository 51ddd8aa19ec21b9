"""A bank of damped sinusoids with explicit state: forces on modes in, velocities weighted for sensors out.

    mass-normalised mode  q̈ + 2d q̇ + (ω² + d²) q = f(t) = φᵀF(t)
        [physics of any vibration text, e.g. Meirovitch 2001, eq. 7.113]
    pole s = -d + iω, state z, velocity q̇ = Re z;   an impulse j at u:   z += (1 + i d/ω) φᵀĵ j e^{s(t-u)}
    output of weight set w and body b:   y[w, b, n] = Σ_modes Re(weight[w] z[n])

(that is q̇ = e^{-dt}(cos ωt - (d/ω) sin ωt): the continuous-time response, sampled; strikes are exact at any sub-sample
time, and nothing aliases.)

    instrument: bodies in, tables out | layout: the tables
    src/bank: strike_pool (pulses under way) | drive (driven motion) | tile (free ringing) | translation (the rigid
    body) | poles, transmission (contacts) -> bank: samples of all bodies

A body below the floor costs nothing. Time is counted in absolute samples; blocks of 256 lie on that grid, so any split
into calls gives the same bits. All work in place: `copy()` a state first to look ahead and come back.
"""

from sonic_bullet.engine.bank.instrument import (
    Bank,
    BankState,
    append,
    audible,
    empty_bank,
    silence,
    silent,
    subset,
)
from sonic_bullet.engine.bank.layout import FLOOR
from sonic_bullet.engine.bank.mode_set import ModeSet, Translation
from sonic_bullet.engine.bank.transmission import MOST_PARTNERS

__all__ = [
    "FLOOR",
    "MOST_PARTNERS",
    "Bank",
    "BankState",
    "ModeSet",
    "Translation",
    "append",
    "audible",
    "empty_bank",
    "silence",
    "silent",
    "subset",
]
