"""Messages of a command's process to its supervisor (`supervisor`); without one, nothing.

A message is one line of a pipe, written at once, so that lines of several processes do not mix:

    scene PATH     whose code is run from here on          left PATH    to be removed where this process is killed
    exit  STACK    os._exit is called                      closing      what was made so far is being written
    kept  TEXT     what there is where it is stopped now
    done  CODE     the command has come to its end         stage …      what is being done (`progress`)

The time of the last physics step stands in shared memory.
"""

from __future__ import annotations

import os
import shlex
import signal
import struct
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from sonic_bullet.machine.leftovers import report_leftovers
from sonic_bullet.machine.progress import open_sink

LONGEST = 4000  # bytes of a message: pipes take so much at once (PIPE_BUF)
ASK_WHERE, END_IDLE = getattr(signal, "SIGUSR1", None), getattr(signal, "SIGUSR2", None)
STOPS = {signal.SIGINT: "stopped", signal.SIGTERM: "terminated"}
Handler = Callable[[int, FrameType | None], Any]


@dataclass(slots=True)
class WorkerState:
    """Connection to the supervisor. fd: of the pipe; clock: 8 bytes, when the scene stepped last, 0: no scene runs."""

    fd: int = -1
    clock: Any = None
    process: int = 0
    scene: str = ""
    stopped: str = ""
    kept: str = ""


_line = WorkerState()


def connect(fd: int, traces: int, clock: Any, at_idle: Handler) -> None:
    """Make this process a supervised one.

    A crash writes its Python lines to ``traces``, `os._exit` reports where it is called, the first interrupt is a
    KeyboardInterrupt and all others are ignored. at_idle: called where a scene has not stepped for too long.
    """
    import faulthandler

    _line.fd, _line.clock, _line.process = fd, clock, os.getpid()
    catch_stops()
    open_sink(fd)
    report_leftovers(lambda path: tell("left", path))
    faulthandler.enable(traces, all_threads=False)
    # between two bytecodes: faulthandler, at any moment, ends a Python 3.12 or 3.13 now and then
    signal.signal(ASK_WHERE, lambda _, frame: _say_where(traces, frame))  # type: ignore[arg-type]
    signal.signal(END_IDLE, at_idle)  # type: ignore[arg-type]
    leave = os._exit

    def tell_and_leave(status: int) -> None:
        if os.getpid() == _line.process:
            frame: FrameType | None = sys._getframe(1)
            tell("exit", " ".join(_lines_of(frame))[: LONGEST - 10])
        leave(status)

    os._exit = tell_and_leave  # type: ignore[assignment]


def catch_stops() -> None:
    """Make the first interrupt a KeyboardInterrupt, and ignore all others."""
    for word in STOPS:
        if signal.getsignal(word) is not signal.SIG_IGN:  # ignored, as in a shell's background jobs
            signal.signal(word, _stop)


def _forget_stops() -> None:
    """Let signals end a fork of this process at once: a pool ends its workers so."""
    for word, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
        if signal.getsignal(word) is _stop:
            signal.signal(word, handler)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_stops)


def _lines_of(frame: FrameType | None) -> Iterator[str]:
    while frame is not None:
        yield f'File "{escape_path(frame.f_code.co_filename)}", line {frame.f_lineno}'
        frame = frame.f_back


def _say_where(traces: int, frame: FrameType | None) -> None:
    with suppress(OSError):
        os.write(traces, "".join(f"{line}\n" for line in _lines_of(frame)).encode())


def escape_path(path: str) -> str:
    """Escape a path as faulthandler does."""
    return path.encode("ascii", "backslashreplace").decode()[:500]


def _stop(number: int, _: FrameType | None) -> None:
    """Handle the first interrupt: cleaning up is not interrupted again."""
    for word in STOPS:
        signal.signal(word, signal.SIG_IGN)
    _line.stopped = STOPS[signal.Signals(number)]
    raise KeyboardInterrupt(_line.stopped)


def stop_word() -> str:
    """Return how this process was told to end; "": it was not."""
    return _line.stopped


def tell(kind: str, text: str = "") -> None:
    """Send a message to the supervisor, if there is one."""
    if _line.fd >= 0:
        with suppress(OSError):
            os.write(_line.fd, f"{kind} {' '.join(text.splitlines())}\n".encode("utf-8", "surrogateescape")[:LONGEST])


def note_kept(text: str) -> None:
    """Note what a command that is stopped from here on has made and goes on from, for its last words."""
    again = shlex.join(["sonic-bullet", *sys.argv[1:]])
    long = 300  # characters of a command that is not repeated: of many files
    _line.kept = f"{text}; the same command goes on{f': {again}' if len(again) < long else ''}"
    tell("kept", _line.kept)


def kept_words() -> str:
    """Return what was noted to be kept; "": nothing was."""
    return _line.kept


def note_closing() -> None:
    """Report that what was made before an interrupt is being written, so that the supervisor waits."""
    tell("closing")


@contextmanager
def running_scene(path: Path) -> Iterator[None]:
    """Report that a scene's code runs within the context."""
    before, _line.scene = _line.scene, str(path)
    tell("scene", str(path))
    mark_step()
    try:
        yield
    finally:
        _line.scene = before
        if not before and _line.clock is not None:
            struct.pack_into("d", _line.clock, 0, 0.0)
        tell("scene", before)


def mark_step() -> None:
    """Record a physics step."""
    if _line.clock is not None and _line.scene:
        struct.pack_into("d", _line.clock, 0, time.monotonic())


def scene_line(frame: FrameType | None) -> tuple[str, int]:
    """Return the name of the scene that runs and the line of it that a frame comes from, 0: none."""
    while frame is not None and frame.f_code.co_filename != _line.scene:
        frame = frame.f_back
    return Path(_line.scene).name, 0 if frame is None else frame.f_lineno


def end_with(parent: int) -> None:
    """Let this process, a fork, end with its parent (Linux), or now where that has ended."""
    death_signal = 1  # prctl(2)
    process_control(death_signal, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def process_control(option: int, value: int) -> bool:
    """Call prctl on Linux; return whether it succeeded."""
    if sys.platform != "linux":
        return False
    import ctypes

    return bool(ctypes.CDLL(None).prctl(option, value, 0, 0, 0) == 0)
