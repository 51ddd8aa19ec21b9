"""Supervisor of a command: a process that waits for it and outlives it.

    supervisor ── fork ─► worker: runs the command, its scene, PyBullet, Netgen, compilers
        ◄── lines: scene, left, closing, done (`worker`), stage (`progress`) ; Python lines of a crash (faulthandler)
        ──► SIGINT, SIGTERM passed on; SIGKILL to what does not end

A scene may end its process without a message, crash in C, or never step; a long call of C receives no signal. The
worker reports its end. If it ends before, or has to be killed, the supervisor names the line, removes what was left and
ends what the worker had started. Where processes do not fork, the command runs here.
"""

from __future__ import annotations

import atexit
import mmap
import os
import re
import select
import shutil
import signal
import struct
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

from sonic_bullet.machine import progress, worker
from sonic_bullet.machine.worker import (
    ASK_WHERE,
    END_IDLE,
    STOPS,
    catch_stops,
    connect,
    end_with,
    escape_path,
    process_control,
    scene_line,
    tell,
)
from sonic_bullet.records.errors import SceneError

IDLE_S = 10.0
"""Wall time without a physics step after which a scene is taken for a viewer's loop."""
END_S = 0.5
"""For an interrupted command to end by itself; it must be gone within 1 s."""
PACKAGE = escape_path(str(Path(__file__).resolve().parents[1]))
TRACE_LINE = re.compile(r'File "(?P<file>[^"]*)", line (?P<line>\d+)')


@dataclass(frozen=True, slots=True)
class Ending:
    """How a worker ended. code: of the command, or of how it was ended; words: to be printed, "": printed already."""

    code: int
    words: str = ""


@dataclass(slots=True)
class _Worker:
    """The process, and what is known of it."""

    process: int
    said: int
    traces: int
    clock: Any
    scene: str = ""
    left: list[str] = field(default_factory=list)
    code: int | None = None
    closing: bool = False
    kept: str = ""
    exit_lines: str = ""
    trace: str = ""
    unread: bytes = b""
    status: int | None = None
    lines: progress.ProgressLines | None = None

    def listen(self, wait_s: float) -> None:
        """Read its messages, for at most that long."""
        for fd in select.select([self.said, self.traces], [], [], wait_s)[0]:
            data = os.read(fd, 1 << 16)
            if fd == self.traces:
                self.trace = (self.trace + data.decode("ascii", "replace"))[-(1 << 16) :]
                continue
            *lines, self.unread = (self.unread + data).split(b"\n")
            for line in lines:
                self._take(*line.decode("utf-8", "surrogateescape").partition(" ")[::2])

    def _take(self, kind: str, text: str) -> None:
        if kind == "stage" and self.lines is not None:
            self.lines.take(text)
        elif kind == "stage":
            progress.forward(text)
        elif kind == "scene":
            self.scene = text
        elif kind == "left":
            self.left = [*(one for one in self.left if os.path.lexists(one)), text]
        elif kind == "closing":
            self.closing = True
        elif kind == "kept":
            self.kept = text
        elif kind == "exit":
            self.exit_lines = text
        elif kind == "done":
            self.code = int(text)

    def has_ended(self) -> bool:
        """Return whether the process has ended."""
        if self.status is None:
            found, status = os.waitpid(self.process, os.WNOHANG)
            self.status = status if found else None
        return self.status is not None

    def kill(self) -> None:
        """End the process, if it runs."""
        if not self.has_ended():
            os.kill(self.process, signal.SIGKILL)
            self.status = os.waitpid(self.process, 0)[1]

    def where(self) -> str:
        """Ask for file and line of the present call stack; "": it does not answer."""
        self.trace = ""
        os.kill(self.process, ASK_WHERE)  # type: ignore[arg-type]
        end = time.monotonic() + 0.3
        while time.monotonic() < end and not _judgement(self.trace, self.scene):
            self.listen(0.05)
        return self.trace


def run_supervised(run: Callable[[], int], *, alone: bool = True, command: str = "") -> Ending:
    """Call ``run`` in a process of its own and wait for its end, which is an exit code.

    alone: this process is the command's: interrupts are passed on, and the worker ends as an interpreter does; else the
    caller goes on, and an interrupt of it ends the worker. command: heads lines of progress; "": no line before a first
    stage.
    """
    forks_early_only = sys.platform != "linux"  # whether libraries forbid a fork once they are loaded (macOS)
    subreaper = 36  # prctl(2)
    if ASK_WHERE is None or not hasattr(os, "fork") or (threading.active_count() > 1 if alone else forks_early_only):
        if alone:
            catch_stops()
        return Ending(run())
    said, traces, clock = os.pipe(), os.pipe(), mmap.mmap(-1, 8)
    sys.stdout.flush(), sys.stderr.flush()
    signal.pthread_sigmask(signal.SIG_BLOCK, STOPS)  # neither process misses one between fork and handler
    tied, before = process_control(subreaper, 1), set() if alone else set(_children())
    here = os.getpid()
    process = os.fork()
    if not process:
        _close(said[0], traces[0])
        _work(run, (said[1], traces[1]), clock, alone, here)
    _close(said[1], traces[1])
    child = _Worker(process, said[0], traces[0], clock)
    if alone and progress.is_shown() and not progress.on_terminal():
        child.lines = progress.ProgressLines(command, time.monotonic(), progress.COMMAND_QUIET_S)
    stops: list[int] = []
    if alone:
        for word in STOPS:
            if signal.getsignal(word) is not signal.SIG_IGN:
                signal.signal(word, lambda number, _: stops.append(number))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPS)
    try:
        return _wait(child, stops)
    finally:
        child.kill()
        progress.clear_stage(child.process)
        _clean_up(child, tied, before)
        _close(child.said, child.traces)
        if not alone:
            process_control(subreaper, 0)


def _work(run: Callable[[], int], fds: tuple[int, int], clock: Any, alone: bool, parent: int) -> None:
    """Run the worker; it does not return."""
    leave = os._exit
    end_with(parent)
    connect(*fds, clock, _end_idle)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPS)
    code = 2
    try:
        code = run()
    except BaseException:  # a command with SONIC_BULLET_DEBUG
        traceback.print_exc()
    finally:
        with suppress(Exception):
            sys.stdout.flush(), sys.stderr.flush()
        if os.getpid() != worker._line.process:  # a fork of the scene's own that came this far
            leave(code)
        tell("done", str(code))
        if alone:  # as an interpreter ends; the caller of `run_supervised` continues in the other process alone
            atexit._run_exitfuncs()
            with suppress(Exception):
                sys.stdout.flush(), sys.stderr.flush()
        leave(code)


def _end_idle(_: int, frame: FrameType | None) -> None:
    raise SceneError(*_idle_words(*scene_line(frame)))


def _idle_words(name: str, line: int) -> tuple[str, str]:
    where = f" line {line}" if line else ""
    return (
        f"scene '{name}'{where}: {IDLE_S:.0f} s without a physics step",
        "call stepSimulation in its loop, or leave a viewer's loop out",
    )


def _wait(child: _Worker, stops: list[int]) -> Ending:
    close_s = 20.0  # for what was made before the interrupt to be written
    ask_s = 1.0  # how often a scene that does not step is asked for its line
    poll_s = 0.05
    sent, stopped_at, seen_at = 0, 0.0, time.monotonic()
    own_since = asked_at = seen_at
    ended_idle: tuple[str, str] | None = None
    while child.code is None and not child.has_ended():
        child.listen(poll_s)
        now = time.monotonic()
        if child.lines is not None and not stops and child.code is None and (line := child.lines.due(now)):
            progress.write_line(line)
        if len(stops) > sent:
            if sent and now - stopped_at > 0.2:  # asked twice
                break
            stopped_at, sent = stopped_at or now, len(stops)
            os.kill(child.process, stops[0])
        if stopped_at:
            if now - stopped_at > (close_s if child.closing else END_S):
                break
            continue
        stepped = struct.unpack_from("d", child.clock)[0]
        if now - seen_at > 2.0 or not stepped:  # stopped by a terminal or a debugger, or no scene runs
            own_since = now
        own_since, seen_at = max(own_since, stepped), now
        if now - max(own_since, asked_at) > ask_s or (now - own_since > IDLE_S and now - asked_at > ask_s):
            asked_at = now
            found = _judgement(child.where(), child.scene)
            if found != "own":  # a long call into C does not answer
                own_since = now
            elif now - own_since > IDLE_S and not os.environ.get("SONIC_BULLET_DEBUG"):
                if ended_idle is not None:
                    break
                ended_idle = _idle_words(Path(child.scene).name, _line_in(child.trace, child.scene))
                own_since = now - IDLE_S
                os.kill(child.process, END_IDLE)  # type: ignore[arg-type]
    return _find_ending(child, stops, ended_idle)


def _find_ending(child: _Worker, stops: list[int], ended_idle: tuple[str, str] | None) -> Ending:
    leave_s = 0.2  # for the interpreter of an interrupted command to end after its last message
    end = time.monotonic() + (leave_s if stops else 4 * END_S)
    while not child.has_ended() and child.code is not None and time.monotonic() < end:
        child.listen(0.005)
    running = not child.has_ended()
    child.kill()
    while select.select([child.said, child.traces], [], [], 0)[0] and not _at_end(child):
        pass
    if child.code is not None:
        return Ending(child.code)
    if stops:
        word = STOPS[signal.Signals(stops[0])]
        return Ending(128 + stops[0], f"{word}; {child.kept}" if child.kept else word)
    if ended_idle is not None and running:
        return Ending(2, "; ".join(ended_idle))
    return Ending(2, _how_it_ended(child))


def _at_end(child: _Worker) -> bool:
    """Read what a process that is gone has left; return whether there was nothing."""
    before = (len(child.trace), child.exit_lines, child.unread, child.code)
    child.listen(0)
    return before == (len(child.trace), child.exit_lines, child.unread, child.code)


def _how_it_ended(child: _Worker) -> str:
    """Describe in one line what ended the process, and where."""
    assert child.status is not None
    _, crashed, lines = child.trace.rpartition("Fatal Python error")
    lines = child.exit_lines or (lines if crashed else "")
    if os.WIFSIGNALED(child.status):
        number = os.WTERMSIG(child.status)
        name = signal.strsignal(number) or f"signal {number}"
        what = f"the process was ended by {signal.Signals(number).name} ({name})"
        remedy = "the memory may not suffice" if number == signal.SIGKILL else ""
    else:
        call = "os._exit" if child.exit_lines else "exit"
        what, remedy = f"{call}({os.WEXITSTATUS(child.status)}) ended the process before there was a result", ""
    if child.scene:
        line = _line_in(lines, child.scene)
        where = f" line {line}" if line else ""
        return f"scene '{Path(child.scene).name}'{where}: {what}; {remedy or 'take out what ends the process'}"
    last = TRACE_LINE.search(lines)
    where = f" in {Path(last['file']).name} line {last['line']}" if last else ""
    return f"{what}{where}; {remedy or 'a fault of the program or a library: report it with the input'}"


def _line_in(lines: str, scene: str) -> int:
    """Find the line of the scene that was reached last; 0: none."""
    return next((int(one["line"]) for one in TRACE_LINE.finditer(lines) if one["file"] == escape_path(scene)), 0)


def _judgement(trace: str, scene: str) -> str:
    """Judge whose code runs: "own", the scene's; "ours", this package or an import; "": no trace yet.

    trace: its calls, the latest first, which come piece by piece.
    """
    # functions that a script calls in place of PyBullet's: their time is the script's own
    stand_ins = f"{PACKAGE}/listener/pybullet/"
    for one in TRACE_LINE.finditer(trace):
        if one["file"] == escape_path(scene):
            return "own"
        ours = one["file"].startswith(f"{PACKAGE}/") and not one["file"].startswith(stand_ins)
        if ours or one["file"].startswith("<frozen importlib"):
            return "ours"
    return ""


def _clean_up(child: _Worker, tied: bool, before: set[int]) -> None:
    """End what the worker left running, and remove its files; where it ended by itself there is nothing."""
    if child.code is None and tied:
        while orphans := set(_children()) - before:
            for one in orphans:
                with suppress(ProcessLookupError, ChildProcessError):
                    os.kill(one, signal.SIGKILL)
                    os.waitpid(one, 0)
    for path in child.left:
        if os.path.isdir(path) and not os.path.islink(path):
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                os.unlink(path)


def _close(*fds: int) -> None:
    for fd in fds:
        os.close(fd)


def _children() -> list[int]:
    """List the child processes of this one."""
    found = []
    for place in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError, ValueError, IndexError):
            parent = place.read_text(errors="replace").rpartition(")")[2].split()[1]
            found += [int(place.parent.name)] * (int(parent) == os.getpid())
    return found
