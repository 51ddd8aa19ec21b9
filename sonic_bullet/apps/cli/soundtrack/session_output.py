"""Output of `render --session DIR`: a folder that an editor opens.

SessionOptions -> checked -> mix, stems (soundtrack_outputs) and film in DIR -> Timeline
    -> session.otio, session.rpp
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.apps.cli.output import folder_place
from sonic_bullet.options.render import SessionOptions
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError

if TYPE_CHECKING:
    from sonic_bullet.apps.cli.scenes.scene_runs import Replay
    from sonic_bullet.apps.cli.soundtrack.soundtrack_outputs import Soundtrack
    from sonic_bullet.apps.soundtrack.editing.timeline import FilmItem
    from sonic_bullet.files import AudioReport
    from sonic_bullet.files.levels import FileLevel
    from sonic_bullet.scene import RenderResult
    from sonic_bullet.simulators.pictures import PlacedLink

OTIO, REAPER = "session.otio", "session.rpp"


def checked_session(session: SessionOptions, stems: str | None) -> SessionOptions:
    """Return the same with its folder absolute, tried and made; raises FileError."""
    if session.folder is None:
        if session.film_fps is not None or session.film_size is not None:
            raise FileError("--film and --film-size are of a session", "give --session DIR too, or use film")
        return session
    if stems is not None:
        raise FileError("--session holds the stems, and --stems asks for them elsewhere", "give one of both")
    from sonic_bullet.apps.soundtrack.editing.timeline import FILM_FILE

    folder = folder_place(session.folder, "")
    if session.film_fps is not None:
        from sonic_bullet.apps.soundtrack.film_writer import as_fps, check_size, pyav

        as_fps(session.film_fps), check_size(session.film_size or (1280, 720)), pyav()
    Path(folder).mkdir(parents=True, exist_ok=True)
    for name in (OTIO, REAPER, FILM_FILE):
        from sonic_bullet.files import check_output

        check_output(Path(folder) / name)
    return replace(session, folder=folder)


def session_mix(session: SessionOptions) -> str:
    """Path of the session's mix."""
    from sonic_bullet.apps.soundtrack.editing.timeline import MIX_FILE

    return str(Path(session.folder or "") / MIX_FILE)


def write_session(
    session: SessionOptions,
    result: RenderResult | Replay,
    level: FileLevel,
    made: Soundtrack,
    mix: AudioReport,
    standing: list[PlacedLink],
) -> tuple[str, dict[str, Any]]:
    """Write film and projects after mix and stems; return a description and JSON values.

    Raises FileError, AudioError.
    """
    from sonic_bullet.apps.soundtrack.editing.otio_timeline import is_installed, otio_timeline
    from sonic_bullet.apps.soundtrack.editing.reaper_project import reaper_project
    from sonic_bullet.apps.soundtrack.editing.timeline import MIX_FILE, SoundItem, Timeline
    from sonic_bullet.engine.runtime.sound_events import cues_of
    from sonic_bullet.files import replace_file

    folder = Path(session.folder or "")
    film = _film(session, result, level, standing)
    name_of = {f"{stem.name}.wav": result.log.bodies[stem.index].name for stem in made.stems}
    stems = [SoundItem(name, path, mix.frames, mix.channels) for path, name in name_of.items()]
    timeline = Timeline(
        folder.name,
        mix.sr,
        (SoundItem("mix", MIX_FILE, mix.frames, mix.channels, muted=bool(stems)), *stems),
        film,
        cues_of(made.events, result.log, mix.sr, mix.frames),
        made.time_reference,
    )
    projects = {REAPER: reaper_project(timeline)}
    if is_installed():
        projects[OTIO] = otio_timeline(timeline)
    for name, text in projects.items():
        with replace_file(folder / name) as file:
            file.write(text)
    counts = f"{format_count(len(stems), 'stem')}{', a film' if film else ''}"
    held = f"mix, {counts}, {format_count(len(timeline.markers), 'marker')}"
    said = f"{folder}{os.sep}: {held} in {' and '.join(sorted(projects))}"
    if OTIO not in projects:
        said += f"; no {OTIO}: it needs OpenTimelineIO, pip install 'sonic_bullet[session]'"
    return said, {
        "folder": str(folder),
        "projects": sorted(projects),
        "markers": len(timeline.markers),
    }


def _film(
    session: SessionOptions,
    result: RenderResult | Replay,
    level: FileLevel,
    standing: list[PlacedLink],
) -> FilmItem | None:
    if session.film_fps is None:
        return None
    from sonic_bullet.apps.soundtrack.editing.timeline import FILM_FILE, FilmItem
    from sonic_bullet.apps.soundtrack.film import FilmLook, make_film
    from sonic_bullet.apps.soundtrack.film_writer import as_fps

    look = FilmLook(as_fps(session.film_fps), session.film_size or (1280, 720))
    report = make_film(
        Path(session.folder or "") / FILM_FILE,
        result.log,
        result.sound,
        result.sr,
        look=look,
        standing=standing,
        level=level,
    )
    return FilmItem(FILM_FILE, report.pictures, report.fps)
