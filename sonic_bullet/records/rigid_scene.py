"""What a file says of a scene of rigid bodies, by value, before any simulator knows of it.

    glTF -> RigidScene -> bodies, drives and settings of a simulator; materials and models of a listener

Frames: the world has z up; a body's origin is its centre of mass, its axes are its principal ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from sonic_bullet.records.arrays import Array, frozen_array, require, store
from sonic_bullet.records.bodies import Material, ModalModel, Shape
from sonic_bullet.records.coerce import as_number, as_text, as_whole, shown

CombineRule = Literal["average", "minimum", "maximum", "multiply"]
HEAVIEST_KG, FASTEST = 1e9, 1e6


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
            require(rule in known, f"the combine rule {shown(rule)} is none", f"one of {', '.join(known)}")


@dataclass(frozen=True, slots=True, eq=False)
class RigidBody:
    """A body of a scene.

    shapes: its colliders, body frame. mass_kg: 0 for what does not move; inertia_kg_m2 (3,): principal moments, zeros:
    those of its shapes. position_m (3,), quaternion_xyzw (4,), velocity_m_s (3,), spin_rad_s (3,): at the start, world.
    gravity_factor: how much of gravity it feels. material: what its contacts are of; None: a silent, rigid partner.
    model: its modes; None: solved where ``solved``, else it does not ring. gain: of its sound.
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

    def __post_init__(self) -> None:
        """Check the fields."""
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
            mass_kg=as_number(self.mass_kg, f"{where}: mass", "give kilograms", least=0, most=HEAVIEST_KG),
            gravity_factor=as_number(self.gravity_factor, f"{where}: gravityFactor", "give a number"),
            gain=as_number(self.gain, f"{where}: gain", "give a factor, 0 or more", least=0, most=1e10),
        )
        require(len(self.shapes) > 0, f"{where} has no collider", "give it one")
        require(bool((self.inertia_kg_m2 >= 0).all()), f"{where}: a moment of inertia is below 0", "give moments")
        speeds = np.concatenate([self.velocity_m_s, self.spin_rad_s])
        require(bool((np.abs(speeds) <= FASTEST).all()), f"{where} is faster than anything", "give m/s and rad/s")


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
class RigidScene:
    """Bodies, drives, gravity (3,), and notes: what the file asks for and nobody does, by name."""

    bodies: tuple[RigidBody, ...]
    drives: tuple[SpeedDrive, ...]
    gravity_m_s2: Array
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check the fields."""
        store(self, gravity_m_s2=frozen_array(self.gravity_m_s2, float, (3,), "gravity"))
