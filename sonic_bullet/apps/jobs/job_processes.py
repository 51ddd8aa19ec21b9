"""A process a job: a job that crashes, hangs or eats its memory ends alone, and leaves nothing to the next.

items -> up to N processes, each a fork with all that is loaded (elsewhere than on Linux: a new one)
    -> pipe -> result, or the reason -> three tries -> (item, result or reason), as they end
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any, TypeVar

from sonic_bullet.machine.progress import clear_stage
from sonic_bullet.machine.worker import end_with
from sonic_bullet.records.errors import SonicBulletError, exception_words

Item = TypeVar("Item")
Made = TypeVar("Made")
ATTEMPTS = 3


@dataclass(frozen=True, slots=True)
class Failure:
    """Why there is no result: a line."""

    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class _RunningJob:
    item: Any
    nth: int
    process: Any
    until_s: float


def run_jobs(
    do: Callable[[Item], Made], items: Iterable[Item], workers: int, limit_s: float, *, tries: int = ATTEMPTS
) -> Iterator[tuple[Item, Made | Failure]]:
    """Yield (item, do(item)) as they are done, or `Failure` after ``tries`` of at most limit_s seconds each.

    ``do`` depends on its item alone.
    """
    context: Any = get_context("fork" if sys.platform == "linux" else "spawn")
    todo, again = ((item, 1) for item in items), deque[tuple[Item, int]]()
    running: dict[Connection, _RunningJob] = {}
    try:
        while True:
            while len(running) < workers:
                following = again.popleft() if again else next(todo, None)
                if following is None:
                    break
                item, nth = following
                ours, theirs = context.Pipe(duplex=False)
                process = context.Process(target=_work, args=(do, item, theirs, os.getpid()), daemon=True)
                process.start()
                theirs.close()
                running[ours] = _RunningJob(item, nth, process, time.monotonic() + limit_s)
            if not running:
                return
            pause_s = max(0.0, min(job.until_s for job in running.values()) - time.monotonic())
            ended = set(wait(list(running), pause_s))
            late = {pipe for pipe, job in running.items() if job.until_s < time.monotonic()}
            for pipe in ended | late:
                assert isinstance(pipe, Connection)
                job = running.pop(pipe)
                found = _receive_result(pipe, job) if pipe in ended else Failure(f"it took more than {limit_s:g} s")
                job.process.kill()
                job.process.join()
                clear_stage(job.process.pid)
                pipe.close()
                if isinstance(found, Failure) and job.nth < tries:
                    again.append((job.item, job.nth + 1))
                else:
                    yield job.item, found
    finally:
        for job in running.values():
            job.process.kill()
            job.process.join()


def _receive_result(pipe: Connection, job: _RunningJob) -> Any:
    try:
        return pipe.recv()
    except (EOFError, OSError):
        job.process.join()
        code = job.process.exitcode
        how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        return Failure(f"its process ended by {how}" + ("; the memory may not suffice" if code == -9 else ""))


def _work(do: Callable[[Item], Any], item: Item, out: Connection, parent: int) -> None:
    """Run one job in its process and send what it gives."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    end_with(parent)
    found = attempt(do, item)
    with suppress(OSError):
        out.send(found)


def attempt(do: Callable[[Item], Made], item: Item) -> Made | Failure:
    """Return do(item), or the reason why it fails."""
    try:
        return do(item)
    except SonicBulletError as error:
        return Failure(str(error))
    except Exception as error:
        return Failure(exception_words(error))
