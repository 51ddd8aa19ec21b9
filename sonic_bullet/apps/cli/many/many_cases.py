"""`fit` and `diagnose` of many cases: a job a case, and a folder of results.

    DIR/run.json                 command, options and versions
    DIR/NAME/preset.json, result.json (as of --json), summary.txt, and what else was asked for
    DIR/NAME/done.json           written last: the case's SHA-256; a case that has it, unchanged, is never done again
    DIR/summary.csv              a row a case
    DIR/failures.jsonl           cases without a result, each with its reason

Exit 0: all done; 1: a case failed, or is farther from its recordings than silence.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
import msgspec

from sonic_bullet.apps.cli.line_table import finite, write_csv
from sonic_bullet.apps.cli.many.case_jobs import (
    PRESET_FILE,
    VALUES_FILE,
    WORDS_FILE,
    CaseFolder,
    CaseResult,
    digest,
    run_case,
)
from sonic_bullet.apps.cli.output import clean_stdout, folder_place, places, print_report, status, table, write_json
from sonic_bullet.apps.jobs.job_driver import finish_jobs, open_workers
from sonic_bullet.apps.jobs.job_folder import open_job_folder, write_json_lines
from sonic_bullet.files.cases import SPLITS
from sonic_bullet.files.storage.atomic import replace_file, write_errors
from sonic_bullet.files.storage.json_text import json_bytes
from sonic_bullet.options.fit import DiagnoseOptions, FitOptions, ManyOptions
from sonic_bullet.options.option import given_flags
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import FileError, SonicBulletError
from sonic_bullet.session.run_recorder import package_versions

DONE_FILE = "done.json"


def run_many(command: str, sources: Sequence[str], options: FitOptions | DiagnoseOptions) -> None:
    """Run a command over cases; raises SonicBulletError."""
    _check_options(options)
    assert options.output is not None
    (to,), many = places(options.json_to), options.many
    cases = _cases(sources)
    root = folder_place(options.output)
    asked = asdict(options) | asdict(getattr(options, "strike", ManyOptions()))
    chosen = {name: asked[name] for name in asked if name not in ("output", "json_to", "many", *asdict(many))}
    made_by = {"command": command, "options": chosen, "versions": package_versions()}
    own = [case.name for case in cases]
    do = partial(run_case, options)
    with clean_stdout(to) as echo, status(format_count(len(cases), "case")):
        with (
            open_workers(many.workers, many.limit_s or 3600.0, many.scheduler) as crew,
            open_job_folder(root, "run.json", made_by, kind="run", own=own) as place,
        ):
            missing = [case for case in cases if not _is_done(place, case)]
            made, failures = finish_jobs(
                do, missing, crew, count=len(cases), nouns="cases", place=str(root),
                keep=lambda case, found: _keep(place / case.name, found),
                write_lists=lambda failed: _write_lists(command, place, cases, failed),
                update_lists=lambda _, failed: _write_lists(command, place, cases, failed),  # they are few
            )  # fmt: skip
            rows = _rows(command, place, cases)
        failed = {case.name: reason for case, reason in failures.items()}
        summary = CasesReport(command, rows, made, failed)
        print_report(summary, echo)
    write_json(to, summary.to_json())
    if failed or any(row["verdict"] == "worse-than-silence" for row in rows):
        raise click.exceptions.Exit(1)


def _check_options(options: FitOptions | DiagnoseOptions) -> None:
    """Raise FileError for options that many cases have not."""
    output = options.output
    if output is None or output.endswith(".json"):
        given = f"-o {output}" if output else "no -o"
        raise FileError(f"{given} beside several cases", "give a folder for all results: -o DIR")
    if isinstance(options, FitOptions) and (of_one := given_flags(options.strike)):
        given = " and ".join(of_one)
        raise FileError(f"{given} given beside cases", "a case says that itself; leave it out")
    taken = {PRESET_FILE, VALUES_FILE, WORDS_FILE, DONE_FILE}
    # options that name an output, which here is one of each case's
    outputs = {
        "picture": "--picture",
        "page": "--page",
        "csv_to": "--csv",
        "uff_to": "--uff",
        "predict": "--predict",
        "report": "--report",
    }
    for name, option in outputs.items():
        value = getattr(options, name, None)
        if value is None:
            continue
        if value != Path(value).name or value in taken or value in {"-", ".", ".."}:
            raise FileError(
                f"{option} is {value} beside several cases", "give the name of a file in each case's folder of results"
            )
        taken.add(value)


def _cases(sources: Iterable[str]) -> list[CaseFolder]:
    """Return the cases in the order given; FileError where none is there, or two have one name."""
    cases = dict[str, CaseFolder]()
    for source in dict.fromkeys(sources):
        path = Path(source)
        folder = (path.parent if path.name == "case.json" else path).resolve()
        if folder.name in cases:
            if cases[folder.name].folder == folder:
                continue
            what = f"two cases are named {folder.name}: {cases[folder.name].folder} and {folder}"
            raise FileError(what, "rename one, or give each a folder of results by a command of its own")
        cases[folder.name] = CaseFolder(folder.name, folder)
    if not any((case.folder / "case.json").is_file() for case in cases.values()):
        raise FileError(f"{' and '.join(list(sources)[:3])}: no case among them", "give folders with a case.json")
    return list(cases.values())


def _is_done(place: Path, case: CaseFolder) -> bool:
    """Tell whether a case, as it is now, has its result."""
    try:
        before = msgspec.json.decode((place / case.name / DONE_FILE).read_bytes())
        return bool(before["case_sha256"] == digest(case.contents()))
    except (OSError, SonicBulletError, msgspec.DecodeError, KeyError, TypeError):
        return False


def _keep(folder: Path, found: CaseResult) -> None:
    """Write a case's results, the mark that they are whole last; leave none of them where that fails."""
    marked = {**found.files, DONE_FILE: json_bytes({"case_sha256": found.case_sha256})}
    with write_errors(folder):
        (folder / DONE_FILE).unlink(missing_ok=True)
        for name in marked:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
    try:
        for name, content in marked.items():
            with replace_file(folder / name) as file:
                file.write(content)
    except FileError:
        for name in marked:
            (folder / name).unlink(missing_ok=True)
        raise


def _write_lists(command: str, place: Path, cases: Iterable[CaseFolder], failed: Mapping[CaseFolder, str]) -> None:
    listed = sorted((case.name, why) for case, why in failed.items())
    write_json_lines(place / "failures.jsonl", ({"case": name, "reason": why} for name, why in listed))
    write_csv(str(place / "summary.csv"), _rows(command, place, cases), MANY_COLUMNS[command])


def _rows(command: str, place: Path, cases: Iterable[CaseFolder]) -> list[dict[str, Any]]:
    """Return a row for each case that has its result."""
    rows = []
    values_of = {
        "fit": _fit_values,
        "diagnose": _diagnose_values,
    }
    for case in cases:
        if (place / case.name / DONE_FILE).is_file():
            found = msgspec.json.decode((place / case.name / VALUES_FILE).read_bytes())
            rows.append({"case": case.name, "verdict": found["verdict"], **values_of[command](found)})
    return rows


def _fit_values(found: Mapping[str, Any]) -> dict[str, Any]:
    square = found["covariance"][2][2]  # of ln γ
    return {
        "gamma_m2_s2": found["gamma_m2_s2"],
        "gamma_sd": None if square is None else finite(found["gamma_m2_s2"] * square**0.5),
        "poisson_ratio": found["poisson_ratio"],
        "alpha_per_s": found["alpha_per_s"],
        "beta_s": found["beta_s"],
        "modes": len(found["modes"]),
        "distance_db": found["log_spectral_db"],
    }


def _diagnose_values(found: Mapping[str, Any]) -> dict[str, Any]:
    errors = found["errors"]
    return {
        "effects": " ".join(effect["id"] for effect in found["effects"]),
        **{f"{side}_{split}_db": errors[side].get(split) for split in SPLITS for side in ("before", "after")},
    }


MANY_COLUMNS = {
    "fit": (
        "case", "gamma_m2_s2", "gamma_sd", "poisson_ratio", "alpha_per_s", "beta_s", "modes", "distance_db", "verdict"
    ),
    "diagnose": (
        "case", *(f"{side}_{split}_db" for split in SPLITS for side in ("before", "after")), "verdict", "effects"
    ),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class CasesReport:
    """Report of a command run over cases. made: in this run; failed: reasons by case."""

    command: str
    rows: Sequence[Mapping[str, Any]]
    made: int
    failed: Mapping[str, str]

    def to_json(self) -> dict[str, Any]:
        """Return the row of each case, and the reasons."""
        return {"made": self.made, "cases": self.rows, "failures": self.failed}

    def lines(self) -> list[str]:
        """Return a table of the cases, a count, and the first reasons."""
        heads = [name for name in MANY_COLUMNS[self.command] if any(row[name] is not None for row in self.rows)]
        cells = [tuple(_cell(row[name]) for name in heads) for row in self.rows]
        return [
            *([table(tuple(name.replace("_", " ") for name in heads), cells)] if cells else []),
            f"{format_count(len(self.rows), 'case')} with a result, {self.made} made now"
            + (f"; {len(self.failed)} without, in failures.jsonl" if self.failed else ""),
            *(f"{name}: {reason}" for name, reason in sorted(self.failed.items())[:10]),
        ]


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
