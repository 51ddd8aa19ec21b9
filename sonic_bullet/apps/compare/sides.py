"""The two sides of a comparison: a scene that is run, a contact log, or a recording.

scene  -> run, calls recorded -> Side(calls, log, sound)
log    -> rendered            -> Side(log, sound)
recording                     -> Side(sound)
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.compare.revision_tree import RevisionTree, noted_files, own_modules
from sonic_bullet.engine.runtime.replay import render_kept
from sonic_bullet.files import read_audio, read_audio_scale, read_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.machine.progress import progress_listener, progress_to
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import as_path, quote
from sonic_bullet.records.errors import CompareError, SonicBulletError
from sonic_bullet.records.file_endings import SCENE_ENDINGS
from sonic_bullet.records.regular_files import check_regular
from sonic_bullet.scene import render_scene
from sonic_bullet.session.body_requests import BodyRequest
from sonic_bullet.session.directed import use_hook
from sonic_bullet.session.listening import Listener
from sonic_bullet.simulators.calls import FIRST_ABSENT, Call, ObjectId, Plan

OF_WHOM = ("body", "links", "parts", "own_shapes")
"""Fields of a `BodyRequest` that identify it and its shape; all others are inputs."""


@dataclass(frozen=True, slots=True)
class SceneSide:
    """A scene to be run, with options of `render_scene`; None: the scene's own.

    revision: the tree of a git revision that it is in.
    """

    path: str | Path
    seconds: float | None = None
    sr: int = 48_000
    seed: int | None = None
    microphones: Any = None
    material: Any = None
    residual: bool = True
    client: int | None = None
    revision: RevisionTree | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One side of a comparison.

    Parameters
    ----------
    sound, sr
        Sound (channels, n), and its rate.
    log, calls, scene
        Where they are known.
    names
        Of bodies and links in calls.
    frames
        A digest of each frame, for runs that are to be the same.
    notes
        For the user.
    read
        Absolute paths of the files that its run opened.
    """

    name: str
    sound: KeptSound
    sr: int
    log: ContactLog | None = None
    calls: tuple[Call, ...] = ()
    scene: SceneSide | None = None
    names: Mapping[tuple[ObjectId, int], str] = field(default_factory=dict)
    frames: tuple[bytes, ...] = ()
    notes: tuple[str, ...] = ()
    read: frozenset[str] = frozenset()


class OtherSound(SonicBulletError):
    """A run sounds different from its reference, since the step named."""


@dataclass(slots=True, eq=False)
class _Run:
    """Hook of a run: records calls, added bodies, frames. plan: substitutions; like: frames that it must have."""

    side: str
    plan: Plan | None = None
    like: Sequence[bytes] | None = None
    listener: Listener | None = None
    frames: list[bytes] = field(default_factory=list)
    calls: Any = None

    def attach_options(self, options: dict[str, Any]) -> dict[str, Any]:
        call = Call("attach", self.calls.steps, dict(options))
        if self.plan is None:
            self.calls.calls.append(call)
            return options
        first, arguments = self.plan.ahead_of(call)
        self.calls.make(first)
        return dict(arguments) if arguments is not None else options

    def listens(self, listener: Listener) -> None:
        self.listener = self.listener or listener

    def absent(self, body: Any) -> bool:
        return isinstance(body, int) and body >= FIRST_ABSENT

    def replace_requests(self, world: Any, wanted: Sequence[BodyRequest]) -> Sequence[BodyRequest]:
        made: list[BodyRequest] = []
        for one in wanted:
            call = self._adding(one)
            if self.plan is None:
                self.calls.calls.append(call)
                made.append(one)
                continue
            first, arguments = self.plan.ahead_of(call)
            made += self._of_the_other(first)
            if arguments is not None:
                made.append(_substitute_arguments(one, call.arguments, arguments))
        if self.plan is not None:
            made += self._of_the_other(self.plan.remaining_calls(self.calls.steps, "add"))
        return made

    def _adding(self, one: BodyRequest) -> Call:
        who = self.calls.who(one.body)
        shapes = (tuple(shapes for _, shapes in one.parts),) if one.own_shapes else ()
        rest = {x.name: getattr(one, x.name) for x in fields(one) if x.name not in OF_WHOM}
        arguments = {"body": who, "links": one.links, **rest, "model": (one.model,), "shapes": shapes}
        return Call("add", self.calls.steps, arguments, who, own=one)

    def _of_the_other(self, calls: Sequence[Call]) -> Iterator[BodyRequest]:
        """Yield bodies of the other scene that are added here, after making its other calls before them."""
        for call in calls:
            if call.name == "add":
                yield replace(call.own, body=self.calls.ids[call.who])
            else:
                self.calls.make([call])

    def look(self) -> None:
        """Record, before each step, the frame of the last one."""
        if self.listener is None or not self.calls.steps:
            return
        number = len(self.frames)
        self.frames.append(frame_digest(self.listener.frame))
        if self.like is not None and (number >= len(self.like) or self.like[number] != self.frames[-1]):
            raise OtherSound(f"step {number} sounds otherwise")


def frame_digest(frame: Array) -> bytes:
    """Hash a frame."""
    return hashlib.blake2b(frame.tobytes(), digest_size=8).digest()


def _substitute_arguments(one: BodyRequest, before: Any, after: Any) -> BodyRequest:
    """Return the body with the substituted arguments."""
    given = {
        x.name: after[x.name] for x in fields(one) if x.name in after and x.name not in (*OF_WHOM, "model", "links")
    }
    given["model"] = after["model"][0]
    if after["shapes"] is not before["shapes"] and after["shapes"]:
        parts = zip(one.parts, after["shapes"][0], strict=False)
        given |= {"parts": tuple((name, shapes) for (name, _), shapes in parts), "own_shapes": True}
    return replace(one, **given)


def run(
    scene: SceneSide,
    side: str,
    *,
    plan: Plan | None = None,
    like: Sequence[bytes] | None = None,
) -> Side:
    """Run a scene and record its calls; raises what `render_scene` does.

    plan: substitutions; like: frames that it must have, else raise OtherSound.
    """
    from sonic_bullet.simulators.pybullet.clients import clear_file_cache
    from sonic_bullet.simulators.pybullet.interception import Interception

    watch = _Run(side, plan, like)
    watch.calls = Interception(side, plan, watch.look)
    clear_file_cache()
    same_listener = progress_to(progress_listener())  # else nobody's run would show its own
    with (
        noted_files() as files,
        own_modules(scene.revision),
        watch.calls.replace_functions(),
        use_hook(watch),
        same_listener,
    ):
        result = render_scene(
            scene.path, seconds=scene.seconds, sr=scene.sr, seed=scene.seed or 0, microphones=scene.microphones,
            material=scene.material, residual=scene.residual, client=scene.client,
        )  # fmt: skip
    names = {(watch.calls.who(body.body_id), body.link): body.name for body in result.log.bodies}
    return Side(
        str(scene.path), result.sound, result.sr, result.log, tuple(watch.calls.calls), scene, names,
        tuple(watch.frames), result.notes, frozenset(files.paths | set(watch.calls.files)),
    )  # fmt: skip


def as_side(given: Any, side: str) -> Side:
    """Run or read a side.

    Raises
    ------
    CompareError
        It is not a scene, log or recording; and what running and reading raise.
    """
    remedy = "give a scene (.py .gltf .glb), a contact log (.npz), a recording, or a folder of them"
    if isinstance(given, Side):
        return given
    if isinstance(given, SceneSide):
        return run(given, side)
    if isinstance(given, ContactLog):
        return of_log(given, f"log {side}")
    name = as_path(given, side, remedy, error=CompareError)
    place = Path(name)
    check_regular(place)
    if not place.is_file():
        raise CompareError(f"no file {quote(name)}", remedy)
    if place.suffix.lower() in SCENE_ENDINGS:
        return run(SceneSide(name), side)
    if place.suffix.lower() == ".npz":
        return of_log(read_log(name), name)
    samples, sr = read_audio(name)
    if not np.size(samples):
        raise CompareError(f"{quote(name)} holds no sample", "give a recording that has some")
    unknown = f"{name} says no scale: its level is unknown, and its samples are taken as pascals"
    notes = () if read_audio_scale(name) is not None else (unknown,)
    return Side(name, KeptSound.of(np.atleast_2d(np.asarray(samples, float))), sr, notes=notes)


def of_log(log: ContactLog, name: str) -> Side:
    """Render a log as a side; CompareError where it is empty."""
    if not len(log.steps):
        raise CompareError(f"{name} is an empty log: it has no step", "simulate the scene for longer")
    return Side(name, render_kept(log), log.sr, log)
