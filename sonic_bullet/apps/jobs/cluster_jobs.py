"""Jobs on a Dask cluster: as many at once as it has workers, each of one thread; results come back as they are done.

    items -> tasks of the scheduler -> a worker -> result, or the reason -> three tries -> (item, result or reason)

A worker that dies takes its job's try with it: the scheduler gives the job to another one, and gives it up when it has
killed more workers than its setting allowed-failures says. A job that takes too long ends its worker so.
"""

from __future__ import annotations

import logging
import os
import queue
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

from sonic_bullet.apps.jobs.job_processes import ATTEMPTS, Failure, attempt
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.records.errors import FileError, exception_words
from sonic_bullet.session.run_recorder import package_versions

Item = TypeVar("Item")
Made = TypeVar("Made")
ANSWER_S = 10.0
"""Of a scheduler, when it is called and while it works."""


@contextmanager
def open_cluster(address: str) -> Iterator[Any]:
    """Open a client of the scheduler at an address.

    Raises
    ------
    FileError
        Dask is not installed, or no scheduler answers there.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise FileError(f"a scheduler needs Dask: {error}", "pip install 'sonic_bullet[dask]'") from None
    with _without_log():
        try:
            client = Client(address, timeout=ANSWER_S, set_as_default=False)
        except (OSError, ValueError) as error:
            what = f"no scheduler answers at {address}: {' '.join(str(error).split())[:200]}"
            raise FileError(what, "start one with `dask scheduler`, and give the address that it prints") from None
        try:
            yield client
        finally:
            with suppress(Exception):
                client.close(timeout=2)


@contextmanager
def _without_log() -> Iterator[None]:
    """Keep back what Dask and its event loop log: it is told here, in a line."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)


def run_on_cluster(
    client: Any, do: Callable[[Item], Made], items: Iterable[Item], limit_s: float
) -> Iterator[tuple[Item, Made | Failure]]:
    """Yield (item, do(item)) as they are done, or `Failure` after three tries; a try ends after limit_s seconds.

    Parameters
    ----------
    client : distributed.Client
        Of the cluster. Its workers import this package from an installation of the same versions.
    do : callable
        Depends on its item alone; both can be pickled.

    Raises
    ------
    FileError
        The scheduler went away, or its workers have more than one thread each.
    """
    look_s = 0.5  # between two looks at the scheduler and its workers
    versions = package_versions()
    todo, again = ((item, 1) for item in items), deque[tuple[Item, int]]()
    done: queue.SimpleQueue[Any] = queue.SimpleQueue()
    running: dict[str, tuple[Item, int, Any]] = {}
    try:
        workers, looked_s, answered_s = 0, 0.0, time.monotonic()
        while True:
            now_s = time.monotonic()
            if now_s - looked_s >= look_s:
                looked_s = now_s
                if (found := _count_workers(client)) is not None:
                    workers, answered_s = found, now_s
                elif now_s - answered_s > ANSWER_S:
                    raise _gone(client)
                if not workers:
                    report_progress("no worker yet")
            while len(running) < workers:
                following = again.popleft() if again else next(todo, None)
                if following is None:
                    break
                item, nth = following
                key = f"sonic-bullet-{os.urandom(16).hex()}"
                task = client.submit(_work, do, item, limit_s, versions, key=key, pure=False)
                running[key] = (item, nth, task)
                task.add_done_callback(done.put)
            if not running and workers:
                return
            try:
                task = done.get(timeout=look_s)
            except queue.Empty:
                continue
            item, nth, _ = running.pop(task.key)
            made = _receive_result(client, task)
            if isinstance(made, Failure) and task.status == "finished" and nth < ATTEMPTS:
                again.append((item, nth + 1))
            else:
                yield item, made
    finally:
        with suppress(Exception):
            client.cancel([task for _, _, task in running.values()])


def _gone(client: Any) -> FileError:
    return FileError(
        f"the scheduler at {client.scheduler.address if client.scheduler else 'that address'} went away",
        "start it again; the same command goes on with what is missing",
    )


def _count_workers(client: Any) -> int | None:
    """Count the workers; None: the scheduler does not answer. FileError where one has several threads.

    Sound is made by one thread, and the settings of libraries and the deadline are those of a process.
    """
    if client.status != "running":
        return None
    try:
        found = client.nthreads()
    except (OSError, TimeoutError):
        return None
    if several := [address for address, threads in found.items() if threads > 1]:
        raise FileError(f"the worker at {several[0]} has several threads", "start workers with --nthreads 1")
    return len(found)


def _receive_result(client: Any, task: Any) -> Any:
    """Return what a task gives: a result, or `Failure`. A result whose worker has died since is computed again."""
    from distributed import KilledWorker

    while True:
        if task.status not in {"finished", "error"} and client.status != "running":
            raise _gone(client)
        try:
            return task.result(timeout=ANSWER_S)
        except TimeoutError:
            continue
        except (CancelledError, OSError):
            raise _gone(client) from None
        except KilledWorker as error:
            said = f"{error.allowed_failures + 1} workers ended while they made it"
            return Failure(f"{said}; the memory may not suffice, or it takes too long")
        except Exception as error:  # a worker that cannot load the package
            return Failure(f"a worker could not run it: {exception_words(error)}")


def _work(do: Callable[[Item], Made], item: Item, limit_s: float, versions: dict[str, str]) -> Made | Failure:
    """Run one job in a worker, which ends where it takes too long."""
    mine = package_versions()
    if mine != versions:
        other = ", ".join(f"{name} {mine[name]} for {versions[name]}" for name in mine if mine[name] != versions[name])
        return Failure(f"a worker has other versions: {other}")
    with _deadline(limit_s):
        return attempt(do, item)


@contextmanager
def _deadline(limit_s: float) -> Iterator[None]:
    """End this process after so many seconds, also where a call of C holds the interpreter."""
    if hasattr(signal, "setitimer"):
        # SIGALRM, which nothing handles, ends a process; set in any thread
        signal.setitimer(signal.ITIMER_REAL, limit_s)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
        return
    timer = threading.Timer(limit_s, os._exit, [1])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
