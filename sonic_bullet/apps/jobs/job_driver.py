"""The driver of many jobs: what has no result yet -> processes or a cluster -> kept, or listed with its reason.

The caller names files and lists; this module names who works, has the lists follow job by job, so that they are true
whatever ends the run, and says what is kept where it is stopped.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from typing import Any, TypeVar

from sonic_bullet.apps.jobs.cluster_jobs import open_cluster, run_on_cluster
from sonic_bullet.apps.jobs.job_processes import Failure, run_jobs
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.machine.worker import note_kept

Item = TypeVar("Item")
Made = TypeVar("Made")


@dataclass(frozen=True, slots=True)
class JobWorkers:
    """Who works.

    Parameters
    ----------
    processes
        At once, on this machine, where there is no cluster.
    limit_s
        Wall time of a job, after which its process is ended.
    cluster
        Client of a Dask cluster, or None.
    """

    processes: int
    limit_s: float
    cluster: Any = None


@contextmanager
def open_workers(processes: int | None, limit_s: float, scheduler: str | None) -> Iterator[JobWorkers]:
    """Open workers: those of the scheduler at an address, or processes of this machine, one a core where none are said.

    Raises
    ------
    FileError
        Dask is not installed, or no scheduler answers there.
    """
    with open_cluster(scheduler) if scheduler else nullcontext() as cluster:
        yield JobWorkers(processes or cores(), limit_s, cluster)


def finish_jobs(
    do: Callable[[Item], Made | Failure],
    missing: Sequence[Item],
    workers: JobWorkers,
    *,
    count: int,
    nouns: str,
    place: str,
    keep: Callable[[Item, Made], str | None],
    write_lists: Callable[[Mapping[Item, str]], None],
    update_lists: Callable[[Item, Mapping[Item, str]], None],
    prepare: Callable[[], None] = lambda: None,
    describe: Callable[[], str] = lambda: "",
) -> tuple[int, dict[Item, str]]:
    """Do the jobs that are missing; return how many are done, and why others are not.

    Parameters
    ----------
    do
        Depends on its item alone; on a cluster it can be pickled.
    count, nouns, place
        Of all jobs, done before or now; what their results are called, and where they are kept, for who reads.
    keep
        Called with an item and its result in this process, as they are done; returns why the result is no good, or
        None.
    write_lists
        Called before anything is done, and at the end with the reasons.
    update_lists
        Called after each job, with its item and the reasons so far.
    prepare
        Called before the first job, where one is missing.
    describe
        Called for what a line of progress adds.

    Raises
    ------
    SonicBulletError
        Of ``prepare``, ``keep`` and the lists, and where the scheduler went away.
    """
    made, failures = 0, dict[Item, str]()

    def tell() -> None:
        done = f"{count - len(missing) + made} of {count}"
        note_kept(f"{done} {nouns} kept in {place}")
        report_progress(f"{done}{f', {len(failures)} failed' if failures else ''}{describe()}")

    write_lists(failures)
    tell()
    if missing:
        prepare()
        tell()
    if workers.cluster is None:
        jobs = run_jobs(do, missing, workers.processes, workers.limit_s)
    else:
        jobs = run_on_cluster(workers.cluster, do, missing, workers.limit_s)
    for item, found in jobs:
        reason = found.reason if isinstance(found, Failure) else keep(item, found)
        if reason is None:
            made += 1
        else:
            failures[item] = reason
        update_lists(item, failures)
        tell()
    write_lists(failures)
    return made, failures


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
