r"""Run time: a listener on a PyBullet client that turns each physics step into a frame of sound.

    stepSimulation (hooked) -> World.take_step -> tables, which wait -> Synthesizer.feed_all -> frame
                                                                    \-> ContactLog -> save / write

Steps wait until somebody reads, at most WAITING_STEPS: many at once cost less than one by one, and have the same
samples. While a body waits for its modes they wait in the log, without a limit: who reads first has those solved that
were touched (unsolved_models.py), and the log is replayed.

A frame lags physics by `latency_steps`, as a strike spans steps and loads are interpolated between them; files
do not.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain, groupby
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.engine.runtime.body_substitution import can_substitute
from sonic_bullet.engine.runtime.clock import Clock
from sonic_bullet.engine.runtime.replay import as_tail_db, body_notes, numbered_groups
from sonic_bullet.engine.runtime.synthesizer import LATENCY_STEPS, Synthesizer
from sonic_bullet.files import AudioReport, check_sr, write_audio
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.rows.log_steps import LogSteps
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.records import Air, Array, Material, ModalModel, Sensor, Shape, channels_of, felt_bodies
from sonic_bullet.records.coerce import as_call, as_flag, as_kind, as_path, as_whole, check_options
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import AudioError, RestitutionWarning, SceneError, SceneWarning
from sonic_bullet.records.step_tables import StepTables, group_steps
from sonic_bullet.session.arguments import as_sensors, keywords
from sonic_bullet.session.body_requests import (
    BodyRequest,
    check_requests,
    enter_bodies,
    wanted_body,
    wanted_cast,
)
from sonic_bullet.session.contact_energy import contact_work_j, inaudible_j, shared_work_j
from sonic_bullet.session.directed import absent
from sonic_bullet.session.felt_bodies import felt_now
from sonic_bullet.session.first_checks import warn_before_solving
from sonic_bullet.session.live import AHEAD_S, FULL_SCALE_PA, Playback, start_playback
from sonic_bullet.session.material_choice import choose_materials, current_choice, draft_notes, draft_requests
from sonic_bullet.session.run_recorder import RunRecorder, package_versions
from sonic_bullet.session.unsolved_models import LinkModels, UnsolvedModels
from sonic_bullet.simulators.opening import open_simulator
from sonic_bullet.simulators.world import World

WAITING_STEPS, WAITING_CONTACTS = 128, 1024
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
        draft: bool = False,
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
        self.draft = as_flag(draft, "draft")
        self.supports, self.image = as_flag(supports, "supports"), as_flag(image, "image")
        how = {name: getattr(self, name) for name in ("sr", "sensors", "seed", "air", "supports", "image")}
        self._synthesizer = Synthesizer(**how, keep=keep)
        self._playback: Playback | None = None
        self._attached = True
        self._models = UnsolvedModels()
        self._begin()
        self._frame: Array | None = np.zeros((channels_of(self.sensors), 0))
        self._together = False
        self._hooked = self.world.listen(self._take)

    def _begin(self) -> None:
        """Start with an empty log."""
        self._kept = RunRecorder(channels_of(self.sensors), keep_log=self.world.logged)
        self._present: Array | None = None  # bodies of the steps that wait, or of the one that sounded last
        self._unrecorded: list[Step | StepTables] = []
        self._silent: list[Step | StepTables] = []  # steps that are to sound yet
        self._waiting = 0  # how many are, with those that wait in the world
        self._begun = False
        self._sounded = 0  # steps that the synthesizer has
        self._in_log = False  # the log alone has the steps that are to sound
        self._over = False  # no step will follow
        self._clock = Clock()  # of the steps in the log
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
        self._collect()
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
        if self.world.emptied == self._emptied and not self._together:
            self._sound_waiting()
        if self._frame is None or self.world.emptied != self._emptied:
            raise SceneError("there is no frame: the world began anew", "make a step first")
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
        accuracy: float | None = 0.01,
        mounting: str | float | None = None,
        tail: bool = False,
        progress: Callable[[str], None] | None = None,
    ) -> Sequence[ModalModel]:
        """Let a body sound; return the modal models of its links, each solved when it is read, or first sounds.

        body: its id, or its name where the simulator goes by names. link: -1 is the base; a link's number or name;
        "all" every link with a collision shape, all of them or, where one fails, none. material: a preset's name, a
        preset file or a `Material`. mesh: a file (in metres) or shapes in the body frame, in place of the body's
        collision shapes. model: modes computed before. roughness_m: rms height of its surface in place of the
        material's. name: in log and messages, not the simulator's; "all" links append theirs ("panda/panda_link7").
        fixed: clamped spheres (x, y, z, radius) in m, body frame. thickness_m: wall of an open surface. to_hz, count:
        how many modes; tail: whether plates and shells go on above them, statistically. accuracy: relative, of the
        highest frequency, and their notes state what is reached; None: it is not looked for, which is faster. mounting:
        "free", "placed" (in a building; of mass 0 the default), "on floor" (one side radiates) or the added loss
        factor. progress: called with the link whose modes or radiation are computed; without one, stderr shows what
        takes over 2 s.

        Warns, before it solves, of a link larger than what is struck to sound or ground that falls
        (`errors.SizeWarning`), and of a mass that is no solid's of its material (`DensityWarning`). Raises
        SceneError (unknown body or link, a name in use), MaterialError, MeshError, ModalError, RecordError.
        """
        how: dict[str, Any] = {
            "material": material, "mesh": mesh, "model": model, "roughness_m": roughness_m, "name": name,
            "fixed": fixed, "thickness_m": thickness_m, "to_hz": to_hz, "count": count, "accuracy": accuracy,
            "mounting": mounting, "tail": tail,
        }  # fmt: skip
        as_call(progress, "progress")
        if absent(body):
            return ()
        return self._add_bodies([replace(wanted_body(self.world, body, link, **how), progress=progress)])[0]

    def add_all(
        self, cast: Mapping[Any, Any], *, progress: Callable[[str], None] | None = None, optional: bool = False
    ) -> list[Sequence[ModalModel]]:
        """Let several bodies sound, all of them or, where one fails, none; return the modal models of each one's links.

        cast: from a body, (body, link) or (body, "all") to its material, or to keywords of `add`. What the cache lacks
        is computed side by side, on two cores. optional: a body that turns out to have no modes is no error: it
        clicks and does not ring, and `notes` name it. progress, warnings, errors: as of `add`.
        """
        as_call(progress, "progress")
        made, optional = wanted_cast(self.world, cast, keywords(Listener.add)), as_flag(optional, "optional")
        return self._add_bodies([replace(one, optional=optional, progress=progress) for one in made])

    def _add_bodies(self, wanted: Sequence[BodyRequest]) -> list[Sequence[ModalModel]]:
        """Add bodies and return their models."""
        asked = check_requests(self.world, wanted)
        wanted = choose_materials(self.world, draft_requests(asked) if self.draft else asked)
        warn_before_solving(self.world, wanted, stacklevel=3)  # where `Listener.add` was called
        models = self._models.enter(wanted)
        made = enter_bodies(self.world, wanted, models, asked)
        if self._playback is not None:
            self._solve(chain.from_iterable(models))
        return [LinkModels(mine, self._solved_model) for mine in made]

    def _solved_model(self, outline: ModalModel) -> ModalModel:
        """Solve for a body's modes, and return its model."""
        self._solve([outline])
        return self._models.solve_outline(outline)

    def _solve(self, outlines: Iterable[ModalModel]) -> None:
        """Solve for the modes of bodies; those that the synthesizer has, silent so far, get theirs."""
        if not self._models:
            return
        moving = self._sounded > 0 and not self._over
        before = {i: self.world.records[i] for i in self._list_unsolved()} if moving else {}
        self._models.solve(outlines, self.air if self.sensors else None)
        changed = {i: one for i, body in before.items() if (one := self._models.body(body)) is not body}
        if changed:
            self._synthesizer.substitute(changed)

    def _list_unsolved(self) -> list[int]:
        """List the indices of the bodies whose modes are not solved."""
        return [int(i) for i in self._models.waiting_in(self.world.records)]

    def _solve_touched(self, contacts: Array) -> None:
        """Solve for those that contact rows (k,), which are to sound now, name.

        For all where sensors tell bodies apart, as their state knows each that is there.
        """
        if not self._models or not self.sensors or self._over:
            return
        if can_substitute(self.sensors, image=self.image):
            touched = sorted({*contacts["a"].tolist(), *contacts["b"].tolist()})
        else:
            touched = self._list_unsolved()
        records = self.world.records
        self._solve([model for i in touched if (model := records[i].model) is not None])

    def _solve_logged(self, steps: LogSteps) -> None:
        """Solve for those that logged steps, which have not sounded, name, the loudest first.

        Where no step will follow, not for those that rest beside nobody that moves: they are below hearing. Where steps
        will, and sensors tell bodies apart, for all.
        """
        waiting, records = self._list_unsolved(), self.world.records
        if not waiting:
            return
        substitutable, felt = can_substitute(self.sensors, image=self.image), felt_bodies(self.sensors)
        bodies = 1 + max(waiting[-1], steps.bodies())
        work, pairs = contact_work_j(steps.blocks(), bodies)
        touched = np.unique(pairs)
        if self._over:
            rings = np.zeros(bodies, bool)
            for i in touched.tolist():
                model = records[i].model
                rings[i] = model is not None and (model.unsolved or model.mode_count > 0)
            touched = touched[shared_work_j(work, pairs, rings)[touched] > inaudible_j(self.air)]
        named = set(touched.tolist()) | {i for i in waiting if records[i].body_id in felt}
        chosen = [i for i in waiting if i in named or not (self._over or substitutable)]
        loudest_first = sorted(chosen, key=lambda i: (-work[i], i))
        self._solve([model for i in loudest_first if (model := records[i].model) is not None])

    def solve_all(self) -> None:
        """Solve for the modes of all bodies added so far, as for whoever cannot wait, or adds contacts of its own."""
        records = self.world.records
        self._solve([model for i in self._list_unsolved() if (model := records[i].model) is not None])

    def finish(self) -> None:
        """Tell that no step follows: where nothing has sounded yet, modes that nobody would hear are not solved for."""
        self._record_waiting()
        self._over = self._kept.has_log and not self._sounded

    def step(self) -> Array:
        """Process the physics step just made; return `frame`. Without hooks, call it after each step.

        A second call without a physics step between gives a frame of no length. A body whose numbers cease to be
        numbers is left out from then on and named (`notes`). Raises SceneError for a lost connection.
        """
        self._take()
        return np.zeros((channels_of(self.sensors), 0)) if self._silent and self._together else self.frame

    def take_step(self) -> None:
        """Process the physics step just made, as `step`; what it sounds like waits until somebody reads."""
        self._take()

    def _take(self) -> None:
        """Take in the physics step just made."""
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
                if not self._defers:
                    self._sound_waiting()
                self._present, at_once = step.body, True
            self._collect()
            self._unrecorded.append(step)
            self._silent.append(step)
        self._waiting += 1
        if at_once and not self._defers:
            self._sound_waiting(returned_s)
        elif not self._together and max(self._waiting / WAITING_STEPS, self.world.waiting / WAITING_CONTACTS) >= 1:
            if self._defers:
                self._leave_to_log()
            else:
                self._sound_waiting()

    @property
    def _defers(self) -> bool:
        """Whether steps wait in the log until somebody reads: a body's modes are not solved, and may never be."""
        return bool(self._models) and self._playback is None and self._kept.has_log

    def _leave_to_log(self) -> None:
        """Leave the steps that wait to the log, which has them; where it does not, let them sound."""
        self._record_waiting()
        if self._kept.has_log:
            self._silent, self._waiting, self._in_log = [], 0, True

    def _collect(self) -> None:
        """Take the steps that wait in the world."""
        parts = self.world.take_waiting()
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
            for dt_s, same in groupby(steps.dt_s):
                self._clock = self._clock.after(dt_s, len(list(same)))
        if self._kept.unsaid:
            self._kept.say()

    def _sound(self, steps: StepTables, returned_s: float = 0.0) -> None:
        frame = self._synthesizer.feed_all(steps, self._models.records(self.world.records))
        self._sounded += len(steps)
        newest, several = self._synthesizer.newest_samples, self.world.newest_steps
        if several > 1:  # sub-steps: the frame is that of the whole step, whose bodies may have changed within it
            newest, before = self._synthesizer.newest(several, steps.dt_s[-1]), self._frame
            longer = frame if before is None else np.concatenate([before, frame], axis=1)
            frame_of_step = longer[:, longer.shape[1] - min(newest, longer.shape[1]) :]
        else:
            frame_of_step = frame[:, frame.shape[1] - newest :]
        self._frame = frame if self._together else frame_of_step
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
        if self._in_log or (self._defers and not self._sounded):
            self._sound_log()
        groups = group_steps(self._silent)
        for steps in groups:
            self._solve_touched(steps.contact)
        self._silent, self._waiting = [], 0
        for steps in groups:
            self._sound(steps, returned_s)

    def _sound_log(self) -> None:
        """Let the steps of the log sound that have not, as a replay of it does; what it lacks stays to sound yet."""
        steps = self._kept.steps()[self._sounded :]
        if self.sensors:
            self._solve_logged(steps)
        quenches = {event.step - self._sounded for event in self._kept.events if event.kind == "quench"}
        self._in_log = False
        for number, group in numbered_groups(steps.tables(), quenches):
            if number in quenches:
                self._synthesizer.quench()
            self._sound(group)
        waiting = [one for steps in group_steps(self._silent) for one in steps.steps()]
        rest = self._kept.count - self._sounded
        self._silent = list(waiting[len(waiting) - rest :]) if rest else []

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
        self.solve_all()  # a card does not wait for modes
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
        if self._defers:
            self._leave_to_log()
        else:
            self._sound_waiting()
        self._kept.event("quench")
        if not self._in_log:
            self._synthesizer.quench()

    @property
    def contacts(self) -> ContactLog:
        """Contact log so far, all that a later render or comparison needs; SceneError where it is not kept."""
        self._record_waiting()
        simulator, world, versions = self.world.simulator, self.world, package_versions()
        steps = self._kept.steps()
        if self._sounded and self.sensors:
            self._sound_waiting()
        else:
            self._solve_logged(steps)
        return ContactLog(
            tuple(self._models.body(body) for body in world.bodies), steps, self.sensors,
            self.sr, self.seed, self.air, world.untouched,
            tuple(self._kept.events), simulator.engine, {**versions, **simulator.versions}, simulator.changes,
            supports=self.supports, image=self.image,
        )  # fmt: skip

    @property
    def notes(self) -> tuple[str, ...]:
        """`left_out`, and bodies that touched nothing, have no mode in the band, or radiate by a simpler law."""
        log = self.contacts if self.world.logged else None
        return (*self.left_out, *(() if log is None else (*draft_notes(log), *body_notes(log))))

    @property
    def left_out(self) -> tuple[str, ...]:
        """Messages on what of the world the sound or the log leaves out; each was a `SceneWarning`."""
        if not self._together and not self._defers:
            self._sound_waiting()
        return (*self.world.notes, *self._models.notes, *self._kept.notes)

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
        self._record_waiting()
        return self._clock.time_s

    def sound(self) -> Array:
        """Return all sound so far without the lag, (channels, floor(sr·time)), float64 pascals (m/s for vibrometers).

        Raises AudioError where it is not kept.
        """
        self._warn_of_no_step()
        return self._synth.sound()

    def kept_sound(self, *, tail_db: float | None = None) -> KeptSound:
        """Return the result of `sound` in its spool, for runs longer than the memory; tail_db as for `write`."""
        self._warn_of_no_step()
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

    def _warn_of_no_step(self) -> None:
        """Warn where bodies were added to a world that is not hooked, and no step of it was told."""
        if not (self._hooked or self._begun) and any(body.material is not None for body in self.world.living):
            warnings.warn(
                "there is no sound: no step was told to the listener; call listener.step() after each step, or attach "
                "to a BulletClient, whose steps it sees",
                SceneWarning,
                stacklevel=3,
            )

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
