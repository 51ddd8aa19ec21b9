"""What microphones need that move, have ears or stand in a room: a path in time, a head's responses, walls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.records.arrays import Array, frozen_array, require, store
from sonic_bullet.records.coerce import as_text, as_whole

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

AHEAD_XYZW = np.array([0.0, 0.0, 0.0, 1.0])
"""Turned nowhere: x is ahead, y left, z up, in the world as in ambiX and in SOFA files."""


def unit_quaternions(value: object, shape: tuple[int | None, ...], name: str) -> Array:
    """Normalise quaternions (…, 4), x, y, z, w; raises RecordError where one is zero."""
    turned = frozen_array(value, float, shape, name)
    length = np.linalg.norm(turned, axis=-1, keepdims=True)
    require(bool((length > 1e-12).all()), f"{name} is zero", "give x, y, z, w of a rotation; 0, 0, 0, 1 turns nothing")
    if (np.abs(length - 1) > 1e-12).any():
        turned = np.asarray(turned / length)
        turned.setflags(write=False)
    return turned


@dataclass(frozen=True, slots=True, eq=False)
class MicrophonePath:
    """Path of a microphone.

    time_s (t,): ascending; position_m (t, 3): in the world; quaternion_xyzw (t, 4): how
    it is turned, None: as its microphone says. Straight between two times, at rest before the first and after the last.
    """

    time_s: Array
    position_m: Array
    quaternion_xyzw: Array | None = None

    if TYPE_CHECKING:  # what may be passed: the fields hold read-only arrays of it

        def __init__(
            self, time_s: ArrayLike, position_m: ArrayLike, quaternion_xyzw: ArrayLike | None = None
        ) -> None: ...

    def __post_init__(self) -> None:
        """Check the fields."""
        time_s = frozen_array(self.time_s, float, (None,), "microphone path: time_s")
        require(len(time_s) > 0, "microphone path: time_s is empty", "give at least one time and place")
        require(
            bool((np.diff(time_s) > 0).all()),
            "microphone path: time_s does not ascend",
            "sort its rows by time, each time once",
        )
        store(self, time_s=time_s)
        store(self, position_m=frozen_array(self.position_m, float, (len(time_s), 3), "microphone path: position_m"))
        if self.quaternion_xyzw is not None:
            turned = unit_quaternions(self.quaternion_xyzw, (len(time_s), 4), "microphone path: quaternion_xyzw")
            store(self, quaternion_xyzw=turned)


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Head:
    """Responses of a head's two ears to sound from far away.

    response (d, 2, n), left and right, at sr Hz, over the
    pressure at its middle without it; direction (d, 3): where the sound comes from, x ahead, y left, z up.
    """

    direction: Array
    response: Array
    sr: int
    name: str = "head"

    if TYPE_CHECKING:  # what may be passed: the fields hold read-only arrays of it

        def __init__(self, direction: ArrayLike, response: ArrayLike, sr: int, name: str = "head") -> None: ...

    def __post_init__(self) -> None:
        """Check the fields."""
        direction = frozen_array(self.direction, float, (None, 3), "head: direction")
        require(len(direction) > 0, "head: direction is empty", "give the responses of at least one direction")
        length = np.linalg.norm(direction, axis=1, keepdims=True)
        require(bool((length > 0).all()), "head: direction holds a zero vector", "give where each sound comes from")
        unit = direction if (np.abs(length - 1) < 1e-12).all() else np.asarray(direction / length)
        unit.setflags(write=False)
        response = frozen_array(self.response, float, (len(unit), 2, None), "head: response")
        require(response.shape[2] > 0, "head: response is empty", "give at least one sample")
        store(
            self,
            direction=unit,
            response=response,
            sr=as_whole(self.sr, "head: sr", "give the rate in Hz", least=1000, most=1_000_000),
            name=as_text(self.name, "head: name", "give a text"),
        )


@dataclass(frozen=True, slots=True, eq=False)
class ShoeboxRoom:
    """A box around a scene, whose walls send sound back.

    size_m (3,): along x, y and z; absorption (b,): the fraction of energy that all walls keep, above 0 and at most 1,
    one number, or one an octave from 125 Hz on, the last for all above; corner_m (3,): its corner of least x, y and z,
    None: round what sounds and hears, its floor beneath.
    """

    size_m: Array
    absorption: Array = 0.2  # type: ignore[assignment]  # a number stands for all octaves
    corner_m: Array | None = None

    if TYPE_CHECKING:  # what may be passed: the fields hold read-only arrays of it

        def __init__(
            self, size_m: ArrayLike, absorption: ArrayLike = 0.2, corner_m: ArrayLike | None = None
        ) -> None: ...

    def __post_init__(self) -> None:
        """Check the fields."""
        least_room_m, most_room_m = 0.1, 200.0  # A box for shoes, and the nave of a cathedral
        most_octaves = 8  # 125 Hz to 16 kHz
        size = frozen_array(self.size_m, float, (3,), "room: size_m")
        remedy = "give metres along x, y and z, such as 6, 4, 3"
        require(bool((size >= least_room_m).all() and (size <= most_room_m).all()), "room: size_m is no room's", remedy)
        alpha = frozen_array(_numbers(self.absorption), float, (None,), "room: absorption")
        octaves = f"give one number above 0 and at most 1, or up to {most_octaves}, one an octave from 125 Hz on"
        require(0 < len(alpha) <= most_octaves, f"room: absorption has {len(alpha)} numbers", octaves)
        require(bool(((alpha > 0) & (alpha <= 1)).all()), "room: absorption is not above 0 and at most 1", octaves)
        store(self, size_m=size, absorption=alpha)
        if self.corner_m is not None:
            store(self, corner_m=frozen_array(self.corner_m, float, (3,), "room: corner_m"))


@dataclass(frozen=True, slots=True, eq=False)
class RoomResponse:
    """Measured impulse response of a room, from a source to a microphone in it.

    response (c, n) at sr Hz, of any scale: what follows its direct sound is added, over that. c is 1, for all channels
    of a render, or one a channel.
    """

    response: Array
    sr: int
    name: str = "response"

    if TYPE_CHECKING:  # what may be passed: the fields hold read-only arrays of it

        def __init__(self, response: ArrayLike, sr: int, name: str = "response") -> None: ...

    def __post_init__(self) -> None:
        """Check the fields."""
        longest_response_s = 30.0  # A mausoleum's
        name = as_text(self.name, "room response: name", "give a text")
        sr = as_whole(self.sr, "room response: sr", "give the rate in Hz", least=1000, most=1_000_000)
        response = frozen_array(self.response, float, (None, None), "room response: response")
        require(response.shape[0] > 0, "room response: response has no channel", "give at least one channel")
        silent = not response.shape[1] or not np.abs(response).max(axis=1).all()
        require(not silent, "room response: response is silent", "give the room's impulse response")
        short = response.shape[1] <= longest_response_s * sr
        require(short, f"room response: response lasts over {longest_response_s:g} s", "give an impulse response alone")
        store(self, response=response, sr=sr, name=name)


def _numbers(value: object) -> object:
    """Let one number be a list of one."""
    return [value] if isinstance(value, (int, float)) and not isinstance(value, bool) else value
