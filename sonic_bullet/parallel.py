"""Work on several things at once: a second process takes every next one from the same list.

    items -> [do(item), …] in their order, whoever did them

A fork, so that nothing has to be handed over but results; what the other process could not do or send is done here, and
raises here. Where processes do not fork (Windows; macOS, whose libraries forbid it) or there is one core, all is done
here. Work inside work stays where it is: here by _INSIDE, there because the helper is a daemon, which may have no
children. Linear algebra has one thread in each: its own, waiting for each other on small matrices, had made two
processes slower than one, and sums come in another order with every number of threads.
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

from sonic_bullet.machine.progress import PipeSay, clear_stage, waiting_for
from sonic_bullet.machine.worker import end_with

Item = TypeVar("Item")
Made = TypeVar("Made")

ROOM_BYTES = 1 << 20
"""Results that wait to be fetched: what Linux allows everybody."""
HELD, AHEAD = 2, 4
"""Arrays that the other process is asked for at once, and how far ahead of the one that is waited for this one works.
"""
_INSIDE: ContextVar[bool] = ContextVar("inside", default=False)  # a list that is being worked on
_OUT: ContextVar[Connection | None] = ContextVar("out", default=None)  # of the other process


@contextmanager
def one_thread() -> Iterator[None]:
    """Linear algebra on one thread while this lasts: as fast on matrices of hundreds, and the same bits on every
    machine's number of cores and with every setting of its threads. Whatever turns recordings into numbers begins so.
    """
    import scipy.linalg  # noqa: F401  its library has threads apart from numpy's, and must be there to be told
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, user_api="blas"):
        yield


def said_here(say: Callable[[str], None]) -> Callable[[str], None]:
    """``say`` for what runs in a `parallel_map`: what the other process says is said by this one, when it next listens.
    A caller's function is then called where the caller is.
    """
    if isinstance(say, PipeSay):  # its pipe is every process's
        return say

    def tell(text: str) -> None:
        out = _OUT.get()
        if out is None:
            say(text)
        else:
            with suppress(OSError):
                out.send_bytes(ForkingPickler.dumps((None, text)))

    return tell


def parallel_map(
    do: Callable[[Item], Made], items: Iterable[Item], say: Callable[[str], None] = lambda text: None
) -> list[Made]:
    """[do(item) for item in items], on two cores where there are two. ``do`` must not depend on what it did before.

    say: is told what the other process says (`said_here`) once this one has nothing left to begin. Raises whatever do
    raises.
    """
    listed = list(items)
    if _INSIDE.get():
        return [do(item) for item in listed]
    with one_thread():
        return _shared(do, listed, say) if len(listed) > 1 and _can_fork() else [do(item) for item in listed]


def arrays_in_order(make: Callable[[int], Any], count: int, shape: tuple[int, ...], dtype: Any) -> Iterator[Any]:
    """make(0) … make(count - 1), arrays of one shape, on two cores where there are two, each as soon as all before it
    are there; few are held at a time. ``make`` must not depend on what it did before. Raises whatever make raises.
    """
    import numpy as np

    if count < 2 or _INSIDE.get() or not _can_fork():
        yield from map(make, range(count))
        return
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    room = np.frombuffer(mmap.mmap(-1, HELD * size), dtype).reshape(HELD, *shape)  # both processes' own
    context: Any = get_context("fork")
    ours, theirs = context.Pipe()
    other = context.Process(target=_make_asked, args=(make, room, ours, theirs, os.getpid()), daemon=True)
    try:
        with _nobody_compiles():
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
                while alive and len(asked) < HELD and begun < count:
                    asked[begun] = next(place for place in range(HELD) if place not in asked.values())
                    alive = _sent(ours, (begun, asked[begun]))
                    begun += 1
                if alive and asked and ((number in asked and begun - number > AHEAD) or begun == count or ours.poll()):
                    answer = _received(ours)
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


def _sent(ours: Connection, what: Any) -> bool:
    """Whether the other process is there to get it."""
    try:
        ours.send(what)
    except OSError:
        return False
    return True


def _make_asked(make: Callable[[int], Any], room: Any, ours: Connection, theirs: Connection, parent: int) -> None:
    """The other process of `arrays_in_order`: makes what it is asked for; what it cannot make ends it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with(parent)
    ours.close()
    with suppress(Exception):
        while os.getppid() == parent:
            number, place = theirs.recv()
            room[place] = make(number)
            theirs.send((number, None))


def _shared(do: Callable[[Item], Made], listed: list[Item], say: Callable[[str], None]) -> list[Made]:
    try:
        other, ours, taken = _started(do, listed)
    except OSError:  # no memory or no process to be had
        return [do(item) for item in listed]
    made: dict[int, Made] = {}
    before = _INSIDE.set(True)
    try:
        while (i := _next(taken)) < len(listed):
            made[i] = do(listed[i])
        with waiting_for(other.pid):
            while (found := _received(ours)) is not None:
                number, what = found
                if number is None:
                    say(what)
                else:
                    made[number] = what
        return [made[i] if i in made else do(item) for i, item in enumerate(listed)]
    finally:
        _INSIDE.reset(before)
        other.kill()
        other.join()
        ours.close()


def _started(do: Callable[[Any], Any], items: list[Any]) -> tuple[Any, Connection, Any]:
    """The other process, where its results come out, and the count of what is taken. Raises OSError."""
    import fcntl

    context: Any = get_context("fork")
    taken = context.Value("i", 0)
    ours, theirs = context.Pipe(duplex=False)
    with suppress(OSError):  # else the other process stands still with its first large result while this one works
        fcntl.fcntl(theirs.fileno(), fcntl.F_SETPIPE_SZ, ROOM_BYTES)
    other = context.Process(target=_help, args=(do, items, taken, ours, theirs, os.getpid()), daemon=True)
    try:
        with _nobody_compiles():
            other.start()
    except OSError:
        ours.close()
        raise
    finally:
        theirs.close()
    return other, ours, taken


@contextmanager
def _nobody_compiles() -> Iterator[None]:
    """While this thread forks: numba's lock, held by a thread that the other process does not have, would never be
    free there.
    """
    if "numba" not in sys.modules:
        yield
        return
    from numba.core.compiler_lock import global_compiler_lock

    with global_compiler_lock:
        yield


def _can_fork() -> bool:
    # nor may a pool's worker have children
    return sys.platform == "linux" and len(os.sched_getaffinity(0)) > 1 and not current_process().daemon


def _next(taken: Any) -> int:
    with taken.get_lock():
        taken.value += 1
        return int(taken.value) - 1


def _received(ours: Connection) -> tuple[int | None, Any] | None:
    """What the other process has sent; None at its end, or where it cannot be read: what is missing is done here."""
    try:
        found: tuple[int | None, Any] | None = ours.recv()
    except Exception:  # the other process is gone, or has sent what no one can put together
        return None
    return found


def _help(
    do: Callable[[Any], Any], items: list[Any], taken: Any, ours: Connection, theirs: Connection, parent: int
) -> None:
    """The other process: results one by one, then None."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first one stops, and ends this one
    end_with(parent)
    ours.close()
    _OUT.set(theirs)
    with suppress(OSError):  # nobody listens any more
        while os.getppid() == parent and (i := _next(taken)) < len(items):
            try:
                message = ForkingPickler.dumps((i, do(items[i])))
            except Exception:  # done again where it can be told, or sent nowhere
                continue
            theirs.send_bytes(message)
        clear_stage()
        theirs.send(None)
