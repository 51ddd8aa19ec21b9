"""Poles of a body while it touches, in a millisecond: springs exactly, what loses and what partners yield in one step.

    (Λ + Bᵀ Re(K) B) q = ω² q,  B = (Φ, −Φ_r)      the body's modes and rigid motions, its light partners' rigid motions
    F = Re(K) B q,  κ = Fᵀ Re(K)⁻¹ F               forces at the touches, and the part of ω² that is the springs' own
    x = Fᵀ (1/K − 1/Re K + Σ_j φ_j φ_jᵀ/(λ_j + 2 d_j s + s²)) F,  s = jω        what else gives way, along those forces
    s² + 2 s qᵀDq + ω² − κx/(κ + x) = 0

κx/(κ + x) is both in series, so that it stays below κ where a partner is soft, at its resonance say, and its imaginary
part is never above 0: no mode gains. To first order in x it is Rayleigh's quotient of `in_place`, whose Newton goes on
from here to the exact pole, at ten times the cost: how far the two are from each other is in docs/measured/in-place.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.support.in_place import HELD, STOPPED, InPlace, Touch, gathered, in_place
from sonic_bullet.support.moving import Moving


def first_order(body: Moving, partners: Sequence[Moving], touches: Sequence[Touch]) -> InPlace:
    """See `in_place`; `turn` is the identity: modes are told by the motion that most resembles theirs when free."""
    m = len(body.omega_rad_s)
    if not m or not any(t.spring.normal_n_m or t.spring.tangential_n_m for t in touches):
        return in_place(body, partners, touches)
    x, row = gathered(body, partners, touches, squared=False)
    light = np.flatnonzero((x.other_lam == 0) & x.other.any(axis=0))
    yields = np.flatnonzero(x.other_lam > 0)
    both = np.hstack([x.own, -x.other[:, light]])
    spring = x.spring.real
    stiff = both.T @ (spring[:, None] * both)
    stiff[np.diag_indices(len(x.lam))] += x.lam
    value, vector = np.linalg.eigh(stiff)
    chosen = likest(vector[:m] ** 2)
    q, omega = vector[:, chosen], np.sqrt(np.maximum(value[chosen], 0.0))
    q = q * np.where(np.diag(q[:m]) < 0, -1, 1)  # an eigenvector has no sign: the mode's, so that what passes has one
    force = spring[:, None] * (both @ q)
    kept = (force**2 / spring[:, None]).sum(axis=0)
    s = 1j * omega
    along = x.other[:, yields].T @ force
    below = x.other_lam[yields, None] + 2 * x.other_decay[yields, None] * s + s**2
    lossy = ((1 / x.spring - 1 / spring)[:, None] * force**2).sum(axis=0)
    plates = ((x.plate[:, None] - x.half_space[:, None] * s**2) * force**2).sum(axis=0) / np.where(s == 0, 1, s)
    partner = (along**2 / below).sum(axis=0) + plates
    part = kept / np.where(kept > 0, kept + lossy + partner, 1)
    own = (q[:m] ** 2).T @ x.decay[:m]
    new = -own + 1j * np.sqrt(omega**2 - part * (lossy + partner) - own**2)
    held = (omega > HELD * np.sqrt(x.lam[:m].max())) | (-new.real > STOPPED * np.abs(new)) | ~(new.imag > 0)
    root = np.sqrt(x.lam[:m])
    new = np.where(held, root * (-STOPPED + 1j * np.sqrt(1 - STOPPED**2)), new)
    force = np.where(held, 0, force * part) / np.where(s == 0, 1, s)
    lifts = np.zeros((3 * len(touches), m))
    lifts[row] = np.abs(force)
    passed = np.where(held, 0, along * part / below)
    passed /= 1 + (np.abs(passed) ** 2).sum(axis=0)
    ends = np.cumsum([0, *(len(p.omega_rad_s) for p in partners)])
    decay = np.maximum(-new.real, 0.0)
    power = np.stack([own, -(lossy.imag), -(partner.imag)], axis=1)
    power[:, 1:] *= (np.abs(part) ** 2 / np.maximum(2 * omega, 1e-300))[:, None]
    power = np.maximum(power, 0.0)
    whole = np.maximum(power.sum(axis=1, keepdims=True), 1e-300)
    return InPlace(
        new.imag,
        decay,
        np.eye(m),
        tuple(passed[a:b] for a, b in pairwise(ends)),
        lifts[::3],
        decay[:, None] * power / whole,
        ~held,
    )


def likest(share: Array) -> Array:
    """Which column (m,) each row of shares (m, n) is, each column once, the largest share first."""
    best = share.argmax(axis=1)
    order = np.argsort(-share[np.arange(len(best)), best], kind="stable")
    chosen = np.full(len(best), -1)
    first = order[np.sort(np.unique(best[order], return_index=True)[1])]  # of those who want one column, who wants most
    chosen[first] = best[first]
    rest = np.flatnonzero(chosen < 0)
    if len(rest):
        left = np.setdiff1d(np.arange(share.shape[1]), chosen)
        chosen[rest] = left[likest(share[np.ix_(rest, left)])]
    return chosen
