"""The drop-in run time: a listener on a PyBullet client that turns each physics step into a frame of sound.

    stepSimulation (hooked) -> World.after_step -> Step -> Synthesizer.feed -> frame
                                                     \\-> ContactLog -> save / write

A frame lags physics by `latency_steps`, because a strike spans steps and loads are interpolated between them; files do not.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from sonic_bullet.files import AudioReport, check_sr, write_audio
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Air, Array, Material, Microphone, ModalModel, ModalSum, Sensor, Shape, Vibrometer
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import MaterialError, RecordError, SceneError
from sonic_bullet.render import LATENCY_STEPS, Synthesizer
from sonic_bullet.render.radiated import radiation_of

MicrophoneLike = Sequence[float] | Sequence[Sequence[float]] | Sensor | Sequence[Sensor] | Array


def as_sensors(microphone: MicrophoneLike) -> tuple[Sensor, ...]:
    """Sensors of anything that names them: a point, several points, a sensor or several.

    Raises RecordError where a point is not three finite numbers.
    """
    if isinstance(microphone, (Microphone, Vibrometer, ModalSum)):
        return (microphone,)
    items = list(microphone) if isinstance(microphone, (Sequence, np.ndarray)) else [microphone]
    if not items:
        return ()
    if all(isinstance(item, (Microphone, Vibrometer, ModalSum)) for item in items):
        return tuple(items)
    try:
        points = np.atleast_2d(np.asarray(microphone, dtype=float))
    except (TypeError, ValueError):
        raise RecordError(f"microphone {microphone!r} is no place", "give x, y, z in m, several such points, or sensors") from None
    return tuple(Microphone(point) for point in points)


def as_material(material: str | Path | Material) -> Material:
    """The material itself, or the preset of that name or path. Raises MaterialError where it has no damping: it would ring for ever."""
    from sonic_bullet.presets import load_material

    made = material if isinstance(material, Material) else load_material(material)
    if made.alpha_per_s is None:
        raise MaterialError(f"material '{made.name}' states no damping", "give alpha_per_s and beta_s")
    return made


def attach(
    client: Any,
    *,
    sr: int = 48_000,
    microphone: MicrophoneLike = (0.0, -1.0, 0.5),
    seed: int = 0,
    air: Air | None = None,
) -> Listener:
    """Listen to a PyBullet world.

    client: a `BulletClient` (then `stepSimulation` is hooked and nothing else need be called), the `pybullet` module or a client id
    (then call `listener.step()` after each `p.stepSimulation()`). sr: sample rate in Hz, 8000 … 384000. microphone: a point in the
    world in m, several points (one channel each), or sensors (`Microphone`, `Vibrometer`, `ModalSum`); none at all: contacts
    alone, no sound. seed: of the surfaces' roughness. air: the medium, 1.2 kg/m³ and 343 m/s by default. Raises SceneError for a client
    that is not connected, AudioError for a bad rate, RecordError for a microphone or a seed that is none.
    """
    if not isinstance(seed, (int, np.integer)) or seed < 0:
        raise RecordError(f"seed is {seed!r}", "give a whole number, 0 or more")
    return Listener(client, sr=check_sr(sr), sensors=as_sensors(microphone), seed=int(seed), air=air or Air())


class Listener:
    """A PyBullet world that sounds; made by `attach`.

    frame: the sound of the latest step, float64 pascals, (channels, n); n sums to floor(sr·time) exactly. It lags physics by
    `latency_steps` steps. contacts: the log so far. Usable as a context manager: leaving it detaches.
    """

    latency_steps = LATENCY_STEPS

    def __init__(self, client: Any, *, sr: int, sensors: tuple[Sensor, ...], seed: int, air: Air) -> None:
        from sonic_bullet.listener import open_world

        self.sr, self.seed, self.sensors, self.air = sr, seed, sensors, air
        self.world = open_world(client)
        self._synth = Synthesizer(sr=sr, sensors=sensors, seed=seed, air=air)
        self._steps: list[Step] = []
        self._unread: list[Array] = []
        self._attached = True
        self.frame: Array = np.zeros((len(sensors), 0))
        if not isinstance(client, int) and not inspect.ismodule(client):
            self.world.hook(self.world.before_step, self.step)

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
        progress: Callable[[str], None] | None = None,
    ) -> tuple[ModalModel, ...]:
        """Let a body sound; returns the modal models of its links.

        link: -1 is the base, "all" every link with a collision shape. material: a preset's name, a preset file or a `Material`.
        mesh: a file (in metres) or shapes in the body frame, where the body's own collision shapes should not be used.
        model: modes computed before. roughness_m: rms height of its surface in place of the material's. fixed: clamped spheres
        (x, y, z, radius) in m, body frame. thickness_m: wall of an open surface. to_hz, count: how many modes. progress: called now and then with
        which body's modes are being computed, how far that is, and that it is their radiation next (seconds a body the first time, then
        the cache has both).
        Raises SceneError (unknown body), MaterialError, MeshError, ModalError.
        """
        from sonic_bullet.listener import links_with_shapes

        made = as_material(material)
        if roughness_m is not None:
            made = replace(made, roughness_m=roughness_m)
        links = [one for _, one in links_with_shapes(self.world, body)] if link == "all" else [int(link)]
        return tuple(self._add_link(body, one, made, mesh, model, fixed, thickness_m, to_hz, count, progress) for one in links)

    def _add_link(
        self,
        body: int,
        link: int,
        material: Material,
        mesh: str | Path | Shape | Sequence[Shape] | None,
        model: ModalModel | None,
        fixed: Sequence[Sequence[float]],
        thickness_m: float | None,
        to_hz: float,
        count: int | None,
        progress: Callable[[str], None] | None,
    ) -> ModalModel:
        from sonic_bullet import modal
        from sonic_bullet.effects.presets_of_effects import with_material, with_modes

        name = self.world.name_of(body, link)
        material = with_material(material)

        shapes: tuple[Shape, ...]
        if mesh is None:
            shapes = self.world.shapes_of(body, link)
        elif isinstance(mesh, Shape):
            shapes = (mesh,)
        elif isinstance(mesh, (str, Path)):
            shapes = (modal.read_mesh(mesh),)
        else:
            shapes = tuple(mesh)
        if model is None:
            clamps = tuple((float(x), float(y), float(z), float(r)) for x, y, z, r in fixed)
            say = (lambda text: progress(f"modes of {name}: {text}")) if progress is not None else None
            solved = modal.analyse(shapes, material, to_hz=to_hz, count=count, fixed=clamps, thickness_m=thickness_m, progress=say)
            model = self._shared(with_modes(solved, material))
        if self.sensors and model.mode_count:
            if progress is not None:
                progress(f"how {model.mode_count} modes of {name} radiate")
            radiation_of(model, self.air)
        self.world.add(body, link, material=material, model=model, shapes=shapes)
        return model

    def _shared(self, model: ModalModel) -> ModalModel:
        """The model itself, or the same one that a body has already: equal bodies then share memory and what is derived from it."""
        same = (
            body.model
            for body in self.world.bodies
            if body.model is not None
            and all(np.array_equal(getattr(body.model, name), getattr(model, name)) for name in ("freq_hz", "decay_per_s", "vertex_m", "face", "shape"))
        )
        return next(same, model)

    def step(self) -> Array:
        """Take in the physics step just made; returns `frame`. Called by the hook of a `BulletClient`, by hand otherwise.

        A second call without a physics step between gives a frame of no length. Raises SceneError for NaN or a lost connection.
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
        """Stop everything that rings, as a hand would; what is struck afterwards sounds again."""
        self._synth.quench()

    @property
    def contacts(self) -> ContactLog:
        """The contact log so far: all that a later render needs."""
        return ContactLog(tuple(self.world.bodies), tuple(self._steps), self.sensors, self.sr, self.seed, self.air, self.world.untouched)

    @property
    def time_s(self) -> float:
        """Physics time so far."""
        return float(self._synth.time_s)

    def sound(self) -> Array:
        """All sound so far without the lag, (channels, floor(sr·time)), float64 pascals (m/s for vibrometers)."""
        return self._synth.sound()

    def write(self, path: str | Path, **options: Any) -> AudioReport:
        """Write the sound so far without the lag: float32 with 1.0 = 1 Pa, or scaled by ``peak_dbfs=`` or ``lufs=`` (see `files.write_audio`).

        Raises FileError, AudioError.
        """
        return write_audio(str(path), self.sound(), self.sr, **options)

    def detach(self) -> None:
        """Stop listening and leave the client as it was; sound and log stay. Twice is once."""
        if self._attached:
            self.world.unhook()
            self._attached = False

    def __enter__(self) -> Listener:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.detach()
