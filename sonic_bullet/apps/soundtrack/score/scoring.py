"""Sound and contact log of a file of poses.

.glb .gltf .json .npz -> Export -> Animation -> checks -> steps (method.py) -> AnimatedWorld -> Listener -> RenderResult
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.apps.soundtrack.score.by_hand import move_notes, moves_of, scored_by_hand
from sonic_bullet.apps.soundtrack.score.export import Export, Rule, assemble_animation
from sonic_bullet.apps.soundtrack.score.flight import (
    alone,
    driven_bodies,
    fall_m_s2,
    find_unforced,
    hidden_n_s,
    hidden_turns,
    pose_noise_m,
)
from sonic_bullet.apps.soundtrack.score.gltf import read_gltf
from sonic_bullet.apps.soundtrack.score.keyframes import read_keyframes, read_rules
from sonic_bullet.apps.soundtrack.score.method import find_steps, substeps_of
from sonic_bullet.engine.runtime.replay import render_kept, render_notes
from sonic_bullet.files import check_sr
from sonic_bullet.machine.progress import (
    progress_part,
    report_fraction,
    report_progress,
    show_progress,
    without_progress,
)
from sonic_bullet.options.option import takes
from sonic_bullet.options.render import DEFAULT_MICROPHONE
from sonic_bullet.options.score import AnimationOptions
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.coerce import as_number, as_path, quote
from sonic_bullet.records.errors import AnimationError, MeshError, SceneWarning, SonicBulletError, interrupts
from sonic_bullet.records.regular_files import check_regular
from sonic_bullet.scene import RenderResult, render_scene
from sonic_bullet.session import Listener, attach
from sonic_bullet.simulators.animated import AnimatedBody, PoseStage


def read_animation(path: str | os.PathLike[str], fps: float | None = None, scale: float = 1.0) -> Export:
    """Read a file of poses.

    fps: frames a second in place of its own; scale: of its lengths, 0.01 for centimetres. Raises FileError,
    AnimationError.
    """
    endings = (".glb", ".gltf", ".json", ".npz")
    place = Path(as_path(path, "path", "name an animation, such as take1.glb"))
    if place.suffix.lower() not in endings:
        raise AnimationError(f"{place} is no animation by its name", f"give one that ends in {', '.join(endings)}")
    check_regular(place, "give an animation")
    if fps is not None:
        fps = as_number(fps, "fps", "give frames a second, 5 to 10000", least=5, most=1e4, error=AnimationError)
    scale = as_number(scale, "scale", "give a number above 0", above=0, error=AnimationError)
    if place.suffix.lower() in (".glb", ".gltf"):
        return read_gltf(place, fps, scale)

    return read_keyframes(place, fps, scale)


@show_progress(in_percent=True)
@takes(AnimationOptions)
def score_animation(animation: str | os.PathLike[str] | Animation, options: AnimationOptions) -> RenderResult:
    """Compute the sound of a baked animation, its contact log, and notes for the user.

    The options are keywords. rules: materials of bodies, by name; the first that states something counts. tail_db: as
    of `scene.render_scene`. Raises SonicBulletError; interrupted under way, the exception carries what was scored so
    far as ``partial``.
    """
    sr = check_sr(options.sr)
    notes: tuple[str, ...] = ()
    if not isinstance(animation, Animation):
        export = read_animation(animation, options.fps, options.scale)
        animation, notes = assemble_animation(export, options.rules, options.material or "plastic")
    from sonic_bullet.simulators.pybullet.staged.animated_world import AnimatedStage, AnimatedWorld

    with interrupts(), AnimatedStage(animation.bodies, animation.gravity_m_s2) as stage:
        apart = alone(animation, stage)
        noise_m = pose_noise_m(animation, apart)
        notes += _check_fall(animation, noise_m)
        driven = driven_bodies(animation, apart, noise_m)
        if driven.any():
            bodies = tuple(
                replace(x, driven=x.driven or bool(d)) for x, d in zip(animation.bodies, driven, strict=True)
            )
            animation = replace(animation, bodies=bodies)
            stage.bodies = bodies
            stage.held |= driven
            noise_m = pose_noise_m(animation, apart)  # driven motion is no noise
        report_progress("who touches whom")
        steps: list[tuple[Array, Array]] = []
        stopped: KeyboardInterrupt | None = None
        try:
            hidden_m_s = 0.0 if noise_m is None else hidden_n_s(1.0, noise_m, animation.fps)
            with progress_part(0.0, 0.7):
                find_steps(animation, stage, steps, hidden_m_s=hidden_m_s)
            steps = _drop_unforced_contacts(animation, stage, steps, find_unforced(animation, noise_m))
        except KeyboardInterrupt as error:  # steps so far are played and kept
            stopped = error
        dt_s = 1 / animation.fps / substeps_of(animation.fps)
        notes += _driven_notes(animation.bodies) + _noise_notes(animation, noise_m)
        hidden = np.asarray(hidden_turns(animation).any(axis=0))
        notes += _turn_notes(animation, hidden) + _deep_notes(steps, stage, hidden)
        places = DEFAULT_MICROPHONE if options.microphones is None else options.microphones
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)
            listener = attach(AnimatedWorld(stage, steps, dt_s), sr=sr, seed=options.seed, microphone=places)
            ids = dict(zip((one.name for one in animation.bodies), stage.ids, strict=True))
            listener.add_all({ids[name]: made for name, made in animation.materials.items()})
            try:
                for number in range(len(steps)):
                    listener.take_step()
                    if number % 16 == 0:
                        report_fraction(0.7 + 0.3 * number / len(steps))
            except (SonicBulletError, KeyboardInterrupt) as error:
                error.partial = _result(listener, notes)  # type: ignore[union-attr]
                raise
        if stopped is not None:
            stopped.partial = _result(listener, notes)  # type: ignore[attr-defined]
            raise stopped
        return _result(listener, notes, options.tail_db)


def score_scene(path: str | Path, *, tail_db: float | None = None, **options: Any) -> RenderResult:
    """Compute a scene's sound with that of its kinematic bodies (by_hand.py). options: of `scene.render_scene`.

    Raises what `render_scene` does, AnimationError where it drives no body or its driven bodies cannot be scored;
    interrupted, the exception carries what was scored so far as ``partial``.
    """
    shapes: dict[tuple[int, int], tuple[Shape, ...]] = {}

    def by_poses(listener: Listener) -> None:
        listener.world.driven_contacts = False

    def look(listener: Listener) -> None:
        listener.solve_all()  # what is driven by hand gets its contacts below
        for body in listener.world.living:
            with suppress(MeshError):
                shapes[body.body_id, body.link] = listener.world.shapes_of(body.body_id, body.link)

    with progress_part(0.0, 0.5):
        result = render_scene(path, at_start=by_poses, at_end=look, **options)
    moves = moves_of(result.log)
    if not any(one.drives for one in moves):
        raise AnimationError(f"{path} drives no body by hand", "render it: contacts are simulated")
    known = {
        i: shapes[body.body_id, body.link]
        for i, body in enumerate(result.log.bodies)
        if (body.body_id, body.link) in shapes
    }
    notes = (
        *(note for note in result.notes if note not in render_notes(result.sound, result.log)),
        *move_notes(result.log, moves),
    )
    log = result.log
    try:
        with interrupts():
            with progress_part(0.5, 0.8):
                log = scored_by_hand(result.log, known, moves)
            with progress_part(0.8, 1.0):
                sound = render_kept(log, tail_db=tail_db)
    except (SonicBulletError, KeyboardInterrupt) as error:
        log = getattr(error, "log", log)
        if hasattr(error, "kept") or hasattr(error, "log"):
            with without_progress():
                kept = error.kept if hasattr(error, "kept") else render_kept(log)
            error.partial = RenderResult(kept, log, result.sr, notes)  # type: ignore[union-attr]
        raise
    return RenderResult(sound, log, result.sr, (*notes, *render_notes(sound, log)))


def _result(listener: Listener, notes: tuple[str, ...], tail_db: float | None = None) -> RenderResult:
    listener.finish()
    sound, log = listener.kept_sound(tail_db=tail_db), listener.contacts
    return RenderResult(sound, log, listener.sr, (*notes, *listener.left_out, *render_notes(sound, log)))


def _check_fall(animation: Animation, noise_m: float | None) -> tuple[str, ...]:
    """Raise AnimationError where bodies fall as if lengths were in another unit."""
    found, expected = fall_m_s2(animation, noise_m), float(np.linalg.norm(animation.gravity_m_s2))
    if found is None or expected == 0:
        return ()
    ratio = found / expected
    fall_range = (0.02, 5.0)  # falls below are a slow motion of 1:7, and above another unit of length
    if not fall_range[0] < ratio < fall_range[1]:
        factor = {2: "0.01, centimetres", 3: "0.001, millimetres"}.get(round(np.log10(ratio)), f"{1 / ratio:.3g}")
        raise AnimationError(
            f"bodies fall with {found:.4g} m/s² in this animation, gravity is {expected:.3g}",
            f"give --scale {factor}, or the true --fps",
        )
    if abs(ratio - 1) > 0.1:
        return (f"bodies fall with {found:.3g} m/s², gravity is {expected:.3g}: slow motion, or another scale",)
    return ()


def _driven_notes(bodies: Sequence[AnimatedBody]) -> tuple[str, ...]:
    names = [quote(one.name) for one in bodies if one.driven]
    return (f"{', '.join(names[:8])} moved by hand: what it pushes is heard, not what pushes it",) if names else ()


def _noise_notes(animation: Animation, noise_m: float | None) -> tuple[str, ...]:
    """Describe what noise in the poses hides, where it is more than a light touch."""
    if noise_m is None:
        return ()
    hidden = [(hidden_n_s(one.mass_kg, noise_m, animation.fps), one.name) for one in animation.bodies if one.mass_kg]
    worst = max(hidden, default=(0.0, ""))
    speed = worst[0] / max((one.mass_kg for one in animation.bodies if one.name == worst[1]), default=1.0)
    if speed < 0.02:
        return ()
    return (
        f"poses are good to {noise_m * 1e6:.3g} µm: impacts below {speed:.2g} m/s ({worst[0] * 1e3:.2g} mN s of "
        f"{quote(worst[1])}) are hidden in that and not played",
    )


def _drop_unforced_contacts(
    animation: Animation, stage: PoseStage, steps: list[tuple[Array, Array]], alone: Array
) -> list[tuple[Array, Array]]:
    """Remove the contacts of bodies that rotate by a hidden amount and fall as without contact. alone (t - 1, b)."""
    each, made = substeps_of(animation.fps), []
    for number, (motion, raw) in enumerate(steps):
        mine, kept = alone[min(number // each, len(alone) - 1)], raw
        if mine.any() and len(raw):
            kept = raw[~(mine[stage.rows(raw["body_a"])] | mine[stage.rows(raw["body_b"])])]
        made.append((motion, kept))
    return made


def _turn_notes(animation: Animation, hidden: Array) -> tuple[str, ...]:
    """Describe the bodies whose rotation the frame rate hides."""
    said = []
    for i in np.flatnonzero(hidden).tolist():
        turn = animation.turn_rad[:, i]
        k = int(turn.argmax())
        slow, fast = turn[k] / (2 * np.pi) * animation.fps, (1 - turn[k] / (2 * np.pi)) * animation.fps
        said.append(
            f"{animation.fps:g} frames a second hide how {quote(animation.bodies[i].name)} turns: from frame {k} to "
            f"{k + 1} it is {slow:.3g} turns a second one way, or {fast:.3g} the other, or more; of what touches it "
            f"meanwhile only what changes the way of its centre is played. Bake at {4 * fast:.0f} frames a second or "
            "more"
        )
    return tuple(said)


def _deep_notes(steps: Sequence[tuple[Array, Array]], stage: PoseStage, hidden: Array) -> tuple[str, ...]:
    """Describe deep overlaps. hidden (b,): whose rotation is not known, and so not how deep it gets."""
    deepest = 0.0
    for _, raw in steps:
        if len(raw):
            known = ~(hidden[stage.rows(raw["body_a"])] | hidden[stage.rows(raw["body_b"])])
            deepest = max(deepest, -float(raw["gap_m"][known].min(initial=0.0)))
    deep_m = 0.01  # how deep poses may overlap at a frame and still be one touch of two bodies
    if deepest < deep_m:
        return ()
    return (f"bodies overlap by up to {deepest * 1e3:.0f} mm at frames: their meshes, or the scale, may be wrong",)


def rules_of(table: str | os.PathLike[str] | None) -> tuple[Rule, ...]:
    """Read the rules of a table's file, none without one. Raises FileError, AnimationError."""
    if table is None:
        return ()

    return read_rules(as_path(table, "table", "name a JSON table of materials"))
