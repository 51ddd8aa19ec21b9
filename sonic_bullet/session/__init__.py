"""The drop-in run time: a listener on a PyBullet client that turns each physics step into a frame of sound.

    stepSimulation (hooked) -> World.after_step -> Step -> Synthesizer.feed -> frame
                                                     \\-> ContactLog -> save / write

A frame lags physics by `latency_steps`, because a strike spans steps and loads are interpolated between them; files do
not.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from sonic_bullet.files import AudioReport, check_sr, write_audio
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.geometry import oversize
from sonic_bullet.listener.world import World
from sonic_bullet.machine.terminal import status
from sonic_bullet.records import Air, Array, Material, ModalModel, Sensor, Shape
from sonic_bullet.records.coerce import (
    as_call,
    as_kind,
    as_path,
    as_whole,
    check_options,
    shown,
)
from sonic_bullet.records.contacts import Event, Step
from sonic_bullet.records.errors import AudioError, SceneError, SizeWarning
from sonic_bullet.render import LATENCY_STEPS, Synthesizer
from sonic_bullet.session.arguments import MicrophoneLike, as_sensors
from sonic_bullet.session.wanted_bodies import WantedBody, solved_bodies, wanted_body


def attach(
    client: Any,
    *,
    sr: int = 48_000,
    microphone: MicrophoneLike = (0.0, -1.0, 0.5),
    seed: int = 0,
    air: Air | None = None,
) -> Listener:
    """Listen to a PyBullet world.

    client: a `BulletClient` (then `stepSimulation` is hooked and nothing else need be called), the `pybullet` module or
    a client id (then call `listener.step()` after each `p.stepSimulation()`); or a `listener.World` of another
    simulator. sr: sample rate in Hz, 8000 … 384000. microphone: a point in the world in m, several points (one channel
    each), or sensors (`Microphone`, `Vibrometer`, `ModalSum`); none at all: contacts alone, no sound. seed: of the
    surfaces' roughness. air: the medium, 1.2 kg/m³ and 343 m/s by default. Raises SceneError for a client that is not
    connected, AudioError for a bad rate, RecordError for a microphone or a seed that is none.
    """
    return Listener(client, sr=sr, sensors=as_sensors(microphone), seed=seed, air=Air() if air is None else air)


def _opened(client: Any) -> World:
    from sonic_bullet.listener import open_world

    return open_world(client)


def _wanted(world: World, who: Any, how: Any) -> WantedBody:
    """One entry of a cast."""
    body, link = who if isinstance(who, tuple) and len(who) == 2 else (who, -1)
    given = how if isinstance(how, Mapping) else {"material": how}
    check_options(map(str, given), [name for name in _keywords(Listener.add) if name != "progress"], "add_all")
    return wanted_body(world, body, link, **{"material": None, **given})


def _keywords(call: Callable[..., Any]) -> list[str]:
    """Names of the arguments that are given by name alone."""
    parameters = inspect.signature(call).parameters
    return [name for name, one in parameters.items() if one.kind is inspect.Parameter.KEYWORD_ONLY]


class Listener:
    """A simulated world that sounds; made by `attach`.

    frame: the sound of the latest step, float64 pascals, (channels, n); n sums to floor(sr·time) exactly. It lags
    physics by `latency_steps` steps. contacts: the log so far. Usable as a context manager: leaving it detaches.
    """

    latency_steps = LATENCY_STEPS

    def __init__(self, client: Any, *, sr: int, sensors: tuple[Sensor, ...], seed: int, air: Air) -> None:
        self.sr, self.sensors = check_sr(sr), as_sensors(sensors, "sensors")
        self.seed = as_whole(seed, "seed", "give a whole number, 0 or more", least=0, most=2**63 - 1)
        self.air = as_kind(air, Air, "air", "give an Air(density_kg_m3=…, sound_speed_m_s=…), or leave it out")
        self.world = client if isinstance(client, World) else _opened(client)
        self._synth = Synthesizer(sr=self.sr, sensors=self.sensors, seed=self.seed, air=self.air)
        self._steps: list[Step] = []
        self._events: list[Event] = []
        self._unread: list[Array] = []
        self._attached = True
        self.frame: Array = np.zeros((len(self.sensors), 0))
        self.world.listen(self.step)

    def add(
        self,
        body: int,
        link: int | str = -1,
        *,
        material: str | Path | Material,
        mesh: str | Path | Shape | Sequence[Shape] | None = None,
        model: ModalModel | None = None,
        roughness_m: float | None = None,
        fixed: Sequence[Sequence[float]] = (),
        thickness_m: float | None = None,
        to_hz: float = 20_000.0,
        count: int | None = None,
        accuracy: float = 0.01,
        progress: Callable[[str], None] | None = None,
    ) -> tuple[ModalModel, ...]:
        """Let a body sound; returns the modal models of its links.

        link: -1 is the base; a link's number or name; "all" every link with a collision shape, all of them or, where
        one fails, none. material: a preset's name, a preset file or a `Material`. mesh: a file (in metres) or shapes in
        the body frame, where the body's own collision shapes should not be used. model: modes computed before.
        roughness_m: rms height of its surface in place of the material's. fixed: clamped spheres (x, y, z, radius) in
        m, body frame. thickness_m: wall of an open surface. to_hz, count: how many modes. accuracy: relative, of the
        highest frequency; the models' notes tell what is reached. progress: called now and then with which link's modes
        are being computed, how far that is, and that it is their radiation next (seconds a link the first time, then
        the cache has both); without one, a terminal shows it. Warns (`errors.SizeWarning`) of a link larger than
        anything that is struck to sound. Raises SceneError (unknown body or link), MaterialError, MeshError, ModalError
        naming body and link, RecordError.
        """
        how: dict[str, Any] = {
            "material": material, "mesh": mesh, "model": model, "roughness_m": roughness_m, "fixed": fixed,
            "thickness_m": thickness_m, "to_hz": to_hz, "count": count, "accuracy": accuracy,
        }  # fmt: skip
        return self._added([wanted_body(self.world, body, link, **how)], progress)[0]

    def add_all(
        self, cast: Mapping[Any, Any], *, progress: Callable[[str], None] | None = None
    ) -> list[tuple[ModalModel, ...]]:
        """Let several bodies sound, all of them or, where one fails, none; the modal models of each one's links.

        cast: from a body, (body, link) or (body, "all") to its material, or to keywords of `add`. What was never
        computed before is computed side by side, on two cores. progress, warnings, errors: as `add` has them.
        """
        if not isinstance(cast, Mapping):
            raise SceneError(f"cast is {shown(cast)}", "give a dict from bodies to materials")
        return self._added([_wanted(self.world, who, how) for who, how in cast.items()], progress)

    def _added(
        self, wanted: Sequence[WantedBody], progress: Callable[[str], None] | None
    ) -> list[tuple[ModalModel, ...]]:
        """The models of bodies that are listened to from now on."""
        as_call(progress, "progress")
        known = (body.model for body in self.world.bodies if body.model is not None)
        with status("sonic_bullet") if progress is None else nullcontext(progress) as say:
            models = solved_bodies(self.world, wanted, known, self.air if self.sensors else None, say)
        for one, mine in zip(wanted, models, strict=True):
            for link, (_, shapes), model in zip(one.links, one.parts, mine, strict=True):
                self.world.add(one.body, link, material=one.material, model=model, shapes=shapes)
        for one, mine in zip(wanted, models, strict=True):
            for link, (name, _), model in zip(one.links, one.parts, mine, strict=True):
                if large := oversize(model.vertex_m, model.mass_kg):
                    remedy = (
                        "load it with globalScaling=0.001, or give its mesh in metres, if its numbers are millimetres"
                    )
                    said = f"body {one.body} link {link} ({name}) {large}; {remedy}"
                    warnings.warn(said, SizeWarning, stacklevel=3)
        return [tuple(mine) for mine in models]

    def step(self) -> Array:
        """Take in the physics step just made; returns `frame`.

        Called by the hook of a `BulletClient`, by hand otherwise.

        A second call without a physics step between gives a frame of no length. A body whose numbers cease to be
        numbers is left out from then on and named (`notes`). Raises SceneError for a lost connection.
        """
        if not self._attached:
            raise SceneError("the listener is detached", "attach a new one")
        step = self.world.after_step()
        if not self.world.stepped:
            self.frame = np.zeros((len(self.sensors), 0))
            return self.frame
        self._steps.append(step)
        self.frame = self._synth.feed(step, self.world.bodies)
        self._unread.append(self.frame)
        return self.frame

    def read(self) -> Array:
        """All frames since the last read, joined, (channels, n): for environments that hide many steps in one call."""
        frames, self._unread = self._unread, []
        return np.concatenate(frames, axis=1) if frames else np.zeros((len(self.sensors), 0))

    def quench(self) -> None:
        """Stop everything that rings, as a hand would, now: where the last step taken in ends.

        What strikes from the next step on sounds again.

        What was struck before is silent from then on, strikes that are still to sound included, and so is what travels
        to the microphones; what rolls or slides goes on. `sound` and files fall silent at that very sample, `frame` as
        much later as it lags. It is an event of the log, so that a replay stops there too, at any rate.
        """
        self._events.append(Event("quench", len(self._steps)))
        self._synth.quench()

    @property
    def contacts(self) -> ContactLog:
        """The contact log so far: all that a later render needs."""
        return ContactLog(
            tuple(self.world.bodies),
            tuple(self._steps),
            self.sensors,
            self.sr,
            self.seed,
            self.air,
            self.world.untouched,
            tuple(self._events),
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the world is left out of the sound, and why; each was a `SceneWarning` when it happened."""
        return self.world.notes

    @property
    def time_s(self) -> float:
        """Physics time so far."""
        return float(self._synth.time_s)

    def sound(self) -> Array:
        """All sound so far without the lag, (channels, floor(sr·time)), float64 pascals (m/s for vibrometers)."""
        return self._synth.sound()

    def write(self, path: str | Path, **options: Any) -> AudioReport:
        """Write the sound so far without the lag: float32 with 1.0 = 1 Pa, or scaled by ``peak_dbfs=`` or ``lufs=``
        (see `files.write_audio`).

        Raises FileError, AudioError.
        """
        check_options(options, _keywords(write_audio), "write", error=AudioError)
        place = as_path(path, "path", "name a file, such as out.wav")
        if not self.sensors:
            raise AudioError(
                "there is no microphone, so there is no sound to write", "attach with microphone=(x, y, z)"
            )
        return write_audio(place, self.sound(), self.sr, **options)

    def detach(self) -> None:
        """Stop listening and leave the client as it was; sound and log stay. Twice is once."""
        if self._attached:
            self.world.unhook()
            self._attached = False

    def __enter__(self) -> Listener:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.detach()
