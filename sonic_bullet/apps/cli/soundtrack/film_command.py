"""Command `film`: a scene or a contact log as pictures with sound."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.apps.cli.output import clean_stdout, places, print_report, progress_bar, quiet_stderr, write_json
from sonic_bullet.apps.cli.scenes.receivers import Receivers
from sonic_bullet.apps.cli.scenes.rooms import read_room
from sonic_bullet.apps.cli.sound_level import check_level, file_level, report_level, scale_path
from sonic_bullet.options.film import FilmOptions
from sonic_bullet.options.option import keywords
from sonic_bullet.options.render import DEFAULT_SR, RenderSceneOptions
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError, SonicBulletError

if TYPE_CHECKING:
    from sonic_bullet.apps.soundtrack.film import FilmReport
    from sonic_bullet.simulators.pictures import PlacedLink


def run_film(scene: str, options: FilmOptions) -> None:
    """Run `film`; raises SonicBulletError."""
    from sonic_bullet.apps.cli.scenes.render_outputs import with_partial
    from sonic_bullet.apps.cli.scenes.scene_commands import rendered_in_space
    from sonic_bullet.apps.cli.scenes.scene_runs import check_scene_file, checked_scene, standing_collector
    from sonic_bullet.apps.soundtrack.film import make_film, pictures_in
    from sonic_bullet.apps.soundtrack.film_writer import as_fps, check_film_output, check_size
    from sonic_bullet.session.arguments import as_sensors

    level, output = options.level, options.output
    check_level(level)
    check_scene_file(scene, "render")
    asked = checked_scene(options.scene)
    space, room = Receivers.read(options.space), read_room(options.room)
    look = replace(options.look, fps=as_fps(options.look.fps), size=check_size(options.look.size))
    microphones = () if asked.microphones is None else as_sensors(asked.microphones, "microphones")
    count = max(len(microphones), len(space.paths) + len(space.on), 1) * space.channels
    check_film_output(output, asked.sr or DEFAULT_SR, count, options.codec)
    to, json_to, _ = places(output, options.json_to, scale_path(level, output))
    standing: list[PlacedLink] = []

    sound_to = str(Path(str(to)).with_suffix(".wav"))
    with clean_stdout(json_to) as echo:
        with progress_bar(Path(scene).name):
            run = RenderSceneOptions(**keywords(asked), at_end=standing_collector(standing), tail_db=level.tail_db)
            try:
                result = rendered_in_space(scene, run, space, room)
            except (SonicBulletError, KeyboardInterrupt) as error:
                raise with_partial(error, sound_to, sound_to, level) from error
        if not result.log.sensors:
            raise FileError("there is no microphone, so the film has no sound", "give one, --microphone 0,-1,0.5")
        pictures_in(result.log, look.fps, asked.seconds)
        found = file_level(level, result.sound, result.sr, result.log, str(to))
        events = None
        with quiet_stderr():
            # which says when PyBullet was built
            import sonic_bullet.simulators.pybullet.staged.picture_world  # noqa: F401
        with progress_bar("pictures"):
            if options.overlay:
                from sonic_bullet.engine.runtime.sound_events import find_sound_events

                events = find_sound_events(result.log, sr=result.sr)
            report = make_film(
                str(to),
                result.log,
                result.sound,
                result.sr,
                look=look,
                seconds=asked.seconds,
                standing=standing,
                events=events,
                codec=options.codec,
                level=found,
            )
        notes = (*result.notes, *report.notes, *_describe_clipping(report))
        written = WrittenFilm(output, report, notes)
        print_report(written, echo)
        peak = float(result.sound.with_curve(found.curve).peaks().max())
        scale = report_level(level, str(to), found, peak, result.log, report.clipped)
        for note in notes:
            print(f"sonic-bullet: note: {note}", file=sys.stderr)
    write_json(json_to, written.to_json() | {"scale": scale})


def _describe_clipping(report: FilmReport) -> tuple[str, ...]:
    many = format_count(report.clipped, "sample was", "samples were")
    return (f"{many} clipped at full scale; --peak-dbfs -1 avoids it",) * bool(report.clipped)


@dataclass(frozen=True, slots=True)
class WrittenFilm:
    """Report of a film that was written."""

    output: str
    film: FilmReport
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the figures of pictures and sound."""
        return {
            "output": self.output,
            "pictures": self.film.pictures,
            "fps": str(self.film.fps),
            "size": list(self.film.size),
            "seconds": float(self.film.pictures / self.film.fps),
            "samples": self.film.samples,
            "sr": self.film.sr,
            "channels": self.film.channels,
            "codec": self.film.codec,
            "gain_per_pa": self.film.gain_per_pa,
            "clipped": self.film.clipped,
            "notes": list(self.notes),
        }

    def lines(self) -> list[str]:
        """Describe the film in one line."""
        film = self.film
        width, height = film.size
        channels = format_count(film.channels, "channel")
        return [
            f"{self.output}: {float(film.pictures / film.fps):.3f} s, {film.pictures} pictures of {width}x{height} at "
            f"{film.fps} a second, {film.codec}, {channels}, {film.sr} Hz, scaled by {film.gain_per_pa:.4g}"
        ]
