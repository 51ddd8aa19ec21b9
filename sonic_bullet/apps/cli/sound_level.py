"""Level, fades and final decay of a file, and the messages about them: options of `render`, `film` and `score`.

--fade -> --peak-dbfs | --lufs | --pascals, else a peak of -1 dBFS -> one gain, of mix and stems; a limiter, too, where
loudness and true peak conflict -> the file, which states its scale; with --scale-json also a JSON file
-> its loudness on stdout -> "0 dBFS = 63 Pa (peak 129 dB SPL)" and the limiter's reduction on stderr
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.options.render import LevelOptions
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError
from sonic_bullet.records.file_endings import AUDIO_FORMATS

if TYPE_CHECKING:
    from sonic_bullet.files import AudioReport, ContactLog
    from sonic_bullet.files.levels import FileLevel
    from sonic_bullet.files.storage.spooled_sound import KeptSound


def check_level(level: LevelOptions) -> None:
    """Raise AudioError where options are not valid, before anything is rendered."""
    from sonic_bullet.engine.runtime.ringing_on import as_tail_db

    if level.pascals and not (level.peak_dbfs is None and level.lufs is None):
        raise AudioError("--pascals does not scale, and a level is given", "give one of both")
    as_tail_db(level.tail_db, "--tail")


def scale_path(level: LevelOptions, output: str) -> str | None:
    """Return the path of the JSON, if it is asked for."""
    return f"{output}.json" if level.scale_json else None


def fade_sound(level: LevelOptions, sound: KeptSound, sr: int) -> KeptSound:
    """Return the sound with its fades; AudioError where it is shorter than they are."""
    from sonic_bullet.files.storage.spooled_sound import GainCurve

    if level.fade_s is None:
        return sound
    fade_in, fade_out = (round(seconds * sr) for seconds in level.fade_s)
    if fade_in + fade_out > sound.shape[1]:
        lasts = f"{sound.shape[1] / sr:.3f} s"
        raise AudioError(f"--fade takes longer than the sound, {lasts}", "give shorter fades, or render longer")
    return sound.with_curve(GainCurve(sound.shape[1], fade_in, fade_out))


def file_level(level: LevelOptions, sound: KeptSound, sr: int, log: ContactLog, path: str) -> FileLevel:
    """Find the level for `write_audio` and `make_film`; raises AudioError.

    By default silent sound is not scaled, nor sound for a file that cannot state its scale (W64).
    """
    # Peak level that leaves room for overshoots of converters and lossy codecs [EBU R 128, sec. h].
    default_peak_dbfs = -1.0
    from sonic_bullet.engine.runtime.silence import is_silent
    from sonic_bullet.files.levels import find_level

    peak_dbfs = level.peak_dbfs
    own = AUDIO_FORMATS.get(Path(path).suffix.lower())
    unstated = own is not None and own.text == "nowhere"
    as_it_is = level.pascals or level.lufs is not None or level.peak_dbfs is not None
    if not as_it_is and not unstated and not is_silent(sound, log):
        peak_dbfs = default_peak_dbfs
    return find_level(fade_sound(level, sound, sr), sr, peak_dbfs, level.lufs, 1.0)


def report_level(
    options: LevelOptions, path: str, level: FileLevel, peak: float, log: ContactLog, clipped: int = 0
) -> dict[str, Any]:
    """Print full scale, peak and limiter reduction on stderr; write them as JSON where asked for, and return them.

    clipped: samples that the file could not hold.
    """
    from sonic_bullet.apps.cli.output import write_json
    from sonic_bullet.apps.report.plots.scene_plot import quantity
    from sonic_bullet.records.units import REFERENCE_PRESSURE_PA

    units = {quantity(sensor)[1] for sensor in log.sensors}
    unit = units.pop() if len(units) == 1 else "(mixed units)"
    spl = 20 * math.log10(peak / REFERENCE_PRESSURE_PA) if unit == "Pa" and peak > 0 else None
    words = f"peak {spl:.0f} dB SPL" if spl is not None else f"peak {peak:.3g} {unit}"
    cut = ", which the file does not hold" if clipped else ""
    print(f"sonic-bullet: 0 dBFS = {1 / level.gain_per_pa:.3g} {unit} ({words}{cut})", file=sys.stderr)
    if level.limited_db:
        print(f"sonic-bullet: note: {describe_limiter(level)}", file=sys.stderr)
    scale = {"full_scale": 1 / level.gain_per_pa, "unit": unit, "peak": peak, "peak_db_spl": spl}
    scale |= {"limited_db": level.limited_db, "limited_s": level.limited_s}
    write_json(scale_path(options, path), scale)
    return scale


def describe_limiter(level: FileLevel | AudioReport) -> str:
    """Describe the reduction by a limiter."""
    return (
        f"loudness and true peak conflict: a limiter takes off up to {level.limited_db:.1f} dB, in all for "
        f"{level.limited_s:.3f} s; a lower --lufs needs less"
    )


def level_warnings(report: AudioReport) -> tuple[str, ...]:
    """Warn of samples beyond full scale."""
    if report.clipped:
        return (
            f"{format_count(report.clipped, 'sample was', 'samples were')} clipped at full scale: "
            f"{report.format} {report.subtype} holds nothing above 1.0, and the peak is "
            f"{report.peak_pa * report.gain_per_pa:.3g}; a .wav holds it as floats, --peak-dbfs -1 scales it",
        )
    if report.over:
        return (
            f"{format_count(report.over, 'sample passes', 'samples pass')} 1.0 (peak {report.peak_pa:.3g} Pa): "
            "the file is exact, but players clip it; --peak-dbfs -1 scales it",
        )
    return ()
