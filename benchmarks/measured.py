"""Recordings by others through the commands a user has: `case new`, `fit`, `residual`, `diagnose`, with takes held out.

    python -m benchmarks.measured --data ../shared/measured [--out PAGE] [--work FOLDER] [CASE ...]

DATA/SET/case.json -> takes cut out of the set's files (every second one held out, MOST at most)
    -> `case new` -> case -> `fit`, `residual`, `diagnose` -> their JSON -> one row, and what is said of what is left
    -> docs/measured/recordings-by-others.md

Distances are those that the commands print: log-spectral, in the case's band, of takes that were not fitted, one gain
fitted where no impulse is known. A case whose JSON stands in FOLDER is not run again. What cannot be run is named, and
counted.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

MOST = 4
LEAD_S, LONGEST_S = 0.05, 2.5
PAGE = Path("docs/measured/recordings-by-others.md")
COMMANDS = ("fit", "residual", "diagnose")
LIMIT_S = 600
COLUMNS = (
    "object",
    "held out",
    "silence",
    "another take",
    "guessed material",
    "fitted",
    "with residual",
    "levels: lines and noise",
    "another take",
    "`diagnose`, before",
    "with effects",
    "effects, or the verdict",
)
OWN_COLUMNS = ("object", "silence", "fitted", "with residual", "effects, or the verdict")
HEAD = """# Recordings by others

Written by `python -m benchmarks.measured --data ../shared/measured`. Each row is what `case new`, `fit`, `residual`
and `diagnose` say of recordings that somebody else made.

Every second take is held out, of at most {most} takes of an object. Distances are log-spectral, in dB, over what
stands 10 dB above the noise in the case's band. They are means over the takes held out. *Silence* and *another take*
(the nearest) stand beside them. *Fitted* and *with residual* are what `fit` and `residual` print: one gain a take where
no impulse is known. *Guessed material* is the shipped preset that was guessed, on the object's mesh where there is one,
at its best gain. *Levels* are the distances of lines with the noise beside them, and of another take, by thirds of
octaves and times that double: cells are compared as they are, levels as sums over cells, of which a noise has no other.
*Before* and *with effects* are the errors of `diagnose` on the takes held out, by the measure of cells.
The eight takes of the bowl are microphones of one stroke. Under *next* stands the one measurement that would decide.
"""
Piece = tuple[Path, float, float]
Said = dict[str, dict[str, Any]]


@dataclass(frozen=True, slots=True)
class Object:
    """What was struck: takes as pieces (file, from, to in s) of its set's files, and what `case new` is told of it."""

    name: str
    set: str
    takes: tuple[Piece, ...]
    options: tuple[str, ...] = ()
    ready: Path | None = None


def objects(data: Path) -> Iterator[Object]:
    """The objects of all sets that hold recordings."""
    for name, of_file in (("diffimpact-hammer", "object"), ("wood-iet-timbr", "date")):
        for entry in _read(data / name)["files"]:
            hits = [hit["t_hit_s"] for hit in entry["hits"]]
            ends = [*(h - LEAD_S for h in hits[1:]), hits[-1] + LONGEST_S]
            takes = [
                (data / name / entry["file"], h - LEAD_S, min(e, h + LONGEST_S))
                for h, e in zip(hits, ends, strict=True)
            ]
            yield Object(f"{name}: {entry[of_file].split(' (')[0]}", name, tuple(takes[:MOST]))
    robot: dict[str, list[Piece]] = {}
    for entry in _read(data / "diffimpact-robot")["files"]:
        piece = (data / "diffimpact-robot" / entry["file"], entry["t_hit_s"] - LEAD_S, entry["t_hit_s"] + 1.2)
        robot.setdefault(f"{entry['object']}, {entry['tool']}", []).append(piece)
    for what, takes in robot.items():
        yield Object(f"diffimpact-robot: {what}", "diffimpact-robot", tuple(takes[:MOST]))
    for name, pattern, what in (
        ("agogo-forzee", "AgogoHigh*", "high bell"),
        ("ride-bja", "BL_*", "bell"),
        ("ride-bja", "RD_*", "bow"),
    ):
        yield Object(f"{name}: {what}", name, _whole(data / name / "dev", pattern))
    yield Object("diffsound-bowl", "diffsound-bowl", (), ready=data / "diffsound-bowl")
    bar = data / "pyrfda-steel-bar"
    yield Object(
        bar.name, bar.name, _whole(bar / "dev", "*"), ("--mesh", str(bar / "mesh" / "bar.obj"), "--material", "steel")
    )
    for name, folder in (("bell-sonicpi", "dev"), ("glockenspiel-fluidr3", "dev"), ("xylophone-vcsl", "dev")):
        for path in sorted((data / name / folder).glob("*.flac"))[:1]:
            yield Object(f"{name}: {path.stem}", name, ((path, 0.0, LONGEST_S),))
    for path in sorted((data / "realimpact-clips").glob("*.flac")):
        yield Object(f"realimpact-clips: {path.stem}", "realimpact-clips", ((path, 0.0, LONGEST_S),))


def _read(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "case.json").read_text())
    return found


def _whole(folder: Path, pattern: str) -> tuple[Piece, ...]:
    return tuple((path, 0.0, LONGEST_S) for path in sorted(folder.glob(f"{pattern}.flac"))[:MOST])


def made_case(thing: Object, folder: Path) -> Path:
    """The case of an object: its takes as files of their own, every second one held out."""
    import soundfile

    if thing.ready is not None:
        return thing.ready
    folder.mkdir(parents=True)
    for k, (path, start, stop) in enumerate(thing.takes):
        sound, sr = soundfile.read(path, always_2d=True)
        piece = sound[max(0, round(start * sr)) : round(stop * sr), 0]
        soundfile.write(folder / f"take{k}.wav", piece, sr, subtype="FLOAT")
    _command("case", "new", str(folder), *thing.options)
    case = _read(folder)
    for k, recording in enumerate(case["recordings"]):
        recording["split"] = "fit" if k % 2 == 0 else "holdout"
    (folder / "case.json").write_text(json.dumps(case, indent=1))
    return folder


def _command(*words: str) -> str:
    """Run a command; the last line that it says on stderr."""
    command = [sys.executable, "-m", "sonic_bullet", *words]
    done = subprocess.run(command, check=False, capture_output=True, text=True, preexec_fn=_limit_processor_time)
    last = (done.stderr.strip().splitlines() or ["no word"])[-1].removeprefix("sonic-bullet: ")
    return f"stopped after {LIMIT_S} s of processor" if "SIGXCPU" in last else last


def _limit_processor_time() -> None:
    """End a command that takes too long, on a busy machine no sooner than on an idle one."""
    import resource

    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S + 1))


def kept(thing: Object, work: Path) -> Path:
    """Where what the commands said of an object stays."""
    return work / "".join(c if c.isalnum() else "-" for c in thing.name) / "said.json"


def run(thing: Object, work: Path) -> Said:
    """What the commands say of an object: their JSON by name, or the line that they end with."""
    stays = kept(thing, work)
    folder = stays.parent
    if stays.is_file():
        return dict(json.loads(stays.read_text()))
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    case, said = made_case(thing, folder / "case"), {}
    for name in COMMANDS:
        to = folder / f"{name}.json"
        last = _command(name, str(case), "-o", str(folder / f"{name}-preset.json"), "--json", str(to))
        said[name] = json.loads(to.read_text()) if to.is_file() else {"error": last.replace(str(folder), "").strip()}
    stays.write_text(json.dumps(said))
    return said


def levels(wanted: Sequence[Object], work: Path) -> str:
    """How near levels by band and time come, of objects with takes held out, by `residual` alone: a table."""
    rows, ratios = [], []
    for thing in wanted:
        folder = kept(thing, work).parent / "levels"
        folder.mkdir(parents=True)
        case, to = made_case(thing, folder / "case"), folder / "residual.json"
        last = _command("residual", str(case), "-o", str(folder / "preset.json"), "--json", str(to))
        takes = _takes({"residual": json.loads(to.read_text())}, "residual") if to.is_file() else []
        if not takes:
            print(f"{thing.name}: {'none held out' if to.is_file() else last}", flush=True)
            continue
        names = ("predicted_db", "other_take_db", "levels_db", "other_take_levels_db")
        cells, other_cells, mine, other = (_mean(takes, name) for name in names)
        ratios.append((cells / other_cells, mine / other))
        rows.append([thing.name, str(len(takes)), *map(_shown, (cells, other_cells, mine, other))])
        print(" | ".join(rows[-1]), flush=True)
    head = ["object", "held out", "cells: residual", "another take", "levels: lines and noise", "another take"]
    middle = np.nanmedian(ratios, axis=0)
    said = (
        f"At the median of {len(rows)} objects: {middle[0]:.2f} times another take by cells, {middle[1]:.2f} by levels."
    )
    return f"{_table(head, rows)}\n\n{said}\n"


def _takes(said: Said, command: str, split: str = "holdout") -> list[dict[str, Any]]:
    return [t for t in said[command].get("takes", []) if t["split"] == split]


def _mean(takes: list[dict[str, Any]], name: str) -> float:
    values = [t[name] for t in takes if t.get(name) is not None and np.isfinite(t[name])]
    return float(np.mean(values)) if values else float("nan")


def _shown(value: float | None) -> str:
    return "-" if value is None or not np.isfinite(value) else f"{value:.1f}"


def _number(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _ends(said: Said) -> str:
    """The effects that are named, or the verdict, or that the command was refused."""
    judged = said["diagnose"]
    return ", ".join(f"`{e['id']}`" for e in judged.get("effects", [])) or judged.get("verdict") or "refused"


def row(thing: Object, said: Said) -> list[str]:
    """The cells of an object in the table of takes held out."""
    fitted, beside = _takes(said, "fit"), _takes(said, "residual")
    errors = said["diagnose"].get("errors") or {}
    before, after = (errors.get(when, {}).get("holdout") for when in ("before", "after"))
    values = (
        _mean(fitted, "silence_db"),
        _mean(fitted, "other_take_db"),
        _mean(fitted, "plausible_db"),
        _mean(fitted, "predicted_db"),
        _mean(beside, "predicted_db"),
        _mean(beside, "levels_db"),
        _mean(beside, "other_take_levels_db"),
        before,
        after if said["diagnose"].get("effects") else None,
    )
    return [thing.name, str(len(fitted)), *map(_shown, values), _ends(said)]


def own_row(thing: Object, said: Said) -> list[str]:
    """The cells of an object of which no take is held out: distances of the takes that it was fitted to."""
    fitted, beside = _takes(said, "fit", "fit"), _takes(said, "residual", "fit")
    values = (_mean(fitted, "silence_db"), _mean(fitted, "predicted_db"), _mean(beside, "predicted_db"))
    return [thing.name, *map(_shown, values), _ends(said)]


def words(thing: Object, said: Said) -> str:
    """What the commands say of an object and of what is left, and the line of each that was refused."""
    following = said["diagnose"].get("next_measurement") or said["fit"].get("next_measurement")
    left = (said["diagnose"].get("unexplained") or {}).get("words", "")
    lines = [
        *(f"{name} refused: {said[name]['error']}" for name in COMMANDS if "error" in said[name]),
        *(f"{name}: {said[name]['verdict']}" for name in COMMANDS if said[name].get("verdict")),
        *(
            f"effect: {e['id']}, {', '.join(f'{k} {_number(v)}' for k, v in e.get('parameters', {}).items())}"
            for e in said["diagnose"].get("effects", [])
        ),
        *([f"left: {left}"] if left else []),
        *([f"next: {following}"] if following else []),
        *(f"warned: {one.split('/')[-1]}" for one in said["diagnose"].get("warnings", [])),
    ]
    return "\n".join([thing.name, *(_wrapped(f"  {line}", "    ") for line in lines)])


def summary(found: Sequence[tuple[Object, Said]], not_run: Sequence[str]) -> str:
    """How many objects, how many refusals, and how near predictions of takes held out come."""
    refused = [f"{thing.name} (`{name}`)" for thing, said in found for name in COMMANDS if "error" in said[name]]
    lines = [
        f"{len(found)} objects; {len(refused)} commands were refused{': ' if refused else ''}{', '.join(refused)}."
    ]
    if not_run:
        lines.append(f"Not run: {', '.join(not_run)}.")
    for what, command in (("As fitted", "fit"), ("With the residual", "residual")):
        means = [
            [_mean(takes, name) for name in ("predicted_db", "other_take_db")]
            for _, said in found
            if (takes := _takes(said, command))
        ]
        ratios = [mine / other for mine, other in means if np.isfinite(mine / other)]
        if ratios:
            each = [t for _, said in found for t in _takes(said, command)]
            nearer = sum(t["predicted_db"] < t["silence_db"] for t in each)
            lines.append(
                f"{what}, a take held out is predicted at {np.median(ratios):.2f} times the distance to the nearest "
                f"other take at the median of {len(ratios)} objects, {max(ratios):.2f} times at worst. "
                f"It is nearer than silence in {nearer} of {len(each)} takes."
            )
    by_levels = [
        mine / other
        for _, said in found
        if (takes := _takes(said, "residual"))
        and np.isfinite((mine := _mean(takes, "levels_db")) / (other := _mean(takes, "other_take_levels_db")))
    ]
    if by_levels:
        lines.append(
            f"By levels, lines with the noise beside them are at {np.median(by_levels):.2f} times the distance to the "
            f"nearest other take at the median of {len(by_levels)} objects, {max(by_levels):.2f} times at worst."
        )
    louder = [
        before - _mean(takes, "predicted_db")
        for _, said in found
        if (takes := _takes(said, "fit"))
        and (before := (said["diagnose"].get("errors") or {}).get("before", {}).get("holdout")) is not None
    ]
    gains = [
        (errors["before"]["holdout"], errors["after"]["holdout"])
        for _, said in found
        if said["diagnose"].get("effects") and (errors := said["diagnose"]["errors"])["after"]["holdout"] is not None
    ]
    lines.append(
        f"`diagnose` names effects for {len(gains)} of {len(louder)} objects with takes held out; "
        f"the error on these falls for {sum(after < before for before, after in gains)}."
    )
    if louder:
        lines.append(
            f"What `diagnose` begins from is {np.round(np.median(louder), 1) + 0.0:.1f} dB farther from these takes "
            "than what `fit` predicts (median)."
        )
    return "\n\n".join(map(_wrapped, lines))


def _wrapped(text: str, indent: str = "") -> str:
    return textwrap.fill(text, 118, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def page(found: Sequence[tuple[Object, Said]], not_run: Sequence[str] = ()) -> str:
    """The page."""
    held = [one for one in found if _takes(one[1], "fit")]
    rest = [one for one in found if not _takes(one[1], "fit")]
    parts = [
        HEAD.format(most=MOST),
        summary(found, not_run),
        "## Takes that were held out",
        _table(COLUMNS, [row(*one) for one in held]),
        "## No take held out",
        "Of these the distance is that to the takes that they were fitted to: how well they are described, "
        "not how well\nothers are predicted.",
        _table(OWN_COLUMNS, [own_row(*one) for one in rest]),
        "## What is said of each",
        "```text\n" + "\n\n".join(words(*one) for one in found) + "\n```",
    ]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (columns, ["---"] * len(columns), *rows))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, default=PAGE)
    parser.add_argument("--work", type=Path, help="where cases and what was said of them stay")
    parser.add_argument("--kept", action="store_true", help="write the page of what stands in --work; name the rest")
    parser.add_argument("--levels", action="store_true", help="how near levels by band and time come, and no page")
    parser.add_argument("cases", nargs="*", metavar="CASE", help="objects whose name holds one of these alone")
    asked = parser.parse_args()
    wanted = [o for o in objects(asked.data) if not asked.cases or any(c in o.name for c in asked.cases)]
    with tempfile.TemporaryDirectory() as folder:
        work, found, not_run = asked.work or Path(folder), [], []
        if asked.levels:
            print(levels(wanted, work))
            return
        for thing in wanted:
            if asked.kept and not kept(thing, work).is_file():
                not_run.append(thing.name)
                continue
            said = run(thing, work)
            found.append((thing, said))
            print(" | ".join(row(thing, said)), flush=True)
    asked.out.write_text(page(found, not_run))
    print(f"{len(found)} objects, {len(not_run)} not run: {asked.out}")


if __name__ == "__main__":
    main()
