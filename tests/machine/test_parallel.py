"""Two processes do what one would have done: the same results in the same order, the same errors, and nothing left
behind.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from multiprocessing import active_children, get_context, popen_fork
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import sonic_bullet.machine.parallel as module
from sonic_bullet.machine.parallel import arrays_in_order, one_thread, parallel_map
from sonic_bullet.machine.progress import progress_to, report_progress
from sonic_bullet.records.errors import AudioError

TWO = module._can_fork()


def test_results_come_in_order_whoever_made_them() -> None:
    both = get_context("fork").Barrier(2) if TWO else None  # else the first to run may take all of such light work
    met = False

    def square(x: int) -> tuple[int, int]:
        nonlocal met
        if both is not None and not met:
            both.wait(60)
            met = True
        return x * x, os.getpid()

    found = parallel_map(square, range(12))
    assert [x for x, _ in found] == [x * x for x in range(12)]
    assert len({who for _, who in found}) == (2 if TWO else 1)
    assert not active_children()


def test_errors_are_raised_here_as_they_are() -> None:
    def fails(x: int) -> int:
        if x == 3:
            raise AudioError("a recording is silent", "leave it out of the case")
        return x

    with pytest.raises(AudioError, match="silent"):
        parallel_map(fails, range(6))
    assert not active_children()


def test_what_cannot_be_sent_is_made_here() -> None:
    found = parallel_map(lambda x: lambda: x, range(6))
    assert [made() for made in found] == list(range(6))


def test_a_process_that_dies_takes_nothing_with_it() -> None:
    here = os.getpid()

    def dies(x: int) -> int:
        if os.getpid() != here:
            os._exit(9)
        time.sleep(0.02)
        return x + 1

    assert parallel_map(dies, range(5)) == [1, 2, 3, 4, 5]
    assert not active_children()


def test_work_inside_work_stays_where_it_is() -> None:
    def outer(x: int) -> tuple[int, set[int]]:
        inner = parallel_map(lambda y: (time.sleep(0.005), os.getpid())[1], range(4))
        return os.getpid(), set(inner)

    assert all(inside == {who} for who, inside in parallel_map(outer, range(4)))


def in_a_pool() -> list[int]:
    return parallel_map(lambda x: x + 1, range(4))


def test_a_pools_worker_may_use_it() -> None:
    """Which may have no children of its own."""
    with get_context().Pool(1) as pool:
        assert pool.apply(in_a_pool) == [1, 2, 3, 4]


def test_one_core_does_it_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_can_fork", lambda: False)
    assert set(parallel_map(lambda _: os.getpid(), range(4))) == {os.getpid()}


def test_an_interrupt_here_ends_the_other() -> None:
    here = os.getpid()

    def waits(x: int) -> int:
        if os.getpid() == here:
            raise KeyboardInterrupt
        time.sleep(30)
        return x

    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        parallel_map(waits, range(4))
    assert time.monotonic() - start < 20 and not active_children()  # of the 30 s that the other sleeps


@pytest.mark.skipif(not TWO, reason="one core")
def test_none_is_left_behind_by_one_that_is_killed() -> None:
    """A script that dies without a word, its helper at work on more than a pipe holds."""
    script = (
        "import os, signal, time\n"
        "from multiprocessing import get_context\n"
        "from sonic_bullet.machine.parallel import parallel_map\n"
        "me, begun = os.getpid(), get_context('fork').Event()\n"
        "def do(x):\n"
        "    if os.getpid() == me:\n"
        "        begun.wait(30); time.sleep(0.5); os.kill(me, signal.SIGKILL)\n"
        "    print(os.getpid(), flush=True); begun.set(); time.sleep(0.02)\n"
        "    return bytes(300_000)\n"
        "parallel_map(do, range(400))\n"
    )
    out = subprocess.run([sys.executable, "-c", script], check=False, capture_output=True, text=True, timeout=60).stdout
    helpers = {int(line) for line in out.split()}
    assert helpers
    until = time.monotonic() + 20
    while any(alive(who) for who in helpers) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(alive(who) for who in helpers)


def alive(who: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{who}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_one_thing_alone_is_done_on_one_thread_too(monkeypatch: pytest.MonkeyPatch) -> None:
    import scipy.linalg  # noqa: F401

    def threads(_: int) -> set[int]:
        return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}

    with threadpool_limits(2, user_api="blas"):
        assert parallel_map(threads, [0]) == [{1}]
        monkeypatch.setattr(module, "_can_fork", lambda: False)
        assert parallel_map(threads, range(2)) == [{1}, {1}]


def test_linear_algebra_has_one_thread_in_each_process() -> None:
    """Numpy's library and scipy's, here and there; and as many as before once it is done."""
    import scipy.linalg  # noqa: F401

    def threads(_: int = 0) -> set[int]:
        time.sleep(0.02)  # long enough for the other to take some
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    with threadpool_limits(3, user_api="blas"):
        inside = parallel_map(threads, range(8)) if TWO else []
        with one_thread():
            assert threads() == {1}
        assert threads() == {3}
    assert all(found == {1} for found in inside)


def test_what_the_other_process_says_is_said_here() -> None:
    """A caller's function is called in the caller's process, whoever does the work."""
    heard: list[str] = []

    def work(number: int) -> int:
        report_progress(f"{number} by {os.getpid()}")
        time.sleep(0.05)
        return number

    with progress_to(heard.append):
        assert parallel_map(work, range(6)) == list(range(6))
    assert sorted(line.split()[0] for line in heard) == [str(number) for number in range(6)]
    if module._can_fork():
        assert len({line.split()[2] for line in heard}) == 2


def test_arrays_come_in_order_whoever_makes_them() -> None:
    def make(number: int) -> np.ndarray:
        time.sleep(0.002)
        return np.array([number, os.getpid()])

    made = list(arrays_in_order(make, 60, (2,), np.int64))
    assert [int(one[0]) for one in made] == list(range(60))
    if module._can_fork():
        assert len({int(one[1]) for one in made}) == 2
    assert [int(one[0]) for one in arrays_in_order(make, 1, (2,), np.int64)] == [0]
    assert list(arrays_in_order(make, 0, (2,), np.int64)) == []


def test_arrays_that_the_other_process_cannot_make_are_made_here_and_raise_here() -> None:
    here = os.getpid()

    def make(number: int) -> np.ndarray:
        time.sleep(0.002)
        if os.getpid() != here and number > 10:
            raise ValueError
        return np.array([number])

    assert [int(one[0]) for one in arrays_in_order(make, 40, (1,), np.int64)] == list(range(40))

    def fail(number: int) -> np.ndarray:
        if number == 20:
            raise ValueError("twenty")
        return np.array([number])

    made = []
    with pytest.raises(ValueError, match="twenty"):
        for one in arrays_in_order(fail, 40, (1,), np.int64):
            made.append(int(one[0]))
    assert made == list(range(len(made))) and len(made) <= 20


def test_who_stops_reading_leaves_no_process() -> None:
    reading = arrays_in_order(lambda number: np.array([number]), 1000, (1,), np.int64)
    assert int(next(reading)[0]) == 0
    reading.close()
    assert active_children() == []


def test_arrays_are_made_here_where_no_process_is_to_be_had(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise BlockingIOError("no process")

    monkeypatch.setattr(module, "_can_fork", lambda: True)
    monkeypatch.setattr(popen_fork.Popen, "_launch", refused)  # which makes two pipes of its own, and leaves them
    held = len(os.listdir("/proc/self/fd"))
    made = [int(one[0]) for one in arrays_in_order(lambda number: np.array([number]), 9, (1,), np.int64)]
    assert made == list(range(9))
    assert len(os.listdir("/proc/self/fd")) == held
