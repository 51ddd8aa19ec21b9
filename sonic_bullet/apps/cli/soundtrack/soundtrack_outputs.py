"""Outputs of `render` besides the mix: stems, events, cue points.

SoundtrackWish (options) -> checked -> made (one more run of the log, body by body) -> Soundtrack -> written
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sonic_bullet.apps.cli.output import folder_place
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


def soundtrack_options(command: Any) -> Any:
    """Add the options of `SoundtrackWish`."""
    for option in reversed(
        (
            click.option("--stems", metavar="DIR", help="Also write a sound a body, which add up to the mix."),
            click.option(
                "--stem-peak-dbfs",
                type=click.FloatRange(-200, 0),
                metavar="DB",
                help="Scale each stem to a peak of its own. [default: all as the mix is]",
            ),
            click.option("--stem-lufs", type=float, metavar="L", help="Scale each stem to a loudness of its own."),
            click.option(
                "--events",
                metavar="NAME.json|csv",
                help="Also write every impact, roll and slide: when, who, where, how strong, how loud.",
            ),
            click.option("--cues", is_flag=True, help="Mark events in the WAV, and in stems, as cue points."),
            click.option(
                "--time-reference",
                "time_reference_s",
                type=click.FloatRange(0),
                metavar="S",
                help="With --cues: where on your timeline the file begins. [default: 0]",
            ),
        )
    ):
        command = option(command)
    return command


@dataclass(frozen=True, slots=True)
class SoundtrackWish:
    """Options of stems, events and cues."""

    stems: str | None = None
    stem_peak_dbfs: float | None = None
    stem_lufs: float | None = None
    events: str | None = None
    cues: bool = False
    time_reference_s: float | None = None

    def checked(self, output: str) -> SoundtrackWish:
        """Return the same with the stems' folder absolute and tried; raises FileError."""
        latest_s = 1e9
        if self.events is not None and Path(self.events).suffix.lower() not in (".json", ".csv"):
            raise FileError(f"cannot write {self.events}: events are JSON or CSV", "end the name with .json or .csv")
        form = AUDIO_FORMATS.get(Path(output).suffix.lower())
        if self.cues and (form is None or form.text != "chunks"):
            raise FileError(f"cannot write cue points to {output}", "end its name with .wav")
        from sonic_bullet.files import check_levels

        if self.time_reference_s is not None and not self.cues:
            raise FileError("--time-reference is told beside cue points", "give --cues too")
        if self.time_reference_s is not None and not self.time_reference_s <= latest_s:
            raise FileError(f"--time-reference is {self.time_reference_s:g} s", f"give 0 to {latest_s:g}, 30 years")
        own = {"--stem-peak-dbfs": self.stem_peak_dbfs, "--stem-lufs": self.stem_lufs}
        for option, asked in own.items():
            if asked is not None and self.stems is None:
                raise FileError(f"{option} is of stems", "give --stems DIR too")
        check_levels(self.stem_peak_dbfs, self.stem_lufs)
        if self.stems is None:
            return self
        folder = folder_place(self.stems, "")
        to = Path(output).absolute()
        if os.path.realpath(to.parent) == os.path.realpath(folder) and re.match(r"\d\d+-", to.name):
            raise FileError(f"{output} has the name of a stem in {self.stems}", "give --stems a folder of its own")
        return replace(self, stems=folder)

    def made(
        self,
        result: RenderResult | Replay,
        events_to: str | None,
        *,
        drawn: bool = False,
    ) -> Soundtrack | None:
        """Make stems and events of a render; None where nothing is asked for; raises SonicBulletError.

        drawn: events are needed for a picture.
        """
        wanted = self.events is not None or self.cues or drawn
        if self.stems is None and not wanted:
            return None
        from sonic_bullet.apps.soundtrack.stems import render_stems
        from sonic_bullet.engine.runtime.sound_events import EventObserver, find_sound_events

        log, sr = result.log, result.sr
        if self.stems is None:
            events = find_sound_events(log, sr=sr)
            return Soundtrack(self, log, sr, (), events, events_to)
        observer = EventObserver(log) if wanted else None
        stems = render_stems(
            log, sr=sr, frames=result.sound.shape[1], observer=observer, plan=getattr(result, "plan", None),
        )  # fmt: skip
        return Soundtrack(self, log, sr, stems, observer.events() if observer is not None else (), events_to)


@dataclass(slots=True)
class Soundtrack:
    """Stems and events; `write` writes them, and fills `words` and `described`."""

    wish: SoundtrackWish
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
        begins_s = self.wish.time_reference_s
        return 0 if begins_s is None else round(begins_s * self.sr)

    def cues_for(self, frames: int, body: int | None = None) -> dict[str, Any]:
        """Return keywords of `write_audio` for a file of so many frames."""
        if not self.wish.cues:
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

        if self.events_to is not None and self.wish.events is not None:
            counts = write_events(self.events_to, self.events, self.log)
            self.words.append(f"{self.wish.events}: {', '.join(f'{n} {kind}s' for kind, n in counts.items())}")
            self.described["sounding"] = counts
        if self.wish.stems is None:
            return
        own = self.wish.stem_peak_dbfs is not None or self.wish.stem_lufs is not None
        curve = fades if own else level.curve
        stems = [replace(stem, sound=stem.sound.shaped(curve)) for stem in self.stems]
        reports = list(
            write_stems(
                self.wish.stems,
                stems,
                self.sr,
                gain_per_pa=mix.gain_per_pa,
                peak_dbfs=self.wish.stem_peak_dbfs,
                lufs=self.wish.stem_lufs,
                cues=(lambda body: self.cues_for(mix.frames, body)["cues"]) if self.wish.cues else None,
                time_reference=self.time_reference,
            )
        )
        said = f"{self.wish.stems}{os.sep}: {format_count(len(reports), 'stem')}"
        older = {one.name for one in Path(self.wish.stems).glob("[0-9][0-9]*-*.wav")} - {
            Path(report.path).name for report in reports
        }
        self.words += [
            f"{report.path}: no {self.wish.stem_lufs:g} LUFS below that true peak, it is as loud as in the mix"
            for report in reports
            if self.wish.stem_lufs is not None and not _is_as_loud(report, self.wish.stem_lufs)
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
