"""`attach`: a listener on a simulated world that turns each physics step into a frame of sound.

listening: the `Listener` | body_requests: bodies to add, and their modes | arguments: checks of arguments
run_recorder: log and unread frames | scene_file: kinds of scene files, their code run | directed: substitutes
"""

from __future__ import annotations

from typing import Any

from sonic_bullet.options.render import DEFAULT_MICROPHONE
from sonic_bullet.records import Air
from sonic_bullet.records.sensors import MicrophoneLike
from sonic_bullet.session.arguments import as_sensors
from sonic_bullet.session.directed import direction
from sonic_bullet.session.listening import Listener

__all__ = ["Listener", "attach"]


def attach(
    client: Any,
    *,
    sr: int = 48_000,
    microphone: MicrophoneLike = DEFAULT_MICROPHONE,
    seed: int = 0,
    air: Air | None = None,
    supports: bool = True,
    image: bool = False,
    draft: bool = False,
    keep_log: bool = True,
    keep_sound: bool = True,
) -> Listener:
    """Attach a listener to a PyBullet or MuJoCo world.

    Parameters
    ----------
    client
        A `BulletClient` (then `stepSimulation` is hooked and nothing else need be called), the `pybullet` module or a
        client id (then call `listener.step()` after each `p.stepSimulation()`); MuJoCo's ``(model, data)`` (then every
        `mujoco.mj_step` is watched); or a `listener.World` of another simulator.
    sr
        Sample rate in Hz, 8000 … 384000.
    microphone
        A point in the world in m, several points (one channel each), or sensors (`Microphone`, `Vibrometer`,
        `ModalSum`); an empty sequence: contacts alone, no sound.
    seed
        Of the surfaces' roughness.
    air
        The medium, 1.2 kg/m³ and 343 m/s by default.
    supports
        Whether resting contacts damp a body and transmit vibration; without, it vibrates as a free body, and costs
        less.
    image
        Whether large flat faces of bodies that do not move (planes, boards, walls) mirror the sound before them, up to
        +6 dB near them; three of each microphone at a time.
    draft
        Whether bodies sound by few modes of coarse elements, which take no more than a second at their first touch;
        `Listener.notes` say so.
    keep_log, keep_sound
        Whether `contacts`, and `sound` and `write`, will be used. Data of a long run are in a nameless temporary file
        (in TMPDIR, else in /tmp), removed with the listener.

    Raises
    ------
    SceneError
        The client is not connected.
    AudioError
        The rate is out of range.
    RecordError
        A microphone or the seed is not valid.
    """
    how: dict[str, Any] = {"sensors": as_sensors(microphone), "seed": seed, "air": Air() if air is None else air}
    director = direction()
    if director is not None:
        how = director.attach_options(how)
    made = Listener(
        client, sr=sr, **how, supports=supports, image=image, draft=draft, keep_log=keep_log, keep_sound=keep_sound
    )
    if director is not None:
        director.listens(made)
    return made
