"""Command `score`: the sound of a baked animation."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sonic_bullet.apps.cli.output import clean_stdout, places, progress_bar, quiet_stderr, write_json
from sonic_bullet.apps.cli.scenes.receivers import Receivers
from sonic_bullet.apps.cli.scenes.rooms import read_room
from sonic_bullet.apps.cli.sound_level import check_level, file_level, level_warnings, report_level, scale_path
from sonic_bullet.options.option import keywords
from sonic_bullet.options.score import ScoreOptions
from sonic_bullet.records.errors import FileError, SonicBulletError

if TYPE_CHECKING:
    from sonic_bullet.apps.cli.scenes.scene_runs import Replay
    from sonic_bullet.scene import RenderResult


def run_score(animation: str, options: ScoreOptions) -> None:
    """Run `score`; raises SonicBulletError."""
    from sonic_bullet.apps.cli.output import print_report
    from sonic_bullet.apps.cli.scenes.render_outputs import with_partial
    from sonic_bullet.apps.cli.scenes.render_report import RenderReport
    from sonic_bullet.apps.cli.scenes.scene_commands import rendered_again
    from sonic_bullet.files import check_audio_output, check_sr, write_at_level, write_log

    output, level = options.output, options.level
    asked = replace(options.animation, sr=check_sr(options.animation.sr))
    check_level(level)
    check_audio_output(output)
    of_scene = _check_options(animation, options)
    space, room = Receivers.read(options.space), read_room(options.room)
    to, contacts_to, json_to, _ = places(output, options.contacts, options.json_to, scale_path(level, output))
    with clean_stdout(json_to) as echo:
        with quiet_stderr():
            from sonic_bullet.apps.soundtrack.score.scoring import rules_of, score_animation, score_scene
        spatial = bool(space) or room is not None
        asked = replace(asked, rules=rules_of(options.table), tail_db=None if spatial else level.tail_db)
        result: RenderResult | Replay | None = None
        try:
            with progress_bar(Path(animation).name):
                if of_scene:
                    shared = ("sr", "seed", "microphones", "material", "tail_db")
                    scored = score_scene(animation, **{name: getattr(asked, name) for name in shared})
                else:
                    scored = score_animation(animation, **keywords(asked))
                result = rendered_again(scored, level.tail_db, space, room, animation) if spatial else scored
            if contacts_to is not None:
                write_log(contacts_to, result.log)
        except (SonicBulletError, KeyboardInterrupt) as error:
            if result is not None:
                error.partial = result  # type: ignore[union-attr]
            raise with_partial(error, str(to), output, level) from error
        found = file_level(level, result.sound, result.sr, result.log, str(to))
        report = replace(write_at_level(str(to), result.sound, result.sr, found), path=output)
        notes = (*result.notes, *level_warnings(report))
        rendered = RenderReport(result.log, report, notes)
        print_report(rendered, echo)
        scale = report_level(level, str(to), found, report.peak_pa, result.log, report.clipped)
        for note in notes:
            print(f"sonic-bullet: note: {note}", file=sys.stderr)
    write_json(json_to, rendered.to_json() | {"scale": scale})


def _check_options(animation: str, options: ScoreOptions) -> bool:
    """Return whether it is a scene that is scored; raises FileError where options contradict it, or each other."""
    if options.contacts is not None and not options.contacts.endswith(".npz"):
        raise FileError(f"cannot write {options.contacts}: contact logs are npz files", "end the name with .npz")
    of_scene, asked = Path(animation).suffix.lower() == ".py", options.animation
    if of_scene and (options.table is not None or asked.fps is not None or asked.scale != 1):
        raise FileError(
            f"{animation} is a scene, which says its materials, step and lengths itself",
            "leave out --materials, --fps and --scale",
        )
    return of_scene
