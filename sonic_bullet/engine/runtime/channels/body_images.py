"""Which faces mirror bodies, and at which image microphones their sound is heard.

bodies that come -> flat faces of those that do not move, in the world -> each microphone before one
    -> a free place among its images: IMAGE, the image microphone's place -> the engine's image_gains
a body that leaves -> its images are silent, and their places free
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet._engine import IMAGE
from sonic_bullet.engine.path.images.image_sensors import MOST_FACES, reflection, with_image_sensors
from sonic_bullet.engine.path.room.image_microphones import mirror_microphone
from sonic_bullet.engine.path.space.receiver_places import rotate
from sonic_bullet.records import Air, Array, Body, Material, Microphone, Sensor, channels_of

if TYPE_CHECKING:
    from sonic_bullet.engine.runtime.synthesis_state import Setup, State
    from sonic_bullet.records.contacts import Step


@dataclass(slots=True, eq=False)
class BodyImages:
    """Images (c,) IMAGE, (0,) without any; has_image (b,): 1 where a body may have images."""

    images: Array = field(default_factory=lambda: np.zeros(0, IMAGE))
    has_image: Array = field(default_factory=lambda: np.zeros(0, np.int64))

    def subset(self, keep: Array) -> None:
        """Keep the bodies (k,) of these numbers alone; no other has an active image."""
        if len(self.has_image):
            number = np.zeros(len(self.has_image), np.int64)
            number[keep] = np.arange(len(keep))
            self.images["owner"] = number[self.images["owner"]]
            self.has_image = self.has_image[keep]

    def copy(self) -> BodyImages:
        """Return an independent copy."""
        return BodyImages(self.images.copy(), self.has_image.copy())


def complete_setup(setup: Setup, *, image: bool) -> Setup:
    """Return a setup with the mixing of its room, and, where asked for, image microphones behind its sensors."""
    room = setup.room
    mixing = None if room is None else room.mixing
    own = own_sensors(setup)
    count = sum(isinstance(one, Microphone) for one in own)
    if image and count:
        sensors, mixing = with_image_sensors(setup.sensors, len(own), mixing)
        setup = replace(setup, sensors=sensors, imaged=count)
    return replace(setup, mixing=mixing)


def start_images(setup: Setup) -> BodyImages:
    """Return images of a setup, none of which has a face."""
    count = sum(isinstance(one, Microphone) for one in setup.sensors) if setup.imaged else 0
    images = np.zeros(count, IMAGE)
    images["own"] = -1
    if count:
        images["own"][-MOST_FACES * setup.imaged :] = np.tile(np.arange(setup.imaged), MOST_FACES)
    return BodyImages(images)


def own_sensors(setup: Setup) -> list[Sensor]:
    """List the sensors without images of them and those of a room."""
    sensors = setup.sensors[: len(setup.sensors) - MOST_FACES * setup.imaged]
    if setup.room is None:
        return list(sensors)
    after = np.cumsum([channels_of([one]) for one in sensors])
    return list(sensors[: int(np.searchsorted(after, setup.room.channels)) + 1])


def own_microphones(setup: Setup) -> list[Microphone]:
    """List the microphones among `own_sensors`."""
    return [one for one in own_sensors(setup) if isinstance(one, Microphone)]


def admit_faces(setup: Setup, state: State, step: Step, coming: Sequence[Body], poses: tuple[Array, Array]) -> None:
    """Free images of bodies that are no longer in a step, and give those to faces of bodies that come at poses (k, ·).

    The tables hold the bodies that come, as their last.
    """
    if not setup.imaged:
        return
    held = state.images
    more = np.array([body.mounting != "on floor" for body in coming], np.int64)
    held.has_image = np.concatenate([held.has_image, more])
    images, first = held.images, len(state.body)
    stays = np.append(np.isin(state.body, step.body), [True] * (1 + len(coming)))
    images["active"] &= stays[images["owner"]]
    for k, body in enumerate(coming):
        if body.mass_kg != 0 or not len(body.flat_faces_m):
            continue
        place, turned = poses[0][k], poses[1][k]
        for face in body.flat_faces_m[np.argsort(-_area_m2(body.flat_faces_m), kind="stable")]:
            centre, sides = place + rotate(turned, face[0]), rotate(turned, face[1:])
            across = np.cross(*sides)
            normal = across / np.linalg.norm(across)
            if _is_wall(setup, normal, float(normal @ centre), 4 * float(np.linalg.norm(across))):
                continue
            for c, microphone in enumerate(own_microphones(setup)):
                before = microphone.moves or normal @ (microphone.position_m - centre) >= 0
                free = np.flatnonzero((images["own"] == c) & (images["active"] == 0))
                if before and len(free):
                    row, half_m = images[free[0] : free[0] + 1], np.linalg.norm(sides, axis=1)
                    row["active"], row["owner"], row["normal"], row["offset_m"] = 1, first + k, normal, normal @ centre
                    row["centre_m"], row["axis"], row["half_m"] = centre, sides / half_m[:, None], half_m
                    row["admittance"] = specific_admittance(body.material, setup.air)
                    row["position_m"], row["quaternion_xyzw"] = place, turned
                    _place_image(setup, state, microphone, int(free[0]), normal, float(normal @ centre))
    state.mark_changed()


def _place_image(setup: Setup, state: State, microphone: Microphone, number: int, normal: Array, at_m: float) -> None:
    """Put image microphone ``number`` where it mirrors its own."""
    matrix, shift = reflection(normal, at_m)
    image = mirror_microphone(microphone, matrix, shift)[0]
    place = state.path.microphone_m.copy()
    place[number] = image.position_m
    state.path = replace(state.path, microphone_m=place)
    if state.space is not None:
        sensors = list(state.space.sensors)
        sensors[len(sensors) - len(place) + number] = image
        state.space.sensors = tuple(sensors)
        if microphone.body_id is not None:
            own = int(state.images.images["own"][number])
            state.space.reflections = {**state.space.reflections, number: (own, matrix, shift)}


def _is_wall(setup: Setup, normal: Array, offset_m: float, area_m2: float) -> bool:
    """Return whether a face is one of the room's own walls, or lies on one."""
    on_wall_m = 0.05  # what lies flat on a wall of a room is mirrored by it: a board on the floor
    room = setup.room
    if room is None:
        return False
    sign = room.walls[:, :3] @ normal
    on = (abs(sign) > 1 - 1e-3) & (abs(sign * offset_m - room.walls[:, 3]) < on_wall_m)
    return bool(area_m2 > room.largest_m2 or on.any())


def specific_admittance(material: Material | None, air: Air) -> float:
    """Compute β = ρ₀c₀/(ρ c_P) of a half-space, ρ c_P² = K + 4G/3; 0 of a rigid one [Pierce 1989, sec. 3-3]."""
    if material is None:
        return 0.0
    stiff_pa = material.bulk_pa + 4 / 3 * material.shear_pa
    return float(air.density_kg_m3 * air.sound_speed_m_s / np.sqrt(material.density_kg_m3 * stiff_pa))


def _area_m2(faces_m: Array) -> Array:
    return np.asarray(np.linalg.norm(np.cross(faces_m[:, 1], faces_m[:, 2]), axis=1))
