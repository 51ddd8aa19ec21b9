"""Sensors and their medium: microphones, vibrometers, the plain sum of modes; air."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records.arrays import Array, frozen_array, require, store
from sonic_bullet.records.coerce import as_number, as_whole


@dataclass(frozen=True, slots=True, eq=False)
class Microphone:
    """A point that records pressure in Pa. position_m (3,): world frame, fixed."""

    position_m: Array

    def __post_init__(self) -> None:
        """Check the fields."""
        store(self, position_m=frozen_array(self.position_m, float, (3,), "microphone: position_m"))


@dataclass(frozen=True, slots=True, eq=False)
class Vibrometer:
    """Velocity in m/s of a body's surface at point_m (3,) along direction (3,), both in the body frame."""

    body_id: int
    point_m: Array
    direction: Array
    link: int = -1

    def __post_init__(self) -> None:
        """Check the fields and normalise the direction."""
        direction = frozen_array(self.direction, float, (3,), "vibrometer: direction")
        with np.errstate(over="ignore"):
            length = float(np.linalg.norm(direction))
        require(0 < length < np.inf, "vibrometer: direction is zero", "give the direction in which it looks")
        store(
            self,
            body_id=as_whole(self.body_id, "vibrometer: body_id", "give the body's id"),
            link=as_whole(self.link, "vibrometer: link", "give -1 (the base) or a link's number"),
            point_m=frozen_array(self.point_m, float, (3,), "vibrometer: point_m"),
            direction=frozen_array(direction / length, float, (3,), "vibrometer: direction"),
        )


@dataclass(frozen=True, slots=True, eq=False)
class ModalSum:
    """The plain sum of modes Σ a·e^{-dt}·sin(2πft), a = scale·Uᵀj for an impulse j in N·s.

    References
    ----------
    Ren et al. 2013, eq. 11, 13.
    """

    scale: float = 1.0

    def __post_init__(self) -> None:
        """Check the scale."""
        store(self, scale=as_number(self.scale, "modal sum: scale", "give a number"))


Sensor = Microphone | Vibrometer | ModalSum


@dataclass(frozen=True, slots=True)
class Air:
    """The medium: density and speed of sound."""

    density_kg_m3: float = 1.2
    sound_speed_m_s: float = 343.0

    def __post_init__(self) -> None:
        """Check the fields."""
        store(
            self,
            density_kg_m3=as_number(
                self.density_kg_m3, "air: density_kg_m3", "give kg/m³, above zero", above=0, below=1e4
            ),
            sound_speed_m_s=as_number(
                self.sound_speed_m_s, "air: sound_speed_m_s", "give m/s, above zero", above=0, below=1e5
            ),
        )
