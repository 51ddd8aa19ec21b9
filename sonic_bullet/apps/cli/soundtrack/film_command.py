"""Command `film`: a scene or a contact log as pictures with sound."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sonic_bullet.apps.cli.examples import EXAMPLES
from sonic_bullet.apps.cli.output import clean_stdout, places, print_report, progress_bar, quiet_stderr, write_json
from sonic_bullet.apps.cli.parameters import Numbers, json_option, scene_options
from sonic_bullet.apps.cli.scenes.room_options import OPTIONS as ROOM_OPTIONS
from sonic_bullet.apps.cli.scenes.room_options import read_room, room_options
from sonic_bullet.apps.cli.scenes.space_options import OPTIONS as SPACE_OPTIONS
from sonic_bullet.apps.cli.scenes.space_options import SpaceWish, space_options
from sonic_bullet.apps.cli.sound_level import OPTIONS, LevelWish, level_options
from sonic_bullet.apps.soundtrack.film_codecs import CODECS, USUAL_CODECS
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError, SonicBulletError

if TYPE_CHECKING:
    from sonic_bullet.apps.soundtrack.film import FilmReport
    from sonic_bullet.simulators.pictures import Standing


class Size(click.ParamType):  # type: ignore[type-arg,unused-ignore]  # generic since click 8.3
    """WIDTHxHEIGHT in pixels."""

    name = "WxH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Return the two numbers; click's usage error where they are not valid."""
        if isinstance(value, tuple):
            return value
        width, x, height = str(value).lower().partition("x")
        if not (x and width.isdecimal() and height.isdecimal()) or len(str(value)) > 20:
            self.fail(f"{str(value)[:40]!r} is no size: 1280x720 say", param, ctx)
        return int(width), int(height)


@click.command(epilog=EXAMPLES["film"])
@click.argument("scene", metavar="SCENE.py|.gltf|LOG.npz")
@click.option("-o", "--output", required=True, metavar="NAME.mp4", help="Film: .mp4 .mov .mkv")
@click.option("--seconds", type=float, metavar="S", help="How long. [default: the scene's own, else 4; all of a log]")
@click.option("--fps", default="30", show_default=True, metavar="F", help="Pictures a second: 24, 25, 30000/1001, 60 …")
@click.option("--size", type=Size(), default="1280x720", show_default=True, help="Of the pictures, even numbers.")
@click.option("--camera", type=Numbers("X,Y,Z"), help="Where it stands, in m. [default: it takes in what moves]")
@click.option("--look-at", type=Numbers("X,Y,Z"), help="What it looks at, in m. [default: the middle of what moves]")
@click.option("--follow", metavar="BODY", help="Name of a body that the camera goes with.")
@click.option("--overlay", is_flag=True, help="Draw contacts as they are heard, and why others are silent.")
@click.option("--shadows", is_flag=True, help="Draw shadows; takes twice as long.")
@click.option(
    "--audio", "codec", type=click.Choice(list(CODECS)), help=f"Codec of the sound. [default: {USUAL_CODECS}]"
)
@click.option("--sr", type=float, metavar="HZ", help="Sample rate. [default: 48000; a log's own]")
@level_options
@scene_options
@space_options
@room_options
@json_option
def film(scene: str, output: str, json_to: str | None, **options: Any) -> None:
    """Film a PyBullet scene, or a contact log, with its sound: pictures and samples on one clock."""
    from sonic_bullet.apps.cli.scenes.render_outputs import with_partial
    from sonic_bullet.apps.cli.scenes.scene_commands import check_request, rendered_in_space
    from sonic_bullet.apps.cli.scenes.scene_runs import DEFAULT_SR, WantedMaterials, Wish, standing_collector
    from sonic_bullet.apps.soundtrack.film import FilmLook, make_film, pictures_in
    from sonic_bullet.apps.soundtrack.film_writer import as_fps, check_film_output, check_size
    from sonic_bullet.files import check_sr

    rate = None if options["sr"] is None else check_sr(options["sr"])
    level = LevelWish(**{name: options[name] for name in OPTIONS})
    check_request(scene, options["seconds"], level)
    materials = WantedMaterials.read(options["material"], options["silent"], options["fill_modes"], options["draft"])
    space = SpaceWish.read(**{name: options[name] for name in SPACE_OPTIONS})
    room = read_room(**{name: options[name] for name in ROOM_OPTIONS})
    look = FilmLook(
        as_fps(options["fps"]),
        check_size(options["size"]),
        options["camera"],
        options["look_at"],
        options["follow"],
        options["shadows"],
    )
    count = max(len(options["microphones"]), len(space.paths) + len(space.on), 1) * space.channels
    check_film_output(output, rate or DEFAULT_SR, count, options["codec"])
    to, json_to, _ = places(output, json_to, level.json_path(output))
    standing: list[Standing] = []

    sound_to = str(Path(str(to)).with_suffix(".wav"))
    with clean_stdout(json_to) as echo:
        with progress_bar(Path(scene).name):
            wish = Wish(
                options["seconds"], rate, options["microphones"], options["seed"], materials, None, None,
                standing_collector(standing), level.tail_db, room,
            )  # fmt: skip
            try:
                result = rendered_in_space(scene, wish, space)
            except (SonicBulletError, KeyboardInterrupt) as error:
                raise with_partial(error, sound_to, sound_to, level) from error
        if not result.log.sensors:
            raise FileError("there is no microphone, so the film has no sound", "give one, --microphone 0,-1,0.5")
        pictures_in(result.log, look.fps, options["seconds"])
        found = level.found(result.sound, result.sr, result.log, str(to))
        events = None
        with quiet_stderr():
            # which says when PyBullet was built
            import sonic_bullet.simulators.pybullet.staged.picture_world  # noqa: F401
        with progress_bar("pictures"):
            if options["overlay"]:
                from sonic_bullet.engine.runtime.sound_events import find_sound_events

                events = find_sound_events(result.log, sr=result.sr)
            report = make_film(
                str(to),
                result.log,
                result.sound,
                result.sr,
                look=look,
                seconds=options["seconds"],
                standing=standing,
                events=events,
                codec=options["codec"],
                level=found,
            )
        notes = (*result.notes, *report.notes, *_clipped(report))
        written = WrittenFilm(output, report, notes)
        print_report(written, echo)
        peak = float(result.sound.shaped(found.curve).peaks().max())
        scale = level.say(str(to), found, peak, result.log, report.clipped)
        for note in notes:
            print(f"sonic-bullet: note: {note}", file=sys.stderr)
    write_json(json_to, written.to_json() | {"scale": scale})


def _clipped(report: FilmReport) -> tuple[str, ...]:
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
