"""Options of `compare` and `baseline`."""

from __future__ import annotations

from dataclasses import dataclass

from sonic_bullet.options.option import Options, option
from sonic_bullet.options.render import DEFAULT_SR, SAMPLE_RATES_HZ, client_option, json_option


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareOptions(Options):
    """Two versions."""

    ref: str | None = option(None, "Compare A as it was at this git revision with A as it is now.", metavar="REV")
    audible: bool = option(False, "Is the change beyond chance? Runs A 99 times, starts 0.1 mm apart.")
    tolerance_db: float | None = option(
        None, "Octave levels may differ by so much.", metavar="DB", least=0, most=200, unset="samples are equal"
    )
    report: str | None = option(
        None, "Also write one page that opens offline: players, pictures, tables.", metavar="OUT.html"
    )
    seconds: float | None = option(None, "How long to run both scenes.", metavar="S", above=0)
    sr: int | None = option(
        None,
        "Rate of both scenes in Hz.",
        metavar="HZ",
        least=SAMPLE_RATES_HZ[0],
        most=SAMPLE_RATES_HZ[1],
        unset=str(DEFAULT_SR),
    )
    client: int | None = client_option()
    json_to: str | None = json_option()


@dataclass(frozen=True, slots=True, kw_only=True)
class BaselineOptions(Options):
    """Baseline of a scene."""

    folder: str | None = option(
        None, "Where to.", "-o", "--output", metavar="DIR", unset="sonic_baselines beside each scene"
    )
    reason: str = option("", "Why it is to sound so, for whoever reads the file.", metavar="WHY")
    runs: int = option(99, "Of the ensemble; 0: none.", least=0, most=9999)
    client: int | None = client_option()
