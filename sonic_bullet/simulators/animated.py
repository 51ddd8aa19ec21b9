"""Interface of the simulator that scores an animation: distances in a pose, and the motion that follows from a start.

    AnimatedBody ... -> PoseStage: MOTION (b,) -> closest: RAW (k,), no force        -> a fit of impulses
                               MOTION (b,) -> shoot: MOTION (n + 1, b), RAW each -> a search for the start
    n steps of MOTION and RAW -> AnimatedWorld -> Step, as of any other world

PyBullet's is simulators/pybullet/staged/animated_world.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sonic_bullet.records import Array, Shape
from sonic_bullet.records.arrays import frozen_array, require, store
from sonic_bullet.records.coerce import as_flag, as_number, as_text, quote
from sonic_bullet.records.errors import RecordError


@dataclass(frozen=True, slots=True, eq=False)
class AnimatedBody:
    """A body that an animation moves.

    Parameters
    ----------
    shapes
        In the body frame: origin at the centre of mass, axes along the principal inertia.
    mass_kg
        0 where only the animation moves it.
    inertia_kg_m2 : Array, shape (3,)
        Principal moments.
    restitution, friction
        A pair's value is the product of both bodies' values.
    driven
        Something besides gravity and contacts moves it, a hand or a motor.
    """

    name: str
    shapes: tuple[Shape, ...]
    mass_kg: float
    inertia_kg_m2: Array
    restitution: float = 0.7
    friction: float = 0.7
    driven: bool = False

    def __post_init__(self) -> None:
        """Check and normalise the fields."""
        heaviest_kg = 1e6
        who = f"body {quote(self.name)}"
        as_text(self.name, "the name of a body", "give a text")
        store(
            self,
            mass_kg=as_number(self.mass_kg, f"{who}: mass_kg", "give kilograms, 0 or more", least=0, most=heaviest_kg),
            inertia_kg_m2=frozen_array(self.inertia_kg_m2, float, (3,), f"{who}: inertia_kg_m2"),
            restitution=as_number(
                self.restitution, f"{who}: restitution", "give a number from 0 to 1", least=0, most=1
            ),
            friction=as_number(self.friction, f"{who}: friction", "give a number, 0 or more", least=0, most=100),
            driven=as_flag(self.driven, f"{who}: driven"),
        )
        require(len(self.shapes) > 0, f"{who} has no shape", "give it a mesh")
        if self.mass_kg > 0 and not (self.inertia_kg_m2 > 0).all():
            raise RecordError(f"{who}: a moment of inertia is not above 0", "give its three principal moments")


@dataclass(frozen=True, slots=True, eq=False)
class Rollout:
    """Motion that follows from a start (a single shooting).

    Parameters
    ----------
    motion : Array of MOTION, shape (n + 1, b)
        At the start of each of n steps, and after the last.
    raw
        RAW rows of each step, empty where they were not polled.
    touching : Array of bool, shape (b, b)
        Pairs that exchanged a force.
    """

    motion: Array
    raw: tuple[Array, ...]
    touching: Array


class PoseStage(Protocol):
    """A simulated world whose poses are set, queried and simulated from, in the order of the bodies it was given.

    reach_m (b,): largest distance of a body's points from its centre of mass.
    """

    reach_m: Array

    def boxes(self, motion: Array) -> tuple[Array, Array]:
        """Return the lowest and highest corners (b, 3) of the bodies' axis-aligned boxes, world frame, in that pose."""
        ...

    def rows(self, body_id: Array) -> Array:
        """Map body ids (k,) of RAW rows to indices of the bodies as they were given."""
        ...

    def closest(self, motion: Array, pairs: Sequence[tuple[int, int]], reach_m: float) -> Array:
        """Find where pairs are nearer than reach_m in a pose.

        Parameters
        ----------
        motion : Array of MOTION, shape (b,)
        pairs
            Indices of the bodies.
        reach_m
            Largest distance.

        Returns
        -------
        Array of RAW, shape (k,)
            Rows without force; of faces and edges that lie on each other, their corners.
        """
        ...

    def shoot(
        self, start: Array, end: Array, steps: int, dt_s: float, restitution: Array, *, polled: bool = False
    ) -> Rollout:
        """Simulate so many steps from a start.

        Parameters
        ----------
        start, end : Array of MOTION, shape (b,)
            Bodies that are driven or have mass 0 move straight to `end`.
        restitution : Array, shape (b,)
        polled
            Whether to return the RAW rows of each step.
        """
        ...


def free(bodies: Sequence[AnimatedBody]) -> Array:
    """Select the bodies (b,) that only gravity and contacts move."""
    return np.array([body.mass_kg > 0 and not body.driven for body in bodies], bool)


def rotation(first: Array, second: Array) -> Array:
    """Compute rotation vectors (…, 3) in rad, world frame, between orientations (…, 4): the logarithm of q₂ q₁*.

    References
    ----------
    Sola 2017, Quaternion kinematics, eq. 105.
    """
    v, w, x, y = first[..., :3], first[..., 3:], second[..., :3], second[..., 3:]
    axis, real = w * x - y * v - np.cross(x, v), w * y + (v * x).sum(axis=-1, keepdims=True)
    length = np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = 2 * np.arctan2(length, np.abs(real))
    return np.asarray(np.where(real < 0, -1.0, 1.0) * axis * angle / np.maximum(length, 1e-300))


def matrices(quaternion: Array) -> Array:
    """Convert unit quaternions (…, 4), x y z w, to rotation matrices (…, 3, 3).

    References
    ----------
    Kuipers 1999, sec. 5.15.
    """
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))
