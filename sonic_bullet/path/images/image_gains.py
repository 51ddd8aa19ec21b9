"""How loud the image of a body in a face is at a microphone, at an end of a step.

    g = R · F · Π_k (1 - F_k),   R = (cos θ - β)/(cos θ + β),   β = ρ₀c₀/(ρ c_P)      [Pierce 1989, eq. 3-3.4, 3-6.5]

x: the body's centre, M' the microphone's image, P where the line between them meets the face, θ: from its normal there.
F of a face: 1 well within its edges, a half on them, 0 beyond, over the width of the first zone of diffraction at
1 kHz, v = ±2√(δ/λ), + inwards of an edge; δ: how much longer the way over the edge is than the straight one
                                                                    [Maekawa 1968, Appl. Acoust. 1, 157: N = 2δ/λ]
    δ = √((ρ + ρ')² + a²) - |xM'|,   ρ, ρ': of x and M' from the edge's line, a: between them along it
F_k: of another face of the microphone that lies between, as a table-top is above a floor. A body has no image in its
own face, nor behind it; a face that moves has none.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.path.path_places import FARTHEST_M

IMAGE = np.dtype(
    [
        ("own", "i8"),  # the microphone that it is of; -1: it is an own one
        ("active", "i8"),  # 1: it has a face
        ("owner", "i8"),  # body whose face it is
        ("normal", "f8", (3,)),
        ("offset_m", "f8"),  # normal · x on the face
        ("centre_m", "f8", (3,)),
        ("axis", "f8", (2, 3)),  # along its sides
        ("half_m", "f8", (2,)),
        ("admittance", "f8"),  # over that of air
        ("position_m", "f8", (3,)),  # pose of the owner
        ("quaternion_xyzw", "f8", (4,)),
    ],
    align=True,
)
"""A microphone, in the order of the path's."""


@njit(nogil=True, error_model="numpy")
def _from_edge(face, k, side, point):  # pragma: no cover - compiled
    """Compute ρ of a point (3,) from the line of an edge of a face."""
    out, height = -side * face.half_m[k], -face.offset_m
    for axis in range(3):
        out += (point[axis] - face.centre_m[axis]) * face.axis[k, axis]
        height += point[axis] * face.normal[axis]
    return np.sqrt(out * out + height * height)


@njit(nogil=True, error_model="numpy")
def _within(face, one, other, at, length):  # pragma: no cover - compiled
    """Compute F of a face for the line between two points (3,), length apart, that meets its plane at ``at`` (3,)."""
    edge_wave_m = 0.343  # of 1 kHz, the middle of what is heard
    found = 1.0
    for k in range(2):
        across, along = 0.0, 0.0  # the crossing's place between the edges; the points' distance along them
        for axis in range(3):
            across += (at[axis] - face.centre_m[axis]) * face.axis[k, axis]
            along += (other[axis] - one[axis]) * face.axis[1 - k, axis]
        for side in (-1.0, 1.0):
            inwards = face.half_m[k] - side * across
            over = _from_edge(face, k, side, one) + _from_edge(face, k, side, other)
            longer = np.sqrt(over * over + along * along) - length
            v = 2.0 * np.sqrt((longer if longer > 0.0 else 0.0) / edge_wave_m)
            t = 0.5 + 0.5 * (v if inwards > 0.0 else -v)
            t = 0.0 if t < 0.0 else (1.0 if t > 1.0 else t)
            found *= t * t * (3.0 - 2.0 * t)
    return found


@njit(nogil=True, error_model="numpy")
def _passes(face, one, other, at):  # pragma: no cover - compiled
    """Compute 1 - F of a face for the line between two points (3,)."""
    near, far, length = -face.offset_m, -face.offset_m, 0.0
    for axis in range(3):
        near += face.normal[axis] * one[axis]
        far += face.normal[axis] * other[axis]
        length += (other[axis] - one[axis]) ** 2
    if near * far >= 0.0:
        return 1.0
    part = near / (near - far)
    for axis in range(3):
        at[axis] = one[axis] + part * (other[axis] - one[axis])
    return 1.0 - _within(face, one, other, at, np.sqrt(length))


@njit(nogil=True, error_model="numpy")
def _gain(b, c, position_m, image_m, images, work):  # pragma: no cover - compiled
    """Compute g of body b at position_m (3,) and image microphone c at image_m (3,)."""
    face, foot, place, at = images[c], work[0], work[1], work[2]
    height, depth, length = -face.offset_m, face.offset_m, 0.0
    for axis in range(3):
        height += face.normal[axis] * position_m[axis]
        depth -= face.normal[axis] * image_m[axis]
        length += (position_m[axis] - image_m[axis]) ** 2
    length = np.sqrt(length)
    if height <= 0.0 or depth < 0.0 or not length < FARTHEST_M:
        return 0.0
    part = height / (height + depth)
    for axis in range(3):
        foot[axis] = position_m[axis] + part * (image_m[axis] - position_m[axis])
        place[axis] = image_m[axis] + 2.0 * depth * face.normal[axis]
    cosine = (height + depth) / length
    found = _within(face, position_m, image_m, foot, length)
    found *= (cosine - face.admittance) / (cosine + face.admittance)
    for k in range(len(images)):
        other = images[k]
        if found != 0.0 and k != c and other.active == 1 and other.own == face.own and other.owner != b:
            found *= _passes(other, position_m, foot, at) * _passes(other, foot, place, at)
    return found


@njit(nogil=True, error_model="numpy")
def image_gains(slots, window, aim_m, microphone_m):  # pragma: no cover - compiled
    """Compute g (2, b, c) at both ends of a step, 1 of own microphones; (0, 0, 0) without images.

    slots: of the ends in the window, `groups.WindowTables`; aim_m: as `path_places.Course` has it.
    """
    images, bodies, channels = window.images, window.position_m.shape[1], len(microphone_m)
    if len(images) == 0:
        return np.zeros((0, 0, 0))
    found, work = np.ones((2, bodies, channels)), np.empty((3, 3))
    for end in range(2):
        position_m, turned = window.position_m[slots[end]], window.quaternion_xyzw[slots[end]]
        for c in range(channels):
            face = images[c]
            if face.own < 0:
                continue
            rests = face.active == 1
            if rests:
                for axis in range(3):
                    rests = rests and position_m[face.owner, axis] == face.position_m[axis]
                for axis in range(4):
                    rests = rests and turned[face.owner, axis] == face.quaternion_xyzw[axis]
            for b in range(bodies):
                found[end, b, c] = 0.0
                if rests and window.has_image[b] == 1 and b != face.owner:
                    image_m = aim_m[end, b, c] if len(aim_m) > 0 else microphone_m[c]
                    found[end, b, c] = _gain(b, c, position_m[b], image_m, images, work)
    return found
