"""Where microphones are at each step's start, and where each will be when it hears what a body sends then.

    path: straight between its times | body: its pose at the step's start | fixed
    M*(t; b) = M(t + D), |M* - x_b(t)| = c D     by fixed point: each round leaves |v|/c of the error

The path (propagation) counts delay from when a sound is sent. With M* for the microphone's place the delay is that of a
moving listener to the letter, (1 + v/c) and not 1/(1 - v/c) [Pierce 1989, sec. 9-1 has both]. A body's later poses are
not known: its microphone flies on with the velocity of the step that begins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from sonic_bullet.engine.path.room.image_microphones import turned_image
from sonic_bullet.records import Array, Microphone
from sonic_bullet.records.errors import AudioError
from sonic_bullet.signal.elementary import arccos, matrix_product, sin

FIXED_POINT_ROUNDS = 8
"""Of the fixed point: 1e-8 of the first guess's error at a tenth of the speed of sound."""


class ReceiverPlaces(NamedTuple):
    """Microphones (c) at starts of steps (k): position_m, velocity_m_s (k, c, 3), quaternion_xyzw (k, c, 4)."""

    position_m: Array
    velocity_m_s: Array
    quaternion_xyzw: Array


def follows(microphones: Sequence[Microphone], bodies: Sequence[tuple[int, int]]) -> Array:
    """Find (c,) which of the bodies, by (body_id, link), each microphone moves with; -1: none. Raises AudioError."""
    found = np.full(len(microphones), -1)
    for c, microphone in enumerate(microphones):
        if microphone.body_id is None:
            continue
        key = (microphone.body_id, microphone.link)
        if key not in bodies:
            link = "" if key[1] < 0 else f" link {key[1]}"
            raise AudioError(
                f"microphone {c} moves with body {key[0]}{link}, which was not added or is gone",
                "add that body before the first step",
            )
        found[c] = bodies.index(key)
    return found


def place_receivers(
    microphones: Sequence[Microphone], leads: Array, time_s: Array, position_m: Array, quaternion_xyzw: Array
) -> ReceiverPlaces:
    """Place microphones at starts of steps time_s (k + 1,) but the last, with poses of bodies (k + 1, b, ·).

    leads: `follows`.
    """
    count = len(time_s)
    place, turned = np.empty((count, len(microphones), 3)), np.empty((count, len(microphones), 4))
    for c, one in enumerate(microphones):
        if one.path is not None:
            for axis in range(3):
                place[:, c, axis] = np.interp(time_s, one.path.time_s, one.path.position_m[:, axis])
            turned[:, c] = _turned_on_path(one, time_s)
        elif leads[c] >= 0:
            pose = quaternion_xyzw[:, leads[c]]
            place[:, c] = position_m[:, leads[c]] + rotate(pose, one.position_m)
            turned[:, c] = multiply(pose, one.quaternion_xyzw)
        else:
            place[:, c], turned[:, c] = one.position_m, one.quaternion_xyzw
    span = np.maximum(np.diff(time_s), 1e-12)[:, None, None]
    return ReceiverPlaces(place[:-1], np.diff(place, axis=0) / span, turned[:-1])


def with_reflections(places: ReceiverPlaces, reflections: Mapping[int, tuple[int, Array, Array]]) -> ReceiverPlaces:
    """Put microphones where they are images of others: of each its number, that of the other, matrix, shift."""
    for c, (own, matrix, shift_m) in reflections.items():
        places.position_m[:, c] = matrix_product(places.position_m[:, own], matrix.T) + shift_m
        places.velocity_m_s[:, c] = matrix_product(places.velocity_m_s[:, own], matrix.T)
        places.quaternion_xyzw[:, c] = turned_image(places.quaternion_xyzw[:, own], matrix)
    return places


def aim_at(
    microphones: Sequence[Microphone], places: ReceiverPlaces, time_s: Array, position_m: Array, speed_m_s: float
) -> Array:
    """Compute (k, b, c, 3) where each microphone will be when it hears what bodies at (k, b, 3) send at time_s."""
    aim = np.broadcast_to(places.position_m[:, None], (*position_m.shape[:2], len(microphones), 3)).copy()
    for c, one in enumerate(microphones):
        if not one.moves:
            continue
        for _ in range(FIXED_POINT_ROUNDS):
            late_s = np.linalg.norm(aim[:, :, c] - position_m, axis=-1) / speed_m_s
            if one.path is not None:
                for axis in range(3):
                    arrival_s = time_s[:, None] + late_s
                    aim[:, :, c, axis] = np.interp(arrival_s, one.path.time_s, one.path.position_m[:, axis])
            else:
                flown = places.velocity_m_s[:, None, c] * late_s[:, :, None]
                aim[:, :, c] = places.position_m[:, None, c] + flown
    return aim


def _turned_on_path(one: Microphone, time_s: Array) -> Array:
    """Interpolate (k, 4) how a microphone is turned at times: along the shorter arc between two of its path's."""
    path = one.path
    if path is None or path.quaternion_xyzw is None:
        return np.broadcast_to(one.quaternion_xyzw, (len(time_s), 4))
    at = np.clip(np.searchsorted(path.time_s, time_s, side="right") - 1, 0, len(path.time_s) - 1)
    after = np.minimum(at + 1, len(path.time_s) - 1)
    length = np.where(after > at, path.time_s[after] - path.time_s[at], 1.0)
    part = np.clip((time_s - path.time_s[at]) / length, 0, 1)[:, None]
    first, last = path.quaternion_xyzw[at], path.quaternion_xyzw[after]
    last = np.where((first * last).sum(axis=1, keepdims=True) < 0, -last, last)
    between = arccos(np.clip((first * last).sum(axis=1, keepdims=True), -1, 1))
    small = between < 1e-6
    whole = np.where(small, 1, sin(between))
    weight = np.where(small, 1 - part, sin((1 - part) * between) / whole)
    turned = weight * first + np.where(small, part, sin(part * between) / whole) * last
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def rotate(quaternion_xyzw: Array, vector: Array) -> Array:
    """Turn vectors (…, 3) by quaternions (…, 4)."""
    axis, real = quaternion_xyzw[..., :3], quaternion_xyzw[..., 3:]
    twice = 2 * _cross(axis, vector)
    return np.asarray(vector + real * twice + _cross(axis, twice))


def _cross(a: Array, b: Array) -> Array:
    """Compute the bits of np.cross, which takes ten times as long for few vectors."""
    (ax, ay, az), (bx, by, bz) = ((v[..., 0], v[..., 1], v[..., 2]) for v in (a, b))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def turn_back(quaternion_xyzw: Array, vector: Array) -> Array:
    """Express vectors (…, 3) of the world in frames turned by quaternions (…, 4)."""
    return rotate(quaternion_xyzw * [-1, -1, -1, 1], vector)


def multiply(first: Array, second: Array) -> Array:
    """Compose the turn ``second`` (…, 4) and then ``first`` (…, 4)."""
    a, b = first[..., :3], second[..., :3]
    real = first[..., 3:] * second[..., 3:] - (a * b).sum(axis=-1, keepdims=True)
    return np.concatenate([first[..., 3:] * b + second[..., 3:] * a + np.cross(a, b), real], axis=-1)
