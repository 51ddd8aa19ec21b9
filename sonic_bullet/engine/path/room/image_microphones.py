"""Microphones mirrored at the walls of a box: what one hears is what a wall sends to the one that it mirrors.

    |x_s - M_i| = |S_i x_s + o_i - x_m|,   M_i = S_i (x_m - o_i),   p = Σ_i β^n_i p(M_i),   β² = 1 - α
        [Allen & Berkley, JASA 65(4), 1979, eq. 8-10; β of one sign: rigid walls that lose energy]

S_i: 1 or -1 along each axis, n_i: reflections, α: the fraction of energy that a wall keeps. A source's direction, and
the directions that a microphone hears from, are mirrored likewise, so that what radiates or hears in a direction does.

Turned by Q, with ears or axes of its own, a microphone hears v = Q⁻¹S u from u. Where det S = 1 that is one turned by
SQ; else one turned by S Q S_y whose left and right are exchanged, S_y v: of ambisonics Y_lm changes sign for m < 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from sonic_bullet.machine.identity_cache import WhileAlive
from sonic_bullet.records import Ambisonics, Array, Binaural, Head, Microphone, ShoeboxRoom
from sonic_bullet.records.errors import AudioError

LEFT_RIGHT = np.diag([1.0, -1.0, 1.0])


class Images(NamedTuple):
    """Images of a point in a box, the point itself not among them: sign, offset (i, 3), reflections (i,)."""

    sign: Array
    offset_m: Array
    order: Array


def find_images(room: ShoeboxRoom, corner_m: Array, centre_m: Array, radius_m: float) -> Images:
    """Find images of points of a room at which ``centre_m`` (3,) lies within radius_m of its own image.

    Raises AudioError where pyroomacoustics is missing.
    """
    extra = "pip install 'sonic_bullet[room]'"
    try:
        import pyroomacoustics
    except ImportError:
        raise AudioError("a room needs pyroomacoustics, which is not installed", extra) from None
    size, inside = room.size_m, np.asarray(centre_m - corner_m)
    most = int(np.ceil(radius_m / size).sum())
    box = pyroomacoustics.ShoeBox(size, fs=48_000, materials=pyroomacoustics.Material(0.5), max_order=most)
    box.add_source(inside)
    box.add_microphone(size / 2)
    box.image_source_model()
    found = box.sources[0]
    sign = np.where(found.orders_xyz.T % 2 == 0, 1.0, -1.0)
    images = found.images.T.astype(float)
    offset = 2 * size * np.round((images - sign * inside) / (2 * size))  # exact: its places are 32 bit
    near = (np.linalg.norm(sign * inside + offset - inside, axis=1) <= radius_m) & (found.orders > 0)
    order = np.argsort(found.orders[near], kind="stable")
    sign, offset = sign[near][order], offset[near][order]
    return Images(sign, offset + corner_m - sign * corner_m, found.orders[near][order])


def mirror_microphone(microphone: Microphone, reflection: Array, offset_m: Array) -> tuple[Microphone, Array]:
    """Make the image x -> reflection (3, 3) · x + offset_m of a microphone, and the signs (channels,) of its channels.

    One that moves with a body has its own place still: its image is that of where it is then.
    """

    def place(position_m: Array) -> Array:
        return np.asarray(position_m @ reflection.T + offset_m)

    path, turned = microphone.path, microphone.quaternion_xyzw
    odd = bool(np.linalg.det(reflection) < 0)
    if path is not None:
        also = None if path.quaternion_xyzw is None else turned_image(path.quaternion_xyzw, reflection)
        path = replace(path, position_m=place(path.position_m), quaternion_xyzw=also)
    at: Any = None if path is not None else place(microphone.position_m)
    if microphone.body_id is None:
        turned = turned_image(turned, reflection)
    else:
        at = microphone.position_m
    made = replace(microphone, directivity=False, path=path, position_m=at, quaternion_xyzw=turned)
    signs = np.ones(microphone.channels)
    if odd and isinstance(made, Binaural):
        made = replace(made, head=_exchange_ears(made.head))
    elif odd and isinstance(made, Ambisonics):
        degree = np.floor(np.sqrt(np.arange(made.channels))).astype(int)
        signs[np.arange(made.channels) < degree * (degree + 1)] = -1.0
    return made, signs


@WhileAlive
def _exchange_ears(head: Head) -> Head:
    """Exchange left and right of the directions that a head was measured at; one head, one image of it."""
    return replace(head, direction=head.direction @ LEFT_RIGHT)


def turned_image(quaternion_xyzw: Array, reflection: Array) -> Array:
    """Turn quaternions (…, 4) as an image is turned."""
    from scipy.spatial.transform import Rotation

    matrix = reflection @ Rotation.from_quat(quaternion_xyzw).as_matrix()
    odd = bool(np.linalg.det(reflection) < 0)
    return np.asarray(Rotation.from_matrix(matrix @ LEFT_RIGHT if odd else matrix).as_quat())


def own_channels(sensors: Sequence[object]) -> list[tuple[Microphone, int]]:
    """List the microphones among sensors, and the first channel of each."""
    found, at = [], 0
    for one in sensors:
        if isinstance(one, Microphone):
            found.append((one, at))
        at += one.channels if isinstance(one, Microphone) else 1
    return found
