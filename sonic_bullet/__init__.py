"""PyBullet scenes that sound, from physics alone.

    import sonic_bullet as sb
    listener = sb.attach(client)
    listener.add(body, material="porcelain")

Packages are imported when first used. What a step becomes, and where:

    simulators -> engine: contact (forces) -> bank (modes in motion) -> path (pressure); runtime drives them -> files
    modal (modes of a shape), radiation (what the air adds), effects (what a model may lack) | session: a listener
    lab: recordings to materials and diagnoses | apps: compare, film, data sets, environments, bake, the command line
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonic_bullet.apps.bake import read_baked
    from sonic_bullet.apps.compare.compared_sides import compare
    from sonic_bullet.engine.runtime.replay import render_log
    from sonic_bullet.files import read_audio, read_log, write_audio
    from sonic_bullet.files.contact_log import ContactLog
    from sonic_bullet.files.presets import list_materials, load_material
    from sonic_bullet.files.responses.room_responses import read_room_response
    from sonic_bullet.files.responses.sensor_responses import read_response
    from sonic_bullet.files.sofa.heads import read_head
    from sonic_bullet.records import (
        Air,
        Ambisonics,
        Binaural,
        ContactMicrophone,
        Head,
        Material,
        Microphone,
        MicrophonePath,
        ModalModel,
        ModalSum,
        RoomResponse,
        SensorResponse,
        Shape,
        ShoeboxRoom,
        Vibrometer,
    )
    from sonic_bullet.records.contacts import Contacts, Step
    from sonic_bullet.records.errors import SonicBulletError
    from sonic_bullet.session import Listener, attach
    from sonic_bullet.session.log_writer import LogWriter
    from sonic_bullet.simulators import keep_restitution

__version__ = "0.1.0"

_HOME = {
    "Air": "records",
    "Ambisonics": "records",
    "Binaural": "records",
    "ContactLog": "files",
    "ContactMicrophone": "records",
    "Contacts": "records.contacts",
    "Head": "records",
    "Listener": "session",
    "LogWriter": "session.log_writer",
    "Material": "records",
    "Microphone": "records",
    "MicrophonePath": "records",
    "ModalModel": "records",
    "ModalSum": "records",
    "RoomResponse": "records",
    "SensorResponse": "records",
    "ShoeboxRoom": "records",
    "Shape": "records",
    "SonicBulletError": "records.errors",
    "Step": "records.contacts",
    "Vibrometer": "records",
    "attach": "session",
    "compare": "apps.compare.compared_sides",
    "keep_restitution": "simulators",
    "list_materials": "files.presets",
    "load_material": "files.presets",
    "read_audio": "files",
    "read_baked": "apps.bake",
    "read_head": "files.sofa.heads",
    "read_log": "files",
    "read_response": "files.responses.sensor_responses",
    "read_room_response": "files.responses.room_responses",
    "render_log": "engine.runtime.replay",
    "write_audio": "files",
}

__all__ = [
    "Air",
    "Ambisonics",
    "Binaural",
    "ContactLog",
    "ContactMicrophone",
    "Contacts",
    "Head",
    "Listener",
    "LogWriter",
    "Material",
    "Microphone",
    "MicrophonePath",
    "ModalModel",
    "ModalSum",
    "RoomResponse",
    "SensorResponse",
    "Shape",
    "ShoeboxRoom",
    "SonicBulletError",
    "Step",
    "Vibrometer",
    "attach",
    "compare",
    "keep_restitution",
    "list_materials",
    "load_material",
    "read_audio",
    "read_baked",
    "read_head",
    "read_log",
    "read_response",
    "read_room_response",
    "render_log",
    "write_audio",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"sonic_bullet.{_HOME[name]}"), name)
    raise AttributeError(f"module 'sonic_bullet' has no attribute '{name}'")


def __dir__() -> list[str]:
    """List the public names."""
    return sorted(_HOME)
