"""Recordings of one thing in several states, a take each.

folder, file, or a case whose recordings name a state -> channel -> from the onset to the next hit -> less the hum that
    stands before the onsets -> RecordedState
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import gcd
from pathlib import Path

import numpy as np

from sonic_bullet.files import read_channel
from sonic_bullet.files.cases import CASE_FORMAT, read_case
from sonic_bullet.lab.lines.band_limit import without_drift
from sonic_bullet.lab.lines.onset import Span, span
from sonic_bullet.lab.lines.standing_hum import describe_hum, find_session_hum
from sonic_bullet.records import Array, frozen_array
from sonic_bullet.records.errors import AudioError, FileError
from sonic_bullet.records.file_endings import AUDIO_FORMATS

SHORTEST_S = 0.1
"""Shorter takes tell two lines apart that are 10 Hz from each other, and no decay below 500 Hz."""


@dataclass(frozen=True, slots=True, eq=False)
class Take:
    """One strike: its samples (n,) from the onset on, and those before it (m,), which hold the noise alone.

    hit_again: whether a second hit ends it.
    """

    name: str
    signal: Array
    before: Array
    note: str = ""
    hit_again: bool = False

    def __post_init__(self) -> None:
        """Freeze the samples."""
        object.__setattr__(self, "signal", frozen_array(self.signal, np.float64, (None,), "take"))
        object.__setattr__(self, "before", frozen_array(self.before, np.float64, (None,), "what precedes a take"))

    @property
    def strength_db(self) -> float:
        """Peak of the first 20 ms in dB of full scale, before what a state changes in the ringing can lower it."""
        return float(20 * np.log10(max(float(np.abs(self.signal).max()), 1e-9)))


@dataclass(frozen=True, slots=True, eq=False)
class RecordedState:
    """Takes of a thing in one state at one sample rate. number: what is varied, litres say; None where nothing is."""

    name: str
    takes: tuple[Take, ...]
    sr: int
    number: float | None = None


def read_states(
    paths: Sequence[str | os.PathLike[str]],
    *,
    numbers: Mapping[str, float] | None = None,
    channel: int | None = None,
) -> tuple[RecordedState, ...]:
    """Read states.

    Parameters
    ----------
    paths : sequence of path
        A folder of recordings or a recording each, in the order of the states; or one: a folder of such folders or of
        recordings, a state each, or a case whose recordings name their states.
    numbers : mapping, optional
        Numbers of states by name.
    channel : int, optional
        Channel of the recordings, from 0.

    Raises
    ------
    FileError, AudioError
        A path cannot be read, or holds no strike.
    """
    listed = _list_states(paths)
    if len(listed) < 2:
        raise FileError("one state alone", "give BEFORE and AFTER, or a folder that holds a folder a state")
    unknown = sorted(set(numbers or {}) - {name for name, _, _ in listed})
    if unknown:
        names = ", ".join(name for name, _, _ in listed)
        raise FileError(f"there is no state '{unknown[0]}' to give a number", f"name one of {names}")
    states = [
        _state(name, files, channel, (numbers or {}).get(name, number if number is not None else _number_in(name)))
        for name, files, number in listed
    ]
    if all(state.number is not None for state in states):
        states.sort(key=lambda state: state.number or 0.0)
    return at_common_rate(states)


def read_state(place: str | os.PathLike[str], *, channel: int | None = None) -> RecordedState:
    """Read one state, a folder of its takes. Raises FileError, AudioError."""
    files = recordings_in(Path(place))
    if not files:
        raise FileError(f"{place} holds no recording", "give a folder of recordings")
    return _state(Path(place).name, files, channel, None)


def at_common_rate(states: Sequence[RecordedState]) -> tuple[RecordedState, ...]:
    """Return the states at the least of their rates."""
    from scipy.signal import resample_poly

    least = min(state.sr for state in states)
    if all(state.sr == least for state in states):
        return tuple(states)

    def resampled(signal: Array, sr: int) -> Array:
        common = gcd(least, sr)
        return np.asarray(resample_poly(signal, least // common, sr // common)) if len(signal) else signal

    return tuple(
        state
        if state.sr == least
        else replace(
            state,
            sr=least,
            takes=tuple(
                replace(take, signal=resampled(take.signal, state.sr), before=resampled(take.before, state.sr))
                for take in state.takes
            ),
        )
        for state in states
    )


def take_of(signal: Array, sr: int, name: str) -> Take:
    """Cut one strike out of a recording (n,): from its onset to the next hit.

    Raises
    ------
    AudioError
        Too little follows the onset.
    """
    signal, drift = without_drift(signal, sr)
    found = span(signal, sr)
    later = tuple(at for at in found.later if _strikes_again(signal, found.start, at, sr))
    if later and later[0] - found.start < SHORTEST_S * sr and _is_louder(signal, found.start, later[0], sr):
        found = Span(later[0], found.stop, later[1:])  # a rumble, or the striker's lift, and then the strike
        later = tuple(at for at in later[1:] if _strikes_again(signal, found.start, at, sr))
    found = Span(found.start, later[0] if later else len(signal), later)
    notes = [drift]
    if found.later:
        notes.append(f"{found.describe_hits(sr)}: only the first is used")
    struck = signal[found.start : found.stop]
    if len(struck) < SHORTEST_S * sr:
        raise AudioError(f"{name}: {len(struck) / sr:.3f} s follow the onset", f"a take needs {SHORTEST_S:g} s")
    return Take(name, struck, signal[: found.start], "; ".join(filter(None, notes)), bool(found.later))


def _is_louder(signal: Array, start: int, later: int, sr: int) -> bool:
    """Say whether the later of two onsets is the strike: ten times as strong as what the first one began."""
    times, about = 10.0, round(0.03 * sr)
    return float((signal[later : later + about] ** 2).mean()) > times * float((signal[start:later] ** 2).mean())


def _strikes_again(signal: Array, start: int, later: int, sr: int) -> bool:
    """Say whether a hit raises what rings: a click upon a ringing thing is none of its strikes."""
    rises, near_db, about_s = 1.5, 20.0, 0.03
    about = round(about_s * sr)
    first, before, after = (
        float((signal[max(a, 0) : b] ** 2).mean())
        for a, b in ((start, start + about), (later - about, later - about // 10), (later, later + about))
    )
    return after > rises * before and after > first * 10 ** (-near_db / 10)


def _list_states(paths: Sequence[str | os.PathLike[str]]) -> list[tuple[str, list[Path], float | None]]:
    """List name, files and declared number of each state."""
    places = [Path(path) for path in paths]
    for place in places:
        if not place.exists():
            raise FileError(f"there is no {place}", "give folders of recordings, or recordings")
    if len(places) == 1 and (places[0].name == "case.json" or (places[0] / "case.json").is_file()):
        return _listed_in_case(places[0])
    if len(places) == 1 and places[0].is_dir():
        inner = sorted(one for one in places[0].iterdir() if one.is_dir() and recordings_in(one))
        places = inner if len(inner) >= 2 else recordings_in(places[0])
    names = _names(places)
    listed: list[tuple[str, list[Path], float | None]] = []
    for name, place in zip(names, places, strict=True):
        files = recordings_in(place) if place.is_dir() else [place]
        if not files:
            raise FileError(f"{place} holds no recording", "give folders of recordings")
        listed.append((name, files, None))
    return listed


def _listed_in_case(place: Path) -> list[tuple[str, list[Path], float | None]]:
    case = read_case(place)
    named: dict[str, list[Path]] = {}
    for one in case.recordings:
        if one.state is not None and one.file is not None:
            named.setdefault(one.state, []).append(one.file)
    if len(named) < 2:
        raise FileError(
            f"case {case.name} names {len(named)} states", f'give its recordings a "state" each ({CASE_FORMAT})'
        )
    order = [*(name for name in case.states if name in named), *(name for name in named if name not in case.states)]
    return [(name, named[name], case.states.get(name)) for name in order]


def recordings_in(place: Path) -> list[Path]:
    """List the recordings of a folder, by name."""
    return sorted(one for one in place.iterdir() if one.suffix.lower() in AUDIO_FORMATS)


def _names(places: Sequence[Path]) -> list[str]:
    """Name states by folder, with as much of the path as tells them apart."""
    if not places:
        return []
    for depth in range(1, 1 + max(len(place.resolve().parts) for place in places)):
        names = ["/".join(place.resolve().parts[-depth:]) for place in places]
        if len(set(names)) == len(names):
            return names
    raise FileError(f"{places[0]} is given twice", "give another folder for each state")


def _number_in(name: str) -> float | None:
    """Return the number that a state's name begins with, as "0.25 l" or "1/4"."""
    found = re.match(r"\s*([-+]?\d+(?:\.\d+)?(?:/\d+)?)(?:\s*[a-zA-Z%°µ]{0,6})?\s*$", name)
    if not found:
        return None
    return float(Fraction(found[1])) if "." not in found[1] else float(found[1])


def _state(name: str, files: Sequence[Path], channel: int | None, number: float | None) -> RecordedState:
    takes: list[Take] = []
    rate = 0
    for file in files:
        signal, sr, _ = read_channel(file, channel)
        if rate and sr != rate:
            from scipy.signal import resample_poly

            common = gcd(rate, sr)
            signal = np.asarray(resample_poly(signal, rate // common, sr // common))
        rate = rate or sr
        takes.append(take_of(signal, rate, file.name))
    return RecordedState(name, _without_hum(takes, rate), rate, number)


def _without_hum(takes: Sequence[Take], sr: int) -> tuple[Take, ...]:
    """Take off the hum that stands before the onsets of one session's takes."""
    whole = [np.concatenate([take.before, take.signal]) for take in takes]
    starts = [len(take.before) for take in takes]
    hums, hz = find_session_hum(whole, sr, starts)
    if not hz:
        return tuple(takes)
    return tuple(
        replace(
            take,
            signal=take.signal - hum[at:],
            before=take.before - hum[:at],
            note="; ".join(filter(None, [take.note, describe_hum(hz) if hum.any() else ""])),
        )
        for take, hum, at in zip(takes, hums, starts, strict=True)
    )
