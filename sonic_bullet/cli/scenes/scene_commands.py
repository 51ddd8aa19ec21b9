"""`render` and `doctor`: check every output's place first, run, then write log, sound, picture and JSON, each whole or
not at all.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.cli.output import (
    clean_stdout,
    described_render,
    places,
    progress_bar,
    quiet_stderr,
    status,
    write_json,
)
from sonic_bullet.cli.scenes.scene_runs import (
    Replay,
    WantedMaterials,
    Wish,
    check_scene_file,
    is_log,
    replayed,
    simulated,
)
from sonic_bullet.cli.sound_level import OPTIONS, LevelWish, level_warnings
from sonic_bullet.cli.soundtrack.soundtrack_outputs import Soundtrack, SoundtrackWish
from sonic_bullet.files import (
    AudioReport,
    check_audio_output,
    check_sr,
    kept_name,
    write_audio,
    write_log,
)
from sonic_bullet.machine.worker import note_closing, stop_word
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError, FileError, SceneError, SonicBulletError

if TYPE_CHECKING:
    from sonic_bullet.files.contact_log import ContactLog
    from sonic_bullet.scene import RenderResult


def run_render(
    scene: str,
    *,
    output: str,
    seconds: float | None,
    sr: float | None,
    contacts: str | None,
    models: str | None,
    picture: str | None,
    json_to: str | None,
    microphones: tuple[tuple[float, float, float], ...],
    seed: int | None,
    material: tuple[str, ...],
    silent: tuple[str, ...],
    residual: bool | None,
    supports: bool | None,
    **others: Any,
) -> None:
    """The `render` command. others: options of `LevelWish` and `SoundtrackWish`.

    Raises SonicBulletError, and KeyboardInterrupt whose text names the file with what was rendered so far.
    """
    rate = None if sr is None else check_sr(sr)
    level = LevelWish(**{name: others.pop(name) for name in OPTIONS})
    check_request(scene, seconds, level)
    materials = WantedMaterials.read(material, silent)
    if models is not None and contacts is None:
        raise FileError("--models says where a log's models are, and no log is asked for", "give --contacts too")
    extras = SoundtrackWish(**others).checked(output)
    to, contacts, picture, json_to, events_to = _check_places(
        output, contacts, picture, json_to, extras.events, level.json_path(output)
    )
    made: Soundtrack | None = None
    with clean_stdout(json_to) as say:
        try:
            with progress_bar(Path(scene).name) as (progress, tell):
                wish = Wish(
                    seconds,
                    rate,
                    microphones,
                    seed,
                    materials,
                    residual,
                    supports,
                    progress,
                    tell,
                    tail_db=level.tail_db,
                )
                result: RenderResult | Replay = replayed(scene, wish) if is_log(scene) else simulated(scene, wish)
        except (SonicBulletError, KeyboardInterrupt) as error:
            raise with_partial(error, to, output, level) from error
        if contacts is not None:
            try:
                write_log(contacts, result.log, models or "included")
            except SonicBulletError as error:
                error.partial = result  # type: ignore[attr-defined]
                raise with_partial(error, to, output, level) from error
        try:
            with progress_bar("stems and events") as (progress, tell):
                made = extras.made(result, events_to, progress, tell, drawn=picture is not None)
        except (SonicBulletError, KeyboardInterrupt) as error:
            error.partial = result  # type: ignore[union-attr]
            raise with_partial(error, to, output, level) from error
        report = replace(_written(to, result, level, made), path=output)
        if made is not None:
            made.write(report)
        if picture is not None:
            from sonic_bullet.plots.scene_plot import render_picture

            seen = made.events if made is not None else ()
            render_picture(picture, result.sound, result.sr, result.log, Path(scene).name, seen)
        notes = (*result.notes, *_by_hand(scene, result.log), *_oversized(result.log), *level_warnings(report))
        say("\n".join([summary(report, result.log), *(made.words if made is not None else ())]))
        scale = {}
        if report.channels:
            scale = level.say(to, report.gain_per_pa, report.peak_pa, result.log, report.clipped)
        for note in notes:
            print(f"sonic-bullet: note: {note}", file=sys.stderr)
    lifted = None if isinstance(result, Replay) else result.lifted
    write_json(
        json_to,
        described_render(result.log, report, notes, lifted) | {"scale": scale} | (made.described if made else {}),
    )


def run_doctor(scene: str, seconds: float, json_to: str | None) -> None:
    """The `doctor` command. Raises SonicBulletError."""
    (json_to,) = places(json_to)
    if is_log(scene):
        raise SceneError(f"{scene} is a contact log, which has no settings", "give the scene it came from")
    with clean_stdout(json_to) as say:
        with quiet_stderr():
            from sonic_bullet.scene import examine_scene

        with status(Path(scene).name) as tell:
            findings = examine_scene(scene, seconds, tell)
        if findings:
            for finding in findings:
                say(f"{finding.severity}: {finding.id}: {finding.what}\n    {finding.remedy}")
        else:
            say(f"{scene}: nothing found that would spoil its sound")
    write_json(
        json_to,
        {
            "scene": scene,
            "findings": [{"id": f.id, "severity": f.severity, "what": f.what, "remedy": f.remedy} for f in findings],
        },
    )


def check_request(scene: str, seconds: float | None, level: LevelWish) -> None:
    """Raise what is wrong with what is asked of a scene or log, before anything runs."""
    if seconds is not None and not 0 < seconds < 1e6:
        raise AudioError(f"{seconds} seconds cannot be rendered", "give --seconds above 0")
    level.check()
    check_scene_file(scene, "render")


def _check_places(output: str, *others: str | None) -> tuple[str, str | None, str | None, str | None, str | None]:
    """Where all outputs go, absolute: each can be written, and no two are one file, before anything is simulated.

    Raises FileError.
    """
    check_audio_output(output)
    contacts, picture, *_ = others
    if contacts is not None and not contacts.endswith(".npz"):
        raise FileError(f"cannot write {contacts}: contact logs are npz files", "end the name with .npz")
    if picture is not None:
        from sonic_bullet.plots.scene_plot import check_picture_output

        check_picture_output(picture)
    to, *found = places(output, *others)
    return str(to), found[0], found[1], found[2], found[3]


def _written(output: str, result: RenderResult | Replay, level: LevelWish, made: Soundtrack | None) -> AudioReport:
    """The sound as a file. Where silence keeps it from being one, the error says why it is silent."""
    from sonic_bullet.render import why_silent

    try:
        cues: dict[str, Any] = {} if made is None else made.cues_for(result.sound.shape[1])
        how = level.options(result.sound, result.log, output)
        return write_audio(output, result.sound, result.sr, **how, **cues)
    except AudioError as error:
        reason = None if result.sound.peaks().any() else why_silent(result.log)
        raise AudioError(error.what, reason) if reason else error from error


def with_partial(
    error: SonicBulletError | KeyboardInterrupt, to: str, output: str, level: LevelWish
) -> SonicBulletError | KeyboardInterrupt:
    """The error, its text naming NAME.partial.EXT as the user would, where what was rendered before it is written as a
    valid file beside ``to``.
    """
    result: RenderResult | Replay | None = getattr(error, "partial", None)
    note_closing()
    said = ""
    if result is not None and all(result.sound.shape):
        partial = kept_name(Path(to))
        said = f"the first {result.sound.shape[1] / result.sr:.3f} s are in {kept_name(Path(output))}"
        try:
            try:
                write_audio(partial, result.sound, result.sr, **level.options(result.sound, result.log, output))
            except AudioError:
                # silent or too short for the level asked for: kept as it is
                write_audio(partial, result.sound, result.sr)
        except FileError as failure:  # the error itself is what the user must read first
            said = failure.what
    if isinstance(error, SonicBulletError) and not stop_word():
        return type(error)(error.what, "; ".join(part for part in (error.remedy, said) if part))
    stopped = stop_word() if isinstance(error, SonicBulletError) else str(error) or "stopped"
    return KeyboardInterrupt("; ".join(part for part in (stopped, said) if part))


def _by_hand(scene: str, log: ContactLog) -> tuple[str, ...]:
    from sonic_bullet.soundtrack.score.by_hand import move_notes, moves_of

    moves = () if is_log(scene) else moves_of(log)
    driven = any(one.drives for one in moves)
    remedy = (f"contacts of what is driven are not simulated: sonic-bullet score {scene} lets it sound",)
    return (*move_notes(log, moves), *(remedy if driven else ()))


def _oversized(log: ContactLog) -> tuple[str, ...]:
    from sonic_bullet.geometry import oversize
    from sonic_bullet.records.simulated import with_body_id

    large = [(body, oversize(body.model.vertex_m, body.model.mass_kg)) for body in log.bodies if body.model is not None]
    remedy = "load it with globalScaling=0.001, or give its mesh in metres, if its numbers are millimetres"
    return tuple(f"{with_body_id(body.name, body.body_id)} {words}; {remedy}" for body, words in large if words)


def summary(report: AudioReport, log: ContactLog) -> str:
    """What was written, in one line."""
    from sonic_bullet.plots.scene_plot import quantity

    channels = format_count(report.channels, "channel")
    scale = "" if report.gain_per_pa == 1 else f", scaled by {report.gain_per_pa:.4g}"
    scale += ", clipped" if report.clipped else ""
    units = {quantity(sensor)[1] for sensor in log.sensors}
    unit = units.pop() if len(units) == 1 else "(mixed units)"
    return (
        f"{report.path}: {report.seconds:.3f} s, {channels}, {report.sr} Hz, peak {report.peak_pa:.4g} {unit}, "
        f"rms {report.rms_pa:.4g} {unit}{scale}"
    )
