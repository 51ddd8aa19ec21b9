"""Outputs of `render --takes N`: each take rendered, levelled and written, one after another; then the page.

Each is whole or absent: an error or interrupt leaves those before it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.apps.cli.output import progress_bar
from sonic_bullet.apps.cli.scenes.render_outputs import find_level_of, with_partial
from sonic_bullet.apps.cli.scenes.render_report import RenderReport
from sonic_bullet.apps.cli.scenes.scene_runs import render_log
from sonic_bullet.apps.cli.scenes.take_plan import TakePlan, describe_draws
from sonic_bullet.apps.cli.sound_level import level_warnings, report_level
from sonic_bullet.apps.report.takes_page import take_entry, write_page
from sonic_bullet.files import write_at_level
from sonic_bullet.files.loudness.meter import measure_loudness
from sonic_bullet.options.render import LevelOptions, RenderSceneOptions
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import SonicBulletError
from sonic_bullet.session.variation import AS_SIMULATED, make_take

if TYPE_CHECKING:
    from sonic_bullet.apps.cli.scenes.scene_runs import Room
    from sonic_bullet.files.contact_log import ContactLog
    from sonic_bullet.files.levels import FileLevel


def write_takes(
    log: ContactLog,
    notes: tuple[str, ...],
    takes: TakePlan,
    level: LevelOptions,
    places: list[tuple[str, str]],
    page: str | None,
    scene: RenderSceneOptions,
    *,
    room: Room,
    echo: Callable[[str], None],
) -> dict[str, Any]:
    """Write all takes of a log; return them as JSON values; raises SonicBulletError, KeyboardInterrupt.

    places: name of each as the user gave it, and its absolute path; page: absolute.
    """
    described: list[dict[str, Any]] = []
    entries: list[dict[str, Any]] = []
    scales: list[tuple[str, FileLevel, float, ContactLog, int]] = []
    said, lines = [*notes, AS_SIMULATED], []
    for number, (output, to) in enumerate(places, start=1):
        take = make_take(log, number, takes.variation)
        try:
            with progress_bar(f"take {number} of {len(places)}"):
                result = render_log(take.log, scene, (), room)
        except (SonicBulletError, KeyboardInterrupt) as error:
            raise with_partial(error, to, output, level) from error
        found = find_level_of(result, level, to)
        try:
            report = replace(write_at_level(to, result.sound, result.sr, found), path=output)
        except SonicBulletError as error:
            finished = "; ".join([error.remedy, *[f"{name} is finished" for name, _ in places[: number - 1]][-1:]])
            raise type(error)(error.what, finished) from error
        sound = result.sound.with_curve(found.curve)
        loudness = measure_loudness(sound, result.sr, found.gain_per_pa)
        draws = describe_draws(take)
        written = RenderReport(take.log, report, result.notes)
        lines += [*written.lines(), f"{output}: {loudness}", *[f"{output}: {draws}"] * bool(draws)]
        scales.append((to, found, report.peak_pa, take.log, report.clipped))
        said += [one for one in (*result.notes, *level_warnings(report)) if one not in said]
        described.append(
            written.to_json()
            | {"take": number, "seed": take.log.seed, "drawn": {name: dict(of) for name, of in take.drawn.items()}}
            | {"loudness": asdict(loudness)}
        )
        if page is not None:
            entries.append(take_entry(output, sound, result.sr, found.gain_per_pa, str(loudness), take.drawn))
    if page is not None:
        write_page(page, entries, f"Takes of {Path(places[0][0]).name}, seed {log.seed}", AS_SIMULATED)
        lines.append(f"{takes.page}: {format_count(len(entries), 'take')}")
    echo("\n".join(lines))
    for one, scale in zip(described, scales, strict=True):
        one["scale"] = report_level(level, *scale) if one["channels"] else {}
    for note in said:
        print(f"sonic-bullet: note: {note}", file=sys.stderr)
    return {"takes": described, "notes": said, "varied": sorted(takes.variation.varied)}
