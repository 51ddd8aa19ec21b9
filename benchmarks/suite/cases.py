"""A case folder in the practice cases' format, and its truth.

    recipe + material (as it is, not as guessed) -> Body -> strikes -> effects -> files

Guesses are wrong by up to 25 % in E and ρ (18 % together) and 0.03 in ν; strikes and sensors sit on vertices; one gain
a case.
"""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.suite import live_rooms, objects, physics
from benchmarks.suite.effects import CARRIED, LISTED, UNLISTED, Effect, Scene
from benchmarks.suite.live_rooms import LiveRoom
from benchmarks.suite.objects import MATERIALS, RECIPES, Body, Material, Recipe
from benchmarks.suite.physics import Strike
from benchmarks.suite.sounding import (
    HELD_OUT,
    apart,
    as_it_acts,
    as_recorded,
    damping_of,
    each_beside,
    paired,
    short_of,
    strike_sound,
)
from sonic_bullet.records import Array

PEAK = 0.5
STEPS = (0.005, 0.01, 0.02, 0.04, 0.04, 0.02, 0.04, 0.008)  # impulses in N·s, as the practice cases spread them
NU_OFF = (-0.03, 0.02)


@dataclass(frozen=True, slots=True)
class Plan:
    """One case to be made: effects as (id, strength 0-2); transfer: with another object; noise_db: below the peak of
    0.5; form: audio, features or no-mesh; live: in a room as it is (live_rooms.py), whose noise has its own level and
    colour; impulses: whether they are declared.
    """

    name: str
    recipe: str
    effects: tuple[tuple[str, int], ...]
    seed: int
    transfer: bool = False
    noise_db: float = -72.0
    colour: str = "room"
    rate: int = 44_100
    seconds: float = 2.0
    fineness: float = 1.0
    form: str = "audio"
    live: bool = False
    impulses: bool = True


TRIES = 6


@dataclass(frozen=True, slots=True, eq=False)
class AudioObservation:
    """A case made, not yet written: bodies and sensors, strikes with the body each is of, sounds, what rings, truth."""

    bodies: list[Body]
    sensors: list[tuple[int, Array]]
    strikes: list[Strike]
    owner: list[int]
    heard: list[Array]
    ringing: physics.Ring
    truth: dict[str, Any]


def make_case(folder: Path, plan: Plan, cache: Path, noises: Path | None = None) -> dict[str, Any]:
    """Writes folder/plan.name whole (case.json last, by rename) and gives its truth.

    Effects that cannot be heard, alone or beside each other, are drawn again, up to TRIES times; then the draw is kept
    that comes nearest. noises: a folder of recordings whose quiet stretches are the floor of live rooms.
    """
    short: list[float] = []
    take: AudioObservation | float = 0.0
    for attempt in range(TRIES):
        take = _take(plan, np.random.default_rng([plan.seed, attempt]), cache, lacking=0.0, noises=noises)
        if isinstance(take, AudioObservation):
            break
        short.append(take)
    if not isinstance(take, AudioObservation):
        rng = np.random.default_rng([plan.seed, int(np.argmin(short))])
        take = _take(plan, rng, cache, lacking=np.inf, noises=noises)
    assert isinstance(take, AudioObservation)
    _save(folder / plan.name, plan, take)
    return take.truth


def _take(
    plan: Plan, rng: np.random.Generator, cache: Path, lacking: float, noises: Path | None
) -> AudioObservation | float:
    """A case, or only the dB that it lacks to be heard where these are more than ``lacking``."""
    recipe = RECIPES[plan.recipe]
    material = _as_it_is(MATERIALS[recipe.material], rng)
    unit = objects.solved(recipe, material.poisson, cache, fineness=plan.fineness)
    plain = objects.body(recipe.name, objects.as_made(unit, material))
    sensor = _sensor(plain, rng)
    strikes = _strikes(plain, rng, 8)
    n = int(plan.seconds * plan.rate)
    quiet = Scene(recipe, material, plain, strikes, sensor, 1.0, plan.rate, n, cache)
    dry = [strike_sound(quiet, plain, s, sensor, (), i) for i, s in enumerate(strikes)]
    scene = replace(quiet, gain=PEAK / max(float(np.abs(x).max()) for x in dry))
    effects = tuple({**LISTED, **UNLISTED}[name](strength, rng, scene) for name, strength in plan.effects)
    if plan.live and any(e.truth.get("kind") == "hum" for e in effects) and np.isfinite(lacking):
        return 100.0  # dB: it hums there as it is
    body = as_it_acts(scene, material, effects, unit)
    bodies, sensors = [body], [sensor]
    all_strikes, owner = list(strikes), [0] * 8
    if plan.transfer:
        bodies.append(_other(recipe, material, effects, rng, plan, cache))
        sensors.append(_sensor(bodies[1], rng))
        all_strikes += _strikes(bodies[1], rng, 3)[1:]
        owner += [1, 1]
    acting = (effects, tuple(e for e in effects if e.belongs in CARRIED))
    sd = PEAK * 10 ** (plan.noise_db / 20)
    own, *others = rng.spawn(2)  # their own, so that a single's bytes do not hang on them
    room = live_rooms.drawn(others[0], plan.rate, len(all_strikes), PEAK, noises) if plan.live else None
    if room is not None:
        sd = room.floor_rms

    def floor(chance: np.random.Generator) -> Array:
        return physics.noise(chance, n, sd, plan.colour) if room is None else room.floor(chance, n)

    def sound(i: int) -> Array:
        o = owner[i]
        return strike_sound(scene, bodies[o], all_strikes[i], sensors[o], acting[o], i)

    judged = {i: sound(i) for i in HELD_OUT}
    heard = [as_recorded(judged[i], effects, floor(rng)) for i in HELD_OUT]
    without = [[scene.gain * dry[i] + floor(rng) for i in HELD_OUT] for _ in range(2)]
    noise_floor = physics.white_floor(sd) if room is None else physics.floor_like(floor(others[0]))
    distance = apart(without, heard, noise_floor)
    beside = (
        each_beside(scene, material, unit, effects, [judged[i] for i in HELD_OUT], noise_floor, partial(floor, own))
        if len(effects) > 1
        else []
    )
    if (short := short_of(tuple(s for _, s in plan.effects), distance, beside)) > lacking:
        return short
    clean = [judged[i] if i in judged else sound(i) for i in range(len(all_strikes))]
    quieter = min(1.0, 0.95 / max(float(np.abs(x).max()) for x in clean))
    if room is None:
        heard = [as_recorded(quieter * x, effects, floor(rng)) for x in clean]
    else:
        heard = [_in_the_room(room, i, quieter * x, effects, rng) for i, x in enumerate(clean)]
    ringing = physics.ring(paired(body, effects), damping_of(body, material, effects), strikes[0], sensor)
    truth = {
        "effects": [{"id": e.id, "strength": s, **e.truth} for e, (_, s) in zip(effects, plan.effects, strict=True)],
        "alpha": material.alpha,
        "beta": material.beta,
        "sigma": scene.gain * quieter,
        "modes_hz": np.round(np.abs(ringing.pole.imag) / (2 * np.pi), 3).tolist(),
        "decay_per_s": np.round(-ringing.pole.real, 4).tolist(),
        "youngs_modulus": material.youngs_pa,
        "density": material.density,
        "poisson_ratio": material.poisson,
        "noise_sd": sd,
        "distance_db": distance,
        "beside_db": {e.id: d for e, d in zip(effects, beside, strict=False)},
        "plan": asdict(plan),
        **({} if room is None else {"live_room": room.truth()}),
    }
    return AudioObservation(bodies, sensors, all_strikes, owner, heard, ringing, truth)


def _in_the_room(room: LiveRoom, which: int, x: Array, effects: tuple[Effect, ...], rng: np.random.Generator) -> Array:
    """A take as its room has it, from before its onset on."""
    late = np.concatenate([np.zeros(room.lead(which)), x])
    return as_recorded(late, effects, room.noise(rng, len(late), which))


def _save(where: Path, plan: Plan, take: AudioObservation) -> None:
    where.mkdir(parents=True, exist_ok=True)
    if plan.form == "features":
        entries = _measured(take.ringing, plan.recipe, np.random.default_rng(plan.seed))
    else:
        files = [f"strike-{i + 1:02d}.flac" for i in range(len(take.heard))]
        for name, x in zip(files, take.heard, strict=True):
            _write(where / name, x, plan.rate)
        splits = ["fit"] * 5 + ["holdout"] * 3 + ["transfer"] * (len(files) - 8)
        entries = [
            _entry(f, take.bodies[o], s, p, plan.impulses)
            for f, o, s, p in zip(files, take.owner, take.strikes, splits, strict=True)
        ]
    if plan.form != "no-mesh":
        for b in take.bodies:
            objects.write_obj(where / f"{b.name}.obj", b)
    (where / "truth.json").write_text(json.dumps(take.truth, indent=1, default=float))
    unfinished = where / "case.json.partial"
    unfinished.write_text(
        json.dumps(_declared(plan, take.bodies, RECIPES[plan.recipe], take.sensors, entries), indent=1, default=float)
    )
    os.replace(unfinished, where / "case.json")


def _as_it_is(guess: Material, rng: np.random.Generator) -> Material:
    """What the object is made of, where ``guess`` is what it is taken for."""
    ratio, both = rng.uniform(-0.18, 0.18), rng.uniform(-0.1, 0.1)
    young, density = guess.youngs_pa * np.exp(both + ratio / 2), guess.density * np.exp(both - ratio / 2)
    nu = round(guess.poisson + float(rng.choice(NU_OFF)), 4)
    return Material(
        guess.name,
        young,
        density,
        nu,
        guess.alpha * np.exp(rng.uniform(-0.5, 0.5)),
        guess.beta * np.exp(rng.uniform(-0.5, 0.5)),
    )


def _sensor(body: Body, rng: np.random.Generator) -> tuple[int, Array]:
    """Of forty vertices the one where the weaker modes move best, and the normal there."""
    tries = rng.choice(np.flatnonzero(np.isfinite(body.normal[:, 0])), 40, replace=False)
    seen = np.abs(np.einsum("kx,kxm->km", body.normal[tries], body.modes.shape[tries]))
    best = tries[np.argmax(np.log(seen + 1e-9).mean(axis=1))]
    return int(best), body.normal[best]


def _strikes(body: Body, rng: np.random.Generator, count: int) -> tuple[Strike, ...]:
    """Blows along the inward normal, tilted by a few degrees in half the cases, at other vertices each."""
    vertices = rng.choice(np.flatnonzero(np.isfinite(body.normal[:, 0])), count, replace=False)
    tilt = 0.1 * (rng.random() < 0.5)
    out = []
    for v, step in zip(vertices, STEPS[:count], strict=True):
        way = -body.normal[v] + tilt * rng.standard_normal(3)
        way = np.round(way / np.linalg.norm(way), 6)
        out.append(
            Strike(
                int(v),
                (float(way[0]), float(way[1]), float(way[2])),
                round(float(step * np.exp(rng.uniform(-0.15, 0.15))), 6),
            )
        )
    return tuple(out)


def _other(
    recipe: Recipe, material: Material, effects: tuple[Effect, ...], rng: np.random.Generator, plan: Plan, cache: Path
) -> Body:
    """Another body of the same material: another recipe, or a scaled copy. Effects of the material act on it too."""
    second = RECIPES[recipe.other] if recipe.other else recipe
    scale = 1.0 if recipe.other else float(rng.choice([0.7, 0.85]))
    made = next((e.modes(second, material.poisson, cache) for e in effects if e.modes and e.belongs in CARRIED), None)
    unit = made or objects.solved(second, material.poisson, cache, fineness=plan.fineness)
    name = second.name if recipe.other else f"{recipe.name}_x{scale:g}"
    return objects.body(name, objects.as_made(unit, material, scale))


def _measured(ringing: physics.Ring, name: str, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Lines in place of audio: frequencies to 10⁻⁵, every second one for the fit."""
    freq = np.sort(np.abs(ringing.pole.imag) / (2 * np.pi)) * (1 + 1e-5 * rng.standard_normal(len(ringing.pole)))
    halves = (("fit", freq[::2]), ("holdout", freq[1::2]))
    return [
        {"object": name, "split": split, "features": [{"freq_hz": round(float(f), 4)} for f in part]}
        for split, part in halves
    ]


def _entry(file: str, body: Body, strike: Strike, split: str, impulse: bool) -> dict[str, Any]:
    where = np.round(body.modes.vertex_m[strike.vertex], 6).tolist()
    struck: dict[str, Any] = {"position": where, "direction": list(strike.direction)}
    struck |= {"impulse": strike.impulse} if impulse else {}
    return {"file": file, "object": body.name, "split": split, "strike": struck}


def _declared(
    plan: Plan, bodies: list[Body], recipe: Recipe, sensors: list[tuple[int, Array]], entries: list[dict[str, Any]]
) -> dict[str, Any]:
    guess = MATERIALS[recipe.material]
    elastic = {"youngs_modulus": guess.youngs_pa, "density": guess.density, "poisson_ratio": guess.poisson}
    things = {}
    for b in bodies:
        things[b.name] = {"mesh": f"{b.name}.obj", "units": "m", "material": guess.name, "elastic_guess": elastic}
        if plan.form == "no-mesh":
            del things[b.name]["mesh"]
    return {
        "format": "sonic-bullet-case/1",
        "case": plan.name,
        "objects": things,
        "support": "free (soft foam)",
        "sensor": {
            "type": "near-field microphone",
            "response": "gain * normal surface velocity at the position; gain common to the case, unknown",
            "position": {
                b.name: np.round(b.modes.vertex_m[q], 6).tolist() for b, (q, _) in zip(bodies, sensors, strict=True)
            },
            "direction": {b.name: np.round(way, 6).tolist() for b, (_, way) in zip(bodies, sensors, strict=True)},
        },
        # what radiates is planted as an effect of unknown strength; all else rings in a vacuum
        "medium": "unknown" if any(name == "radiation" for name, _ in plan.effects) else "none",
        "band_hz": [20, 20000],
        **({} if plan.live else {"onset": "the impulse arrives at sample 0 of every file"}),
        "recordings": entries,
    }


def _write(path: Path, x: Array, rate: int) -> None:
    import soundfile

    if not np.isfinite(x).all() or np.abs(x).max() >= 1:
        raise ValueError(f"{path.name} would clip: peak {np.abs(x).max():.3f}")
    soundfile.write(path, x, rate, subtype="PCM_24", format="FLAC")
