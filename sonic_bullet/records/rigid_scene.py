"""What a file says of a scene of rigid bodies, by value, before any simulator knows of it.

    glTF -> RigidScene -> bodies, joints, drives and settings of a simulator; materials and models of a listener
    simulator, contact log -> RigidScene -> glTF

Frames: the world has z up; a body's origin is its centre of mass, its axes are its principal ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from sonic_bullet.records.arrays import Array, frozen_array, require, store
from sonic_bullet.records.bodies import Material, ModalModel, Shape
from sonic_bullet.records.coerce import as_number, as_text, as_whole, quote
from sonic_bullet.records.mounting import Mounting, as_mounting
from sonic_bullet.records.receivers import unit_quaternions

CombineRule = Literal["average", "minimum", "maximum", "multiply"]
JointKind = Literal["fixed", "point", "hinge", "slider"]


@dataclass(frozen=True, slots=True)
class PhysicsMaterial:
    """Friction and restitution of a body, and how a pair's are made of both bodies'."""

    friction: float = 0.6
    restitution: float = 0.0
    friction_rule: CombineRule = "average"
    restitution_rule: CombineRule = "average"

    def __post_init__(self) -> None:
        """Check the fields."""
        store(
            self,
            friction=as_number(self.friction, "dynamicFriction", "give 0 or more", least=0, most=1e3),
            restitution=as_number(self.restitution, "restitution", "give a number from 0 to 1", least=0, most=1),
        )
        for rule in (self.friction_rule, self.restitution_rule):
            known = get_args(CombineRule)
            require(rule in known, f"the combine rule {quote(rule)} is none", f"one of {', '.join(known)}")


@dataclass(frozen=True, slots=True, eq=False)
class RigidBody:
    """A body of a scene.

    shapes: its colliders, body frame. mass_kg: 0 for what does not move; inertia_kg_m2 (3,): principal moments, zeros:
    those of its shapes. position_m (3,), quaternion_xyzw (4,), velocity_m_s (3,), spin_rad_s (3,): at the start, world.
    gravity_factor: how much of gravity it feels. material: what its contacts are of; None: a silent, rigid partner.
    model: its modes; None: solved where ``solved``, else it does not ring. gain: of its sound. mounting: of the model,
    whose decays are without its loss.
    """

    name: str
    shapes: tuple[Shape, ...]
    mass_kg: float
    inertia_kg_m2: Array
    position_m: Array
    quaternion_xyzw: Array
    velocity_m_s: Array
    spin_rad_s: Array
    physics: PhysicsMaterial = PhysicsMaterial()
    gravity_factor: float = 1.0
    material: Material | None = None
    model: ModalModel | None = None
    solved: bool = False
    gain: float = 1.0
    mounting: Mounting = "free"

    def __post_init__(self) -> None:
        """Check the fields."""
        heaviest_rigid_kg, fastest_m_s_rigid = 1e9, 1e6
        where = as_text(self.name, "the name of a body", "give a text")
        for name, width in (
            ("inertia_kg_m2", 3),
            ("position_m", 3),
            ("quaternion_xyzw", 4),
            ("velocity_m_s", 3),
            ("spin_rad_s", 3),
        ):
            store(self, **{name: frozen_array(getattr(self, name), float, (width,), f"{where}: {name}")})
        store(
            self,
            mass_kg=as_number(self.mass_kg, f"{where}: mass", "give kilograms", least=0, most=heaviest_rigid_kg),
            gravity_factor=as_number(self.gravity_factor, f"{where}: gravityFactor", "give a number"),
            mounting=as_mounting(self.mounting, f"{where}: mounting"),
            gain=as_number(self.gain, f"{where}: gain", "give a factor, 0 or more", least=0, most=1e10),
        )
        require(len(self.shapes) > 0, f"{where} has no collider", "give it one")
        require(bool((self.inertia_kg_m2 >= 0).all()), f"{where}: a moment of inertia is below 0", "give moments")
        speeds = np.concatenate([self.velocity_m_s, self.spin_rad_s])
        require(
            bool((np.abs(speeds) <= fastest_m_s_rigid).all()), f"{where} is faster than anything", "give m/s and rad/s"
        )


@dataclass(frozen=True, slots=True, eq=False)
class SpeedDrive:
    """A motor that holds a body's speed along a direction: F = damping · (speed - v), at most most_n.

    body, partner: numbers of the bodies, partner -1: the world. direction (3,): unit, world. turns_locked: the body
    keeps its orientation.
    """

    body: int
    partner: int
    direction: Array
    speed_m_s: float
    damping_n_s_m: float
    most_n: float
    turns_locked: bool

    def __post_init__(self) -> None:
        """Check the fields."""
        store(
            self,
            body=as_whole(self.body, "body of a drive", "give its number", least=0),
            direction=frozen_array(self.direction, float, (3,), "direction of a drive"),
            speed_m_s=as_number(self.speed_m_s, "velocityTarget", "give m/s"),
            damping_n_s_m=as_number(self.damping_n_s_m, "damping of a drive", "give N s/m, 0 or more", least=0),
            most_n=as_number(self.most_n, "maxForce of a drive", "give newtons, 0 or more", least=0),
        )


@dataclass(frozen=True, slots=True, eq=False)
class RigidJoint:
    """What holds two bodies together, in one frame of the world at the start.

    kind: which motions are left: none, all turns (point), the turn about the axis (hinge), the way along it (slider).
    body, partner: numbers of the bodies, partner -1: the world. position_m (3,), axis (3,): unit, world. range: least
    and most angle in rad, or way in m, from the start; None: endless. collides: whether both bodies touch each other.
    """

    kind: JointKind
    body: int
    partner: int
    position_m: Array
    axis: Array
    range: tuple[float, float] | None = None
    collides: bool = False

    def __post_init__(self) -> None:
        """Check the fields."""
        kinds = get_args(JointKind)
        require(self.kind in kinds, f"a joint is {quote(self.kind)}", f"one of {', '.join(kinds)}")
        store(
            self,
            body=as_whole(self.body, "body of a joint", "give its number", least=0),
            partner=as_whole(self.partner, "partner of a joint", "give its number, or -1", least=-1),
            position_m=frozen_array(self.position_m, float, (3,), "position of a joint"),
            axis=frozen_array(self.axis, float, (3,), "axis of a joint"),
        )
        require(abs(float(np.linalg.norm(self.axis)) - 1) < 1e-6, "the axis of a joint is no unit", "divide it")


@dataclass(frozen=True, slots=True, eq=False)
class BodyPath:
    """Poses of a body by time, on the line and the shorter arc between: recorded, or prescribed to a body of mass 0.

    body: its number. time_s (t,), ascending; position_m (t, 3), quaternion_xyzw (t, 4): world.
    """

    body: int
    time_s: Array
    position_m: Array
    quaternion_xyzw: Array

    def __post_init__(self) -> None:
        """Check the fields."""
        time = frozen_array(self.time_s, float, (None,), "times of a path")
        store(
            self,
            body=as_whole(self.body, "body of a path", "give its number", least=0),
            time_s=time,
            position_m=frozen_array(self.position_m, float, (len(time), 3), "positions of a path"),
            quaternion_xyzw=frozen_array(self.quaternion_xyzw, float, (len(time), 4), "orientations of a path"),
        )
        require(len(time) > 0 and bool((np.diff(time) > 0).all()), "the times of a path do not rise", "sort its keys")


@dataclass(frozen=True, slots=True, eq=False)
class Viewpoint:
    """Where a scene is looked at from, and so heard: a camera's name, place (3,) and turn (4,), x ahead, y left, z up.

    body: number of the body in whose frame that is, with which it moves; -1: the world.
    """

    name: str
    position_m: Array
    quaternion_xyzw: Array
    body: int = -1

    def __post_init__(self) -> None:
        """Check the fields."""
        store(
            self,
            position_m=frozen_array(self.position_m, float, (3,), "position of a camera"),
            quaternion_xyzw=unit_quaternions(self.quaternion_xyzw, (4,), "turn of a camera"),
            body=as_whole(self.body, "body of a camera", "give its number, or -1", least=-1),
        )


@dataclass(frozen=True, slots=True, eq=False)
class RigidScene:
    """Bodies, drives, gravity (3,), joints, paths; notes: what is asked for and nobody does, by name.

    viewpoint: its first camera; None: it has none.
    """

    bodies: tuple[RigidBody, ...]
    drives: tuple[SpeedDrive, ...]
    gravity_m_s2: Array
    notes: tuple[str, ...] = ()
    joints: tuple[RigidJoint, ...] = ()
    paths: tuple[BodyPath, ...] = ()
    viewpoint: Viewpoint | None = None

    def __post_init__(self) -> None:
        """Check the fields."""
        store(self, gravity_m_s2=frozen_array(self.gravity_m_s2, float, (3,), "gravity"))
        for number in (*(joint.body for joint in self.joints), *(path.body for path in self.paths)):
            require(number < len(self.bodies), "a joint or a path of a body that is none", "give its number")
