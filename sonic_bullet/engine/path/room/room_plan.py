"""What a log is rendered with so that a room is heard: more sensors, what of them is summed, and filters of the sums.

sensors: own | images of each microphone | four far ones
rows = mixing @ channels: own, with images whose walls are the same at all frequencies | early: those of g reflections
    for each own channel | far
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sonic_bullet.engine.path.room.image_microphones import find_images, mirror_microphone, own_channels
from sonic_bullet.engine.path.room.late_field import TETRAHEDRON, early_filters, late_filters, reverberation_time_s
from sonic_bullet.engine.path.room.room_fit import RoomPlace, place_room
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array, Microphone, Sensor, ShoeboxRoom, channels_of


@dataclass(frozen=True, slots=True, eq=False)
class RoomPlan:
    """sensors, mixing (rows, channels of them); channels: own; early (g, t), late (channels, far, t): filters.

    begin_s: when the late field begins, t60_s: the longest; note: what a user should read. walls (k, 4): its planes, a
    unit vector and its product with them; largest_m2: a face of a body that is larger is a wall of the room.
    """

    sensors: tuple[Sensor, ...]
    mixing: Array
    channels: int
    early: Array
    late: Array
    begin_s: float
    t60_s: float
    note: str
    walls: Array = field(default_factory=lambda: np.zeros((0, 4)))
    largest_m2: float = 4.0  # of a room of unknown size, larger faces are its own: a table for ten

    @property
    def taps(self) -> int:
        """Length of the longest filter."""
        return int(max(1, self.early.shape[-1] * bool(len(self.early)), self.late.shape[-1]))

    def ring_s(self, tail_db: float) -> float:
        """Compute how long the room rings on until it is tail_db lower."""
        return self.begin_s + self.t60_s * -tail_db / 60


def plan_room(room: ShoeboxRoom, log: ContactLog) -> RoomPlan:
    """Plan a room for a log. Raises SceneError where it is too small, AudioError where pyroomacoustics is missing."""
    own = own_channels(log.sensors)
    place = place_room(room, log, [one for one, _ in own])
    channels = channels_of(log.sensors)
    t60_s = reverberation_time_s(room, log.air)
    # How far Eyring's law has fallen when the images end, at the latest: else those of absorbing walls, which fall more
    # slowly [Kuttruff 2000, eq. 5.41], are all that T60 is read from.
    echo_db = 10.0
    radius_m = _early_radius_m(room, place, own, log.air.sound_speed_m_s * float(t60_s.max()) * echo_db / 60)
    images = find_images(room, place.corner_m, place.centre_m, radius_m)
    flat = len(room.absorption) == 1
    orders = np.unique(images.order)
    rows = channels * (1 if flat else 1 + len(orders)) + len(TETRAHEDRON)
    sensors: list[Sensor] = list(log.sensors)
    parts = [np.eye(rows, channels)]
    for sign, offset_m, order in zip(*images, strict=True):
        kept = (1 - room.absorption[0]) ** (order / 2) if flat else 1.0
        begin = 0 if flat else channels * (1 + int(np.searchsorted(orders, order)))
        for microphone, at in own:
            image, signs = mirror_microphone(microphone, np.diag(sign), offset_m)
            sensors.append(image)
            part = np.zeros((rows, len(signs)))
            part[begin + at + np.arange(len(signs)), np.arange(len(signs))] = kept * signs
            parts.append(part)
    for k, direction in enumerate(TETRAHEDRON):
        sensors.append(Microphone(place.centre_m + radius_m * direction))
        part = np.zeros((rows, 1))
        part[rows - len(TETRAHEDRON) + k] = radius_m
        parts.append(part)
    begin_s = radius_m / log.air.sound_speed_m_s
    late = late_filters(room, log.air, own, channels, log.sr, begin_s)
    early = np.zeros((0, 1)) if flat else early_filters(room, orders, log.sr)
    t60 = ", ".join(f"{one:.2f}" for one in t60_s)
    size, corner = (" x ".join(f"{x:g}" for x in one) for one in (room.size_m, np.round(place.corner_m, 3) + 0.0))
    note = f"room of {size} m from {corner.replace(' x ', ', ')}: T60 {t60} s by Eyring"
    return RoomPlan(
        tuple(sensors), np.concatenate(parts, axis=1), channels, early, late, begin_s, float(t60_s.max()), note,
        _walls(room, place), float(np.sort(room.size_m)[:2].prod()) / 2,
    )  # fmt: skip


def _walls(room: ShoeboxRoom, place: RoomPlace) -> Array:
    """List the planes (6, 4) of the walls."""
    low = np.column_stack([np.eye(3), place.corner_m])
    return np.concatenate([low, np.column_stack([np.eye(3), place.corner_m + room.size_m])])


def _early_radius_m(
    room: ShoeboxRoom, place: RoomPlace, own: Sequence[tuple[Microphone, int]], fallen_m: float
) -> float:
    """Find how far away images are followed: `images` of them, or to fallen_m, but beyond all that sounds and hears."""
    # Images that are followed, on average over places: up to 22 ms in 72 m³, where the echoes come too close to be told
    # apart at 20 V/S + 12 = 25 ms [Lindau, Kosanke, Weinzierl, J. Audio Eng. Soc. 60(11), 2012, eq. 8]. Each costs 4 %
    # of a table-top.
    images = 24
    dense_m = (3 * images * float(np.prod(room.size_m)) / (4 * np.pi)) ** (1 / 3)
    places = [one.position_m[None] if one.path is None else one.path.position_m for one, _ in own]
    away_m = max((float(np.linalg.norm(at - place.centre_m, axis=1).max()) for at in places), default=0.0)
    return float(max(min(dense_m, max(fallen_m, away_m + place.reach_m)), 2 * place.reach_m))
