r"""Run time: a listener on a PyBullet client that turns each physics step into a frame of sound.

    stepSimulation (hooked) -> World.take_step -> tables, which wait -> Synthesizer.feed_all -> frame
                                                                    \-> ContactLog -> save / write

Steps wait until somebody reads, at most WAITING_STEPS: many at once cost less than one by one, and have the same
samples. A frame lags physics by `latency_steps`, as a strike spans steps and loads are interpolated between them; files
do not.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from sonic_bullet.engine.runtime.replay import LATENCY_STEPS, Synthesizer, as_tail_db, body_notes
from sonic_bullet.files import AudioReport, check_sr, write_audio
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.machine.progress import progress_to
from sonic_bullet.records import Air, Array, Material, ModalModel, Sensor, Shape, channels_of
from sonic_bullet.records.coerce import as_call, as_flag, as_kind, as_path, as_whole, check_options
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import AudioError, CacheWarning, RestitutionWarning, SceneError
from sonic_bullet.records.step_tables import StepTables, group_steps
from sonic_bullet.session.arguments import as_sensors, keywords
from sonic_bullet.session.body_requests import (
    BodyRequest,
    cache_note,
    checked,
    enter_bodies,
    solved_bodies,
    wanted_body,
    wanted_cast,
)
from sonic_bullet.session.directed import absent
from sonic_bullet.session.felt_bodies import felt_now
from sonic_bullet.session.first_checks import warn_before_solving
from sonic_bullet.session.live import AHEAD_S, FULL_SCALE_PA, Playback, start_playback
from sonic_bullet.session.material_choice import choose_materials, current_choice
from sonic_bullet.session.run_recorder import RunRecorder, package_versions
from sonic_bullet.simulators.opening import open_simulator
from sonic_bullet.simulators.world import World

WAITING_STEPS, WAITING_CONTACTS = 8, 1024
"""Steps that wait for somebody to read, and their contacts, at most: what is done once for several steps costs as much
as the sound of some 50 contacts, and no step is to take much longer than the others."""


class Listener:
    """A simulated world that sounds; made by `attach`. Usable as a context manager: leaving it detaches."""

    latency_steps = LATENCY_STEPS

    def __init__(
        self,
        client: Any,
        *,
        sr: int,
        sensors: tuple[Sensor, ...],
        seed: int,
        air: Air,
        supports: bool = True,
        image: bool = False,
        keep_log: bool = True,
        keep_sound: bool = True,
    ) -> None:
        self.sr, self.sensors = check_sr(sr), as_sensors(sensors, "sensors")
        self.seed = as_whole(seed, "seed", "give a whole number, 0 or more", least=0, most=2**63 - 1)
        self.air = as_kind(air, Air, "air", "give an Air(density_kg_m3=…, sound_speed_m_s=…), or leave it out")
        self.world = client if isinstance(client, World) else open_simulator(client)
        self.world.felt = felt_now(self.sensors)
        self.world.silence(current_choice().silent)
        self.world.logged = keep_log = as_flag(keep_log, "keep_log")
        self.keeps_sound = keep = as_flag(keep_sound, "keep_sound")
        self.supports, self.image = as_flag(supports, "supports"), as_flag(image, "image")
        how = {name: getattr(self, name) for name in ("sr", "sensors", "seed", "air", "supports", "image")}
        self._synthesizer = Synthesizer(**how, keep=keep)
        self._playback: Playback | None = None
        self._attached = True
        self._models: WeakKeyDictionary[ModalModel, None] = WeakKeyDictionary()  # of all bodies, each once
        self._begin()
        self._frame: Array | None = np.zeros((channels_of(self.sensors), 0))
        self._together = False
        self.world.listen(self._take)

    def _begin(self) -> None:
        """Start with an empty log."""
        self._kept = RunRecorder(channels_of(self.sensors), keep_log=self.world.logged)
        self._present: Array | None = None  # bodies of the steps that wait, or of the one that sounded last
        self._unrecorded: list[Step | StepTables] = []
        self._silent: list[Step | StepTables] = []  # steps that are to sound yet
        self._waiting = 0  # how many are, with those that wait in the world
        self._begun = False
        self._emptied = self.world.emptied

    def reset(self) -> None:
        """Restart: the same bytes as of a listener just attached, with the same bodies added in the same order.

        Vibration and sound on its way, log, unread frames, sound and time are cleared; other bodies get new records;
        removed bodies are dropped. Settings, and added bodies, stay. Without hooks removals are not observed: after a
        resetSimulation, a body of the same id, name and shape counts as the one that was added. Raises SceneError,
        having changed nothing: detached, called while a step is made, connection lost, or a `World` that cannot
        restart.
        """
        if not self._attached:
            raise SceneError("the listener is detached", "attach a new one")
        self._sound_waiting()
        self.world.reset()
        self._synthesizer.reset()
        self._begin()
        self._frame = None

    @property
    def frame(self) -> Array:
        """Sound of the latest step, float64 pascals, (channels, n); n sums to floor(sr·time) exactly.

        It lags physics by `latency_steps` steps. Raises SceneError where no step was made since `reset`, or since the
        world was emptied (resetSimulation).
        """
        if self._frame is None or self.world.emptied != self._emptied:
            raise SceneError("there is no frame: the world began anew", "make a step first")
        if not self._together:
            self._sound_waiting()
        return self._frame

    def add(
        self,
        body: int | str,
        link: int | str = -1,
        *,
        material: str | Path | Material,
        mesh: str | Path | Shape | Sequence[Shape] | None = None,
        model: ModalModel | None = None,
        roughness_m: float | None = None,
        name: str | None = None,
        fixed: Sequence[Sequence[float]] = (),
        thickness_m: float | None = None,
        to_hz: float = 20_000.0,
        count: int | None = None,
        accuracy: float = 0.01,
        mounting: str | float | None = None,
        tail: bool = False,
        progress: Callable[[str], None] | None = None,
    ) -> tuple[ModalModel, ...]:
        """Let a body sound; return the modal models of its links.

        body: its id, or its name where the simulator goes by names. link: -1 is the base; a link's number or name;
        "all" every link with a collision shape, all of them or, where one fails, none. material: a preset's name, a
        preset file or a `Material`. mesh: a file (in metres) or shapes in the body frame, in place of the body's
        collision shapes. model: modes computed before. roughness_m: rms height of its surface in place of the
        material's. name: in log and messages, not the simulator's; "all" links append theirs ("panda/panda_link7").
        fixed: clamped spheres (x, y, z, radius) in m, body frame. thickness_m: wall of an open surface. to_hz, count:
        how many modes; tail: whether plates and shells go on above them, statistically. accuracy: relative, of the
        highest frequency; their notes state what is reached. mounting: "free", "placed" (in a building; of mass 0 the
        default), "on floor" (one side radiates) or the added loss factor. progress: called with the link whose modes or
        radiation are computed; without one, stderr shows what takes over 2 s.

        Warns, before it solves, of a link larger than what is struck to sound or ground that falls
        (`errors.SizeWarning`), and of a mass that is no solid's of its material (`DensityWarning`). Raises
        SceneError (unknown body or link, a name in use), MaterialError, MeshError, ModalError, RecordError.
        """
        how: dict[str, Any] = {
            "material": material, "mesh": mesh, "model": model, "roughness_m": roughness_m, "name": name,
            "fixed": fixed, "thickness_m": thickness_m, "to_hz": to_hz, "count": count, "accuracy": accuracy,
            "mounting": mounting, "tail": tail,
        }  # fmt: skip
        with progress_to(as_call(progress, "progress")):
            return () if absent(body) else self._added([wanted_body(self.world, body, link, **how)])[0]

    def add_all(
        self, cast: Mapping[Any, Any], *, progress: Callable[[str], None] | None = None
    ) -> list[tuple[ModalModel, ...]]:
        """Let several bodies sound, all of them or, where one fails, none; return the modal models of each one's links.

        cast: from a body, (body, link) or (body, "all") to its material, or to keywords of `add`. What the cache lacks
        is computed side by side, on two cores. progress, warnings, errors: as of `add`.
        """
        with progress_to(as_call(progress, "progress")):
            return self._added(wanted_cast(self.world, cast, keywords(Listener.add)))

    def _added(self, wanted: Sequence[BodyRequest]) -> list[tuple[ModalModel, ...]]:
        """Add bodies and return their models."""
        asked = checked(self.world, wanted)
        wanted = choose_materials(self.world, asked)
        warn_before_solving(self.world, wanted, stacklevel=3)  # where `Listener.add` was called
        begun_s = time.monotonic()
        models = solved_bodies(self.world, wanted, self._models, self.air if self.sensors else None)
        if note := cache_note(wanted, time.monotonic() - begun_s):
            warnings.warn(note, CacheWarning, stacklevel=3)  # where `Listener.add` was called
        self._models.update(dict.fromkeys(model for mine in models for model in mine))
        return enter_bodies(self.world, wanted, models, asked)

    def step(self) -> Array:
        """Process the physics step just made; return `frame`. Without hooks, call it after each step.

        A second call without a physics step between gives a frame of no length. A body whose numbers cease to be
        numbers is left out from then on and named (`notes`). Raises SceneError for a lost connection.
        """
        self._take()
        return np.zeros((channels_of(self.sensors), 0)) if self._silent and self._together else self.frame

    def _take(self) -> None:
        """Take in the physics step just made; what it sounds like waits until somebody reads."""
        if not self._attached:
            raise SceneError("the listener is detached", "attach a new one")
        if not self._begun:
            self._begun = True
            for words in self.world.settings_notes():
                warnings.warn(words, RestitutionWarning, stacklevel=2)
        returned_s = 0.0 if self._playback is None else time.perf_counter()
        step = self.world.take_step()
        if not self.world.stepped:
            self._sound_waiting()
            self._frame = np.zeros((channels_of(self.sensors), 0))
            return
        if self.world.emptied != self._emptied:
            self._record_waiting()
            self._emptied = self.world.emptied
            self._kept.event("reset")
        at_once = self._playback is not None or self._frame is None
        if step is not None:
            if step.body is not self._present:
                self._sound_waiting()
                self._present, at_once = step.body, True
            self._collect()
            self._unrecorded.append(step)
            self._silent.append(step)
        self._waiting += 1
        if at_once:
            self._sound_waiting(returned_s)
        elif not self._together and max(self._waiting / WAITING_STEPS, self.world.waiting / WAITING_CONTACTS) >= 1:
            self._sound_waiting()

    def _collect(self) -> None:
        """Take the steps that wait in the world."""
        parts = self.world.taken()
        self._unrecorded += parts
        self._silent += parts

    @property
    def _synth(self) -> Synthesizer:
        """The synthesizer after all steps that were made."""
        self._sound_waiting()
        return self._synthesizer

    def _record_waiting(self) -> None:
        """Store the steps that wait in the log."""
        self._collect()
        waiting, self._unrecorded = self._unrecorded, []
        for steps in group_steps(waiting):
            self._kept.steps_made(steps)
        if self._kept.unsaid:
            self._kept.say()

    def _sound(self, steps: StepTables, returned_s: float = 0.0) -> None:
        frame = self._synthesizer.feed_all(steps, self.world.records)
        self._frame = frame if self._together else frame[:, frame.shape[1] - self._synthesizer.newest_samples :]
        self._kept.frame(frame)
        if self._synthesizer.unkept is not None:
            self._kept.give_up("sound", self._synthesizer.unkept)
        if self._playback is not None:
            self._playback.push(frame, returned_s)
        if self._kept.unsaid:
            self._kept.say()

    def _sound_waiting(self, returned_s: float = 0.0) -> None:
        """Let the steps that wait sound."""
        self._record_waiting()
        silent, self._silent, self._waiting = self._silent, [], 0
        for steps in group_steps(silent):
            self._sound(steps, returned_s)

    @contextmanager
    def together(self) -> Iterator[None]:
        """Let the steps of the block sound at its end: the same samples for less time. Until then `frame` stays.

        For environments that hide many steps in one call.
        """
        outer = self._together
        if not outer:
            self._sound_waiting()
            self._together = True
        try:
            yield
        finally:
            if not outer:
                try:
                    self._sound_waiting()
                finally:
                    self._together = False

    def play(
        self, device: str | int | None = None, *, full_scale_pa: float = FULL_SCALE_PA, ahead_s: float = AHEAD_S
    ) -> Playback:
        """Play the sound from now on: each step returns when the card has space for its frame.

        A loop faster than real time is paced by it; leave `time.sleep` out. A slower one leaves gaps, which
        `Playback.report` counts. A card that goes away is a `PlaybackWarning`, and physics and log go on. Close the
        result, or use it as a context manager.

        device: name or number of a sound card, None for the system's own, "null" for none, clocked in real time.
        full_scale_pa: the pressure (m/s for vibrometers) of full scale; larger samples are clipped and counted.
        ahead_s: how much sound may wait for the card: how late a step may be.

        Raises AudioError: no such card or rate, fewer channels than microphones, no microphone, detached, playing
        already.
        """
        if not self._attached:
            raise AudioError("the listener is detached, so nothing more will sound", "attach a new one")
        if self._playback is not None:
            if not self._playback.closed and self._playback.failure is None:
                raise AudioError("the listener plays already", "close what its play() returned first")
            self._playback.close()
        self._sound_waiting()
        how: dict[str, Any] = {"sr": self.sr, "channels": channels_of(self.sensors), "lag_steps": self.latency_steps}
        self._playback = start_playback(device, **how, full_scale_pa=full_scale_pa, ahead_s=ahead_s)
        return self._playback

    def read(self) -> Array:
        """Return all frames since the last read (channels, n), for environments that hide many steps in one call."""
        if not self._together:
            self._sound_waiting()
        return self._kept.read()

    def quench(self) -> None:
        """Stop all vibration now, at the end of the last step, as a hand would; later strikes sound again.

        Earlier strikes are silent from then on, also those that have not sounded yet, and so is sound on its way to the
        microphones; rolling and sliding continue. `sound` and files fall silent at that very sample, `frame` later by
        its lag. It is an event of the log, so that a replay stops there too, at any rate.
        """
        self._sound_waiting()
        self._kept.event("quench")
        self._synthesizer.quench()

    @property
    def contacts(self) -> ContactLog:
        """Contact log so far, all that a later render or comparison needs; SceneError where it is not kept."""
        self._record_waiting()
        simulator, world, versions = self.world.simulator, self.world, package_versions()
        return ContactLog(
            tuple(world.bodies), self._kept.steps(), self.sensors, self.sr, self.seed, self.air, world.untouched,
            tuple(self._kept.events), simulator.engine, {**versions, **simulator.versions}, simulator.changes,
            supports=self.supports, image=self.image,
        )  # fmt: skip

    @property
    def notes(self) -> tuple[str, ...]:
        """`left_out`, and bodies that touched nothing, have no mode in the band, or radiate by a simpler law."""
        return (*self.left_out, *(body_notes(self.contacts) if self.world.logged else ()))

    @property
    def left_out(self) -> tuple[str, ...]:
        """Messages on what of the world the sound or the log leaves out; each was a `SceneWarning`."""
        if not self._together:
            self._sound_waiting()
        return (*self.world.notes, *self._kept.notes)

    @property
    def lifted(self) -> dict[str, tuple[int, int]]:
        """Numbers of steps of each body with supports, by name: in all, and with contact separation.

        In the latter the vibration is so large that contacts would lift off and chatter, which their law does not
        describe.
        """
        return self._synth.separations

    @property
    def time_s(self) -> float:
        """Physics time so far."""
        return float(self._synth.time_s)

    def sound(self) -> Array:
        """Return all sound so far without the lag, (channels, floor(sr·time)), float64 pascals (m/s for vibrometers).

        Raises AudioError where it is not kept.
        """
        return self._synth.sound()

    def kept_sound(self, *, tail_db: float | None = None) -> KeptSound:
        """Return the result of `sound` in its spool, for runs longer than the memory; tail_db as for `write`."""
        return self._synth.kept_sound(as_tail_db(tail_db))

    def write(self, path: str | Path, *, tail_db: float | None = None, **options: Any) -> AudioReport:
        """Write the sound so far without the lag: 1.0 = 1 Pa, or scaled (options of `files.write_audio`).

        tail_db: include the decay after the last step until that far below the peak, -60 say, at most 10 s; None, 0:
        no decay. By blocks, however long; lufs= alone needs all of it in memory. Raises FileError, AudioError.
        """
        check_options(options, [*keywords(write_audio), "tail_db"], "write", error=AudioError)
        tail_db = as_tail_db(tail_db)
        place = as_path(path, "path", "name a file, such as out.wav")
        if not self.sensors:
            raise AudioError(
                "there is no microphone, so there is no sound to write", "attach with microphone=(x, y, z)"
            )
        return write_audio(place, self.kept_sound(tail_db=tail_db), self.sr, **options)

    def detach(self) -> None:
        """Remove the hooks from the client; sound and log stay. A second call does nothing."""
        if self._attached:
            self.world.unhook()
            self._attached = False
            if self._playback is not None:
                self._playback.close()

    def __enter__(self) -> Listener:
        """Return the listener."""
        return self

    def __exit__(self, *_: object) -> None:
        """Detach the listener."""
        self.detach()
