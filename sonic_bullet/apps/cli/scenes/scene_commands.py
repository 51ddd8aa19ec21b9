"""Commands `render` and `doctor`: check every output's place first, run, then write (render_outputs.py)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sonic_bullet.apps.cli.output import clean_stdout, places, progress_bar, quiet_stderr, status, write_json
from sonic_bullet.apps.cli.scenes.receivers import Receivers
from sonic_bullet.apps.cli.scenes.render_outputs import RenderOutputs, with_partial
from sonic_bullet.apps.cli.scenes.rooms import read_room
from sonic_bullet.apps.cli.scenes.scene_runs import (
    Replay,
    check_scene_file,
    checked_scene,
    is_log,
    prepare_log,
    render_log,
    replay_log,
    run_scene,
    standing_collector,
)
from sonic_bullet.apps.cli.scenes.take_outputs import write_takes
from sonic_bullet.apps.cli.scenes.take_plan import TakePlan
from sonic_bullet.apps.cli.sound_level import check_level, scale_path
from sonic_bullet.apps.cli.soundtrack.session_output import checked_session, session_mix
from sonic_bullet.apps.cli.soundtrack.soundtrack_outputs import checked_soundtrack
from sonic_bullet.apps.report.plots.scene_plot import check_picture_output
from sonic_bullet.engine.runtime.replay import render_notes
from sonic_bullet.files import check_audio_output
from sonic_bullet.options.render import RenderOptions, RenderSceneOptions
from sonic_bullet.records.errors import FileError, SceneError, SonicBulletError

if TYPE_CHECKING:
    from sonic_bullet.apps.cli.scenes.scene_runs import Room
    from sonic_bullet.files.contact_log import ContactLog
    from sonic_bullet.options.cache import DoctorOptions
    from sonic_bullet.scene import RenderResult
    from sonic_bullet.simulators.pictures import PlacedLink


def run_render(scene: str, options: RenderOptions) -> None:
    """Run `render`.

    Raises SonicBulletError, and KeyboardInterrupt whose text names the file with the sound so far.
    """
    level, contacts = options.level, options.contacts
    check_level(level)
    check_scene_file(scene, "render")
    asked = replace(checked_scene(options.scene), tail_db=level.tail_db)
    if options.models is not None and contacts is None:
        raise FileError("--models says where a log's models are, and no log is asked for", "give --contacts too")
    space, room, takes = Receivers.read(options.space), read_room(options.room), TakePlan.read(options.takes)
    session = checked_session(options.session, options.soundtrack.stems)
    if options.output is None and session.folder is None:
        raise FileError("there is no --output", "give -o NAME.wav, or --session DIR")
    if takes.takes is not None:
        _check_takes_alone(options)
    output = options.output or session_mix(session)
    extras = checked_soundtrack(replace(options.soundtrack, stems=session.folder or options.soundtrack.stems), output)
    to, contacts, picture, json_to, events_to = _check_places(
        output, contacts, options.picture, options.json_to, extras.events, scale_path(level, output)
    )
    names = takes.outputs(output) if takes.takes is not None else []
    *take_places, page, _ = places(*names, takes.page, json_to)
    scene_page = page if takes.takes is None else None
    outputs = RenderOutputs(
        scene, output, to, contacts, options.models, picture, events_to, level, extras, session, scene_page,
        takes.page or "",
    )  # fmt: skip
    standing: list[PlacedLink] = []
    if session.film_fps is not None or scene_page:
        asked = replace(asked, at_end=standing_collector(standing))
    with clean_stdout(json_to) as echo:
        try:
            with progress_bar(Path(scene).name):
                result: RenderResult | Replay
                if not takes:
                    result = rendered_in_space(scene, asked, space, room)
                else:
                    log, said = log_of(scene, asked, space)
                    if takes.takes is None:
                        log, more = takes.change_log(log, scene)
                        result = render_log(log, asked, (*said, *more), room)
        except (SonicBulletError, KeyboardInterrupt) as error:
            raise with_partial(error, to, output, level) from error
        if takes.takes is not None:
            to_each = [(name, str(place)) for name, place in zip(names, take_places, strict=True)]
            log = takes.apply_to(log, scene)
            described = write_takes(log, said, takes, level, to_each, page, asked, room=room, echo=echo)
        else:
            described = outputs.write(result, standing, echo)
    write_json(json_to, described)


def log_of(path: str, scene: RenderSceneOptions, space: Receivers) -> tuple[ContactLog, tuple[str, ...]]:
    """Return the log of a scene, run, or a log as it is to be rendered, and notes for the user."""
    if is_log(path):
        log, said = prepare_log(path, scene)
    else:
        result = run_scene(path, replace(scene, tail_db=0.0), feels_all=bool(space.touching))
        log, of_other_sensors = result.log, render_notes(result.sound, result.log)
        said = tuple(note for note in result.notes if note not in of_other_sensors)
    if not space:
        return log, said
    log, more = space.apply_to(log if scene.sr is None else replace(log, sr=scene.sr), path)
    return log, (*said, *more)


def rendered_in_space(
    path: str, scene: RenderSceneOptions, space: Receivers, room: Room = None
) -> RenderResult | Replay:
    """Run a scene or replay a log; with other microphones, or in a room, from the scene's log."""
    if space or room is not None:
        log, said = log_of(path, scene, space)
        return render_log(log, scene, said, room)
    return replay_log(path, scene) if is_log(path) else run_scene(path, scene)


def rendered_again(result: RenderResult, tail_db: float, space: Receivers, room: Room, where: str) -> Replay:
    """Render what was rendered once more, from its log, with other microphones or in a room."""
    of_other_sensors = render_notes(result.sound, result.log)
    said = tuple(note for note in result.notes if note not in of_other_sensors)
    log, more = space.apply_to(result.log, where)
    return render_log(log, RenderSceneOptions(tail_db=tail_db), (*said, *more), room)


def _check_takes_alone(options: RenderOptions) -> None:
    """Raise FileError where an output of one sound is asked for of several takes."""
    of_one = {
        "--contacts": options.contacts, "--picture": options.picture, "--scale-json": options.level.scale_json,
        "--stems": options.soundtrack.stems, "--events": options.soundtrack.events,
        "--session": options.session.folder, "--cues": options.soundtrack.cues,
    }  # fmt: skip
    for option, value in of_one.items():
        if value:
            raise FileError(f"{option} is of one sound, and --takes writes several", "give --take K in its place")


def run_doctor(scene: str, options: DoctorOptions) -> None:
    """Run `doctor`; raises SonicBulletError."""
    (json_to,) = places(options.json_to)
    if is_log(scene):
        raise SceneError(f"{scene} is a contact log, which has no settings", "give the scene it came from")
    with clean_stdout(json_to) as echo:
        with quiet_stderr():
            from sonic_bullet.scene import examine_scene

        with status(Path(scene).name):
            findings = examine_scene(scene, options.seconds, client=options.client)
        if findings:
            for finding in findings:
                echo(f"{finding.severity}: {finding.id}: {finding.what}\n    {finding.remedy}")
        else:
            echo(f"{scene}: nothing found that would spoil its sound")
    write_json(
        json_to,
        {
            "scene": scene,
            "findings": [{"id": f.id, "severity": f.severity, "what": f.what, "remedy": f.remedy} for f in findings],
        },
    )


def _check_places(output: str, *others: str | None) -> tuple[str, str | None, str | None, str | None, str | None]:
    """Return the absolute paths of all outputs; FileError where one cannot be written or two are one file."""
    check_audio_output(output)
    contacts, picture, *_ = others
    if contacts is not None and not contacts.endswith(".npz"):
        raise FileError(f"cannot write {contacts}: contact logs are npz files", "end the name with .npz")
    if picture is not None:
        check_picture_output(picture)
    to, *found = places(output, *others)
    return str(to), found[0], found[1], found[2], found[3]
