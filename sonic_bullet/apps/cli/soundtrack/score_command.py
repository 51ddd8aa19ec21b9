"""Command `score`: the sound of a baked animation."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sonic_bullet.apps.cli.examples import EXAMPLES
from sonic_bullet.apps.cli.output import clean_stdout, places, progress_bar, quiet_stderr, write_json
from sonic_bullet.apps.cli.parameters import Numbers, json_option
from sonic_bullet.apps.cli.scenes.room_options import OPTIONS as ROOM_OPTIONS
from sonic_bullet.apps.cli.scenes.room_options import read_room, room_options
from sonic_bullet.apps.cli.scenes.space_options import OPTIONS as SPACE_OPTIONS
from sonic_bullet.apps.cli.scenes.space_options import SpaceWish, space_options
from sonic_bullet.apps.cli.sound_level import OPTIONS, LevelWish, level_options, level_warnings
from sonic_bullet.records.errors import FileError, SonicBulletError

if TYPE_CHECKING:
    from sonic_bullet.apps.cli.scenes.scene_runs import Replay
    from sonic_bullet.scene import RenderResult


@click.command(epilog=EXAMPLES["score"])
@click.argument("animation", metavar="ANIMATION|SCENE.py")
@click.option("-o", "--output", required=True, metavar="NAME.wav", help="Sound file, as render has them.")
@click.option("--materials", "table", metavar="TABLE.json", help="Who is made of what, by name patterns.")
@click.option("--material", metavar="M", help="Of what moves and has none. [default: plastic]")
@click.option("--fps", type=float, metavar="F", help="Frames a second, in place of the file's own.")
@click.option("--scale", type=float, default=1.0, metavar="X", help="Of all lengths: 0.01 for centimetres.")
@click.option("--sr", type=float, default=48_000, metavar="HZ", help="Sample rate. [default: 48000]")
@click.option("--contacts", metavar="NAME.npz", help="Also write the contact log, for render and film.")
@level_options
@click.option(
    "--microphone",
    "microphones",
    type=Numbers("X,Y,Z"),
    multiple=True,
    help="A microphone in the world, in m, z up; repeat for more channels. [default: 0,-1,0.5]",
)
@click.option("--seed", type=click.IntRange(0), default=0, help="Seed of the surfaces' roughness. [default: 0]")
@space_options
@room_options
@json_option
def score(animation: str, output: str, json_to: str | None, contacts: str | None, **options: Any) -> None:
    """Render a baked animation's sound (.glb .gltf .json .npz), or that of a scene's bodies that are moved by hand."""
    from sonic_bullet.apps.cli.output import print_report
    from sonic_bullet.apps.cli.scenes.render_outputs import with_partial
    from sonic_bullet.apps.cli.scenes.render_report import RenderReport
    from sonic_bullet.apps.cli.scenes.scene_commands import rendered_again
    from sonic_bullet.apps.cli.scenes.scene_runs import WantedMaterials, Wish
    from sonic_bullet.files import check_audio_output, check_sr, write_at_level, write_log

    sr, level = check_sr(options["sr"]), LevelWish(**{name: options[name] for name in OPTIONS})
    level.check()
    check_audio_output(output)
    of_scene = _check_options(animation, contacts, options)
    space = SpaceWish.read(**{name: options[name] for name in SPACE_OPTIONS})
    room = read_room(**{name: options[name] for name in ROOM_OPTIONS})
    to, contacts_to, json_to, _ = places(output, contacts, json_to, level.json_path(output))
    with clean_stdout(json_to) as echo:
        with quiet_stderr():
            from sonic_bullet.apps.soundtrack.score.scoring import (
                SCORE_MICROPHONE,
                rules_of,
                score_animation,
                score_scene,
            )
        rules = rules_of(options["table"])
        result: RenderResult | Replay | None = None
        try:
            with progress_bar(Path(animation).name):
                how: dict[str, Any] = {"sr": sr, "seed": options["seed"]}
                spatial = bool(space) or room is not None
                how["tail_db"] = None if spatial else level.tail_db
                if of_scene:
                    places_m = options["microphones"] or None
                    scored = score_scene(animation, microphones=places_m, material=options["material"], **how)
                else:
                    how |= {name: options[name] for name in ("fps", "scale")}
                    how |= {"rules": rules, "material": options["material"] or "plastic"}
                    scored = score_animation(animation, microphones=options["microphones"] or SCORE_MICROPHONE, **how)
                result = scored
                if spatial:
                    wish = Wish(None, None, (), None, WantedMaterials(), None, None)
                    wish = replace(wish, tail_db=level.tail_db, room=room)
                    result = rendered_again(scored, wish, space, animation)
            if contacts_to is not None:
                write_log(contacts_to, result.log)
        except (SonicBulletError, KeyboardInterrupt) as error:
            if result is not None:
                error.partial = result  # type: ignore[union-attr]
            raise with_partial(error, str(to), output, level) from error
        found = level.found(result.sound, sr, result.log, str(to))
        report = replace(write_at_level(str(to), result.sound, sr, found), path=output)
        notes = (*result.notes, *level_warnings(report))
        rendered = RenderReport(result.log, report, notes)
        print_report(rendered, echo)
        scale = level.say(str(to), found, report.peak_pa, result.log, report.clipped)
        for note in notes:
            print(f"sonic-bullet: note: {note}", file=sys.stderr)
    write_json(json_to, rendered.to_json() | {"scale": scale})


def _check_options(animation: str, contacts: str | None, options: dict[str, Any]) -> bool:
    """Return whether it is a scene that is scored; raises FileError where options contradict it, or each other."""
    if contacts is not None and not contacts.endswith(".npz"):
        raise FileError(f"cannot write {contacts}: contact logs are npz files", "end the name with .npz")
    of_scene = Path(animation).suffix.lower() == ".py"
    if of_scene and (options["table"] is not None or options["fps"] is not None or options["scale"] != 1):
        raise FileError(
            f"{animation} is a scene, which says its materials, step and lengths itself",
            "leave out --materials, --fps and --scale",
        )
    return of_scene
