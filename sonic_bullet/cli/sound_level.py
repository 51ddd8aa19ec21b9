"""How loud a file is to be, how far it rings on, and what is said of it: the options of `render`, `film` and `score`.

--peak-dbfs | --lufs | --pascals, else a peak of -1 dBFS -> one gain, of mix and stems -> the file, which says it
-> "0 dBFS = 63 Pa (peak 129 dB SPL)" on stderr -> with --scale-json a JSON beside the file
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError

if TYPE_CHECKING:
    from sonic_bullet.files import AudioReport, ContactLog
    from sonic_bullet.files.rows.spool import KeptSound

DEFAULT_PEAK_DBFS = -1.0
"""Below full scale by what rebuilt waveforms of converters and lossy codecs overshoot [EBU R 128, sec. h]."""
TAIL_DB = -60.0
OPTIONS = ("peak_dbfs", "lufs", "pascals", "tail_db", "scale_json")


def level_options(command: Any) -> Any:
    """The options of `LevelWish`."""
    for option in reversed(
        (
            click.option(
                "--peak-dbfs",
                type=float,
                metavar="DB",
                help="Scale so that the peak is DB below full scale. [default: -1]",
            ),
            click.option("--lufs", type=float, metavar="L", help="Scale to this programme loudness (say -23)."),
            click.option("--pascals", is_flag=True, help="Do not scale: 1.0 in the file is 1 Pa."),
            click.option(
                "--tail",
                "tail_db",
                type=float,
                default=TAIL_DB,
                metavar="DB",
                help="Ring on after the last step, without physics, at most 10 s, until it is that far below the peak: "
                "-60; 0: not. [default: -60]",
            ),
            click.option("--scale-json", is_flag=True, help="Also write the scale as JSON, to NAME.EXT.json."),
        )
    ):
        command = option(command)
    return command


@dataclass(frozen=True, slots=True)
class LevelWish:
    """What is asked for. tail_db: 0 none."""

    peak_dbfs: float | None = None
    lufs: float | None = None
    pascals: bool = False
    tail_db: float = TAIL_DB
    scale_json: bool = False

    def check(self) -> None:
        """Raise AudioError where it cannot be: before anything is rendered."""
        from sonic_bullet.files import check_levels
        from sonic_bullet.render.ringing_on import as_tail_db

        if self.pascals and not (self.peak_dbfs is None and self.lufs is None):
            raise AudioError("--pascals does not scale, and a level is given", "give one of both")
        check_levels(self.peak_dbfs, self.lufs)
        as_tail_db(self.tail_db, "--tail")

    def json_path(self, output: str) -> str | None:
        """Where the JSON goes, if it is asked for."""
        return f"{output}.json" if self.scale_json else None

    def options(self, sound: KeptSound, log: ContactLog, path: str) -> dict[str, Any]:
        """Keywords of `write_audio` and `make_film`. What is silent is not scaled unless it is asked for, nor what goes
        into a file that cannot say its scale (W64).
        """
        from sonic_bullet.render.silence import is_silent

        asked: dict[str, Any] = {"peak_dbfs": self.peak_dbfs, "lufs": self.lufs}
        as_it_is = self.pascals or self.lufs is not None or self.peak_dbfs is not None
        if as_it_is or Path(path).suffix.lower() == ".w64" or is_silent(sound, log):
            return asked
        return asked | {"peak_dbfs": DEFAULT_PEAK_DBFS}

    def say(self, path: str, gain_per_pa: float, peak: float, log: ContactLog, clipped: int = 0) -> dict[str, Any]:
        """Say on stderr what full scale is and how loud the peak, and write it beside the file where that is asked for;
        the same as JSON. clipped: samples that the file could not hold.
        """
        from sonic_bullet.cli.output import write_json
        from sonic_bullet.plots.scene_plot import quantity
        from sonic_bullet.records.units import REFERENCE_PRESSURE_PA

        units = {quantity(sensor)[1] for sensor in log.sensors}
        unit = units.pop() if len(units) == 1 else "(mixed units)"
        spl = 20 * math.log10(peak / REFERENCE_PRESSURE_PA) if unit == "Pa" and peak > 0 else None
        words = f"peak {spl:.0f} dB SPL" if spl is not None else f"peak {peak:.3g} {unit}"
        cut = ", which the file does not hold" if clipped else ""
        print(f"sonic-bullet: 0 dBFS = {1 / gain_per_pa:.3g} {unit} ({words}{cut})", file=sys.stderr)
        scale = {"full_scale": 1 / gain_per_pa, "unit": unit, "peak": peak, "peak_db_spl": spl}
        write_json(self.json_path(path), scale)
        return scale


def level_warnings(report: AudioReport) -> tuple[str, ...]:
    """What a user should know of samples beyond full scale."""
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
