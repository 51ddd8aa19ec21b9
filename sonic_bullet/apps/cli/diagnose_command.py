"""Command `diagnose`: find what the model of a case lacks.

Exit 0: a verdict; 1: the baseline is farther from the recordings than silence.
"""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click

from sonic_bullet.apps.cli.output import (
    clean_stdout,
    folder_place,
    places,
    print_report,
    status,
    table,
    warn,
    write_json,
)
from sonic_bullet.apps.cli.states_command import run_states
from sonic_bullet.files import write_audio
from sonic_bullet.files.cases import read_case
from sonic_bullet.files.presets import write_preset
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.options.fit import DiagnoseOptions
from sonic_bullet.options.states import StatesOptions
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError

SIDES = ("before", "after")  # the folders of --predict


def run_diagnose(source: str, options: DiagnoseOptions) -> None:
    """Run `diagnose`; raises SonicBulletError."""
    output, report, predict, propose = options.output, options.report, options.predict, options.propose
    if output is not None and not output.endswith(".json"):
        raise FileError(f"cannot write {output}: presets are JSON files", "end the name with .json")
    if report is not None and not report.endswith((".html", ".htm")):
        raise FileError(f"cannot write {report}: a report is a page", "end the name with .html")
    case, strike, written = read_case(source), None, ""
    if len({one.state for one in case.recordings if one.state is not None}) > 1:
        _diagnose_states(source, case, options, {"-o": output, "--predict": predict, "--next": propose})
        return
    output, report, json_to = places(output, report, options.json_to)
    folder = None if predict is None else folder_place(predict, *SIDES)
    warn(case.warnings)
    with clean_stdout(json_to) as echo:
        from sonic_bullet.lab.diagnosis.diagnose import diagnose

        with status(source):
            found = diagnose(case, seed=options.seed)
            if folder is not None:
                written = f"{format_count(_write_predictions(found, folder), 'strike')} predicted in {predict}"
            if propose:
                from sonic_bullet.lab.diagnosis.separating_strike import separating_strike

                report_progress("looking for the strike that would tell most")
                strike = separating_strike(found.closed)
            if report is not None:
                from sonic_bullet.apps.bake.page.fitted_bodies import struck_page
                from sonic_bullet.apps.report.diagnosis_page import write_report

                report_progress("drawing the report")
                takes = (*found.takes, *found.unfitted)
                struck = struck_page(case, found.closed.before, found.closed.after, found.bodies, takes)
                write_report(report, found, proposal(strike) if propose else "", struck)
        if output is not None:
            from sonic_bullet.lab.diagnosis.preset_export import preset_of

            write_preset(output, preset_of(found))
        summary = DiagnosisReport(found, propose, strike, written)
        print_report(summary, echo)
    warn(found.warnings)
    write_json(json_to, summary.to_json())
    if found.verdict == "worse-than-silence":
        raise click.exceptions.Exit(1)


def _diagnose_states(source: str, case: Any, options: DiagnoseOptions, of_one: dict[str, Any]) -> None:
    """Answer for a case recorded in several states as `states` does: the first is the model of the others."""
    if given := [name for name, value in of_one.items() if value]:
        raise FileError(
            f"{given[0]} is for a model that is fitted, and case {case.name} names states of its object",
            f"leave {given[0]} out, or diagnose a case of one state",
        )
    warn(case.warnings)
    run_states((source,), StatesOptions(report=options.report, json_to=options.json_to))


def _write_predictions(found: Any, folder: str) -> int:
    """Write every strike's WAV before and after; return the number of strikes; raises FileError."""
    from sonic_bullet.lab.diagnosis.diagnose import predictions

    made = predictions(found)
    for side in SIDES:
        try:
            os.makedirs(Path(folder) / side, exist_ok=True)
        except OSError as error:
            raise FileError(
                f"cannot make the folder {Path(folder) / side}: {error.strerror or error}",
                "choose another with --predict",
            ) from error
    for stem, sr, before, after in made:
        for side, sample in (("before", before), ("after", after)):
            write_audio(Path(folder) / side / f"{stem}.wav", sample, sr, full_scale_pa=None)
    return len(made)


@dataclass(frozen=True, slots=True)
class DiagnosisReport:
    """Report of a `Diagnosis`; strike: the one to measure next, where ``proposed``; predicted: what was written."""

    found: Any
    proposed: bool = False
    strike: Any = None
    predicted: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the diagnosis, and the next strike where it was asked for."""
        from sonic_bullet.lab.diagnosis.diagnose import diagnosis_to_json

        asked = {"next_strike": asdict(self.strike) if self.strike else None} if self.proposed else {}
        return diagnosis_to_json(self.found) | asked

    def lines(self) -> list[str]:
        """Return verdict, effects with their numbers, distances, and what to measure next."""
        from sonic_bullet.lab.diagnosis.baseline_words import describe_baseline
        from sonic_bullet.lab.diagnosis.deciding_measurement import next_measurement
        from sonic_bullet.lab.diagnosis.selection.effect_table import HEAD, effect_table, explain_chance
        from sonic_bullet.lab.diagnosis.selection.stepwise import NothingCompared
        from sonic_bullet.lab.diagnosis.unexplained import NOTHING

        splits = {r.split for r in self.found.case.recordings}

        def missing(split: str) -> str:
            return "not compared" if split in self.found.not_compared else "no audio"

        words = {
            "none": "the model suffices: no effect is accepted",
            "explained": "the model lacks" + (", not alone" if self.found.unexplained else ""),
            "unexplained": "something is left that no known effect explains",
            "worse-than-silence": "what was fitted is farther from the recordings than silence, with every effect",
            "nothing": NOTHING,
        }
        nothing = type(self.found.closed) is NothingCompared
        text = [f"{self.found.case.name}: {self.found.verdict}: {words['nothing' if nothing else self.found.verdict]}"]
        for c in self.found.closed.added:
            numbers = ", ".join(f"{k} {_number(v)}" for k, v in c.effect.parameters().items())
            text.append(
                f"  {c.id} ({c.effect.owner.value}): {numbers}; {c.mean_db:.2f} dB nearer on strikes left out, "
                f"chance {c.control_db:.2f} dB"
            )
        level = self.found.errors["before"].get("fit")
        far = "" if level is None else f"; {level:.2f} dB from the fitted strikes"
        text.append(f"baseline, before anything is added: {describe_baseline(self.found)}{far}")
        rows = [
            (
                split,
                *(
                    f"{self.found.errors[side][split]:.2f} dB"
                    if self.found.errors[side][split] is not None
                    else missing(split)
                    for side in ("before", "after")
                ),
            )
            for split in ("fit", "holdout", "transfer")
            if split in self.found.errors["before"] and split in splits
        ]
        text.append(table(("log-spectral distance", "before", "after"), rows))
        if self.found.errors["floor"] is not None:
            text.append(f"noise alone: {self.found.errors['floor']:.2f} dB")
        if tried := effect_table(self.found.closed):
            text += [table(HEAD, [row.cells() for row in tried]), explain_chance()]
        if self.found.unexplained:
            text.append(f"left: {self.found.unexplained['words']}")
        if said := next_measurement(self.found.found, self.found.closed, self.found.unexplained):
            text.append(f"next: {said}")
        if self.proposed:
            text.append(f"next strike: {proposal(self.strike)}")
        if self.predicted:
            text.append(self.predicted)
        return text


def proposal(strike: Any) -> str:
    """Return what is proposed to strike next, or that nothing is."""
    return str(strike or "no two models that these strikes leave open")


def _number(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    shown_numbers = 4  # numbers of a list, in the summary: all of them are in the JSON
    if isinstance(value, list):
        more = f", and {len(value) - shown_numbers} more" if len(value) > shown_numbers else ""
        return "[" + ", ".join(_number(v) for v in value[:shown_numbers]) + more + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} {_number(v)}" for k, v in value.items()) + "}"
    return str(value)
