"""What long work says while it lasts, and who shows it.

    status(label), show_stage(text) ─► a terminal: one line, rewritten
                                    ─► else a pipe ─► supervisor of the command, or a thread ─► lines of stderr

A line each time another stage begins, and every 4 s while one lasts. The supervisor is a process of its own: it speaks
while a compiler or a call of C holds the interpreter. Processes that were forked write into the same pipe.
SONIC_BULLET_PROGRESS=0: nothing is said.
"""

from __future__ import annotations

import os
import re
import select
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import wraps
from typing import ParamSpec, TypeVar

Say = Callable[[str], None]
P = ParamSpec("P")
Made = TypeVar("Made")

EVERY_S = 4.0
"""Between lines of one stage: below the 5 s after which a user takes a program for dead, with room for a busy machine.
"""
LEAST_S = 1.0
"""Between lines of stages that follow each other fast."""
COMMAND_QUIET_S, CALL_QUIET_S = 1.0, 2.0
"""A command, a call from Python that takes less says nothing."""
LONGEST = 300  # characters of a line
NO_PRINT = re.compile(r"[\x00-\x1f\x7f-\x9f]")
DETAIL = re.compile(r": |\d+ ?%")
"""Where what a stage is ends and how far it is begins."""

_SHOWN: list[Say] = []


@dataclass(slots=True)
class _Sink:
    """Where messages go: "stage PROCESS TAB LABEL TAB TEXT". fd: of a pipe, -1: none; last: this process's own."""

    fd: int = -1
    last: tuple[str, str] = ("", "")


_SINK = _Sink()


@dataclass(frozen=True, slots=True)
class PipeSay:
    """Says what is being done into the pipe, whichever process calls it."""

    label: str

    def __call__(self, text: str) -> None:
        _SINK.last = self.label, text
        _send(os.getpid(), self.label, text)


@dataclass(slots=True)
class ProgressLines:
    """Which of what is said becomes a line, and when. command: heads them; "": there are none
    before a stage is said."""

    command: str
    begin_s: float
    quiet_s: float
    _said: dict[str, tuple[str, str]] = field(default_factory=dict)
    _idle: str = "starting"
    _last_s: float = -1e9
    _stages: tuple[str, ...] | None = None

    def take(self, message: str) -> None:
        """Take in "PROCESS TAB LABEL TAB TEXT"; without label and text that process does nothing any more."""
        process, label, text = (*message.split("\t"), "", "")[:3]
        self._idle = "working"
        if label or text:
            self._said[process] = label, text
        else:
            self._said.pop(process, None)

    def due(self, now_s: float) -> str:
        """The line to be written now; "": none."""
        stages = tuple(DETAIL.split(text)[0] for _, text in self._said.values())
        pause_s = LEAST_S if stages and stages != self._stages else EVERY_S
        if not (self.command or self._said):
            return ""
        if now_s - self.begin_s < self.quiet_s or now_s - self._last_s < pause_s:
            return ""
        self._last_s, self._stages = now_s, stages
        labels = dict.fromkeys(label for label, _ in self._said.values())
        texts = "; ".join(text for _, text in self._said.values() if text) or ("" if labels else self._idle)
        head = " ".join([*([self.command] if self.command else []), *labels])
        return f"[{now_s - self.begin_s:.0f} s] {head}{': ' if head and texts else ''}{texts}"[:LONGEST]


@contextmanager
def shown_by(say: Say) -> Iterator[Say]:
    """While this lasts, `status` writes through ``say``."""
    _SHOWN.append(say)
    try:
        yield say
    finally:
        _SHOWN.remove(say)


@contextmanager
def status(label: str) -> Iterator[Say]:
    """A function of the present activity: a spinner on a terminal's stderr, elsewhere lines of it (the module's head).

    What starts while another is shown writes into that one.
    """
    if _SHOWN:
        yield _SHOWN[-1]
    elif not is_shown():
        yield lambda text: None
    elif on_terminal():
        from rich.console import Console
        from rich.markup import escape

        with (
            Console(stderr=True).status(escape(label)) as line,
            shown_by(lambda text: line.update(escape(f"{label}: {text}"))) as say,
        ):
            yield say
    else:
        with _printed(), shown_by(PipeSay(label)) as say:
            say("")
            try:
                yield say
            finally:
                clear_stage()


def says_so(*, text: str = "", fraction: str = "") -> Callable[[Callable[P, Made]], Callable[P, Made]]:
    """Give a function, where its caller gives neither, arguments of these names that `status` shows: a function of
    what is being done and one of the fraction done.
    """

    def decorated(function: Callable[P, Made]) -> Callable[P, Made]:
        @wraps(function)
        def called(*args: P.args, **options: P.kwargs) -> Made:
            names = [name for name in (text, fraction) if name]
            if any(options.get(name) is not None for name in names):
                return function(*args, **options)
            with status("sonic_bullet") as say:
                options.update({name: say if name == text else percent(say) for name in names})
                return function(*args, **options)

        return called

    return decorated


def percent(say: Say) -> Callable[[float], None]:
    """A function of the fraction done; it says another percent than before: it is called every physics step."""
    before = -1

    def progress(fraction: float) -> None:
        nonlocal before
        if int(100 * fraction) != before:
            before = int(100 * fraction)
            say(f"{before} %")

    return progress


@contextmanager
def show_stage(text: str) -> Iterator[None]:
    """Say what is done while this lasts, beside what is being done already; a terminal's line stays as it is."""
    with status("sonic_bullet") as say:
        before = _SINK.last[1]
        if not isinstance(say, PipeSay) or text in before:
            yield
            return
        say(f"{before}: {text}" if before else text)
        try:
            yield
        finally:
            say(before)


def is_shown() -> bool:
    """Whether progress is shown at all."""
    return sys.stderr is not None and os.environ.get("SONIC_BULLET_PROGRESS") != "0"  # None: a program without console


def on_terminal() -> bool:
    """Whether stderr is a terminal, where one line is rewritten."""
    return sys.stderr is not None and sys.stderr.isatty()


def open_sink(fd: int) -> None:
    """Have messages written to a pipe that another process reads."""
    _SINK.fd = fd


def forward(message: str) -> None:
    """Hand on what another process said."""
    _write(f"stage {message}\n")


def clear_stage(process: int | None = None) -> None:
    """Say that a process, this one for None, does nothing that is to be shown."""
    _send(os.getpid() if process is None else process, "", "")


@contextmanager
def waiting_for(process: int) -> Iterator[None]:
    """This process waits for another one: what that one says is shown alone."""
    last = _SINK.last
    clear_stage()
    try:
        yield
    finally:
        clear_stage(process)
        if _SHOWN and any(last):
            _send(os.getpid(), *last)


def write_line(line: str) -> None:
    """A line of stderr; dropped where nobody reads what was written before, who would be waited for."""
    with suppress(Exception):  # a stream that is closed, or no stream
        stream = sys.stderr
        with suppress(OSError, ValueError):  # a notebook's has no number
            if not select.select([], [stream.fileno()], [], 0)[1]:
                return
        stream.write(line + "\n")
        stream.flush()


def _send(process: int, label: str, text: str) -> None:
    label, text = (NO_PRINT.sub("?", " ".join(part.split()))[:LONGEST] for part in (label, text))
    _write(f"stage {process}\t{label}\t{text}\n")


def _write(message: str) -> None:
    if _SINK.fd >= 0:
        with suppress(OSError):
            os.write(_SINK.fd, message.encode("utf-8", "surrogateescape"))


@contextmanager
def _printed() -> Iterator[None]:
    """Somebody reads the pipe while this lasts: whoever does so already, or a thread."""
    if _SINK.fd >= 0:
        yield
        return
    out, into = os.pipe()
    thread = threading.Thread(target=_print_lines, args=(out,), daemon=True, name="sonic_bullet progress")
    with ExitStack() as stack:
        stack.callback(os.close, out)
        stack.callback(os.close, into)
        with suppress(RuntimeError):  # no thread to be had
            thread.start()
            stack.callback(thread.join, 1.0)
            stack.callback(os.write, into, b"end\n")
            open_sink(into)
            stack.callback(open_sink, -1)
        yield


def _print_lines(out: int) -> None:
    """The thread: reads until it is told to end."""
    lines, unread = ProgressLines("", time.monotonic(), CALL_QUIET_S), b""
    with suppress(OSError, ValueError):
        while True:
            if select.select([out], [], [], 0.1)[0]:
                *read, unread = (unread + os.read(out, 1 << 16)).split(b"\n")
                for message in read:
                    kind, _, text = message.decode("utf-8", "replace").partition(" ")
                    if kind == "end":
                        return
                    lines.take(text)
            if line := lines.due(time.monotonic()):
                write_line(line)
