"""Values that prove themselves when built: read-only arrays of a stated shape, units in the names.

bodies, contacts, residual: what one room hands another;  arrays: what records are built of;  units; errors
"""

from sonic_bullet.records.arrays import Array, frozen_array
from sonic_bullet.records.bodies import (
    ORTHOTROPIC,
    Air,
    Body,
    Material,
    Microphone,
    ModalModel,
    ModalSum,
    Sensor,
    Shape,
    ShapeKind,
    Vibrometer,
    isotropic_stiffness_pa,
)
from sonic_bullet.records.residual import Residual

__all__ = [
    "ORTHOTROPIC",
    "Air",
    "Array",
    "Body",
    "Material",
    "Microphone",
    "ModalModel",
    "ModalSum",
    "Residual",
    "Sensor",
    "Shape",
    "ShapeKind",
    "Vibrometer",
    "frozen_array",
    "isotropic_stiffness_pa",
]
