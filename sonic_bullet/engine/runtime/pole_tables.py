"""Constants of the bodies for the poles that they have on contacts (src/runtime/pole_updates.hpp): tables, flat.

Resonator, lines of its residual -> MOBILITY row, ω, d, pairs of one frequency, weights; TouchSides
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sonic_bullet._engine import MOBILITY
from sonic_bullet.records import Array

if TYPE_CHECKING:
    from sonic_bullet.engine.bank import Bank
    from sonic_bullet.engine.bank.resonator import Resonator
    from sonic_bullet.engine.runtime.residual_voice import ResidualVoice


class TouchSides(NamedTuple):
    """Elastic properties of the bodies (b,) where they are touched; turns (b, 3, 3): J^{−1/2} by columns."""

    compliance_per_pa: Array
    poisson: Array
    loss_factor: Array
    roughness_m: Array
    slips: Array
    turns: Array


class PoleTables(NamedTuple):
    """Bodies without contacts.

    mobility (b,) MOBILITY: where a body's numbers lie in the flat arrays omega_rad_s and decay_per_s (of its modes),
    pair (the first of each two of one frequency), follow (the mode of each line of a residual) and weight (W, modes).
    free_law (6, lanes): of the bank.
    """

    mobility: Array
    omega_rad_s: Array
    decay_per_s: Array
    pair: Array
    follow: Array
    weight: Array
    sides: TouchSides
    free_law: Array


def pole_tables(resonators: tuple[Resonator, ...], voices: tuple[ResidualVoice | None, ...], bank: Bank) -> PoleTables:
    """Build the tables of the bodies in a bank."""
    mobility, none = np.zeros(len(resonators), MOBILITY), np.zeros(0, np.int64)
    follows = [none if voice is None else voice.follows for voice in voices]
    for row, one, lines in zip(mobility, resonators, follows, strict=True):
        row["modes"], row["pairs"], row["follows"] = one.mode_count, len(one.mobility.pairs), len(lines)
        row["gain"] = one.body.gain
    for at, count in (("mode_at", "modes"), ("pair_at", "pairs"), ("follow_at", "follows")):
        mobility[at] = np.cumsum(mobility[count]) - mobility[count]
    sets = len(resonators[0].weight) if resonators else 1
    mobility["weight_at"] = sets * mobility["mode_at"]
    return PoleTables(
        mobility,
        _join_tables((one.omega_rad_s for one in resonators), float),
        _join_tables((one.decay_per_s for one in resonators), float),
        _join_tables((one.mobility.pairs for one in resonators), np.int64),
        _join_tables(follows, np.int64),
        _join_tables((one.weight.ravel() for one in resonators), complex),
        _touch_sides(resonators),
        bank.law,
    )


def _join_tables(parts: Iterable[Array], kind: type) -> Array:
    return np.concatenate([np.zeros(0, kind), *parts]).astype(kind, copy=False)


def _touch_sides(resonators: tuple[Resonator, ...]) -> TouchSides:
    """Collect the bodies' properties where they are touched."""
    sides = [one.side for one in resonators]
    return TouchSides(
        np.array([side.compliance_per_pa for side in sides], float),
        np.array([side.poisson for side in sides], float),
        np.array([side.loss_factor for side in sides], float),
        np.array([side.roughness_m for side in sides], float),
        np.array([one.body.dynamics.get("lateralFriction") == 0 for one in resonators], bool),  # μ is their product
        np.array([one.mobility.turn for one in resonators], float).reshape(-1, 3, 3),
    )
