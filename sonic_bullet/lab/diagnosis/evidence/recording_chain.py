"""Chains of lines: what a mode that depends on its own level leaves in a linear fit, and its linear limit.

    a e^{−dt} e^{iβ(1 − e^{−2dt})} = a e^{−dt} [e^{iβ} − iβ e^{iβ} e^{−2dt} + …]      decays d, 3d, 5d, …      frequency
        goes with level²     (effects.amplitude_pitch)
    a/((1 + c)e^{dt} − c)          = a/(1 + c) [e^{−dt} + c/(1 + c) e^{−2dt} + …]      decays d, 2d, 3d, …      decay
        goes with level; with its square: d, 3d, 5d, …   (effects.amplitude_damping)

Least squares fit such a mode by a few lines, each shorter than the one before and near it. The slowest is the linear
mode, the body's and the material's own, and the level of a whole chain of a mode whose frequency alone bends falls as
it does; at the onset all lines add up to the excitation. A baseline fitted to the loudest line of each chain has
neither.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.geometry import label_components
from sonic_bullet.lab.lines.joint_lines import Lines
from sonic_bullet.records import Array

LINKS = (
    (1.25, 1.0, False),
    (1.1, 3.0, True),
    # a chain's next line is so much shorter at least, and as near as that many times its decay;
    # whether modes are only bent
)


def merge_line_chains(lines: Lines, link: tuple[float, float, bool]) -> Lines | None:
    """Replace every chain of such links by one line.

    It has the slowest's frequency, the slowest's decay or the chain's own, and the amplitudes' sum. Where there are too
    few chains, only those that are plain are replaced, if the loudest line is in one; None if not.
    """
    # chains, and of all modes' lines: fewer are neighbours, hits or a room's
    least_chains, least_share_of_chains = 4, 0.1
    groups = chains(lines, link)
    many = sum(len(g) > 1 for g in groups)
    # links of the loudest line's chain, which bends most, the shorter the farther off: neighbours are two or three
    plain_lines = 4
    if many < max(least_chains, least_share_of_chains * len(groups)):
        loudest = np.abs(lines.amplitude).max(axis=0).argmax() if len(groups) else -1
        plain = [len(g) >= plain_lines and _one_direction(lines.freq_hz[g]) for g in groups]
        if not any(p and loudest in g for p, g in zip(plain, groups, strict=True)):
            return None
        groups = [part for p, g in zip(plain, groups, strict=True) for part in ([g] if p else np.split(g, len(g)))]
    slow = np.array([g[0] for g in groups])
    order = np.argsort(lines.freq_hz[slow])
    slow, groups = slow[order], [groups[i] for i in order]
    decay = np.array([_falls(lines, g) if link[2] and len(g) > 1 else lines.decay_per_s[g[0]] for g in groups])
    return replace(
        lines,
        freq_hz=lines.freq_hz[slow],
        decay_per_s=decay,
        freq_sd_hz=lines.freq_sd_hz[slow],
        decay_sd_per_s=lines.decay_sd_per_s[slow],
        amplitude=np.stack([lines.amplitude[:, g].sum(axis=1) for g in groups], axis=1),
        amplitude_sd=np.stack([np.sqrt((lines.amplitude_sd[:, g] ** 2).sum(axis=1)) for g in groups], axis=1),
        energy=np.array([lines.energy[g].sum() for g in groups]),
    )


def _one_direction(freq_hz: Array) -> bool:
    """Decide whether all steps from line to line have one sign."""
    return len(set(np.sign(np.diff(freq_hz)).tolist())) == 1


def share(lines: Lines, link: tuple[float, float, bool]) -> float:
    """Compute the fraction of chains among all groups."""
    groups = chains(lines, link)
    return sum(len(g) > 1 for g in groups) / max(len(groups), 1)


def _falls(lines: Lines, group: Array) -> float:
    """Compute the decay of a chain's level in 1/s.

    Bent or not, a mode's level goes as e^{−dt}, and no single line of many is as certain.
    """
    long, frames, faint = 3.0, 120, 0.03  # of 1/d; of the strongest level
    pole = -lines.decay_per_s[group] + 2j * np.pi * (lines.freq_hz[group] - lines.freq_hz[group[0]])
    time = np.linspace(0, long / lines.decay_per_s[group[0]], frames)
    level = np.abs(lines.amplitude[:, group] @ np.exp(pole[:, None] * time))
    level = level[level.max(axis=1) > 0]
    if not len(level):
        return float(lines.decay_per_s[group[0]])
    weight = 1 / (1 + (faint * level.max() / np.maximum(level, 1e-300)) ** 2)
    ramp = time - (weight * time).sum(axis=1, keepdims=True) / np.maximum(weight.sum(axis=1, keepdims=True), 1e-300)
    falls = -(weight * ramp * np.log(np.maximum(level, 1e-300))).sum() / (weight * ramp**2).sum()
    # lines that beat are no chain
    return float(np.clip(falls, lines.decay_per_s[group[0]], lines.decay_per_s[group[-1]]))


def chains(lines: Lines, link: tuple[float, float, bool]) -> list[Array]:
    """Group the lines, by index, the slowest first; most groups hold one line.

    A line follows the nearest one that it may; two that follow none are two modes though others lie between, unless
    they are at one frequency.
    """
    one = 2.0  # decays: slow lines that lie nearer are one mode's
    near = 0.012  # of a frequency
    shorter = 5.0  # at most
    omega, decay = 2 * np.pi * lines.freq_hz, np.nan_to_num(lines.decay_per_s)
    ratio = decay[None, :] / np.maximum(decay[:, None], 1e-12)
    gap = np.abs(omega[:, None] - omega[None, :])
    linked = (
        (ratio > link[0])
        & (ratio < shorter)
        & (gap < link[1] * decay[None, :])
        & (gap < near * omega[:, None])
        & (decay[:, None] > 0)
    )
    first = ~linked.any(axis=0)
    parent = np.where(linked, gap, np.inf).argmin(axis=0) if len(omega) else np.zeros(0, int)
    follows = np.zeros_like(linked)
    follows[parent[~first], np.flatnonzero(~first)] = True
    shared = linked[first].astype(int) @ linked[first].T.astype(int) > 0
    same = shared & (gap < one * np.maximum(decay[:, None], decay[None, :]))[np.ix_(first, first)]
    follows[np.ix_(first, first)] |= same
    group = label_components(len(omega), *np.nonzero(follows))
    return [
        who[np.argsort(decay[who], kind="stable")]
        for who in (np.flatnonzero(group == g) for g in range(group.max(initial=-1) + 1))
    ]
