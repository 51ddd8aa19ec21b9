"""Outputs of `render` besides the mix: stems, events, cue points.

SoundtrackOptions -> checked -> made (one more run of the log, body by body) -> Soundtrack -> written
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.apps.cli.output import folder_place
from sonic_bullet.options.render import SoundtrackOptions
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError
from sonic_bullet.records.file_endings import AUDIO_FORMATS

if TYPE_CHECKING:
    from sonic_bullet.apps.cli.scenes.scene_runs import Replay
    from sonic_bullet.apps.soundtrack.stems import Stem
    from sonic_bullet.engine.runtime.sound_events import SoundEvent
    from sonic_bullet.files import AudioReport, ContactLog
    from sonic_bullet.files.levels import FileLevel
    from sonic_bullet.files.storage.spooled_sound import GainCurve
    from sonic_bullet.scene import RenderResult


def checked_soundtrack(options: SoundtrackOptions, output: str) -> SoundtrackOptions:
    """Return the same with the stems' folder absolute and tried; raises FileError."""
    if options.events is not None and Path(options.events).suffix.lower() not in (".json", ".csv"):
        raise FileError(f"cannot write {options.events}: events are JSON or CSV", "end the name with .json or .csv")
    form = AUDIO_FORMATS.get(Path(output).suffix.lower())
    if options.cues and (form is None or form.text != "chunks"):
        raise FileError(f"cannot write cue points to {output}", "end its name with .wav")
    if options.time_reference_s is not None and not options.cues:
        raise FileError("--time-reference is told beside cue points", "give --cues too")
    own = {"--stem-peak-dbfs": options.stem_peak_dbfs, "--stem-lufs": options.stem_lufs}
    for option, asked in own.items():
        if asked is not None and options.stems is None:
            raise FileError(f"{option} is of stems", "give --stems DIR too")
    if options.stems is None:
        return options
    folder = folder_place(options.stems, "")
    to = Path(output).absolute()
    if os.path.realpath(to.parent) == os.path.realpath(folder) and re.match(r"\d\d+-", to.name):
        raise FileError(f"{output} has the name of a stem in {options.stems}", "give --stems a folder of its own")
    return replace(options, stems=folder)


def make_soundtrack(
    options: SoundtrackOptions,
    result: RenderResult | Replay,
    events_to: str | None,
    *,
    drawn: bool = False,
) -> Soundtrack | None:
    """Make stems and events of a render; None where nothing is asked for; raises SonicBulletError.

    drawn: events are needed for a picture.
    """
    wanted = options.events is not None or options.cues or drawn
    if options.stems is None and not wanted:
        return None
    from sonic_bullet.apps.soundtrack.stems import render_stems
    from sonic_bullet.engine.runtime.sound_events import EventObserver, find_sound_events

    log, sr = result.log, result.sr
    if options.stems is None:
        events = find_sound_events(log, sr=sr)
        return Soundtrack(options, log, sr, (), events, events_to)
    observer = EventObserver(log) if wanted else None
    stems = render_stems(
        log, sr=sr, frames=result.sound.shape[1], observer=observer, plan=getattr(result, "plan", None),
    )  # fmt: skip
    return Soundtrack(options, log, sr, stems, observer.events() if observer is not None else (), events_to)


@dataclass(slots=True)
class Soundtrack:
    """Stems and events; `write` writes them, and fills `words` and `described`."""

    options: SoundtrackOptions
    log: ContactLog
    sr: int
    stems: Sequence[Stem]
    events: Sequence[SoundEvent]
    events_to: str | None
    words: list[str] = field(default_factory=list)
    described: dict[str, Any] = field(default_factory=dict)

    @property
    def time_reference(self) -> int:
        """Time reference in samples."""
        begins_s = self.options.time_reference_s
        return 0 if begins_s is None else round(begins_s * self.sr)

    def cues_for(self, frames: int, body: int | None = None) -> dict[str, Any]:
        """Return keywords of `write_audio` for a file of so many frames."""
        if not self.options.cues:
            return {}
        from sonic_bullet.engine.runtime.sound_events import cues_of

        return {
            "cues": cues_of(self.events, self.log, self.sr, frames, body),
            "time_reference": self.time_reference,
        }

    def write(self, mix: AudioReport, fades: GainCurve | None, level: FileLevel) -> None:
        """Write events and stems; raises FileError, AudioError.

        Stems have the fades of the mix, and its limiter, except those with a level of their own.
        """
        from sonic_bullet.apps.soundtrack.event_tables import write_events
        from sonic_bullet.apps.soundtrack.stems import write_stems

        if self.events_to is not None and self.options.events is not None:
            counts = write_events(self.events_to, self.events, self.log)
            self.words.append(f"{self.options.events}: {', '.join(f'{n} {kind}s' for kind, n in counts.items())}")
            self.described["sounding"] = counts
        if self.options.stems is None:
            return
        own = self.options.stem_peak_dbfs is not None or self.options.stem_lufs is not None
        curve = fades if own else level.curve
        stems = [replace(stem, sound=stem.sound.with_curve(curve)) for stem in self.stems]
        reports = list(
            write_stems(
                self.options.stems,
                stems,
                self.sr,
                gain_per_pa=mix.gain_per_pa,
                peak_dbfs=self.options.stem_peak_dbfs,
                lufs=self.options.stem_lufs,
                cues=(lambda body: self.cues_for(mix.frames, body)["cues"]) if self.options.cues else None,
                time_reference=self.time_reference,
            )
        )
        said = f"{self.options.stems}{os.sep}: {format_count(len(reports), 'stem')}"
        older = {one.name for one in Path(self.options.stems).glob("[0-9][0-9]*-*.wav")} - {
            Path(report.path).name for report in reports
        }
        self.words += [
            f"{report.path}: no {self.options.stem_lufs:g} LUFS below that true peak, it is as loud as in the mix"
            for report in reports
            if self.options.stem_lufs is not None and not _is_as_loud(report, self.options.stem_lufs)
        ]
        if older:
            said += f"; {', '.join(sorted(older)[:5])} there {'is' if len(older) == 1 else 'are'} of another render"
        self.words.append(said)
        self.described["stems"] = [
            {
                "path": report.path,
                "body": self.log.bodies[stem.index].body_id,
                "link": self.log.bodies[stem.index].link,
                "name": self.log.bodies[stem.index].name.encode("utf-8", "replace").decode(),
                "peak_pa": report.peak_pa,
                "gain_per_pa": report.gain_per_pa,
                "limited_db": report.limited_db,
                "loudness": None if report.loudness is None else asdict(report.loudness),
            }
            for stem, report in zip(stems, reports, strict=True)
        ]


def _is_as_loud(report: AudioReport, lufs: float) -> bool:
    """Return whether a file has the loudness asked for, to a tenth."""
    found = None if report.loudness is None else report.loudness.integrated_lufs
    return found is not None and abs(found - lufs) < 0.1
