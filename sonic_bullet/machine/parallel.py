"""Process a list of items in two processes, each of which takes the next item.

    items -> [do(item), …] in their order, whichever process did them

The second process is a fork, so that only results are transferred. Items that it could not process or send are
processed here, where their errors are raised. Where processes do not fork (Windows; macOS, whose libraries forbid it)
or there is one core, all items are processed here. Nested calls do not fork: in this process by _inside, in the other
because it is a daemon, which may have no children. Linear algebra has one thread in each process: its own threads,
waiting for each other on small matrices, made two processes slower than one, and the order of sums depends on the
number of threads.
"""

from __future__ import annotations

import mmap
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from multiprocessing import current_process, get_context
from multiprocessing.connection import Connection
from multiprocessing.reduction import ForkingPickler
from typing import Any, TypeVar

from sonic_bullet.machine.progress import clear_stage, in_every_process, progress_to, report_progress, waiting_for
from sonic_bullet.machine.worker import end_with

Item = TypeVar("Item")
Made = TypeVar("Made")

_inside: ContextVar[bool] = ContextVar("inside", default=False)  # a list that is being worked on


@contextmanager
def one_thread(*, with_scipy: bool = True) -> Iterator[None]:
    """Run linear algebra on one thread within the block.

    That is as fast on matrices of hundreds, and gives the same bits for every number of cores and every setting of
    threads. All that converts recordings to numbers runs in such a block.

    with_scipy: scipy's as well, which takes 0.3 s to load; False where a block within limits it once there is work.
    """
    if with_scipy:
        import scipy.linalg  # noqa: F401  its library has threads of its own, and must be loaded to be limited
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, user_api="blas"):
        yield


def parallel_map(do: Callable[[Item], Made], items: Iterable[Item]) -> list[Made]:
    """Return [do(item) for item in items], on two cores where there are two; raises whatever ``do`` raises.

    ``do`` must not depend on earlier calls. Progress of the other process is reported in this one, once this one has no
    further item to begin; what shows it by a pipe hears it at once.
    """
    listed = list(items)
    if _inside.get():
        return [do(item) for item in listed]
    with one_thread():
        return _share_work(do, listed) if len(listed) > 1 and _can_fork() else [do(item) for item in listed]


def arrays_in_order(make: Callable[[int], Any], count: int, shape: tuple[int, ...], dtype: Any) -> Iterator[Any]:
    """Yield make(0) … make(count - 1), arrays of one shape, on two cores where there are two.

    Each is yielded as soon as all before it are; few are stored at a time. ``make`` must not depend on earlier calls.
    Raises whatever it raises.
    """
    # Arrays requested of the other process at once, and how far this process works ahead of the one it waits for
    held, ahead = 2, 4
    import numpy as np

    if count < 2 or _inside.get() or not _can_fork():
        yield from map(make, range(count))
        return
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    room = np.frombuffer(mmap.mmap(-1, held * size), dtype).reshape(held, *shape)  # both processes' own
    context: Any = get_context("fork")
    ours, theirs = context.Pipe()
    other = context.Process(target=_make_asked, args=(make, room, ours, theirs, os.getpid()), daemon=True)
    try:
        other.start()
    except OSError:  # no memory or no process to be had
        ours.close()
    theirs.close()
    if ours.closed:
        yield from map(make, range(count))
        return
    asked: dict[int, int] = {}  # number -> its place in the room
    made: dict[int, Any] = {}
    begun, alive = 0, True
    try:
        for number in range(count):
            while number not in made:
                while alive and len(asked) < held and begun < count:
                    asked[begun] = next(place for place in range(held) if place not in asked.values())
                    alive = _send(ours, (begun, asked[begun]))
                    begun += 1
                if alive and asked and ((number in asked and begun - number > ahead) or begun == count or ours.poll()):
                    answer = _receive(ours)
                    alive = answer is not None and answer[0] is not None
                    if answer is not None and answer[0] is not None:
                        made[answer[0]] = room[asked.pop(answer[0])].copy()
                elif number in asked and not alive:
                    made[number] = make(number)
                else:
                    made[begun], begun = make(begun), begun + 1
            yield made.pop(number)
    finally:
        other.kill()
        other.join()
        ours.close()


def _send(ours: Connection, what: Any) -> bool:
    """Send to the other process; return whether it is there."""
    try:
        ours.send(what)
    except OSError:
        return False
    return True


def _make_asked(make: Callable[[int], Any], room: Any, ours: Connection, theirs: Connection, parent: int) -> None:
    """Run the other process of `arrays_in_order`: make the arrays requested; an error ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with(parent)
    ours.close()
    with suppress(Exception):
        while os.getppid() == parent:
            number, place = theirs.recv()
            room[place] = make(number)
            theirs.send((number, None))


def _share_work(do: Callable[[Item], Made], listed: list[Item]) -> list[Made]:
    try:
        other, ours, taken = _start_process(do, listed)
    except OSError:  # no memory or no process to be had
        return [do(item) for item in listed]
    made: dict[int, Made] = {}
    before = _inside.set(True)
    try:
        while (i := _next(taken)) < len(listed):
            made[i] = do(listed[i])
        with waiting_for(other.pid):
            while (found := _receive(ours)) is not None:
                number, what = found
                if number is None:
                    report_progress(what)
                else:
                    made[number] = what
        return [made[i] if i in made else do(item) for i, item in enumerate(listed)]
    finally:
        _inside.reset(before)
        other.kill()
        other.join()
        ours.close()


def _start_process(do: Callable[[Any], Any], items: list[Any]) -> tuple[Any, Connection, Any]:
    """Start the other process; return it, the pipe of its results, and the count of items taken; raises OSError."""
    room_bytes = 1 << 20  # Size of the pipe for results: what Linux allows every user
    import fcntl

    context: Any = get_context("fork")
    taken = context.Value("i", 0)
    ours, theirs = context.Pipe(duplex=False)
    with suppress(OSError):  # else the other process blocks on its first large result while this one works
        fcntl.fcntl(theirs.fileno(), fcntl.F_SETPIPE_SZ, room_bytes)
    other = context.Process(target=_help, args=(do, items, taken, ours, theirs, os.getpid()), daemon=True)
    try:
        other.start()
    except OSError:
        ours.close()
        raise
    finally:
        theirs.close()
    return other, ours, taken


def _can_fork() -> bool:
    # nor may a pool's worker have children
    return sys.platform == "linux" and len(os.sched_getaffinity(0)) > 1 and not current_process().daemon


def _next(taken: Any) -> int:
    with taken.get_lock():
        taken.value += 1
        return int(taken.value) - 1


def _receive(ours: Connection) -> tuple[int | None, Any] | None:
    """Receive from the other process; None at its end, or where the message cannot be read."""
    try:
        found: tuple[int | None, Any] | None = ours.recv()
    except Exception:  # the other process is gone, or its message cannot be unpickled
        return None
    return found


def _help(
    do: Callable[[Any], Any], items: list[Any], taken: Any, ours: Connection, theirs: Connection, parent: int
) -> None:
    """Run the other process: send results one by one, then None."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process handles it, and ends this one
    end_with(parent)
    ours.close()

    def report(text: str) -> None:
        theirs.send_bytes(ForkingPickler.dumps((None, text)))

    with suppress(OSError), progress_to(None if in_every_process() else report):  # the pipe is closed
        while os.getppid() == parent and (i := _next(taken)) < len(items):
            try:
                message = ForkingPickler.dumps((i, do(items[i])))
            except Exception:  # the first process does it again and raises the error
                continue
            theirs.send_bytes(message)
        clear_stage()
        theirs.send(None)
