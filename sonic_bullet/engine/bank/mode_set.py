"""Modes of one body, and its translation, as the bank takes them."""

from __future__ import annotations

from dataclasses import dataclass

from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True)
class Translation:
    """Pole of a body's three translations, and weight: pressure at 1 m, in Pa·m per N·s along an axis.

    Forces act evenly over the sample before each instant, pulses over cells of the sample grid, not at once: such modes
    decay within a few samples, and a slow force must contribute by its slope alone.
    """

    omega_rad_s: float
    decay_per_s: float
    weight: float


@dataclass(frozen=True, slots=True, eq=False)
class ModeSet:
    """Modes of one body for the bank, all `audible`.

    Attributes
    ----------
    omega_rad_s, decay_per_s : (m,) of the damped modes
    weight : (W, m) complex
    bend, damping_growth : (m,) of level-dependent modes, None: linear; see `poles.bend_poles`
        ω (1 + bend·|z|²) and d (1 + (damping_growth·|z|)^damping_growth_power)
    translation : None where only the modes sound
    """

    omega_rad_s: Array
    decay_per_s: Array
    weight: Array
    bend: Array | None = None
    damping_growth: Array | None = None
    damping_growth_power: float = 1.0
    translation: Translation | None = None
