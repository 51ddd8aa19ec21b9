"""Changing poles: of bodies whose contacts change (take_coming), of level-dependent modes (bend_poles).

    coming (8, m): d and ω a sample, d/ω, e^s and e^{256 s}, separation -> law, pole, block at the next block's start

Block starts lie on the grid of absolute time: any split into calls gives the same bits. ½|z|² is a mode's energy
whatever its pole is, and z continues as it is: no change of poles adds energy or causes a jump.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from typing import TYPE_CHECKING

import numba
import numpy as np

from sonic_bullet.bank.kernels import uncounted
from sonic_bullet.bank.tile import BLOCK
from sonic_bullet.records import Array

if TYPE_CHECKING:
    from sonic_bullet.bank.instrument import Bank, BankState


@uncounted
def take_coming(b, start, stop, ringing, law, pole, block, coming):  # pragma: no cover - compiled
    """Take the poles that were to come, at the begin of body b's block."""
    modes = law.shape[1]
    if ringing[b].fresh:
        ringing[b].fresh = 0
        for m in range(start, stop):
            law[0, m], law[1, m], law[2, m] = coming[0, m], coming[1, m], coming[2, m]
            pole[m], pole[modes + m] = coming[3, m], coming[4, m]
            block[m], block[modes + m] = coming[5, m], coming[6, m]
            law[6, m] = coming[7, m]


@uncounted
def bend_poles(b, span, bank):  # pragma: no cover - compiled
    """Compute the poles of body b, bent by level, for the ``span`` samples to come: means over the unforced decay.

    a = |z|:  ȧ = −d a (1 + (ca)^p)  ->  a(T)/a = ((1 + (ca)^p) e^{pdT} − (ca)^p)^{−1/p};   ω <- ω (1 + b ⟨a²⟩),
        ⟨a²⟩ = a² (1 − e^{−2d'T})/2d'T
    (Nayfeh & Mook 1979, eq. 2.3.35 and section 3.3), d' the block's mean decay; exact in amplitude, and in phase for c
    = 0.
    """
    z, driven, law, pole, block = bank.z, bank.driven, bank.law, bank.pole, bank.block
    modes = law.shape[1]
    for m in range(bank.body[b].start, bank.body[b].stop):
        bend, damping_growth, power = law[3, m], law[4, m], law[5, m]
        if bend == 0.0 and damping_growth == 0.0:
            continue
        d, w = -law[0, m] * span, law[1, m]
        level = np.sqrt(z[m] ** 2 + z[modes + m] ** 2 + driven[m] ** 2 + driven[modes + m] ** 2)
        c = (damping_growth * level) ** power
        fall = np.log(max((1.0 + c) * np.exp(power * d) - c, 1.0)) / power
        mean = -np.expm1(-2.0 * fall) / (2.0 * fall) if fall > 1e-9 else 1.0
        turn = min(max(w * (1.0 + bend * level * level * mean), 0.0), 3.141)
        p = np.exp(-fall / span)
        pole[m], pole[modes + m] = p * np.cos(turn), p * np.sin(turn)
        if span == BLOCK:
            q = np.exp(-fall)
            block[m], block[modes + m] = q * np.cos(turn * BLOCK), q * np.sin(turn * BLOCK)


def prepare_poles(state: BankState) -> None:
    """Compile what `set_poles` calls, or load its machine code."""
    values = 0, 0, 0, state.ringing, state.law, state.pole, state.block, state.coming
    take_coming.compile(tuple(numba.typeof(one) for one in values))


def set_poles(bank: Bank, state: BankState, b: int, step: Array, separation: Array | None = None) -> None:
    """Set other poles (m,), s = (-d + iω)/sr, of body b's modes from the next block's start.

    At once where nothing of it is active. separation (m,): fraction of a contact's load that a modal velocity of 1
    removes; None: none.
    """
    start, stop, m = (int(bank.body[b][name]) for name in ("start", "stop", "columns"))
    lanes = slice(start, start + m)
    pole, block = np.exp(step), np.exp(BLOCK * step)
    own = bank.law[:3, lanes]
    quadrature = np.where((step.real == own[0]) & (step.imag == own[1]), own[2], -step.real / step.imag)
    state.coming[:, start:stop] = 0.0
    state.coming[:7, lanes] = step.real, step.imag, quadrature, pole.real, pole.imag, block.real, block.imag
    state.coming[7, lanes] = 0.0 if separation is None else separation
    now = state.ringing[b]
    now["fresh"] = 1
    if not (now["ringing"] or now["driven"] or now["tiled"] or now["strike"] >= 0):
        take_coming(b, start, stop, state.ringing, state.law, state.pole, state.block, state.coming)
