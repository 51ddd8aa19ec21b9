"""Does a revision keep every bit of another? Both run the same probes on this machine; no sum is kept in the project.

    python tools/gate.py BASE [HEAD] [--only PATTERN] [--list] [--jobs N] [--data DIR] [--keep DIR] [--bench [PART ...]]

Of each revision a whole tree is made in a temporary folder, with its engine built (once, where both have the same
sources), and each job of probes runs in it in a fresh process, with empty caches of its own. What probes give is
compared by SHA-256: "equal", "differs (max |Δ| …)", "missing in BASE", "failed in HEAD: why". Exit 0: all are equal; 1:
one is not; 2: bad input, or an engine that cannot be built, in one line; 130: stopped.

    scene/NAME/…     frames live at 48 and 44.1 kHz, blocks of 1, 7 and 64 steps, replay, without supports, with a
                     residual, vibrometers, models; by the command line: WAV, contact log, events, stems
    modes/MESH       modes of each mesh that the revision ships
    fit/CASE, diagnose/CASE   JSON and preset on the practice cases below --data
"""

from __future__ import annotations

import argparse
import resource
import shutil
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tools.gate_sides import (
    GateError,
    Job,
    Processes,
    Side,
    bench_rows,
    build_engines,
    find_commit,
    list_files,
    make_tree,
    results_name,
    run_git,
    run_job,
)
from tools.gate_values import compare_values, read_values
from tools.installed_tests import environment

ROOT = Path(__file__).resolve().parents[1]
SCRIPT = Path(__file__).resolve().with_name("gate_probe.py")
MESHES = {".obj", ".stl", ".ply", ".off", ".glb", ".gltf"}
SCENE_PROBES = (
    "live-48000", "live-44100", "blocks-1", "blocks-7", "blocks-64", "replay", "replay-44100", "no-supports",
    "residual", "vibrometer", "models", "wav", "contact-log", "events", "stems",
)  # fmt: skip


def list_jobs(files: frozenset[str], data: Path) -> tuple[list[Job], int]:
    """List the jobs of both revisions' files, and count the probes that are skipped for want of data."""
    paths = sorted(map(PurePosixPath, files))
    scenes = [path for path in paths if path.parent.as_posix() == "scenes" and path.suffix == ".py"]
    jobs = [
        Job(f"scene/{path.stem}", tuple(f"scene/{path.stem}/{one}" for one in SCENE_PROBES), str(path))
        for path in scenes
    ]
    jobs += [Job(f"modes/{path}", (f"modes/{path}",), str(path)) for path in paths if path.suffix.lower() in MESHES]
    cases = sorted(path.parent.name for path in (data / "practice").glob("*/case.json"))
    for kind in ("fit", "diagnose"):
        jobs += [Job(f"{kind}/{case}", (f"{kind}/{case}",)) for case in cases]
    return jobs, 0 if cases else 2


def choose_jobs(jobs: Sequence[Job], pattern: str) -> list[Job]:
    """Keep the probes whose names match. Raises GateError where none does."""
    chosen = [
        Job(job.name, tuple(probe for probe in job.probes if fnmatchcase(probe, pattern)), job.source) for job in jobs
    ]
    if not (found := [job for job in chosen if job.probes]):
        raise GateError(f"no probe matches '{pattern}': --list names them")
    return found


def judge(probe: str, sides: Sequence[Side], why: Sequence[dict[str, str]]) -> str:
    """Say what became of a probe on both sides."""
    reasons = [(side.label, one.get(probe, "stopped")) for side, one in zip(sides, why, strict=True)]
    if all(reason == "missing" for _, reason in reasons):
        return "missing in both"
    said = [f"{reason.partition(':')[0]} in {label}{reason[len(reason.partition(':')[0]):]}"
            for label, reason in reasons if reason]  # fmt: skip
    if said:
        return "; ".join(said)
    base, head = (read_values(side.result(probe)) for side in sides)
    return compare_values(base, head)


def run_jobs(
    sides: Sequence[Side], jobs: Sequence[Job], data: Path, script: Path, count: int, processes: Processes
) -> tuple[list[dict[str, str]], bool]:
    """Run all jobs on both sides, so many at once; why probes have no result, by side, and whether it was stopped.

    The engines are built first. Raises GateError where one cannot be.
    """
    why: list[dict[str, str]] = [{} for _ in sides]
    lock = threading.Lock()
    total = sum(len(job.probes) for job in jobs) * len(sides)
    done = 0

    def say(line: str) -> None:
        nonlocal done
        with lock:
            done += 1
            print(f"[{done}/{total}] {line}", file=sys.stderr, flush=True)

    def one(number: int, job: Job) -> None:
        why[number].update(run_job(sides[number], job, data, script, processes, say))

    stopped = False
    with ThreadPoolExecutor(count) as threads:
        tasks: list[Future[None]] = []
        try:
            threads.submit(build_engines, sides, processes).result()
            tasks += [threads.submit(one, number, job) for job in jobs for number in range(len(sides))]
            for task in tasks:
                task.result()
        except BaseException as problem:
            for task in tasks:
                task.cancel()
            processes.end()
            if not isinstance(problem, KeyboardInterrupt):
                raise
            stopped = True
    return why, stopped


def report_bench(sides: Sequence[Side], parts: Sequence[str], processes: Processes) -> None:
    """Print the rows of `make bench` as ratios; they decide nothing."""
    base, head = (bench_rows(side, parts, processes) for side in sides)
    for what in [*base, *(one for one in head if one not in base)]:
        if what in base and what in head and base[what]:
            print(f"bench: {what}: HEAD/BASE {head[what] / base[what]:.3f} ({head[what]:g}/{base[what]:g})")
        else:
            print(f"bench: {what}: {'no ratio' if what in base and what in head else 'on one side alone'}")
    if not base and not head:
        print("bench: no rows")


def compare_revisions(asked: argparse.Namespace, root: Path, script: Path) -> int:
    """Make both trees, run the probes in them and print what is equal. Raises GateError."""
    commits = [find_commit(root, revision) for revision in (asked.base, asked.head)]
    files = [list_files(root, commit) for commit in commits]
    data = (root / asked.data).resolve()
    jobs, skipped = list_jobs(files[0] | files[1], data)
    jobs = choose_jobs(jobs, asked.only)
    if asked.list:
        print("\n".join(probe for job in jobs for probe in job.probes))
        return 0
    if asked.head == "HEAD" and run_git(root, "status", "--porcelain", error="git gives no status"):
        print("what is not committed is not compared", file=sys.stderr)
    processes = Processes()
    with tempfile.TemporaryDirectory(prefix="gate-", ignore_cleanup_errors=True) as made:
        home = Path(made).resolve()
        shutil.copy(script, home / "probe.py")
        text = script.read_text(encoding="utf-8")
        python = environment(home)  # else an editable install of this checkout comes before the trees
        sides: list[Side] = []
        for label, commit, known in zip(("BASE", "HEAD"), commits, files, strict=True):
            name = results_name(commit, text, data) + ("-again" if sides and commits[0] == commit else "")
            results = Path(asked.keep).resolve() / name if asked.keep else home / label / "results"
            sides.append(Side(label, commit, known, home / label, results, python))
        try:
            for side in sides:
                make_tree(root, side)
            why, stopped = run_jobs(sides, jobs, data, home / "probe.py", asked.jobs, processes)
            verdicts = {probe: judge(probe, sides, why) for job in jobs for probe in job.probes}
            for probe, verdict in verdicts.items():
                print(f"{probe}: {verdict}")
            if asked.bench is not None and not stopped:
                report_bench(sides, asked.bench, processes)
        except KeyboardInterrupt:
            stopped, verdicts = True, {}
        finally:
            processes.end()
    equal = sum(verdict == "equal" for verdict in verdicts.values())
    lacking = f", fit and diagnose skipped: no practice cases in {asked.data}" if skipped else ""
    print(f"{equal} of {len(verdicts)} probes equal{lacking}{', stopped' if stopped else ''}")
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"processor time {(used.ru_utime + used.ru_stime) / 60:.1f} min", file=sys.stderr)
    return 130 if stopped else int(equal != len(verdicts))


def positive(text: str) -> int:
    """Read a whole number above 0."""
    if (number := int(text)) < 1:
        raise ValueError(text)
    return number


class OneLine(argparse.ArgumentParser):
    """A parser whose complaints are one line."""

    def error(self, message: str) -> None:  # type: ignore[override]
        raise GateError(message)


def main(arguments: Sequence[str] | None = None, root: Path = ROOT, script: Path = SCRIPT) -> int:
    """Compare two revisions, as the command line asks.

    Parameters
    ----------
    arguments
        Of the command; None: the process's own.
    root
        The repository.
    script
        What runs the probes of a job in a tree.

    Returns
    -------
    The exit code.
    """
    assert __doc__ is not None
    show: Callable[[str], argparse.RawDescriptionHelpFormatter] = argparse.RawDescriptionHelpFormatter
    parser = OneLine(prog="gate.py", description=__doc__, formatter_class=show)  # type: ignore[arg-type]
    parser.add_argument("base", metavar="BASE")
    parser.add_argument("head", metavar="HEAD", nargs="?", default="HEAD")
    parser.add_argument("--only", metavar="PATTERN", default="*", help="probes whose names match, as scene/bar/*")
    parser.add_argument("--list", action="store_true", help="name the probes and run none")
    parser.add_argument("--jobs", metavar="N", type=positive, default=2, help="processes at once [2]")
    parser.add_argument("--data", metavar="DIR", default="../shared", help="folder with practice/ [../shared]")
    parser.add_argument("--keep", metavar="DIR", help="keep results of a commit here, and take up those that are")
    parser.add_argument("--bench", metavar="PART", nargs="*", help="also the rows of make bench, as ratios")
    try:
        return compare_revisions(parser.parse_args(arguments), root, script)
    except GateError as problem:
        print(f"gate: {problem}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # trees and processes go as on Ctrl-C
    raise SystemExit(main())
