"""Interface to draw a scene: meshes at poses, seen by a camera.

    ColouredMesh (triangles, colour) … -> open_pictures -> Pictures.picture(poses, Camera) -> (height, width, 3) uint8

PyBullet's own renderer is one (simulators/pybullet/staged/picture_world.py), without a window or a graphics card;
another renderer has to provide `picture`.
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
"""Angle of view along the height, that of a 35 mm film through a lens of 33 mm."""


@dataclass(frozen=True, slots=True, eq=False)
class ColouredMesh:
    """A rigid mesh to be drawn.

    Parameters
    ----------
    vertex_m : Array, shape (v, 3)
        In its own frame.
    face : Array, shape (f, 3)
        Counter-clockwise seen from outside.
    colour
        Red, green, blue, 0 … 1.
    """

    vertex_m: Array
    face: Array
    colour: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Position and view of a camera.

    Parameters
    ----------
    eye_m, target_m : Array, shape (3,)
        World frame, z up.
    view_deg
        Angle of view along the height.
    """

    eye_m: Array
    target_m: Array
    view_deg: float = VIEW_DEG

    def __post_init__(self) -> None:
        """Check and normalise the fields."""
        eye, target = (frozen_array(getattr(self, name), float, (3,), f"camera: {name}") for name in self.__slots__[:2])
        require(bool((eye != target).any()), "the camera looks at itself", "give it another place or target")
        view = as_number(self.view_deg, "camera: view_deg", "give degrees, 40 say", least=1, most=170)
        store(self, eye_m=eye, target_m=target, view_deg=view)

    def to_camera_axes(self, place_m: Array) -> Array:
        """Transform points (k, 3) of the world to the camera's axes: right, up, ahead, in m."""
        ahead = (self.target_m - self.eye_m) / np.linalg.norm(self.target_m - self.eye_m)
        right = np.cross(ahead, self.up)
        right = right / np.linalg.norm(right)
        return np.asarray((place_m - self.eye_m) @ np.array([right, np.cross(right, ahead), ahead]).T)

    @property
    def up(self) -> Array:
        """Upward axis of its pictures: z, or y where it looks along z."""
        ahead = self.target_m - self.eye_m
        return np.array([0.0, 1.0, 0.0] if np.linalg.norm(ahead[:2]) < 1e-6 * abs(ahead[2]) else [0.0, 0.0, 1.0])

    def focal(self, height: int) -> float:
        """Return the pixels that an object as large as its distance covers in pictures of that height."""
        return float(height / 2 / np.tan(np.radians(self.view_deg) / 2))


@dataclass(frozen=True, slots=True, eq=False)
class PlacedLink:
    """A link of a world with its mesh and its present pose (body frame)."""

    body_id: int
    link: int
    name: str
    mesh: ColouredMesh
    position_m: Array
    quaternion_xyzw: Array


class Pictures(Protocol):
    """A renderer of a fixed set of meshes."""

    def picture(self, position_m: Array, quaternion_xyzw: Array, shown: Array, camera: Camera) -> Array:
        """Draw the meshes at poses (k, 3), (k, 4) where shown (k,) is True; (height, width, 3) uint8."""

    def close(self) -> None:
        """Release the renderer."""


def open_pictures(
    meshes: Sequence[ColouredMesh], size: tuple[int, int], *, shadows: bool = False, still: Array | None = None
) -> Pictures:
    """Open a renderer of meshes.

    Parameters
    ----------
    meshes
    size
        Width and height in pixels.
    shadows
    still : Array of bool, shape (k,)
        Meshes that keep their pose, before the same camera, in all pictures.

    Raises
    ------
    SceneError
        A mesh cannot be drawn.
    """
    from sonic_bullet.simulators.pybullet.staged.picture_world import PyBulletPictures

    return PyBulletPictures(meshes, size, shadows, np.zeros(len(meshes), bool) if still is None else still)


def standing_in(client_id: int) -> tuple[PlacedLink, ...]:
    """List all links of a PyBullet world that have a shape, at their present poses."""
    from sonic_bullet.simulators.pybullet.staged.picture_world import list_links

    return list_links(client_id)
