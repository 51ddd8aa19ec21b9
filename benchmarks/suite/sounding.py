"""What is recorded of a blow under a case's effects, and how far each of them moves it: nothing fitted, by the suite's
own measure.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.suite import objects, physics
from benchmarks.suite.bricks import Modes
from benchmarks.suite.effects import Effect, Scene
from benchmarks.suite.objects import Body, Material
from benchmarks.suite.physics import Strike
from sonic_bullet.records import Array

# dB beyond the floor, in squares, that a weak, medium, strong effect must move the holdout strikes, alone or beside
# another
LEAST = (1.0, 1.8, 3.0)
HELD_OUT = (5, 6, 7)


def as_it_acts(scene: Scene, material: Material, effects: tuple[Effect, ...], unit: Modes) -> Body:
    """The body with those effects that change its modes."""
    now = next((e.modes(scene.recipe, material.poisson, scene.folder) for e in effects if e.modes), unit)
    return objects.body(scene.recipe.name, objects.as_made(now, material))


def paired(body: Body, effects: tuple[Effect, ...]) -> Body:
    """The body as its effects turn, part or tilt its modes."""
    modes = body.modes
    for e in effects:
        if e.pairs:
            modes = e.pairs(modes)
    return replace(body, modes=modes)


def damping_of(body: Body, material: Material, effects: tuple[Effect, ...]) -> Array:
    """D (m, m) of all that takes energy; a law stands in the place of Rayleigh's, whatever else does comes on top."""
    modes = paired(body, effects).modes
    damping = physics.rayleigh(modes.value, material)
    for e in sorted(effects, key=lambda e: e.id != "damping-law"):
        if e.damping:
            damping = e.damping(modes, damping)
    return damping


def strike_sound(
    scene: Scene, body: Body, strike: Strike, sensor: tuple[int, Array], effects: tuple[Effect, ...], which: int
) -> Array:
    """What is recorded of one blow, without noise."""
    ringing = physics.ring(paired(body, effects), damping_of(body, scene.material, effects), strike, sensor)
    for e in effects:
        if e.pulse and e.id == "contact-time":  # a soft blow leaves high modes at less than the impulse would
            taps = e.pulse(strike.impulse, scene.rate)
            left = np.abs(np.exp(-1j * np.outer(np.abs(ringing.pole.imag), np.arange(len(taps)) / scene.rate)) @ taps)
            ringing = replace(ringing, level=ringing.level * left)
    run = next((e.ring for e in effects if e.ring), None)
    x = run(ringing, strike.impulse, scene.n, scene.rate) if run else physics.sounded(ringing, scene.n, scene.rate)
    x = scene.gain * strike.impulse * x
    for e in effects:
        if e.pulse:
            x = np.convolve(x, e.pulse(strike.impulse, scene.rate))[: scene.n]
    order = ("object", "fixture", "striker", "room", "chain")
    for e in sorted((e for e in effects if e.sound), key=lambda e: order.index(e.belongs)):
        assert e.sound
        x = e.sound(x, strike.impulse, scene.rate, which)
    return np.asarray(x)


def as_recorded(x: Array, effects: tuple[Effect, ...], noise: Array) -> Array:
    """A sound with its noise, after what acts on both (a limit, say)."""
    x = x + noise
    for e in effects:
        x = e.last(x) if e.last is not None else x
    return x


def beyond(distance: dict[str, float]) -> float:
    """By how many dB the effect stands out of the floor, in squares."""
    return float(np.sqrt(max(0.0, distance["effect"] ** 2 - distance["floor"] ** 2)))


def short_of(strengths: tuple[int, ...], distance: dict[str, float], beside: list[dict[str, float]]) -> float:
    """By how many dB the effects together, or one of them beside the others, are heard less than they must be; 0
    where they are heard.
    """
    least = [LEAST[s] for s in strengths]
    together = [min(least) - beyond(distance)] if least else []
    return max([0.0, *together, *(o - beyond(d) for o, d in zip(least, beside, strict=False))])


def apart(without: list[list[Array]], heard: list[Array], floor: physics.Floor) -> dict[str, float]:
    """How far the effects move the strikes from those without them (nothing fitted), and two takes of the latter from
    each other.
    """
    pairs = zip(*without, heard, strict=True)
    far = physics.spectral_distance_db
    both = [(far(a, h, floor), far(a, b, floor)) for a, b, h in pairs]
    return {
        "effect": round(float(np.mean([a for a, _ in both])), 3),
        "floor": round(float(np.mean([b for _, b in both])), 3),
    }


def each_beside(
    scene: Scene,
    material: Material,
    unit: Modes,
    effects: tuple[Effect, ...],
    heard: list[Array],
    floor: physics.Floor,
    noise: Callable[[], Array],
) -> list[dict[str, float]]:
    """How far each effect moves the holdout strikes from what the others alone would give."""
    out = []
    for left_out in effects:
        others = tuple(e for e in effects if e is not left_out)
        body = as_it_acts(scene, material, others, unit)
        sounds = [strike_sound(scene, body, scene.strikes[i], scene.sensor, others, i) for i in HELD_OUT]
        takes = [[as_recorded(x, others, noise()) for x in sounds] for _ in range(2)]
        out.append(apart(takes, [as_recorded(x, effects, noise()) for x in heard], floor))
    return out
