"""Kinematic bodies of a script: bodies driven step by step sound as an animation, a single teleport is silent.

    ContactLog, shapes -> moves of each body -> Animation of all, driven ones marked
        -> momentum less that of the simulated contacts -> places of driven pairs, fitted (impulse_fit.py)
        -> the log with their rows, rendered as any other

PyBullet's own contacts of a body that is reset every step show what its solver would have done, not what the script
did: those rows are dropped (listener), and bodies of mass 0 make none with each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from sonic_bullet.apps.soundtrack.score.animation import STILL_M, STILL_RAD, Animation
from sonic_bullet.apps.soundtrack.score.impulse_fit import fit_steps
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.geometry import inertia
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.contacts import Contacts, Step
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AnimationError
from sonic_bullet.simulators.animated import AnimatedBody, matrices, rotation


@dataclass(frozen=True, slots=True)
class Moves:
    """How the script moved a body of the log (its index).

    Steps (first, one after the last) of each drive, and the steps before which it was teleported alone.
    """

    index: int
    drives: tuple[tuple[int, int], ...]
    teleports: tuple[int, ...]


def moves_of(log: ContactLog) -> tuple[Moves, ...]:
    """Find the kinematic bodies of a log: marked as teleported, or of mass 0 and elsewhere than before."""
    # steps in a row that a body is set at least to be driven: the shortest load that the run time takes for lasting,
    # too
    driven_steps = 4
    by_hand = np.zeros((len(log.steps), len(log.bodies)), bool)
    before: Step | None = None
    mass = np.array([one.mass_kg for one in log.bodies])
    for number, step in enumerate(log.steps):
        by_hand[number, step.body] = step.teleported
        if before is not None and np.array_equal(before.body, step.body):
            away = np.abs(step.position_m - before.position_m).max(axis=1, initial=0) > STILL_M
            turned = np.linalg.norm(rotation(before.quaternion_xyzw, step.quaternion_xyzw), axis=1) > STILL_RAD
            by_hand[number, step.body] |= (mass[step.body] == 0) & (away | turned)
        before = step
    found = []
    for index in np.flatnonzero(by_hand.any(axis=0)).tolist():
        runs = []
        for moved, group in groupby(enumerate(by_hand[:, index].tolist()), key=lambda x: x[1]):
            numbers = [number for number, _ in group]
            if moved:
                runs.append((numbers[0], numbers[-1] + 1))
        drives = tuple(run for run in runs if run[1] - run[0] >= driven_steps)
        teleports = tuple(n for first, stop in runs if stop - first < driven_steps for n in range(first, stop))
        found.append(Moves(index, drives, teleports))
    return tuple(found)


def move_notes(log: ContactLog, moves: Sequence[Moves]) -> tuple[str, ...]:
    """Return notes on them: one line a body."""
    start_s, said = log.start_s, []
    for one in moves:
        name = log.bodies[one.index].name
        if one.drives:
            steps = sum(stop - first for first, stop in one.drives)
            many = format_count(steps, "step")
            said.append(f"{name} is driven by hand in {many} from {start_s[one.drives[0][0]]:.3f} s")
        if one.teleports:
            first = start_s[one.teleports[0]]
            more = f" and {format_count(len(one.teleports) - 1, 'time')} more" if len(one.teleports) > 1 else ""
            said.append(f"{name} is set elsewhere at {first:.3f} s{more}: a teleport, which is silent")
    return tuple(said)


def scored_by_hand(
    log: ContactLog,
    shapes: Mapping[int, tuple[Shape, ...]],
    moves: Sequence[Moves],
) -> ContactLog:
    """Add the contacts of driven bodies to the log. shapes: of bodies by their index.

    Raises
    ------
    AnimationError
        Bodies come or go, steps change their length, or a driven body has neither mass nor model.
    KeyboardInterrupt
        Interrupted, the exception carries the steps so far as ``log``.
    """
    from sonic_bullet.simulators.pybullet.staged.animated_world import AnimatedStage, AnimatedWorld

    driven = {one.index for one in moves if one.drives}
    if not driven:
        return log
    steps = list(log.steps)
    if any(len(step.body) != len(log.bodies) or step.dt_s != steps[0].dt_s for step in steps):
        raise AnimationError(
            "bodies come or go, or steps change their length, in a scene with driven bodies",
            "add every body to the cast, and keep the time step",
        )
    bodies = tuple(_body(log, index, shapes, index in driven) for index in range(len(log.bodies)))
    animation = Animation(
        1 / steps[0].dt_s, bodies, np.stack([step.position_m for step in steps]),
        np.stack([step.quaternion_xyzw for step in steps]), steps[0].gravity_m_s2,
    )  # fmt: skip
    known = [_sum_momentum(step, len(bodies), driven) for step in steps]
    with AnimatedStage(bodies, animation.gravity_m_s2) as stage:
        found: list[tuple[Array, Array]] = []
        stopped: KeyboardInterrupt | None = None
        try:
            fit_steps(animation, stage, found, known=np.stack(known), only=driven)
        except KeyboardInterrupt as error:
            stopped = error
        world = AnimatedWorld(stage, found, steps[0].dt_s)
        for body in stage.ids:
            world.add(body)
        made = [
            _replace_driven_rows(step, world.after_step(), driven, moves, k)
            for k, step in enumerate(steps[: len(found)])
        ]
    heavy = tuple(
        replace(body, mass_kg=one.mass_kg, inertia_kg_m2=np.diag(one.inertia_kg_m2)) if one.driven else body
        for body, one in zip(log.bodies, bodies, strict=True)
    )
    if stopped is not None:
        known_log = replace(log, bodies=heavy).first(len(made))
        stopped.log = replace(known_log, steps=tuple(made))  # type: ignore[attr-defined]
        raise stopped
    return replace(log, bodies=heavy, steps=(*made, steps[-1]))


def _body(log: ContactLog, index: int, shapes: Mapping[int, tuple[Shape, ...]], driven: bool) -> AnimatedBody:
    body, values = log.bodies[index], log.dynamics(index)
    if index not in shapes:
        raise AnimationError(f"the shape of {body.name} is not known", "add it to the cast")
    mass, moments = body.mass_kg, np.diag(body.inertia_kg_m2)
    if driven and mass == 0:
        if body.model is None or not len(body.model.face):
            raise AnimationError(f"{body.name} is driven and has neither mass nor material", "give it a material")

        density = body.model.mass_kg / body.model.volume_m3
        mass, _, moment = inertia(body.model.vertex_m, body.model.face, density)
        moments = np.diag(moment)
    return AnimatedBody(
        f"{index} {body.name}", shapes[index], mass, moments if mass else np.zeros(3),
        values.get("restitution", 0.7), values.get("lateralFriction", 0.7), driven,
    )  # fmt: skip


def _mark_driven_rows(row: Array, driven: set[int]) -> Array:
    """Return which CONTACT rows (k,) are of a driven body."""
    return np.isin(row["a"], list(driven)) | np.isin(row["b"], list(driven))


def _sum_momentum(step: Step, bodies: int, driven: set[int]) -> Array:
    """Sum linear and angular momentum (b, 6) of a step's simulated contacts, about the centres of mass.

    Contacts of driven bodies are left out.
    """
    found, row = np.zeros((bodies, 6)), step.contacts.row[~_mark_driven_rows(step.contacts.row, driven)]
    frame = matrices(step.quaternion_xyzw)
    for sign, who, point in ((1, "a", "point_a_m"), (-1, "b", "point_b_m")):
        arm = np.einsum("kij,kj->ki", frame[row[who]], row[point])
        np.add.at(found, row[who], sign * np.concatenate([row["impulse_n_s"], np.cross(arm, row["impulse_n_s"])], 1))
    return found


def _replace_driven_rows(step: Step, made: Step, driven: set[int], moves: Sequence[Moves], number: int) -> Step:
    """Replace the rows of driven bodies in a step by the fitted ones; a body driven in it is not teleported."""
    at_hand = np.array([any(a <= number < b for a, b in one.drives) for one in moves], bool)
    moved = step.teleported.copy()
    moved[[one.index for one, yes in zip(moves, at_hand, strict=True) if yes]] = False
    row, old = made.contacts.row, step.contacts.row
    both = [old[~_mark_driven_rows(old, driven)], row[_mark_driven_rows(row, driven)]]
    return replace(step, teleported=moved, contacts=Contacts.of(np.concatenate(both)))
