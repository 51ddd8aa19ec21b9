"""Options of `features` and `states`: recordings without a mesh."""

from __future__ import annotations

from dataclasses import dataclass

from sonic_bullet.options.fit import channel_option, csv_option
from sonic_bullet.options.option import Options, option
from sonic_bullet.options.render import json_option


@dataclass(frozen=True, slots=True, kw_only=True)
class FeatureOptions(Options):
    """Recording."""

    onset_s: float | None = option(
        None, "When the impact starts, in s.", "--onset", metavar="S", least=0, unset="found"
    )
    band: tuple[float, float] | None = option(
        None, "Look between these frequencies in Hz.", metavar="LO,HI", unset="20,20000"
    )
    channel: int | None = channel_option()
    picture: str | None = option(
        None, "Also draw the spectrogram with the features on it, and decay over frequency.", metavar="NAME.png"
    )
    csv_to: str | None = csv_option()
    json_to: str | None = json_option()


@dataclass(frozen=True, slots=True, kw_only=True)
class StatesOptions(Options):
    """States of a thing."""

    numbers: tuple[str, ...] = option((), "Number of a state, as litres filled in.", "--number", metavar="STATE=N")
    pieces: bool = option(False, "They are pieces of one kind: name those that differ from the rest.")
    same_strikes: bool = option(False, "The states are recordings of the same strikes, by two microphones.")
    channel: int | None = channel_option()
    picture: str | None = option(
        None, "Also draw spectra, T60 and the octaves' difference over time.", metavar="NAME.png"
    )
    report: str | None = option(None, "Also write one page that opens offline.", metavar="OUT.html")
    json_to: str | None = json_option()
