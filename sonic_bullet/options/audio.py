"""Options of a file of audio: its level, and what `write_audio` takes beside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from sonic_bullet.options.option import Options, option
from sonic_bullet.records.cues import Cue
from sonic_bullet.records.errors import AudioError, SonicBulletError


@dataclass(frozen=True, slots=True, kw_only=True)
class FileLevelOptions(Options):
    """Level of a file of audio."""

    error: ClassVar[type[SonicBulletError]] = AudioError

    peak_dbfs: float | None = option(
        None,
        "Scale so that the peak is DB below full scale; with a loudness the true peak that a limiter keeps.",
        metavar="DB",
        least=-200,
        most=0,
        unset="-1; in Python not scaled, but beside a loudness",
    )
    lufs: float | None = option(None, "Scale to this programme loudness (say -23).", metavar="L", least=-200, most=200)


@dataclass(frozen=True, slots=True, kw_only=True)
class AudioFileOptions(FileLevelOptions):
    """What `write_audio` takes."""

    full_scale_pa: float | None = option(
        1.0,
        "Pressure in Pa that is 1.0 in a file without a level.",
        above=0,
        unset="samples are in no known unit, and the file states no scale",
    )
    subtype: str | None = option(None, "Sample format in libsndfile's names.", unset="the format's usual one")
    cues: Sequence[Cue] | None = option(
        None, "Named places (records.cues.Cue) in a .wav; an empty list still writes the time reference."
    )
    time_reference: int = option(0, "First sample of the file on its timeline (files.riff).", least=0)
