"""Sensors and their medium: microphones, vibrometers, the plain sum of modes; air."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.records.arrays import Array, frozen_array, require, store
from sonic_bullet.records.coerce import as_flag, as_kind, as_number, as_whole
from sonic_bullet.records.receivers import AHEAD_XYZW, Head, MicrophonePath, unit_quaternions
from sonic_bullet.records.touching.sensor_response import SensorResponse

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True, slots=True, eq=False)
class Microphone:
    """A point that records pressure in Pa.

    position_m (3,): in the world, fixed; with body_id in the frame of that body, with which it moves; None with a path:
    where that begins. quaternion_xyzw (4,): how it is turned there, which matters to ambisonics and heads alone.
    directivity: whether a mode sounds as its pressure is on this side of the body, or as its mean over all directions.
    """

    position_m: Array = None  # type: ignore[assignment]  # a path's first, in its stead
    quaternion_xyzw: Array = field(default_factory=lambda: AHEAD_XYZW)
    body_id: int | None = None
    link: int = -1
    path: MicrophonePath | None = None
    directivity: bool = False

    if TYPE_CHECKING:  # what may be passed: the fields hold read-only arrays of it

        def __init__(
            self,
            position_m: ArrayLike | None = None,
            quaternion_xyzw: ArrayLike = ...,
            body_id: int | None = None,
            link: int = -1,
            path: MicrophonePath | None = None,
            directivity: bool = False,
        ) -> None: ...

    def __post_init__(self) -> None:
        """Check the fields."""
        store(self, directivity=as_flag(self.directivity, "microphone: directivity"))
        path, remedy = self.path, "give one of position_m, in the world or in a body's frame, and path"
        if path is not None:
            path = as_kind(path, MicrophonePath, "microphone: path", "give a MicrophonePath(time_s, position_m)")
            given = path.position_m[0] if self.position_m is None else self.position_m
            require(np.array_equal(given, path.position_m[0]), "microphone: it has two places", remedy)
            require(self.body_id is None, "microphone: it follows both a path and a body", "give one of both")
        require(path is not None or self.position_m is not None, "microphone: it has no place", remedy)
        place = self.position_m if path is None else path.position_m[0]
        store(
            self,
            position_m=frozen_array(place, float, (3,), "microphone: position_m"),
            quaternion_xyzw=unit_quaternions(self.quaternion_xyzw, (4,), "microphone: quaternion_xyzw"),
            body_id=None
            if self.body_id is None
            else as_whole(self.body_id, "microphone: body_id", "give the id of the body that it moves with"),
            link=as_whole(self.link, "microphone: link", "give -1 (the base) or a link's number"),
        )

    @property
    def moves(self) -> bool:
        """Return whether it may be elsewhere at another time."""
        return self.path is not None or self.body_id is not None

    @property
    def channels(self) -> int:
        """Number of channels."""
        return 1


@dataclass(frozen=True, slots=True, eq=False)
class Ambisonics(Microphone):
    """A point that hears where sound comes from: (order + 1)² channels of ambiX.

    Their order is ACN, their weights are SN3D, so that the first is a `Microphone` there. Order 1 to 3; axes: x ahead,
    y left, z up, turned by quaternion_xyzw.
    """

    order: int = 1

    if TYPE_CHECKING:  # what may be passed: the fields hold read-only arrays of it

        def __init__(
            self,
            position_m: ArrayLike | None = None,
            quaternion_xyzw: ArrayLike = ...,
            body_id: int | None = None,
            link: int = -1,
            path: MicrophonePath | None = None,
            directivity: bool = False,
            order: int = 1,
        ) -> None: ...

    def __post_init__(self) -> None:
        """Check the fields."""
        most_order = 3  # of ambisonics: the microphone arrays that are sold, and most players, end there
        Microphone.__post_init__(self)
        remedy = f"give 1, 2 or {most_order}"
        store(self, order=as_whole(self.order, "ambisonics: order", remedy, least=1, most=most_order))

    @property
    def channels(self) -> int:
        """Number of channels."""
        return (self.order + 1) ** 2


@dataclass(frozen=True, slots=True, eq=False)
class Binaural(Microphone):
    """Two ears, left and right, of a head whose middle is the place: x ahead, y left, z up, turned by it."""

    head: Head = None  # type: ignore[assignment]  # fields before it have defaults

    if TYPE_CHECKING:  # what may be passed: the fields hold read-only arrays of it

        def __init__(
            self,
            position_m: ArrayLike | None = None,
            quaternion_xyzw: ArrayLike = ...,
            body_id: int | None = None,
            link: int = -1,
            path: MicrophonePath | None = None,
            directivity: bool = False,
            head: Head = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        """Check the fields."""
        Microphone.__post_init__(self)
        store(self, head=as_kind(self.head, Head, "binaural: head", "give one, such as read_head('FILE.sofa')"))

    @property
    def channels(self) -> int:
        """Number of channels."""
        return 2


@dataclass(frozen=True, slots=True, eq=False)
class Vibrometer:
    """Velocity in m/s of a body's surface at point_m (3,) along direction (3,), both in the body frame.

    Its modes and its rigid motion, as contact pulses make it from 8 Hz on: of a free body, of a link with what its
    joints pass on.
    """

    body_id: int
    point_m: Array
    direction: Array
    link: int = -1

    if TYPE_CHECKING:  # what may be passed: the fields hold read-only arrays of it

        def __init__(self, body_id: int, point_m: ArrayLike, direction: ArrayLike, link: int = -1) -> None: ...

    def __post_init__(self) -> None:
        """Check the fields and normalise the direction."""
        name = self.kind
        direction = frozen_array(self.direction, float, (3,), f"{name}: direction")
        with np.errstate(over="ignore"):
            length = float(np.sqrt((direction**2).sum()))
        require(0 < length < np.inf, f"{name}: direction is zero", "give the direction in which it looks")
        store(
            self,
            body_id=as_whole(self.body_id, f"{name}: body_id", "give the body's id"),
            link=as_whole(self.link, f"{name}: link", "give -1 (the base) or a link's number"),
            point_m=frozen_array(self.point_m, float, (3,), f"{name}: point_m"),
            direction=frozen_array(direction / length, float, (3,), f"{name}: direction"),
        )

    @property
    def kind(self) -> str:
        """What it is called in messages."""
        return "vibrometer"


@dataclass(frozen=True, slots=True, eq=False)
class ContactMicrophone(Vibrometer):
    """Acceleration in m/s² of a body's surface at point_m (3,) along direction (3,), both in the body frame.

    As a `Vibrometer` moves, so it is accelerated; 7.5 samples late. Through its own frequency ``response``, None: flat;
    with its own white noise of ``noise_m_s2_rthz``, m/s² per √Hz of what it gives.
    """

    response: SensorResponse | None = None
    noise_m_s2_rthz: float = 0.0

    if TYPE_CHECKING:  # what may be passed: the fields hold read-only arrays of it

        def __init__(
            self,
            body_id: int,
            point_m: ArrayLike,
            direction: ArrayLike,
            link: int = -1,
            response: SensorResponse | None = None,
            noise_m_s2_rthz: float = 0.0,
        ) -> None: ...

    def __post_init__(self) -> None:
        """Check the fields."""
        Vibrometer.__post_init__(self)
        name = self.kind
        if self.response is not None:
            as_kind(self.response, SensorResponse, f"{name}: response", "give a SensorResponse(freq_hz, magnitude)")
        remedy = "give its density in m/s² per √Hz, such as 1e-3"
        noise = as_number(self.noise_m_s2_rthz, f"{name}: noise_m_s2_rthz", remedy, least=0, below=1e12)
        store(self, noise_m_s2_rthz=noise)

    @property
    def kind(self) -> str:
        """What it is called in messages."""
        return "contact microphone"


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
MicrophoneLike = Sequence[float] | Sequence[Sequence[float]] | Sensor | Sequence[Sensor] | Array
"""What a user may give for sensors: a point in the world in m, several points, a sensor, several sensors."""


def channels_of(sensors: Sequence[Sensor]) -> int:
    """Count the channels of sensors."""
    return sum(sensor.channels if isinstance(sensor, Microphone) else 1 for sensor in sensors)


def channel_sensors(sensors: Sequence[Sensor]) -> tuple[Sensor, ...]:
    """List the sensor of each channel."""
    return tuple(s for s in sensors for _ in range(s.channels if isinstance(s, Microphone) else 1))


def felt_bodies(sensors: Sequence[Sensor]) -> frozenset[int]:
    """Return the ids of the bodies on whose surfaces sensors are."""
    return frozenset(one.body_id for one in sensors if isinstance(one, Vibrometer))


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
