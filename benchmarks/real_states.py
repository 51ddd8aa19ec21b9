"""Does `states` say what changed between recorded states of real things, and nothing of takes of one state?

    python -m benchmarks.real_states pairs  --data ../shared [SET ...]
    python -m benchmarks.real_states splits --data ../shared [--of N] [SET ...]

pairs: each set's states against its README: the name, T60 by octave over the independent measurement's, gap closed
splits: distinct ways to divide the takes of one state in halves, N of each state at most; a statement is a false alarm

A set that is not there is counted and said. Rows are printed as they are made.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from sonic_bullet.files import read_channel
from sonic_bullet.lab.lines.strike_times import find_strikes
from sonic_bullet.lab.states.chance import FEWEST_DEGREES
from sonic_bullet.lab.states.changes import StateValues, compare_states
from sonic_bullet.lab.states.octave_values import OctaveValues, octave_values
from sonic_bullet.lab.states.recorded_states import RecordedState, Take, read_state, read_states, take_of
from sonic_bullet.lab.states.state_causes import find_causes
from sonic_bullet.lab.states.state_comparison import StateComparison, compare
from sonic_bullet.lab.states.take_lines import (
    MOST_PAIRED_LINES,
    SharedLines,
    TakeLines,
    measured_in_takes,
    shared_lines,
)

OCTAVES_HZ = (125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0)
WITHIN = 0.15
"""Of an octave's T60 ratio, as `../shared/states` measured it by itself."""


WALL_PERCENT = 0.3
"""Most that a line of the bottle's outer wall, which water never touches, is to move by."""


@dataclass(frozen=True, slots=True)
class KnownPair:
    """Two states of a set, the names that are right of them, whether the thing changed, and what is declared."""

    place: str
    before: str
    after: str
    names: tuple[str, ...]
    of_the_thing: bool = True
    same_strikes: bool = False


PAIRS = (
    KnownPair("snare-muted", "open", "muted", ("damping",)),
    KnownPair("conga-hand", "open", "muted", ("damping",)),
    KnownPair("hihat-opening", "closed", "loose", ("less-damping",)),
    KnownPair("hihat-opening", "closed", "half-open", ("less-damping",)),
    KnownPair("hihat-opening", "closed", "open", ("less-damping",)),
    KnownPair("ride-bow-bell", "bow", "bell", ("strike-place",), of_the_thing=False),
    KnownPair("tom-microphone", "near", "overhead", ("room", "measurement-chain"), of_the_thing=False),
    KnownPair(
        "tom-microphone", "near", "overhead", ("room", "measurement-chain"), of_the_thing=False, same_strikes=True
    ),
    KnownPair("tom-microphone", "near", "room", ("room", "measurement-chain"), of_the_thing=False),
)
FILLED = {"empty": 0.0, "thirtysecond": 1 / 32, "sixteenth": 1 / 16, "eighth": 1 / 8, "quarter": 1 / 4, "half": 1 / 2}
FILLED["full"] = 1.0
TAPS = ("measured/wood-iet-timbr/dev/170620_G5_Flex.flac", "measured/wood-iet-timbr/dev/170721_G5_Flex.flac")
"""Recordings of many taps of one thing in one state."""
MOST_TAPS = 8


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("pairs", "splits"))
    parser.add_argument("only", nargs="*", metavar="SET")
    parser.add_argument("--data", type=Path, default=Path("../shared"))
    parser.add_argument("--of", type=int, default=35, help="splits of one state, at most")
    given = parser.parse_intermixed_args()  # SET after an option, too
    if given.what == "pairs":
        _print_pairs(given.data / "states", given.only)
    else:
        _print_splits(given.data, given.only, given.of)


def _print_pairs(data: Path, only: Sequence[str]) -> None:
    gaps: list[float] = []
    print("| set | states | name | right | T60 of octaves within 15 % | worst | gap closed | A, A', B dB | s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for pair in PAIRS:
        if only and pair.place not in only:
            continue
        if not (data / pair.place).is_dir():
            print(f"| {pair.place} | not found |")
            continue
        begun = time.process_time()
        states = read_states([data / pair.place / name for name in (pair.before, pair.after)])
        found = compare(states, same_strikes=pair.same_strikes).comparisons[0]
        measured = t60_ratios(data / pair.place, pair) if pair.of_the_thing else {}
        print(_pair_row(pair, found, measured, time.process_time() - begun), flush=True)
        if pair.of_the_thing:
            closed = found.prediction.gap_closed if found.prediction is not None and found.causes else 0.0
            gaps.append(closed if found.verdict in pair.names else 0.0)
    if (data / "bottle-water").is_dir() and (not only or "bottle-water" in only):
        gaps += _print_bottle(data / "bottle-water")
    if gaps:
        print(f"\ngap closed at the median of {len(gaps)} pairs of which the thing changed: {np.median(gaps):.2f}")


def t60_ratios(folder: Path, pair: KnownPair) -> dict[float, float]:
    """Read the T60 ratios by octave, as the set's README measured them by itself, where it holds the pair's first."""
    text = (folder / "README.md").read_text()
    table = text.partition(f"Against `{pair.before}`")[2].splitlines()
    row = next((line for line in table if line.startswith(f"| {pair.after} |")), "")
    ratios = row.strip(" |").rpartition("|")[2].split()
    return {f: float(x) for f, x in zip(OCTAVES_HZ, ratios, strict=False) if x != "-"}


def _pair_row(pair: KnownPair, found: StateComparison, measured: dict[float, float], seconds: float) -> str:
    rows = {row.freq_hz: row.change for row in found.changes.of("octave T60", certain=False)}
    off = [(abs(np.log(rows[f] / true)), f, rows[f], true) for f, true in measured.items() if f in rows]
    near = sum(one[0] <= np.log(1 + WITHIN) for one in off)
    worst = max(off, default=(0.0, 0.0, 1.0, 1.0))
    p = found.prediction
    distances = "" if p is None else f"{p.before_db:.2f}, {p.after_db:.2f}, {p.floor_db:.2f}"
    return (
        f"| {pair.place} | {pair.before} -> {pair.after}{' (same strikes)' * pair.same_strikes} | {found.verdict} | "
        f"{'yes' if found.verdict in pair.names else 'NO'} | {f'{near} of {len(off)}' if off else ''} | "
        f"{f'{worst[1]:g} Hz {worst[2]:.2f} for {worst[3]:.2f}' if off else ''} | "
        f"{'' if p is None else f'{p.gap_closed:.2f}'} | {distances} | {seconds:.0f} |"
    )


def _print_bottle(place: Path) -> list[float]:
    begun = time.process_time()
    found = compare(read_states([place], numbers=FILLED))
    assert found.series is not None
    for one in found.comparisons:
        p = one.prediction
        print(
            f"| bottle-water | {one.changes.before.state.name} -> {one.changes.after.state.name} | {one.verdict} | "
            f"{'yes' if one.verdict == 'added-mass' else 'NO'} | | | {'' if p is None else f'{p.gap_closed:.2f}'} | "
            f"{'' if p is None else f'{p.before_db:.2f}, {p.after_db:.2f}, {p.floor_db:.2f}'} | |"
        )
    print(f"\nseries: {found.series.verdict}, {time.process_time() - begun:.0f} s of processor")
    for law in found.series.moving:
        print(
            f"  {law.freq_hz:.1f} Hz {law.law}: full {law.shift_percent[-1]:+.2f} %, by the others "
            f"{law.predicted_percent[-1]:+.2f} %, off {100 * law.error_share:.1f} % of its size"
        )
    walls = [shift for f, shift in found.series.still if f > 700]
    near = sum(abs(shift) < WALL_PERCENT for shift in walls)
    print(
        f"  {len(walls)} lines above 700 Hz stay: {np.median(walls):+.3f} % at the median, {near} within "
        f"{WALL_PERCENT} %, largest {max(walls, key=abs, default=0.0):+.3f} %"
    )
    return [
        one.prediction.gap_closed if one.prediction is not None and one.verdict == "added-mass" else 0.0
        for one in found.comparisons
    ]


def _print_splits(data: Path, only: Sequence[str], most: int) -> None:
    whole = made = spoke = 0
    print("| state | takes | splits | too few to say | with a statement | names | s a split |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for name, state in _states_of(data, only):
        count = silent = said = 0
        names: list[str] = []
        halves = _halves(len(state.takes), most)
        if len(state.takes) - 2 < FEWEST_DEGREES:  # nothing is ever said of so few
            count, silent, halves = len(halves), len(halves), []
        measured = _MeasuredTakes.of(state) if halves else None
        begun = time.process_time()
        for half in halves:
            assert measured is not None
            sides = [np.array([(k in half) is side for k in range(len(state.takes))]) for side in (True, False)]
            before, after = (measured.part(side) for side in sides)
            found = compare_states(before, after, measure=measured.lines_of)
            count += 1
            silent += found.method == "too few takes"
            if found.anything:
                said += 1
                rows = sorted({f"{row.kind} {row.freq_hz:.0f} Hz" for row in found.rows if row.certain})
                causes = ", ".join(one.name for one in find_causes(found)) or "unexplained"
                names.append(f"{causes} of {len(rows)}: {', '.join(rows[:3])}")
        print(
            f"| {name} | {len(state.takes)} | {count} | {silent} | {said} | {'; '.join(names)} | "
            f"{(time.process_time() - begun) / max(len(halves), 1):.2f} |",
            flush=True,
        )
        whole, made, spoke = whole + count, made + count - silent, spoke + said
    print(f"\n{spoke} of {whole} splits with a statement; {made} had takes enough to say something")


def _states_of(data: Path, only: Sequence[str]) -> Iterator[tuple[str, RecordedState]]:
    """Yield every state that has takes to divide."""
    folders = sorted(one for kind in ("states", "measured") for one in (data / kind).glob("*") if one.is_dir())
    for folder in folders:
        if only and folder.name not in only:
            continue
        inner = sorted(one for one in folder.rglob("*") if one.is_dir())
        of_one_state = [one for one in inner if folder.parent.name == "states" or one.parent.name == "dev"]
        for place in of_one_state:
            if len(list(place.glob("*.flac"))) >= 2:
                yield f"{folder.name}/{place.name}", read_state(place)
    for recording in TAPS:
        if (data / recording).is_file() and (not only or Path(recording).parts[1] in only):
            yield recording, _taps(data / recording)


def _taps(recording: Path) -> RecordedState:
    """Cut the first taps of a recording."""
    sound, sr, _ = read_channel(str(recording), None)
    lead = round(0.02 * sr)
    starts = np.round(find_strikes(sound, sr) * sr).astype(int)
    ends = np.append(starts[1:] - lead, len(sound))
    takes = [
        take_of(sound[max(0, a - lead) : b], sr, f"{recording.name} {k}")
        for k, (a, b) in enumerate(zip(starts, ends, strict=True))
        if b - a > 0.2 * sr
    ]
    return RecordedState(recording.name, tuple(takes[:MOST_TAPS]), sr)


def _halves(count: int, most: int) -> list[tuple[int, ...]]:
    """List distinct ways to take half of so many, of all of them or as many as asked, drawn."""
    ways = [one for one in combinations(range(count), count // 2) if count % 2 or 0 in one]
    chosen = np.random.default_rng(0).permutation(len(ways))[:most]
    return [ways[k] for k in sorted(chosen)]


@dataclass(frozen=True, slots=True, eq=False)
class _MeasuredTakes:
    """All takes of a state, measured once: octaves, and the lines that all of them or either half share, in each.

    A part of them has those lines that most of its takes hold. That is what `shared_lines` of the part finds but for
    lines too weak to be held by single takes; a split then costs its comparison alone.
    """

    state: RecordedState
    octaves: OctaveValues
    pole: np.ndarray
    lines: TakeLines

    @classmethod
    def of(cls, state: RecordedState) -> _MeasuredTakes:
        """Measure a state."""
        takes, sr = state.takes, state.sr
        pole: list[complex] = []
        for some in (takes, takes[::2], takes[1::2]):
            for p in shared_lines(some, sr).pole:
                if not any(abs(p.imag - q.imag) < 0.5 * max(-p.real, -q.real, 1.0) for q in pole):
                    pole.append(complex(p))
        poles = np.array(pole, complex)
        return cls(state, octave_values(takes, sr), poles, measured_in_takes(takes, sr, poles))

    def part(self, side: np.ndarray) -> StateValues:
        """Return some takes (t,) as `values_of` does."""
        takes = tuple(take for take, inside in zip(self.state.takes, side, strict=True) if inside)
        octaves = {f.name: getattr(self.octaves, f.name) for f in fields(self.octaves)}
        mine = {name: values if name == "octave_hz" else values[side] for name, values in octaves.items()}
        held = np.flatnonzero(np.isfinite(self.lines.freq_hz[side]).mean(axis=0) > 0.5)
        freq, t60 = (np.nanmean(values[side][:, held], axis=0) for values in (self.lines.freq_hz, self.lines.t60_s))
        power = (10 ** (self.lines.level_db[side][:, held] / 10)).mean(axis=0)
        decay = np.log(1e3) / t60
        lines = SharedLines(freq, decay, power / (4 * decay), 10 * np.log10(power))
        order = np.argsort(-lines.energy, kind="stable")[:MOST_PAIRED_LINES]
        lines = SharedLines(*(getattr(lines, f.name)[order] for f in fields(lines)))
        return StateValues(replace(self.state, takes=takes), OctaveValues(**mine), lines)

    def lines_of(self, takes: tuple[Take, ...], sr: int, pole: np.ndarray) -> TakeLines:
        """Look up what was measured in takes about the poles nearest to these (k,)."""
        rows = [next(k for k, one in enumerate(self.state.takes) if one is take) for take in takes]
        columns = [int(np.abs(self.pole - p).argmin()) for p in pole]
        return TakeLines(*(getattr(self.lines, f.name)[np.ix_(rows, columns)] for f in fields(self.lines)))


if __name__ == "__main__":
    main()
