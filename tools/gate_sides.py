"""A side of a comparison: a revision's whole tree in a folder, and the processes that run its probes.

revision -> git archive -> TREE, with the engine built of it      TREE + job -> fresh Python, own caches -> npz a probe
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tarfile
import threading
import tomllib
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

OWN = ("SONIC_BULLET_", "NUMBA_", "PYTHON")
"""Beginnings of variables that are not handed on: what decides is set for both sides."""
SAME = {
    **dict.fromkeys(
        ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
    ),
    "PYTHONHASHSEED": "0",
    "PYTHONNOUSERSITE": "1",
    "MPLBACKEND": "Agg",
    "SONIC_BULLET_PROGRESS": "0",
    "LC_ALL": "C.UTF-8",
    "TZ": "UTC",
}
ENGINE = ("CMakeLists.txt", "tools/build_backend.py")
"""What the engine is built of, beside src/ and what pyproject.toml says of how."""
PATIENCE_S = 5.0  # between asking a process to end and ending it


class GateError(Exception):
    """What is wrong with the input, in one line."""


@dataclass(frozen=True, slots=True)
class Job:
    """Probes that one process runs.

    Parameters
    ----------
    name
        Such as "scene/bar".
    probes
        Their names.
    source
        The file of the tree without which the job cannot be; "": none.
    """

    name: str
    probes: tuple[str, ...]
    source: str = ""


@dataclass(frozen=True, slots=True)
class Side:
    """A revision in its tree.

    Parameters
    ----------
    label
        "BASE" or "HEAD".
    commit
        Of the revision.
    files
        What the revision holds, paths from its top.
    home
        A folder of this side alone: tree, caches, work.
    results
        Where the values of probes lie.
    python
        The interpreter of its processes, which has no package of the project installed.
    """

    label: str
    commit: str
    files: frozenset[str]
    home: Path
    results: Path
    python: Path

    @property
    def tree(self) -> Path:
        return self.home / "tree"

    def result(self, probe: str) -> Path:
        """Give the file of a probe's values."""
        return self.results / f"{probe.replace('/', '+')}.npz"

    def environment(self, work: Path) -> dict[str, str]:
        """Give the variables of a process: machine code is this side's own, all else this job's."""
        cache, code = work / "cache", self.home / "code"
        for folder in (cache, code, work / "tmp"):
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        kept = {name: value for name, value in os.environ.items() if not name.startswith(OWN)}
        places = {
            "PYTHONPATH": self.tree,
            "NUMBA_CACHE_DIR": code,
            "SONIC_BULLET_CACHE": cache / "modal",
            "XDG_CACHE_HOME": cache,
            "MPLCONFIGDIR": cache,
            "TMPDIR": work / "tmp",
        }
        return kept | SAME | {name: str(place) for name, place in places.items()}


@dataclass(slots=True)
class Processes:
    """Processes under way, so that all can be ended."""

    running: set[subprocess.Popen[str]] = field(default_factory=set)
    ended: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)

    def run(
        self, command: Sequence[str], environment: dict[str, str], folder: Path, line: Callable[[str], None]
    ) -> tuple[int, str]:
        """Run a command in a process group of its own; ``line`` is given each line. Returns its end and last words."""
        said_path = folder / "stderr"
        with said_path.open("w", encoding="utf-8") as said:
            with self.lock:
                if self.ended:
                    return -signal.SIGTERM, "stopped"
                process = subprocess.Popen(
                    command, env=environment, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=said,
                    text=True, encoding="utf-8", errors="replace", start_new_session=True,
                )  # fmt: skip
                self.running.add(process)
            try:
                assert process.stdout is not None
                for one in process.stdout:
                    line(one)
                process.wait()
            finally:
                with self.lock:
                    self.running.discard(process)
        words = said_path.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return process.returncode, words[-1][:200] if words else ""

    def end(self) -> None:
        """End what runs, and let nothing else begin."""
        with self.lock:
            self.ended = True
            running = list(self.running)
        for sign in (signal.SIGTERM, signal.SIGKILL):
            for process in running:
                with suppress(ProcessLookupError, PermissionError):
                    os.killpg(process.pid, sign)
            for process in running:
                with suppress(subprocess.TimeoutExpired):
                    process.wait(PATIENCE_S)


def run_git(root: Path, *words: str, error: str) -> bytes:
    """Run git in a repository. Raises GateError."""
    try:
        done = subprocess.run(["git", "-C", str(root), *words], check=False, capture_output=True)
    except OSError:
        raise GateError("git cannot be run: install it") from None
    if done.returncode:
        raise GateError(error)
    return done.stdout


def find_commit(root: Path, revision: str) -> str:
    """Give the commit of a revision. Raises GateError."""
    error = f"there is no revision '{revision}' in {root.name}: see 'git log'"
    words = ("rev-parse", "--verify", "--quiet", "--end-of-options", f"{revision}^{{commit}}")
    return run_git(root, *words, error=error).decode().strip()


def list_files(root: Path, commit: str) -> frozenset[str]:
    """List what a commit holds."""
    listed = run_git(root, "ls-tree", "-r", "-z", "--name-only", commit, error="git lists no files")
    return frozenset(listed.decode(errors="surrogateescape").split("\0")) - {""}


def make_tree(root: Path, side: Side) -> None:
    """Write the whole tree of a side's commit into its folder."""
    content = run_git(root, "archive", "--format=tar", side.commit, error="git gives no tree of that revision")
    side.tree.mkdir(parents=True)
    side.results.mkdir(parents=True, exist_ok=True)
    with tarfile.open(fileobj=io.BytesIO(content)) as archive:
        archive.extractall(side.tree, filter="data")


def engine_sources(side: Side) -> str:
    """Name what a side's engine is built of, by its content; "": the revision has none that is built."""
    if "CMakeLists.txt" not in side.files:
        return ""
    found = hashlib.sha256()
    for name in sorted(name for name in side.files if name in ENGINE or name.startswith("src/")):
        content = (side.tree / name).read_bytes()
        found.update(f"{name}\0{len(content)}\0".encode() + content)
    settings = tomllib.loads((side.tree / "pyproject.toml").read_text(encoding="utf-8"))
    how = [settings.get("build-system"), settings.get("tool", {}).get("scikit-build")]
    found.update(json.dumps(how, sort_keys=True).encode())
    return found.hexdigest()


def build_engines(sides: Sequence[Side], processes: Processes) -> None:
    """Build the engine of each side into its tree, once where all that it is built of is the same. Raises GateError."""
    built: dict[str, list[Path]] = {}
    for side in sides:
        if not (sources := engine_sources(side)):
            continue
        if sources not in built:
            print(f"{side.label}: building the engine (a minute or two)", file=sys.stderr, flush=True)
            built[sources] = install_tree(side, processes)
        for path in built[sources]:
            shutil.copy(path, side.tree / "sonic_bullet" / path.name)


def install_tree(side: Side, processes: Processes) -> list[Path]:
    """Install a side's tree into a folder of its own; the files of its engine there. Raises GateError."""
    work, site = side.home / "work" / "build", side.home / "site"
    (work / "tmp").mkdir(parents=True, exist_ok=True)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    environment["TMPDIR"] = str(work / "tmp")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--no-input", "install", "--quiet", "--no-deps"]
    code, words = processes.run([*pip, "--target", str(site), str(side.tree)], environment, work, lambda _: None)
    made = [path for path in (site / "sonic_bullet").glob("_engine.*") if path.name.endswith(tuple(EXTENSION_SUFFIXES))]
    if not made and not processes.ended:
        raise GateError(f"the engine of {side.label} was not built: pip ended with {code}: {words or 'no word'}")
    return made


def results_name(commit: str, script: str, data: Path) -> str:
    """Name the folder of results that only this commit, this probe script, this Python and this data give."""
    given = "\0".join((script, sys.version, sys.prefix, str(data)))
    return f"{commit[:16]}-{hashlib.sha256(given.encode()).hexdigest()[:16]}"


def run_job(
    side: Side, job: Job, data: Path, script: Path, processes: Processes, say: Callable[[str], None]
) -> dict[str, str]:
    """Run the probes of a job that have no result yet; why they have none, by name ("": there is one)."""
    if job.source and job.source not in side.files:
        return dict.fromkeys(job.probes, "missing")
    wanted = [probe for probe in job.probes if not side.result(probe).exists()]
    why = dict.fromkeys(job.probes, "")
    for probe in set(job.probes) - set(wanted):
        say(f"{side.label} {probe}: kept")
    if not wanted:
        return why
    why |= dict.fromkeys(wanted, "stopped")
    work = side.home / "work" / job.name.replace("/", "+")
    environment = side.environment(work)
    asked = {"tree": str(side.tree), "job": job.name, "data": str(data)}
    asked_path = work / "job.json"
    asked_path.write_text(json.dumps(asked | {"probes": {probe: str(side.result(probe)) for probe in wanted}}))

    def note(line: str) -> None:
        with suppress(ValueError, TypeError, KeyError):
            found = json.loads(line)
            why[found["probe"]] = f"failed: {found['error']}" if found["error"] else ""
            say(f"{side.label} {found['probe']}: {found['error'] or 'done'} ({found['used_s']:.1f} s of processor)")

    code, words = processes.run([str(side.python), str(script), str(asked_path)], environment, work, note)
    for probe in wanted:
        if why[probe] == "stopped" and not processes.ended:
            why[probe] = f"failed: the process ended with {code}: {words}"
            say(f"{side.label} {probe}: {why[probe]}")
    return why


def bench_rows(side: Side, parts: Iterable[str], processes: Processes) -> dict[str, float]:
    """Run the table of `make bench` in a side's tree; the first number of each row, by what it is of."""
    work = side.home / "work" / "bench"
    environment, rows = side.environment(work), {}
    only = ["--only", *parts] if parts else []

    def note(line: str) -> None:
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        with suppress(ValueError, IndexError):
            if len(cells) == 3:
                rows[cells[0]] = float(cells[2].split()[0])

    command = [str(side.python), str(side.tree / "benchmarks" / "run_time.py"), *only]
    processes.run(command, environment, work, note)
    return rows
