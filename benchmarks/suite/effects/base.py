"""What an effect may change, and what it knows of the case it is made for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.suite.bricks import Modes
from benchmarks.suite.objects import Body, Material, Recipe
from benchmarks.suite.physics import Ring, Strike
from sonic_bullet.records import Array

CARRIED = ("material", "striker", "room", "chain")  # what another object of the same material meets too
LOUD = 0.04  # N·s: the impulse at which strengths hold


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A case before its effects: the plain body and its strikes, gain in 1/(m/s) so that the loudest peaks at 0.5."""

    recipe: Recipe
    material: Material
    body: Body
    strikes: tuple[Strike, ...]
    sensor: tuple[int, Array]
    gain: float
    rate: int
    n: int
    folder: Path


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """One effect with its truth. Each stage is None where it does nothing.

    modes(unit, poisson, recipe) -> unit modes; pairs(modes) -> modes; damping(modes, D) -> D; ring(ring, impulse, n,
    rate, own) -> samples at gain 1; pulse(impulse, rate) -> taps; sound(samples, impulse, rate, which) -> samples, in
    units of the file; last(samples) the same, after the noise.
    """

    id: str
    belongs: str
    truth: dict[str, Any] = field(default_factory=dict)
    modes: Callable[[Recipe, float, Path], Modes] | None = None
    pairs: Callable[[Modes], Modes] | None = None
    damping: Callable[[Modes, Array], Array] | None = None
    ring: Callable[[Ring, float, int, float], Array] | None = None
    pulse: Callable[[float, float], Array] | None = None
    sound: Callable[[Array, float, float, int], Array] | None = None
    last: Callable[[Array], Array] | None = None


Maker = Callable[[int, np.random.Generator, Scene], Effect]


def pick(strength: int, *three: float) -> float:
    """One of three values: weak, medium, strong."""
    return three[strength]


def jitter(rng: np.random.Generator, value: float, part: float = 0.2) -> float:
    """A value times 1 ± part, log-uniform."""
    return float(value * np.exp(rng.uniform(-part, part)))
