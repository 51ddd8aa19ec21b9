"""`attach`: a listener on a PyBullet client that turns each physics step into a frame of sound.

listening: the `Listener` | wanted_bodies: what `add` was asked for, and its modes | arguments: what people give
keeping: what is kept of a run | scene_file: kinds of scene files, their code run | directed: runs made otherwise
"""

from __future__ import annotations

from typing import Any

from sonic_bullet.records import Air
from sonic_bullet.session.arguments import MicrophoneLike, as_sensors
from sonic_bullet.session.directed import direction
from sonic_bullet.session.listening import Listener

__all__ = ["Listener", "attach"]


def attach(
    client: Any,
    *,
    sr: int = 48_000,
    microphone: MicrophoneLike = (0.0, -1.0, 0.5),
    seed: int = 0,
    air: Air | None = None,
    supports: bool = True,
    keep_log: bool = True,
    keep_sound: bool = True,
) -> Listener:
    """Listen to a PyBullet world.

    client: a `BulletClient` (then `stepSimulation` is hooked and nothing else need be called), the `pybullet` module or
    a client id (then call `listener.step()` after each `p.stepSimulation()`); or a `listener.World` of another
    simulator. sr: sample rate in Hz, 8000 … 384000. microphone: a point in the world in m, several points (one channel
    each), or sensors (`Microphone`, `Vibrometer`, `ModalSum`); none at all: contacts alone, no sound. seed: of the
    surfaces' roughness. air: the medium, 1.2 kg/m³ and 343 m/s by default. supports: whether what a body stands on
    takes of its ringing and passes some on; without, it rings as if it hung in the air, and costs less.
    keep_log, keep_sound: whether `contacts`, and `sound` and `write`, will be asked for; what is kept of a long run
    lies in a nameless temporary file (where TMPDIR says, else in /tmp), gone with the listener.

    Raises SceneError for a client that is not connected, AudioError for a bad rate, RecordError for a microphone or a
    seed that is none.
    """
    how: dict[str, Any] = {"sensors": as_sensors(microphone), "seed": seed, "air": Air() if air is None else air}
    director = direction()
    if director is not None:
        how = director.attached(how)
    made = Listener(client, sr=sr, **how, supports=supports, keep_log=keep_log, keep_sound=keep_sound)
    if director is not None:
        director.listens(made)
    return made
