"""Which of many poles are worth a line: those without near doubles, of a crowd those that take most.

left_k = <e_k, x − what the picked ones take of x>;   next: max Σ_s |left_k|²/<e_k, e_k>
    (orthogonal matching pursuit) [Pati, Rezaiifar & Krishnaprasad 1993]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.lines.sinusoids import moments
from sonic_bullet.records import Array


def drop_near_doubles(pole: Array) -> Array:
    """Poles sorted by frequency without near doubles, which no recording of finite length tells apart."""
    pole = pole[np.argsort(pole.imag)]
    keep = np.ones(len(pole), bool)
    for i in range(1, len(pole)):
        j = i - 1
        while j >= 0 and not keep[j]:
            j -= 1
        if j >= 0 and abs(pole[i] - pole[j]) < 0.1 * min(-pole[i].real, -pole[j].real) + 0.2:
            keep[i] = False
    return np.asarray(pole[keep])


def select_poles(signals: Array, noise: Array, pole: Array, sr: int, count: int) -> Array:
    """Say which poles (at most count,) take most of the signals (s, n), each of what those before it have left.

    All at once, poles of a crowd (a reverberation's) cancel each other at amplitudes that say nothing. A line's other
    half, at −ω, is taken to be far away.
    """
    same = 1e-6  # of a pole's own energy: with less of it apart from those picked it says nothing of its own
    if not len(pole):
        return np.zeros(0, int)
    z = pole / sr
    gap = z[:, None].conj() + z[None, :]
    gram = np.expm1(gap * signals.shape[1]) / np.expm1(gap)
    # (k, s)
    left = (moments(signals, z)[0].conj() / noise[:, None]).T
    own = np.real(np.diag(gram))
    # <e_k, the n-th direction>; of own, what is apart from those picked
    basis, new, found = np.zeros((len(pole), count), complex), own.copy(), []
    for n in range(count):
        energy = np.where(new > same * own, (np.abs(left) ** 2).sum(axis=1) / own, -1.0)
        k = int(energy.argmax())
        if energy[k] < 0:
            break  # nothing is left that they do not say
        found.append(k)
        basis[:, n] = (gram[:, k] - basis[:, :n] @ basis[k, :n].conj()) / np.sqrt(new[k])
        left = left - basis[:, n, None] * (left[k] / np.sqrt(new[k]))
        new = new - np.abs(basis[:, n]) ** 2
    return np.array(found)
