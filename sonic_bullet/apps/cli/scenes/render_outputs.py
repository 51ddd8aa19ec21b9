"""Outputs of `render`: log, sound, stems, session, picture, each written whole or not at all.

result -> log -> stems and events, made -> level -> sound -> stems, film, session -> picture -> words, JSON
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.apps.cli.output import progress_bar
from sonic_bullet.apps.cli.scenes.render_report import RenderReport
from sonic_bullet.apps.cli.scenes.scene_runs import Replay, is_log
from sonic_bullet.apps.cli.sound_level import fade_sound, file_level, level_warnings, report_level
from sonic_bullet.apps.cli.soundtrack.session_output import session_mix, write_session
from sonic_bullet.apps.cli.soundtrack.soundtrack_outputs import Soundtrack, make_soundtrack
from sonic_bullet.apps.report.plots.scene_plot import render_picture
from sonic_bullet.apps.soundtrack.scene_page import write_scene_page
from sonic_bullet.apps.soundtrack.score.by_hand import move_notes, moves_of
from sonic_bullet.engine.runtime.replay import why_silent
from sonic_bullet.files import AudioReport, kept_name, write_at_level, write_audio, write_log
from sonic_bullet.files.loudness.meter import measure_loudness
from sonic_bullet.geometry import oversize
from sonic_bullet.machine.worker import note_closing, stop_word
from sonic_bullet.options.render import LevelOptions, SessionOptions, SoundtrackOptions
from sonic_bullet.records.errors import AudioError, FileError, SonicBulletError
from sonic_bullet.records.simulated import with_body_id

if TYPE_CHECKING:
    from sonic_bullet.files.contact_log import ContactLog
    from sonic_bullet.files.levels import FileLevel
    from sonic_bullet.scene import RenderResult
    from sonic_bullet.simulators.pictures import PlacedLink


@dataclass(frozen=True, slots=True)
class RenderOutputs:
    """Paths and options of the outputs.

    Parameters
    ----------
    output, to
        The sound's name as the user gave it, and its absolute path.
    contacts, picture, events_to, page
        Absolute; None: not asked for.
    page_name
        The page's as the user gave it.
    """

    scene: str
    output: str
    to: str
    contacts: str | None
    models: str | None
    picture: str | None
    events_to: str | None
    level: LevelOptions
    extras: SoundtrackOptions
    session: SessionOptions
    page: str | None = None
    page_name: str = ""

    def write(
        self, result: RenderResult | Replay, standing: list[PlacedLink], echo: Callable[[str], None]
    ) -> dict[str, Any]:
        """Write all outputs; return them as JSON values; raises SonicBulletError.

        standing: shapes of silent partners, for a film.
        """
        made = self._write_log(result)
        found = find_level_of(result, self.level, self.to)
        report = replace(_write_sound(self.to, result, found, made), path=self.output)
        sound = result.sound.with_curve(found.curve)
        loudness = measure_loudness(sound, result.sr, report.gain_per_pa)
        edited: dict[str, Any] = {}
        if made is not None:
            made.write(report, fade_sound(self.level, result.sound, result.sr).curve, found)
            edited = self._write_session(result, found, made, report, standing)
        if self.picture is not None:
            seen = made.events if made is not None else ()
            render_picture(self.picture, sound, result.sr, result.log, Path(self.scene).name, seen)
        words = made.words if made is not None else []
        if self.page is not None:
            words = [*words, self._write_page(result, standing)]
        notes = (
            *result.notes,
            *_by_hand(self.scene, result.log),
            *_find_oversized(result.log),
            *level_warnings(report),
        )
        lifted = None if isinstance(result, Replay) else result.lifted
        rendered = RenderReport(result.log, report, notes, lifted)
        loudness_line = (f"{self.output}: {loudness}",) * (loudness.true_peak_dbtp is not None)
        echo("\n".join([*rendered.lines(), *loudness_line, *words]))
        scale = {}
        if report.channels:
            scale = report_level(self.level, self.to, found, report.peak_pa, result.log, report.clipped)
        for note in notes:
            print(f"sonic-bullet: note: {note}", file=sys.stderr)
        return (
            rendered.to_json()
            | {"scale": scale, "loudness": asdict(loudness)}
            | (made.described if made else {})
            | edited
        )

    def _write_log(self, result: RenderResult | Replay) -> Soundtrack | None:
        """Write the log, make stems and events; where that fails, keep the sound as a partial file."""
        try:
            if self.contacts is not None:
                write_log(self.contacts, result.log, self.models or "included")
            with progress_bar("stems and events"):
                drawn = self.picture is not None or self.session.folder is not None
                return make_soundtrack(self.extras, result, self.events_to, drawn=drawn)
        except (SonicBulletError, KeyboardInterrupt) as error:
            error.partial = result  # type: ignore[union-attr]
            raise with_partial(error, self.to, self.output, self.level) from error

    def _write_page(self, result: RenderResult | Replay, standing: list[PlacedLink]) -> str:
        """Write the page of the scene; return a line on it."""
        assert self.page is not None
        with progress_bar("page"):
            size = write_scene_page(
                self.page, self.scene, result.log, result.sr, result.sound.shape[1],
                standing=standing, plan=getattr(result, "plan", None),
            )  # fmt: skip
        return f"{self.page_name}: {size / 1e6:.1f} MB, opens in a browser, offline"

    def _write_session(
        self,
        result: RenderResult | Replay,
        level: FileLevel,
        made: Soundtrack,
        report: AudioReport,
        standing: list[PlacedLink],
    ) -> dict[str, Any]:
        """Write the session, where one is asked for."""
        if self.session.folder is None:
            return {}
        if Path(self.to) != Path(session_mix(self.session)):
            _write_sound(session_mix(self.session), result, level, made)
        with progress_bar("session"):
            words, described = write_session(self.session, result, level, made, report, standing)
        made.words.append(words)
        return {"session": described}


def find_level_of(result: RenderResult | Replay, level: LevelOptions, output: str) -> FileLevel:
    """Find the level of the sound; where silence prevents that, the error explains the silence."""
    try:
        return file_level(level, result.sound, result.sr, result.log, output)
    except AudioError as error:
        reason = None if result.sound.peaks().any() else why_silent(result.log)
        raise AudioError(error.what, reason) if reason else error from error


def _write_sound(output: str, result: RenderResult | Replay, level: FileLevel, made: Soundtrack | None) -> AudioReport:
    """Write the sound."""
    cues: dict[str, Any] = {} if made is None else made.cues_for(result.sound.shape[1])
    return write_at_level(output, result.sound, result.sr, level, **cues)


def with_partial(
    error: SonicBulletError | KeyboardInterrupt, to: str, output: str, level: LevelOptions
) -> SonicBulletError | KeyboardInterrupt:
    """Write the sound so far as a valid file NAME.partial.EXT; return the error with its name as the user gave it."""
    result: RenderResult | Replay | None = getattr(error, "partial", None)
    note_closing()
    said = ""
    if result is not None and all(result.sound.shape):
        partial = kept_name(Path(to))
        said = f"the first {result.sound.shape[1] / result.sr:.3f} s are in {kept_name(Path(output))}"
        try:
            try:
                found = file_level(level, result.sound, result.sr, result.log, output)
                write_at_level(partial, result.sound, result.sr, found)
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
    moves = () if is_log(scene) else moves_of(log)
    driven = any(one.drives for one in moves)
    remedy = (f"contacts of what is driven are not simulated: sonic-bullet score {scene} lets it sound",)
    return (*move_notes(log, moves), *(remedy if driven else ()))


def _find_oversized(log: ContactLog) -> tuple[str, ...]:
    large = [(body, oversize(body.model.vertex_m, body.model.mass_kg)) for body in log.bodies if body.model is not None]
    remedy = "load it with globalScaling=0.001, or give its mesh in metres, if its numbers are millimetres"
    return tuple(f"{with_body_id(body.name, body.body_id)} {words}; {remedy}" for body, words in large if words)
