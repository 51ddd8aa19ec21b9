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
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

MOST = 6
LEAD_S, LONGEST_S = 0.05, 2.5
PAGE = Path("docs/measured/recordings-by-others.md")
COMMANDS = ("fit", "residual", "diagnose")
COLUMNS = (
    "object",
    "held out",
    "silence",
    "another take",
    "fitted",
    "with effects",
    "with residual",
    "effects, or the verdict",
)
HEAD = """# Recordings by others

Written by `python -m benchmarks.measured --data ../shared/measured`. Each row is what `case new`, `fit`, `residual`
and `diagnose` say of recordings that somebody else made. Every second take is held out. Distances are in dB, over what
stands 10 dB above the noise, in the case's band; one gain is fitted where no impulse is known. Silence and the nearest
of the fitted takes stand beside them. An object of one take has none that is unheard.
"""
Piece = tuple[Path, float, float]


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


def _command(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "sonic_bullet", *words], check=False, capture_output=True, text=True)


def run(thing: Object, work: Path) -> dict[str, Any]:
    """What the commands say of an object: their JSON by name, or the line that they end with."""
    folder = work / "".join(c if c.isalnum() else "-" for c in thing.name)
    kept = folder / "said.json"
    if kept.is_file():
        return dict(json.loads(kept.read_text()))
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    case, said = made_case(thing, folder / "case"), {}
    for name in COMMANDS:
        to = folder / f"{name}.json"
        done = _command(name, str(case), "-o", str(folder / f"{name}-preset.json"), "--json", str(to))
        said[name] = (
            json.loads(to.read_text())
            if to.is_file()
            else {"error": (done.stderr.strip().splitlines() or ["no word"])[-1].removeprefix("sonic-bullet: ")}
        )
    kept.write_text(json.dumps(said))
    return said


def _mean(takes: list[dict[str, Any]], name: str) -> float:
    values = [t[name] for t in takes if t[name] is not None and np.isfinite(t[name])]
    return float(np.mean(values)) if values else float("nan")


def row(thing: Object, said: dict[str, Any]) -> list[str]:
    """The cells of an object in the page's table."""
    takes = [t for t in said["fit"].get("takes", []) if t["split"] == "holdout"]
    beside = [t for t in said["residual"].get("takes", []) if t["split"] == "holdout"]
    judged = said["diagnose"]
    after = (judged.get("errors") or {}).get("after", {}).get("holdout")
    effects = ", ".join(f"`{e['id']}`" for e in judged.get("effects", []))
    values = (
        _mean(takes, "silence_db"),
        _mean(takes, "other_take_db"),
        _mean(takes, "predicted_db"),
        after if effects and after is not None else float("nan"),
        _mean(beside, "predicted_db"),
    )
    shown = ["-" if not np.isfinite(v) else f"{v:.1f}" for v in values]
    return [thing.name, str(len(takes)) if takes else "none", *shown, effects or judged.get("verdict", "-")]


def words(thing: Object, said: dict[str, Any]) -> str:
    """What is left of an object, in the commands' own words."""
    fit, judged = said["fit"], said["diagnose"]
    left = (judged.get("unexplained") or {}).get("words", "")
    lines = [
        f"fit: {fit.get('verdict') or fit.get('error')}",
        f"diagnose: {judged.get('verdict') or judged.get('error')}",
    ]
    return f"- **{thing.name}**. " + "; ".join([*lines, *([f"left: {left}"] if left else [])]) + "."


def page(found: list[tuple[Object, dict[str, Any]]]) -> str:
    """The page."""
    ratios = [
        _mean(takes, "predicted_db") / _mean(takes, "other_take_db")
        for _, said in found
        if (takes := [t for t in said["residual"].get("takes", []) if t["split"] == "holdout"])
        and np.isfinite(_mean(takes, "other_take_db"))
    ]
    table = [
        f"| {' | '.join(COLUMNS)} |",
        "|---" * len(COLUMNS) + "|",
        *(f"| {' | '.join(row(*one))} |" for one in found),
    ]
    ratio = (
        f"With the residual an unheard take is predicted at {np.median(ratios):.2f} times the distance to the nearest\n"
        f"other take at the median of {len(ratios)} objects, {max(ratios):.2f} times at worst.\n"
        if ratios
        else ""
    )
    said = "\n".join(words(*one) for one in found)
    return f"{HEAD}\n{chr(10).join(table)}\n\n{ratio}\n## What is said of each\n\n{said}\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, default=PAGE)
    parser.add_argument("--work", type=Path, help="where cases and what was said of them stay")
    parser.add_argument("cases", nargs="*", metavar="CASE", help="objects whose name holds one of these alone")
    asked = parser.parse_args()
    wanted = [o for o in objects(asked.data) if not asked.cases or any(c in o.name for c in asked.cases)]
    with tempfile.TemporaryDirectory() as folder:
        found = []
        for thing in wanted:
            said = run(thing, asked.work or Path(folder))
            found.append((thing, said))
            print(" | ".join(row(thing, said)), flush=True)
    asked.out.write_text(page(found))
    failed = sum("error" in said["fit"] for _, said in found)
    print(f"{len(found)} objects, {failed} refused: {asked.out}")


if __name__ == "__main__":
    main()
