"""Leaps of load and lasting contacts of a log, by a rule of its own: what scenes promise of their contacts is held
against it.

A pair of bodies strikes in a step where its impulse leaps above what it carried in the step before. Between strikes a
pair that is loaded for five steps or more slides where its slip passes 1 mm/s, else rolls where its contact moves
faster than 1 mm/s, else rests.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.apps.report.plots.scene_plot import Events
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array

MOVING_M_S = 1e-3
LASTING_STEPS = 5
LEAP = 2.0  # a strike at least doubles the impulse of the step before


def find_leaps(log: ContactLog) -> Events:
    """Strikes and lasting contacts of every body that sounds (those with a model), by the rules of the
    module's head.
    """
    step, start_s = log.step, np.append(log.start_s, log.duration_s)
    touching, normal_n_s, slip, sweep = _loads(log)
    pair, index = np.unique(touching, axis=0, return_inverse=True)
    strikes: list[tuple[int, float, float]] = []
    bars: list[tuple[int, float, float, str]] = []
    for number, (a, b) in enumerate(pair):
        mine = np.flatnonzero(index.ravel() == number)
        steps, at = np.unique(step[mine], return_inverse=True)
        impulse = np.bincount(at, normal_n_s[mine])
        before = np.where(np.diff(steps, prepend=-2) == 1, np.append(0.0, impulse[:-1]), 0.0)
        hit = impulse > LEAP * before
        hit &= ~np.append(False, hit[:-1] & (np.diff(steps) == 1))  # a strike that spans two steps is one
        bodies = [int(i) for i in (a, b) if log.bodies[i].model is not None]
        strikes += [
            (body, float(start_s[steps[i]]), float(impulse[i] - before[i]))
            for body in bodies
            for i in np.flatnonzero(hit)
        ]
        moving = [
            np.bincount(at, normal_n_s[mine] * speed[mine]) / np.maximum(impulse, 1e-300) for speed in (slip, sweep)
        ]
        kind = np.where(moving[0] > MOVING_M_S, 2, np.where(moving[1] > MOVING_M_S, 1, 0))
        cuts = np.flatnonzero((np.diff(steps) != 1) | (np.diff(kind) != 0)) + 1
        for run in np.split(np.arange(len(steps)), cuts):
            if len(run) >= LASTING_STEPS:
                span = (
                    float(start_s[steps[run[0]]]),
                    float(start_s[steps[run[-1]] + 1]),
                    ("rests", "rolls", "slides")[kind[run[0]]],
                )
                bars += [(body, *span) for body in bodies]
    return Events(
        np.array([s[0] for s in strikes], int),
        np.array([s[1] for s in strikes], float),
        np.array([s[2] for s in strikes], float),
        np.array([r[0] for r in bars], int),
        np.array([r[1:3] for r in bars], float).reshape(-1, 2),
        tuple(r[3] for r in bars),
    )


def _loads(log: ContactLog) -> tuple[Array, Array, Array, Array]:
    """(k, 2) bodies that touch, the lower index first, (k,) normal impulse in N·s, slip and sweep in m/s of all rows: a
    fifth of what the rows themselves take, made block by block.
    """
    pair, normal_n_s = [np.zeros((0, 2), np.int32)], [np.zeros(0)]
    slip, sweep = [np.zeros(0)], [np.zeros(0)]
    for row in (block.contact for block in log.blocks()):
        pair.append(np.sort(np.stack([row["a"], row["b"]], 1), axis=1))
        normal_n_s.append(np.abs(np.einsum("ki,ki->k", row["impulse_n_s"], row["normal"])))
        slip.append(np.linalg.norm(row["slip_m_s"], axis=1))
        sweep.append(row["sweep_m_s"].max(1, initial=0))
    return np.concatenate(pair), np.concatenate(normal_n_s), np.concatenate(slip), np.concatenate(sweep)
