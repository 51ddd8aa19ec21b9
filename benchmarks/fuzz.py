"""Every reader against mutated files whose checksums are right: only the project's own errors, in bounded memory, time
and text.

    python benchmarks/fuzz.py [--inputs 300000] [--seed 0] [--workers 2] [--keep DIR] [--doors log,flac,…]
    python benchmarks/fuzz.py --again flac:1234 [--seed 0]        one input, with its traceback

(seed, format, number) -> a file (fuzzing/) -> its reader and one step on, in a process of its own
    -> read, or refused by a SonicBulletError of at most 1 kB; anything else is a fault and its file is kept in DIR as
        FORMAT-NUMBER.SUFFIX
A fault: another exception or a crash; more than 2 GB; more than 30 s of processor time, or two minutes of waiting; a
text over 1 kB.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.fuzzing.doors import Door, doors
from sonic_bullet.machine.parallel import one_thread
from sonic_bullet.records.errors import SonicBulletError

MEMORY_BYTES = 2 << 30
SECONDS = 30
TEXT_BYTES = 1000
CHUNK, QUICK_CHUNK = 400, 40  # inputs to a process; few where time is short, so that every format has its turn
KEPT_ALIKE = 2  # files kept of faults of one kind at one place


class Overlong(BaseException):
    """An input took longer than `SECONDS` of processor time."""


@dataclass
class Tally:
    """What became of a door's inputs.

    slowest_s: of one input; longest: text in bytes; faults: (kind, number, where and what).
    """

    inputs: int = 0
    read: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    longest: int = 0
    seconds: float = 0.0
    faults: list[tuple[str, int, str]] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        for name in ("inputs", "read", "refused", "seconds"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.slowest_s, self.longest = max(self.slowest_s, other.slowest_s), max(self.longest, other.longest)
        self.faults += other.faults


def mutated(door: Door, seed: int, number: int) -> bytes:
    """The input of that number: the same on every machine."""
    return door.change(random.Random(f"{seed}/{door.name}/{number}"))


def _overlong(*_: object) -> None:
    raise Overlong


def enter(door: Door, path: Path) -> tuple[str, str]:
    """("read" | "refused" | a fault's kind, text)."""
    try:
        door.enter(path)
    except SonicBulletError as error:
        text = str(error)
        return ("refused" if len(text.encode("utf-8", "replace")) <= TEXT_BYTES else "text"), text
    except Overlong:
        return "time", f"more than {SECONDS} s"
    except MemoryError as error:
        return "memory", _place(error)
    except Exception as error:
        return "foreign", _place(error)
    return "read", ""


def _place(error: BaseException) -> str:
    frames = list(traceback.extract_tb(error.__traceback__))
    own = [f for f in frames if "sonic_bullet" in f.filename and "site-packages" not in f.filename] or frames
    return f"{type(error).__name__} at {Path(own[-1].filename).name}:{own[-1].lineno}: {str(error)[:150]}"


def _work(door: Door, seed: int, numbers: range, folder: Path, at: Any, answer: Any) -> None:
    """One process: the inputs of a chunk, one after another, until one has taken too much memory."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGPROF, _overlong)
    own = Path(tempfile.mkdtemp(dir=folder))
    for number in numbers:
        at.value = number
        path = own / f"{door.name.replace(' ', '-')}-{number}{door.suffix}"
        path.write_bytes(mutated(door, seed, number))
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        start = time.process_time()
        kind, text = enter(door, path)
        signal.setitimer(signal.ITIMER_PROF, 0)
        took = time.process_time() - start
        path.unlink(missing_ok=True)
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 > MEMORY_BYTES
        kind = "memory" if grown else kind
        tally = Tally(
            1,
            kind == "read",
            kind == "refused",
            took,
            len(text.encode("utf-8", "replace")) if kind in ("refused", "text") else 0,
            took,
        )
        if kind not in ("read", "refused"):
            tally.faults.append((kind, number, text))
        answer.send(tally)  # one by one: should the next end this process, nothing is lost
        if grown:
            break
    answer.close()


def run(
    inputs: int,
    seed: int,
    folder: Path,
    *,
    chosen: tuple[Door, ...] | None = None,
    workers: int = 1,
    keep: Path | None = None,
    seconds: float = float("inf"),
) -> dict[str, Tally]:
    """Tallies by door.

    inputs: in all, shared out by the doors' shares. chosen: None for all doors. seconds: after which no further chunk
    is begun.
    """
    chosen = doors() if chosen is None else chosen
    whole = sum(door.share for door in chosen)
    tasks, chunk = [], CHUNK if seconds == float("inf") else QUICK_CHUNK
    for door in chosen:
        count = max(1, round(inputs * door.share / whole))
        tasks += [(i / count, door, range(i, min(i + chunk, count))) for i in range(0, count, chunk)]
    tasks.sort(key=lambda task: task[0])
    queue = [(door, numbers) for _, door, numbers in tasks]
    tallies = {door.name: Tally() for door in chosen}
    running: list[tuple[Any, Any, Any, Door, range, list[float]]] = []
    context, end = get_context("fork"), time.monotonic() + seconds
    while queue or running:
        while queue and len(running) < workers and time.monotonic() < end:
            door, numbers = queue.pop(0)
            at, (receive, send) = context.RawValue("q", numbers.start), context.Pipe(False)
            process = context.Process(target=_work, args=(door, seed, numbers, folder, at, send))
            process.start()
            send.close()
            running.append((process, receive, at, door, numbers, [-1.0, 0.0, 0.0]))
        if not running:
            break
        for entry in list(running):
            process, receive, at, door, numbers, _ = entry
            told, ended = _told(receive)
            stuck = _stuck(entry)
            if ended or stuck:
                running.remove(entry)
                if stuck:
                    process.kill()
                process.join()
                if stuck or process.exitcode:
                    where = f"hung over {4 * SECONDS} s" if stuck else f"the process ended with {process.exitcode}"
                    told.append(Tally(1, faults=[("time" if stuck else "foreign", at.value, where)]))
                if at.value + 1 < numbers.stop:
                    queue.insert(0, (door, range(at.value + 1, numbers.stop)))
            for tally in told:
                tallies[door.name].add(tally)
                _keep(keep, door, seed, tally, tallies[door.name])
    return tallies


def _told(receive: Any) -> tuple[list[Tally], bool]:
    """What a process has answered since, and whether it is over."""
    told: list[Tally] = []
    try:
        while receive.poll(0.0 if told else 0.02):
            told.append(receive.recv())
    except EOFError:
        return told, True
    return told, False


def _stuck(entry: tuple[Any, Any, Any, Door, range, list[float]]) -> bool:
    """Whether a process has been at one input for far longer than its own alarm lets it: it sits in foreign code, or
    waits.

    Counted in looks of a second at most: a machine that is put to sleep does not hang.
    """
    at, since = entry[2].value, entry[5]
    now = time.monotonic()
    number, waited, last = since
    since[:] = [at, waited + min(now - last, 1.0) if number == at else 0.0, now]
    return since[1] > 4 * SECONDS


def _keep(keep: Path | None, door: Door, seed: int, tally: Tally, known: Tally) -> None:
    """Files of faults, a few of each kind and place."""
    if keep is None:
        return
    alike = Counter((kind, text.split(":", 2)[0:2].__repr__()) for kind, _, text in known.faults)
    for kind, number, text in tally.faults:
        key = (kind, text.split(":", 2)[0:2].__repr__())
        if alike[key] <= KEPT_ALIKE or number % 50 == 0:
            print(f"{door.name}:{number} {kind}: {text[:200]}", file=sys.stderr, flush=True)
            keep.mkdir(parents=True, exist_ok=True)
            (keep / f"{door.name.replace(' ', '-')}-{number}{door.suffix}").write_bytes(mutated(door, seed, number))


def table(tallies: dict[str, Tally]) -> str:
    """One line a format, faults by kind, and the sum."""
    head = (
        "format",
        "inputs",
        "read",
        "refused",
        "foreign",
        "memory",
        "time",
        "text",
        "slowest s",
        "longest text",
        "ms each",
    )
    rows: list[tuple[str, ...]] = [head]
    total = Tally()
    for tally in tallies.values():
        total.add(tally)
    for name, t in [*tallies.items(), ("all", total)]:
        kinds = Counter(kind for kind, *_ in t.faults)
        numbers = (t.inputs, t.read, t.refused, *(kinds[k] for k in ("foreign", "memory", "time", "text")))
        rows.append(
            (
                name,
                *map(str, numbers),
                f"{t.slowest_s:.2f}",
                str(t.longest),
                f"{1000 * t.seconds / max(t.inputs, 1):.1f}",
            )
        )
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if i else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    )


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--inputs", type=int, default=300_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--keep", type=Path, help="folder for the files of faults")
    parser.add_argument("--doors", default="", help="names of formats, with commas between; all by default")
    parser.add_argument("--again", metavar="FORMAT:NUMBER", help="one input, with its traceback")
    asked = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SONIC_BULLET_CACHE"] = str(Path(folder) / "cache")
        if asked.again:
            name, number = asked.again.rsplit(":", 1)
            door = next(door for door in doors() if door.name == name)
            path = Path(folder) / f"again{door.suffix}"
            path.write_bytes(mutated(door, asked.seed, int(number)))
            door.enter(path)
            return 0
        names = asked.doors.split(",") if asked.doors else [door.name for door in doors()]
        chosen = tuple(door for door in doors() if door.name in names)
        with one_thread():
            warm(Path(folder))
            tallies = run(asked.inputs, asked.seed, Path(folder), chosen=chosen, workers=asked.workers, keep=asked.keep)
    print(table(tallies))
    faults = [(name, *fault) for name, tally in tallies.items() for fault in tally.faults]
    places = Counter((name, kind, text.split(": ")[0]) for name, kind, _, text in faults)
    for (name, kind, where), count in places.most_common():
        first = next(f for f in faults if (f[0], f[1], f[3].split(": ")[0]) == (name, kind, where))
        print(f"{count:6d} {name} {kind}: {first[3][:200]} (first: --again '{name}:{first[2]}' --seed {asked.seed})")
    return int(bool(faults))


def warm(folder: Path) -> None:
    """Each door once with an unchanged draw, so that what is compiled or imported once is not counted against
    an input.
    """
    for door in doors():
        for number in range(3):
            path = folder / f"warm{door.suffix}"
            path.write_bytes(mutated(door, -1, number))
            enter(door, path)
            path.unlink(missing_ok=True)


if __name__ == "__main__":
    sys.exit(main())
