"""Commands `render` and `doctor`: check every output's place first, run, then write (render_outputs.py)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.apps.cli.output import clean_stdout, places, progress_bar, quiet_stderr, status, write_json
from sonic_bullet.apps.cli.scenes.render_outputs import RenderOutputs, with_partial
from sonic_bullet.apps.cli.scenes.room_options import OPTIONS as ROOM_OPTIONS
from sonic_bullet.apps.cli.scenes.room_options import read_room
from sonic_bullet.apps.cli.scenes.scene_runs import (
    Replay,
    WantedMaterials,
    Wish,
    check_scene_file,
    is_log,
    prepared,
    rendered,
    replayed,
    simulated,
    standing_collector,
)
from sonic_bullet.apps.cli.scenes.space_options import OPTIONS as SPACE_OPTIONS
from sonic_bullet.apps.cli.scenes.space_options import SpaceWish
from sonic_bullet.apps.cli.scenes.take_options import OPTIONS as TAKE_OPTIONS
from sonic_bullet.apps.cli.scenes.take_options import TakesWish
from sonic_bullet.apps.cli.scenes.take_outputs import write_takes
from sonic_bullet.apps.cli.sound_level import OPTIONS, LevelWish
from sonic_bullet.apps.cli.soundtrack.session_output import OPTIONS as SESSION_OPTIONS
from sonic_bullet.apps.cli.soundtrack.session_output import SessionWish
from sonic_bullet.apps.cli.soundtrack.soundtrack_outputs import SoundtrackWish
from sonic_bullet.files import check_audio_output, check_sr
from sonic_bullet.records.errors import AudioError, FileError, SceneError, SonicBulletError

if TYPE_CHECKING:
    from sonic_bullet.files.contact_log import ContactLog
    from sonic_bullet.scene import RenderResult
    from sonic_bullet.simulators.pictures import Standing


def run_render(
    scene: str,
    *,
    output: str | None,
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
    fill_modes: bool,
    draft: bool,
    residual: bool | None,
    supports: bool | None,
    image: bool | None,
    client: int | None = None,
    **others: Any,
) -> None:
    """Run `render`. others: options of `LevelWish`, `SoundtrackWish` and `SessionWish`.

    Raises SonicBulletError, and KeyboardInterrupt whose text names the file with the sound so far.
    """
    rate = None if sr is None else check_sr(sr)
    level = LevelWish(**{name: others.pop(name) for name in OPTIONS})
    check_request(scene, seconds, level)
    materials = WantedMaterials.read(material, silent, fill_modes, draft)
    if models is not None and contacts is None:
        raise FileError("--models says where a log's models are, and no log is asked for", "give --contacts too")
    space = SpaceWish.read(**{name: others.pop(name) for name in SPACE_OPTIONS})
    room = read_room(**{name: others.pop(name) for name in ROOM_OPTIONS})
    takes = TakesWish.read(**{name: others.pop(name) for name in TAKE_OPTIONS})
    session = SessionWish(**{name: others.pop(name) for name in SESSION_OPTIONS}).checked(others["stems"])
    if output is None and session.folder is None:
        raise FileError("there is no --output", "give -o NAME.wav, or --session DIR")
    if takes.takes is not None:
        others_given = {"--contacts": contacts, "--picture": picture, "--scale-json": level.scale_json or None}
        _check_takes_alone(others_given | {f"--{name}": others[name] for name in ("stems", "events")}, others, session)
    output = output or session.mix
    extras = SoundtrackWish(**others | {"stems": session.folder or others["stems"]}).checked(output)
    to, contacts, picture, json_to, events_to = _check_places(
        output, contacts, picture, json_to, extras.events, level.json_path(output)
    )
    names = takes.outputs(output) if takes.takes is not None else []
    *take_places, page, _ = places(*names, takes.page, json_to)
    scene_page = page if takes.takes is None else None
    outputs = RenderOutputs(
        scene, output, to, contacts, models, picture, events_to, level, extras, session, scene_page, takes.page or ""
    )
    standing: list[Standing] = []
    with clean_stdout(json_to) as echo:
        try:
            with progress_bar(Path(scene).name):
                wish = Wish(
                    seconds, rate, microphones, seed, materials, residual, supports,
                    at_end=standing_collector(standing) if session.film_fps is not None or scene_page else None,
                    tail_db=level.tail_db, room=room, image=image, client=client,
                )  # fmt: skip
                result: RenderResult | Replay
                if not takes:
                    result = rendered_in_space(scene, wish, space)
                else:
                    log, said = log_of(scene, wish, space)
                    if takes.takes is None:
                        log, more = takes.changed(log, scene)
                        result = rendered(log, wish, (*said, *more))
        except (SonicBulletError, KeyboardInterrupt) as error:
            raise with_partial(error, to, output, level) from error
        if takes.takes is not None:
            to_each = [(name, str(place)) for name, place in zip(names, take_places, strict=True)]
            log = takes.applied(log, scene)
            described = write_takes(log, said, takes, level, to_each, page, wish, echo)
        else:
            described = outputs.write(result, standing, echo)
    write_json(json_to, described)


def log_of(scene: str, wish: Wish, space: SpaceWish) -> tuple[ContactLog, tuple[str, ...]]:
    """Return the log of a scene, run, or a log as it is to be rendered, and notes for the user."""
    from sonic_bullet.engine.runtime.replay import render_notes

    if is_log(scene):
        log, _, said = prepared(scene, wish)
    else:
        result = simulated(scene, replace(wish, tail_db=0.0, room=None, feels_all=bool(space.touching)))
        log, of_other_sensors = result.log, render_notes(result.sound, result.log)
        said = tuple(note for note in result.notes if note not in of_other_sensors)
    if not space:
        return log, said
    log, more = space.applied(log if wish.rate is None else replace(log, sr=wish.rate), scene)
    return log, (*said, *more)


def rendered_in_space(scene: str, wish: Wish, space: SpaceWish) -> RenderResult | Replay:
    """Run a scene or replay a log; with other microphones, or in a room, from the scene's log."""
    if space or wish.room is not None:
        log, said = log_of(scene, wish, space)
        return rendered(log, wish, said)
    return replayed(scene, wish) if is_log(scene) else simulated(scene, wish)


def rendered_again(result: RenderResult, wish: Wish, space: SpaceWish, where: str) -> Replay:
    """Render what was rendered once more, from its log, with other microphones or in a room."""
    from sonic_bullet.engine.runtime.replay import render_notes

    of_other_sensors = render_notes(result.sound, result.log)
    said = tuple(note for note in result.notes if note not in of_other_sensors)
    log, more = space.applied(result.log, where)
    return rendered(log, wish, (*said, *more))


def _check_takes_alone(outputs_given: dict[str, Any], others: dict[str, Any], session: SessionWish) -> None:
    """Raise FileError where an output of one sound is asked for of several takes."""
    given = outputs_given | {"--session": session.folder, "--cues": others["cues"] or None}
    for option, value in given.items():
        if value is not None:
            raise FileError(f"{option} is of one sound, and --takes writes several", "give --take K in its place")


def run_doctor(scene: str, seconds: float, json_to: str | None) -> None:
    """Run `doctor`; raises SonicBulletError."""
    (json_to,) = places(json_to)
    if is_log(scene):
        raise SceneError(f"{scene} is a contact log, which has no settings", "give the scene it came from")
    with clean_stdout(json_to) as echo:
        with quiet_stderr():
            from sonic_bullet.scene import examine_scene

        with status(Path(scene).name):
            findings = examine_scene(scene, seconds)
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


def check_request(scene: str, seconds: float | None, level: LevelWish) -> None:
    """Raise an error for wrong options of a scene or log, before anything runs."""
    if seconds is not None and not 0 < seconds < 1e6:
        raise AudioError(f"{seconds} seconds cannot be rendered", "give --seconds above 0")
    level.check()
    check_scene_file(scene, "render")


def _check_places(output: str, *others: str | None) -> tuple[str, str | None, str | None, str | None, str | None]:
    """Return the absolute paths of all outputs; FileError where one cannot be written or two are one file."""
    check_audio_output(output)
    contacts, picture, *_ = others
    if contacts is not None and not contacts.endswith(".npz"):
        raise FileError(f"cannot write {contacts}: contact logs are npz files", "end the name with .npz")
    if picture is not None:
        from sonic_bullet.apps.report.plots.scene_plot import check_picture_output

        check_picture_output(picture)
    to, *found = places(output, *others)
    return str(to), found[0], found[1], found[2], found[3]
