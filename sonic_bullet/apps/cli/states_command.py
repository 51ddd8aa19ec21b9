"""Command `states`: what changed between two states of one thing, or along a series of them.

Exit 0: whatever the answer is; 2: wrong use, or a recording that cannot be read.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from fractions import Fraction
from pathlib import Path
from statistics import median
from typing import Any

from sonic_bullet.apps.cli.output import clean_stdout, places, print_report, status, table, warn, write_json
from sonic_bullet.options.states import StatesOptions
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError

SHOWN_ROWS = 12
"""Rows of a table; JSON has all."""
STILL_PERCENT = 0.3
"""Of a frequency: ten degrees move a metal's lines by as much, the neighbour of a split pair lies farther."""


def run_states(paths: tuple[str, ...], options: StatesOptions) -> Any:
    """Run `states`, and return what was compared, None of pieces; raises SonicBulletError."""
    picture, report = options.picture, options.report
    if picture is not None and not picture.endswith((".png", ".pdf", ".svg")):
        raise FileError(f"cannot write {picture}: pictures are .png, .pdf or .svg", "end the name with one of them")
    if report is not None and not report.endswith((".html", ".htm")):
        raise FileError(f"cannot write {report}: a report is a page", "end the name with .html")
    picture, report, json_to = places(picture, report, options.json_to)
    with clean_stdout(json_to) as echo:
        from sonic_bullet.lab.states.recorded_states import read_states
        from sonic_bullet.lab.states.state_comparison import compare

        with status("states"):
            given = read_states(paths, numbers=_numbers(options.numbers), channel=options.channel)
        if options.pieces:
            _run_pieces(given, echo, json_to, (picture, report))
            return None
        with status("states"):
            found = compare(given, same_strikes=options.same_strikes)
            if picture is not None:
                from sonic_bullet.apps.report.plots.states_plot import write_states_picture

                write_states_picture(Path(picture), found)
            if report is not None:
                from sonic_bullet.apps.report.plots.states_plot import states_picture_png
                from sonic_bullet.apps.report.states_page import write_states_page

                write_states_page(report, found, StatesReport(found).lines(), states_picture_png(found))
        summary = StatesReport(found)
        print_report(summary, echo)
    warn(f"{state.name}/{take.name}: {take.note}" for state in given for take in state.takes if take.note)
    write_json(json_to, summary.to_json())
    return found


def _run_pieces(given: Any, echo: Any, json_to: str | None, drawn: tuple[str | None, ...]) -> None:
    """Hold pieces of one kind against each other."""
    from sonic_bullet.lab.states.odd_pieces import FEWEST_PIECES, find_odd_pieces

    if any(drawn):
        raise FileError("--pieces draws no picture and no page", "leave --picture and --report out; --json has it all")
    with status("states"):
        found = find_odd_pieces(given)
    if found is None:
        raise FileError(
            f"{format_count(len(given), 'piece')} cannot be held against each other",
            f"give {FEWEST_PIECES} or more that share four lines",
        )
    summary = PiecesReport(found)
    print_report(summary, echo)
    write_json(json_to, summary.to_json())


@dataclass(frozen=True, slots=True)
class PiecesReport:
    """Report of pieces of one kind."""

    found: Any

    def to_json(self) -> dict[str, Any]:
        """Return every number."""
        return {
            "odd": [one.name for one in self.found.odd],
            "pieces": [asdict(one) for one in self.found.pieces],
            "line_hz": list(self.found.line_hz),
        }

    def lines(self) -> list[str]:
        """Return which pieces are odd, and a table of all."""
        odd = self.found.odd
        words = {"shape": "lines moved each by its own: a notch, a crack or a mass", "damping": "another damping"}
        said = [
            f"{format_count(len(self.found.pieces), 'piece')} by {format_count(len(self.found.line_hz), 'line')}: "
            + (f"{len(odd)} differ from the rest" if odd else "none differs from the rest beyond what they scatter")
        ]
        said += [
            f"  {one.name}: {'; '.join(words[x] for x in one.verdict.split(', '))} ({one.oddest_hz:.1f} Hz "
            f"{one.oddest_percent:+.2f} %, T60 ×{one.t60_ratio:.2f})"
            for one in odd
        ]
        rows = [
            (
                one.name,
                one.verdict or "as the rest",
                f"{one.pitch_percent:+.2f} %",
                f"{one.oddest_percent:+.3f} % at {one.oddest_hz:.0f} Hz",
                f"{one.shape_chance:.1g}",
                f"×{one.t60_ratio:.2f}",
                f"{one.damping_chance:.1g}",
            )
            for one in self.found.pieces
        ]
        return [*said, table(("piece", "verdict", "pitch", "oddest line", "chance", "T60", "chance"), rows)]


def _numbers(given: tuple[str, ...]) -> dict[str, float]:
    """Read STATE=N, N a number or a fraction."""
    found = {}
    for one in given:
        name, sign, value = one.rpartition("=")
        try:
            found[name] = float(Fraction(value))
        except (ValueError, ZeroDivisionError) as error:
            raise FileError(f"--number {one} is none", "write STATE=N, as half=1/2 or full=0.95") from error
        if not sign or not name:
            raise FileError(f"--number {one} names no state", "write STATE=N, as half=1/2 or full=0.95")
    return found


@dataclass(frozen=True, slots=True)
class StatesReport:
    """Report of compared states."""

    found: Any

    def to_json(self) -> dict[str, Any]:
        """Return every number."""
        made: dict[str, Any] = self.found.to_json()
        return made

    def lines(self) -> list[str]:
        """Return what changed in words and tables."""
        said: list[str] = []
        for one in self.found.comparisons:
            said += _lines_of(one)
        if self.found.series is not None:
            said += _lines_of_series(self.found.series)
        return said


def _lines_of(one: Any) -> list[str]:
    changes = one.changes
    before, after = changes.before.state, changes.after.state
    takes = f"{format_count(len(before.takes), 'take')} and {len(after.takes)}"
    head = f"{before.name} -> {after.name} ({takes}): "
    ways = {
        "exchange": "by exchange of takes between the states",
        "scatter": "by the scatter of takes",
        "too few takes": "",
    }
    compared = format_count(len(changes.rows), "value")
    if one.by_series:
        said = [f"{head}{one.verdict}, by the series"]
    elif one.verdict == "too few takes":
        said = [f"{head}too few takes to say; what was measured, without a statement:"]
    elif one.verdict == "none":
        said = [f"{head}none beyond takes: of {compared}, none differs more than takes do ({ways[changes.method]})"]
        return said
    else:
        certain = sum(row.certain for row in changes.rows)
        said = [f"{head}{one.verdict}: {certain} of {compared} differ beyond takes, {ways[changes.method]}"]
    for cause in one.causes:
        said.append(f"  {cause.name}: {cause.words}")
        if cause.alternatives:
            said.append(f"    not told from {', '.join(cause.alternatives)}; to tell them: {cause.separated_by}")
        if not cause.of_the_thing:
            said.append("    that is no change of the thing")
    if one.verdict == "unexplained":
        said.append("  no effect that is known here makes such a pattern")
    p = one.prediction
    if p is not None and p.gap_closed == p.gap_closed:
        other = "the two states most alike" if one.by_series else "another take"
        between = "" if one.by_series else f" ({100 * p.gap_low:.0f} to {100 * p.gap_high:.0f})"
        said.append(
            f"  takes of {after.name} held out: {p.before_db:.1f} dB from {before.name}, {p.after_db:.1f} dB with what "
            f"is named, {p.floor_db:.1f} dB from {other}; of the gap {100 * p.gap_closed:.0f} % are closed{between}"
        )
    return [*said, *_tables(changes, everything=one.verdict == "too few takes")]


def _tables(changes: Any, everything: bool) -> list[str]:
    """Return a table of the certain changes, kind by kind; of all where takes were too few."""
    from sonic_bullet.lab.states.changes import UNITS

    rows = []
    for kind, unit in UNITS.items():
        of = changes.of(kind, certain=not everything)
        for row in sorted(
            sorted(of, key=lambda row: -abs(row.t))[: 3 if everything else SHOWN_ROWS], key=lambda row: row.freq_hz
        ):
            sign = "×" if unit == "ratio" else ""
            mark = "" if unit == "ratio" else unit
            pattern = f"{sign}{{:.3g}}" if unit == "ratio" else "{:+.3g}"
            bounds = " to ".join(pattern.format(x) for x in (row.low, row.high))
            chance = "" if row.chance is None else f"{row.chance:.1g}"
            rows.append((kind, f"{row.freq_hz:.1f}", pattern.format(row.change), bounds, mark, chance))
    return [table(("what", "Hz", "change", "between", "", "chance"), rows)] if rows else []


def _lines_of_series(series: Any) -> list[str]:
    said = [f"series of {len(series.numbers)} states, {format_count(series.tracked, 'line')} tracked: {series.verdict}"]
    for law in series.moving:
        shown = ", ".join(
            f"{q:g}: {s:+.2f} % ({p:+.2f})"
            for q, s, p in zip(law.numbers, law.shift_percent, law.predicted_percent, strict=True)
        )
        said.append(
            f"  {law.freq_hz:.1f} Hz goes with the number, {law.law}: {shown}; in brackets: by the other states"
        )
    if series.still:
        shift = sorted(s for _, s in series.still)
        middle, near = median(shift), sum(abs(s) < STILL_PERCENT for s in shift)
        listed = ", ".join(f"{f:.1f} Hz {s:+.2f} %" for f, s in series.still[:SHOWN_ROWS])
        said.append(
            f"  {format_count(len(shift), 'line')} from {series.still[0][0]:.0f} to {series.still[-1][0]:.0f} Hz not "
            f"told to go with it: {middle:+.3f} % at the median, {near} within {STILL_PERCENT:g} %; {listed}"
        )
    return said
