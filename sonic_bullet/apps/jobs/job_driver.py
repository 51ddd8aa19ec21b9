"""The driver of many jobs: what has no result yet -> processes or a cluster -> kept, or listed with its reason.

The caller names files and lists; this module names who works, and makes the lists whatever ends the run.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from typing import Any, TypeVar

from sonic_bullet.apps.jobs.cluster_jobs import open_cluster, run_on_cluster
from sonic_bullet.apps.jobs.job_processes import Failure, run_jobs
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.records.errors import SonicBulletError

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
    keep: Callable[[Item, Made], str | None],
    write_lists: Callable[[Mapping[Item, str]], None],
    prepare: Callable[[], None] = lambda: None,
) -> tuple[int, dict[Item, str]]:
    """Do the jobs that are missing; return how many are done, and why others are not.

    Parameters
    ----------
    do
        Depends on its item alone; on a cluster it can be pickled.
    keep
        Called with an item and its result in this process, as they are done; returns why the result is no good, or
        None.
    write_lists
        Called with the reasons at the end, also where an error or an interrupt ends the run.
    prepare
        Called before the first job, where one is missing.

    Raises
    ------
    SonicBulletError
        Of ``prepare``, ``keep`` and ``write_lists``, and where the scheduler went away.
    """
    made, failures = 0, dict[Item, str]()
    try:
        if missing:
            prepare()
            report_progress(f"0 of {len(missing)}")
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
            report_progress(f"{made} of {len(missing)}{f', {len(failures)} failed' if failures else ''}")
    except BaseException:
        with suppress(SonicBulletError):
            write_lists(failures)
        raise
    write_lists(failures)
    return made, failures


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
