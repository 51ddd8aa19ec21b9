"""Values that are checked when built: read-only arrays of a stated shape, units in the names.

bodies, simulated, contacts, residual, modal_options: what one package hands another;
arrays: what records are built of;  units; errors

Names are imported when first used: errors and units need no numpy, and neither does a help text.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonic_bullet.records.arrays import Array, frozen_array
    from sonic_bullet.records.bodies import (
        ORTHOTROPIC,
        Material,
        ModalModel,
        Shape,
        ShapeKind,
        TouchedSurface,
        isotropic_stiffness_pa,
    )
    from sonic_bullet.records.receivers import Head, MicrophonePath, RoomResponse, ShoeboxRoom
    from sonic_bullet.records.residual import Residual
    from sonic_bullet.records.sensors import (
        Air,
        Ambisonics,
        Binaural,
        ContactMicrophone,
        Microphone,
        ModalSum,
        Sensor,
        Vibrometer,
        channel_sensors,
        channels_of,
        felt_bodies,
    )
    from sonic_bullet.records.simulated import Body
    from sonic_bullet.records.touching.sensor_response import SensorResponse

__all__ = [
    "ORTHOTROPIC",
    "Air",
    "Ambisonics",
    "Array",
    "Binaural",
    "Body",
    "ContactMicrophone",
    "Head",
    "Material",
    "Microphone",
    "MicrophonePath",
    "ModalModel",
    "ModalSum",
    "Residual",
    "RoomResponse",
    "Sensor",
    "SensorResponse",
    "Shape",
    "ShapeKind",
    "ShoeboxRoom",
    "TouchedSurface",
    "Vibrometer",
    "channel_sensors",
    "channels_of",
    "felt_bodies",
    "frozen_array",
    "isotropic_stiffness_pa",
]


def __getattr__(name: str) -> Any:
    home = {
        "Air": "sensors",
        "Ambisonics": "sensors",
        "Array": "arrays",
        "Binaural": "sensors",
        "Body": "simulated",
        "ContactMicrophone": "sensors",
        "Material": "bodies",
        "Head": "receivers",
        "Microphone": "sensors",
        "MicrophonePath": "receivers",
        "ModalModel": "bodies",
        "ModalSum": "sensors",
        "ORTHOTROPIC": "bodies",
        "Residual": "residual",
        "RoomResponse": "receivers",
        "ShoeboxRoom": "receivers",
        "Sensor": "sensors",
        "SensorResponse": "touching.sensor_response",
        "Shape": "bodies",
        "TouchedSurface": "bodies",
        "ShapeKind": "bodies",
        "Vibrometer": "sensors",
        "channel_sensors": "sensors",
        "channels_of": "sensors",
        "felt_bodies": "sensors",
        "frozen_array": "arrays",
        "isotropic_stiffness_pa": "bodies",
    }
    if name in home:
        return getattr(importlib.import_module(f"sonic_bullet.records.{home[name]}"), name)
    raise AttributeError(f"module 'sonic_bullet.records' has no attribute '{name}'")
