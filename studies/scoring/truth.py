"""What a world does: its log and its poses; and which impacts the run time accepts of a log.

Scene -> ContactLog, Animation;   ContactLog -> pulses -> Impact ..., those of a pair within two frames as one
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

import sonic_bullet as sb
from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.engine.runtime.body_lifetime import admit
from sonic_bullet.engine.runtime.synthesis_state import Setup, start
from sonic_bullet.engine.runtime.synthesizer import advance
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Material, Microphone
from sonic_bullet.simulators import direct_client, disconnect
from sonic_bullet.simulators.animated import AnimatedBody
from studies.scoring.scenes import Scene
from tests.made.models import box_model

SR = 8000
LEAST_N_S, LEAST_M_S = 0.01, 0.05
SOLID = Material.isotropic("solid", youngs_pa=2e10, poisson=0.3, density_kg_m3=2000, alpha_per_s=50.0, beta_s=1e-7)


class Impact(NamedTuple):
    """Of the bodies low < high (rows of the animation)."""

    low: int
    high: int
    time_s: float
    impulse_n_s: float


def played(scene: Scene) -> tuple[ContactLog, Animation]:
    """A scene's log and its poses at 240 Hz."""
    client = direct_client()
    bodies = scene.build(client)
    client.setPhysicsEngineParameter(numSubSteps=scene.substeps if scene.substeps > 1 else 0)
    listener = sb.attach(client, sr=SR)
    made = []
    for body in bodies:
        info = client.getDynamicsInfo(body, -1)
        shapes = listener.world.shapes_of(body)
        made.append(AnimatedBody(f"body {body}", shapes, info[0], np.array(info[2]), info[5], info[1]))
        listener.add(body, material=SOLID, model=box_model((0.05, 0.05, 0.05), (3000.0,)))
    poses = [[client.getBasePositionAndOrientation(body) for body in bodies]]
    for _ in range(round(scene.seconds * 240)):
        client.stepSimulation()
        poses.append([client.getBasePositionAndOrientation(body) for body in bodies])
    log = listener.contacts
    disconnect(client)
    place = np.array([[p for p, _ in frame] for frame in poses])
    turn = np.array([[q for _, q in frame] for frame in poses])
    return log, Animation(240.0, tuple(made), place, turn)


def at_rate(animation: Animation, every: int, *, single: bool = False) -> Animation:
    """Every so manieth pose; single: as float32 has them."""
    place, turn = animation.position_m[::every], animation.quaternion_xyzw[::every]
    if single:
        place, turn = place.astype(np.float32), turn.astype(np.float32)
    return replace(animation, fps=animation.fps / every, position_m=place, quaternion_xyzw=turn)


def scored(animation: Animation) -> ContactLog:
    """The log that `score` makes of it."""
    from sonic_bullet.apps.soundtrack.score.flight import alone, hidden_n_s, pose_noise_m
    from sonic_bullet.apps.soundtrack.score.method import find_steps, substeps_of
    from sonic_bullet.simulators.pybullet.staged.animated_world import AnimatedStage, AnimatedWorld

    stage = AnimatedStage(animation.bodies, animation.gravity_m_s2)
    steps: list[Any] = []
    noise_m = pose_noise_m(animation, alone(animation, stage)) or 0.0
    find_steps(animation, stage, steps, hidden_m_s=hidden_n_s(1.0, noise_m, animation.fps))
    dt_s = 1 / animation.fps / substeps_of(animation.fps)
    listener = sb.attach(AnimatedWorld(stage, steps, dt_s), sr=SR)
    for body in stage.ids:
        listener.add(body, material=SOLID, model=box_model((0.05, 0.05, 0.05), (3000.0,)))
    for _ in steps:
        listener.step()
    log = listener.contacts
    stage.close()
    return log


def pulses(log: ContactLog) -> list[Impact]:
    """All that the run time plays as impacts."""
    setup = Setup(SR, (Microphone(np.zeros(3)),), 0, log.air)
    state, made = start(setup), []

    def seen(state: Any, number: int, step: Any, found: int, drives: int) -> None:
        for pulse in state.scratch.pulse[:found]:
            low, high = (int(state.body[i]) for i in pulse["body"])
            begin = float(step["after_s"] if pulse["ahead"] else step["begin_s"])
            impulse = float(np.linalg.norm(pulse["impulse_n_s"]))
            made.append(Impact(low, high, begin + float(pulse["start_s"]), impulse))

    state.observer = seen
    for step in log.steps:
        if step.body is not state.present:
            admit(setup, state, step, log.bodies)
        advance(setup, state, [step])
    return made


def impacts(found: Iterable[Impact], window_s: float) -> list[Impact]:
    """Pulses of a pair within that time as one: their sum, at the time of the largest."""
    made: list[Impact] = []
    pairs: dict[tuple[int, int], list[list[Impact]]] = {}
    for one in sorted(found, key=lambda one: one.time_s):
        groups = pairs.setdefault((one.low, one.high), [])
        if groups and one.time_s - groups[-1][0].time_s <= window_s:
            groups[-1].append(one)
        else:
            groups.append([one])
    for (low, high), groups in pairs.items():
        for group in groups:
            first = max(group, key=lambda one: one.impulse_n_s)
            made.append(Impact(low, high, first.time_s, sum(one.impulse_n_s for one in group)))
    return sorted(made, key=lambda one: one.time_s)


def large(found: Sequence[Impact], mass_kg: Sequence[float]) -> list[Impact]:
    """Those of LEAST_N_S, and LEAST_M_S of the lighter body, at least."""
    return [
        one
        for one in found
        if one.impulse_n_s >= LEAST_N_S
        and one.impulse_n_s >= LEAST_M_S * min(m for m in (mass_kg[one.low], mass_kg[one.high]) if m > 0)
    ]


def loads(log: ContactLog) -> list[tuple[int, int, float]]:
    """Which pairs of bodies press on each other, and when: one for each pair and step."""
    found = set()
    for step, begin_s in zip(log.steps, log.start_s, strict=True):
        for row in step.contacts.row:
            if row["impulse_n_s"].any():
                low, high = sorted((int(row["a"]), int(row["b"])))
                found.add((low, high, float(begin_s)))
    return sorted(found)
