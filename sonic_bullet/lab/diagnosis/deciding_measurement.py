"""The one measurement that would decide what a diagnosis leaves open, in a sentence.

It is the first that applies, by the times, frequencies and dependences of what is left.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sonic_bullet.effects.protocol import Dereverberates
from sonic_bullet.lab.diagnosis.selection.stepwise import NothingCompared, SelectionEnd
from sonic_bullet.lab.diagnosis.thresholds import RULES
from sonic_bullet.lab.fit.case_fit import CaseFit
from sonic_bullet.lab.fit.takes.next_measurement import next_measurement as of_fit


def next_measurement(found: CaseFit, end: SelectionEnd | NothingCompared, left: dict[str, Any]) -> str:
    """Name the one measurement that would decide; after a verdict that leaves nothing open, the fit's."""
    return of_fit(found) if isinstance(end, NothingCompared) or not left else next(_open(end, left))


def _open(end: SelectionEnd, left: dict[str, Any]) -> Iterator[str]:
    """Yield a measurement for each thing that is open, the most important first."""
    differs = 0.5  # Standard deviation of ln of what is left, over strikes: more goes with the place or the strike
    no_mode = 0.5  # of what is left, that no modes play
    most = max(left["when"], key=left["when"].__getitem__)
    slope, slope_sd = left["slope_against_impulse"], left["slope_standard_error"]
    if len(end.judged) == 1:
        yield "strike the same place again, three times or more: no effect can be told by one strike"
    if any(isinstance(c.effect, Dereverberates) and c.mean_db > 0 for c in end.tried) and most != "first":
        yield "record at half the distance and at twice it: what the room adds stays, what the body radiates does not"
    if slope is not None and abs(slope) > RULES.standard_errors * slope_sd:
        yield "strike one place at five strengths from soft to hard, force recorded: what is left goes with strength"
    if left["share_of_no_modes"] > no_mode and most == "first":
        yield (
            "record the hammer's force with the sound (case new --force-channel): what is left is at the beginning, "
            "and no mode plays it"
        )
    if left["scatter_over_strikes"] > differs:
        yield "strike one place five times alike: what is left differs from strike to strike, by the place or by itself"
    band = max(left["bands"], key=lambda b: b["share_of_energy_left"])
    yield (
        f"strike and hang it at other points and listen from {band['from_hz']:.0f} to {band['to_hz']:.0f} Hz: what "
        "stays is the body's, what goes is its support's"
    )
