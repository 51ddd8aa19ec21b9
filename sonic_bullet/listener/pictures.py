"""What draws a scene: figures at poses, seen by a camera.

    Figure (triangles, colour) … -> open_pictures -> Pictures.picture(poses, Camera) -> (height, width, 3) uint8

PyBullet's own renderer is one (listener/pybullet/staged/picture_world.py), without a window or a graphics card; another
one answers `picture` and takes the place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sonic_bullet.records import Array, frozen_array
from sonic_bullet.records.arrays import require, store
from sonic_bullet.records.coerce import as_number

VIEW_DEG = 40.0
"""Height of a view, a 35 mm film's through a lens of 33 mm."""


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """A rigid thing to be drawn: vertex_m (v, 3) in its own frame, face (f, 3), counter-clockwise seen from outside,
    colour (3,): red, green, blue, 0 … 1.
    """

    vertex_m: Array
    face: Array
    colour: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Where pictures are taken from: eye_m, target_m (3,) in the world, z up; view_deg: height of the view."""

    eye_m: Array
    target_m: Array
    view_deg: float = VIEW_DEG

    def __post_init__(self) -> None:
        eye, target = (frozen_array(getattr(self, name), float, (3,), f"camera: {name}") for name in self.__slots__[:2])
        require(bool((eye != target).any()), "the camera looks at itself", "give it another place or target")
        view = as_number(self.view_deg, "camera: view_deg", "give degrees, 40 say", least=1, most=170)
        store(self, eye_m=eye, target_m=target, view_deg=view)

    def seen(self, place_m: Array) -> Array:
        """(k, 3) points of the world as the camera has them: to its right, up, and ahead, in m."""
        ahead = (self.target_m - self.eye_m) / np.linalg.norm(self.target_m - self.eye_m)
        right = np.cross(ahead, self.up)
        right = right / np.linalg.norm(right)
        return np.asarray((place_m - self.eye_m) @ np.array([right, np.cross(right, ahead), ahead]).T)

    @property
    def up(self) -> Array:
        """What is up in its pictures: z, or y where it looks along z."""
        ahead = self.target_m - self.eye_m
        return np.array([0.0, 1.0, 0.0] if np.linalg.norm(ahead[:2]) < 1e-6 * abs(ahead[2]) else [0.0, 0.0, 1.0])

    def focal(self, height: int) -> float:
        """Pixels that a thing as large as its distance covers, in pictures so high."""
        return float(height / 2 / np.tan(np.radians(self.view_deg) / 2))


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """A link of a world as it is: whose, its figure, its pose (body frame)."""

    body_id: int
    link: int
    name: str
    figure: Figure
    position_m: Array
    quaternion_xyzw: Array


class Pictures(Protocol):
    """Figures that are drawn wherever they are set."""

    def picture(self, position_m: Array, quaternion_xyzw: Array, shown: Array, camera: Camera) -> Array:
        """(height, width, 3) uint8 of all k figures at poses (k, 3), (k, 4); who is not shown (k,) is left out."""

    def close(self) -> None:
        """Give back what drawing takes."""


def open_pictures(
    figures: Sequence[Figure], size: tuple[int, int], *, shadows: bool = False, still: Array | None = None
) -> Pictures:
    """A world of figures to take pictures of, width and height in pixels. still (k,): who will stand as it is in all
    pictures, and before the same camera. Raises SceneError.
    """
    from sonic_bullet.listener.pybullet.staged.picture_world import PyBulletPictures

    return PyBulletPictures(figures, size, shadows, np.zeros(len(figures), bool) if still is None else still)


def standing_in(client_id: int) -> tuple[Standing, ...]:
    """All links of a PyBullet world that have a shape, as they stand now."""
    from sonic_bullet.listener.pybullet.staged.picture_world import standing

    return standing(client_id)
