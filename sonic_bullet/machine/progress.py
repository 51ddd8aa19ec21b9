"""Progress messages of long work, and their display.

    report_progress(text) ─► whoever listens (progress_to)
    status(label) ─► a terminal: one line, rewritten
                  ─► else a pipe ─► supervisor of the command, or a thread ─► lines of stderr

A line each time another stage begins, and every 4 s while one lasts. The supervisor is a process of its own: it writes
while a compiler or a call of C holds the interpreter. Forked processes write into the same pipe.
SONIC_BULLET_PROGRESS=0: nothing is shown.
"""

from __future__ import annotations

import os
import re
import select
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field

COMMAND_QUIET_S, CALL_QUIET_S = 1.0, 2.0
"""A command, a call from Python that takes less shows nothing."""
LONGEST = 300  # characters of a line

_shown: list[Callable[[str], None]] = []
_listener: ContextVar[Callable[[str], None] | None] = ContextVar("listener", default=None)
_fraction_listener: ContextVar[Callable[[float], None] | None] = ContextVar("fraction_listener", default=None)


@dataclass(slots=True)
class _Sink:
    """Destination of messages "stage PROCESS TAB LABEL TAB TEXT". fd: of a pipe, -1: none; last: this process's own."""

    fd: int = -1
    last: tuple[str, str] = ("", "")


_sink = _Sink()


@dataclass(frozen=True, slots=True)
class PipeProgress:
    """Writer of progress into the pipe, from any process."""

    label: str

    def __call__(self, text: str) -> None:
        """Write what is being done."""
        _sink.last = self.label, text
        _send(os.getpid(), self.label, text)


@dataclass(slots=True)
class ProgressLines:
    """Choice of the messages that become a line, and when. command: heads them; "": no line before a first stage."""

    command: str
    begin_s: float
    quiet_s: float
    _said: dict[str, tuple[str, str]] = field(default_factory=dict)
    _idle: str = "starting"
    _last_s: float = -1e9
    _stages: tuple[str, ...] | None = None

    def take(self, message: str) -> None:
        """Take in "PROCESS TAB LABEL TAB TEXT"; without label and text that process has finished."""
        process, label, text = (*message.split("\t"), "", "")[:3]
        self._idle = "working"
        if label or text:
            self._said[process] = label, text
        else:
            self._said.pop(process, None)

    def due(self, now_s: float) -> str:
        """Return the line to be written now; "": none."""
        detail_start = re.compile(r": |\d+ ?%")  # where a stage's name ends and its progress begins
        stages = tuple(detail_start.split(text)[0] for _, text in self._said.values())
        every_s = 4.0  # between lines of one stage: below the 5 s after which a user takes a program for dead
        between_stages_s = 1.0  # between lines of stages that follow each other fast
        pause_s = between_stages_s if stages and stages != self._stages else every_s
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
def shown_by(display: Callable[[str], None]) -> Iterator[None]:
    """Let `status` write through ``display`` within the context."""
    _shown.append(display)
    try:
        yield
    finally:
        _shown.remove(display)


@contextmanager
def status(label: str) -> Iterator[None]:
    """Show what `report_progress` tells within the context: a spinner on a terminal's stderr, elsewhere lines of it.

    An activity that starts within another writes into that one.
    """
    if _shown or not is_shown():
        with progress_to(_shown[-1] if _shown else ignore_progress):
            yield
    elif on_terminal():
        from rich.console import Console
        from rich.markup import escape

        with Console(stderr=True).status(escape(label)) as line:

            def rewrite(text: str) -> None:
                line.update(escape(f"{label}: {text}"))

            with shown_by(rewrite), progress_to(rewrite):
                yield
    else:
        pipe = PipeProgress(label)
        with _reader_of_pipe(), shown_by(pipe), progress_to(pipe):
            pipe("")
            try:
                yield
            finally:
                clear_stage()


def ignore_progress(_: object) -> None:
    """Ignore a text, or a fraction done."""


def without_progress() -> AbstractContextManager[None]:
    """Let nobody hear the progress within the context."""
    return progress_to(ignore_progress, ignore_progress)


def report_progress(text: str) -> None:
    """Tell whoever listens (`progress_to`) what is being done; without one, nothing."""
    progress_listener()(text)


def report_fraction(done: float) -> None:
    """Tell whoever listens (`progress_to`) which fraction is done, 0 to 1; without one, nothing."""
    fraction_listener()(done)


def progress_listener() -> Callable[[str], None]:
    """Return whoever hears `report_progress`; without one, a deaf one."""
    return _listener.get() or ignore_progress


def fraction_listener() -> Callable[[float], None]:
    """Return whoever hears `report_fraction`; without one, a deaf one."""
    return _fraction_listener.get() or ignore_progress


@contextmanager
def progress_to(
    text: Callable[[str], None] | None = None, fraction: Callable[[float], None] | None = None
) -> Iterator[None]:
    """Let `report_progress` call ``text``, `report_fraction` ``fraction`` within the context.

    None: whoever listens already.
    """
    before = _listener.set(text or _listener.get())
    before_fraction = _fraction_listener.set(fraction or _fraction_listener.get())
    try:
        yield
    finally:
        _listener.reset(before)
        _fraction_listener.reset(before_fraction)


@contextmanager
def progress_under(head: str) -> Iterator[None]:
    """Let what `report_progress` tells within the context stand behind a head."""
    outer = progress_listener()
    with progress_to(lambda text: outer(f"{head}: {text}")):
        yield


@contextmanager
def progress_part(begin: float, end: float) -> Iterator[None]:
    """Let what `report_fraction` tells within the context be that of a part, from ``begin`` to ``end`` of the whole."""
    outer = _fraction_listener.get()
    with progress_to(fraction=None if outer is None else lambda done: outer(begin + (end - begin) * done)):
        yield


@contextmanager
def show_progress(
    text: Callable[[str], None] | None = None,
    fraction: Callable[[float], None] | None = None,
    *,
    in_percent: bool = False,
) -> Iterator[None]:
    """Let a caller's functions hear the progress within the context, and nobody else.

    Where the caller gives neither, whoever listens already; where nobody does, `status` shows it.

    in_percent: whether `status` shows the fraction done, too.
    """
    if text is not None or fraction is not None:
        with progress_to(text or ignore_progress, fraction or ignore_progress):
            yield
    elif _listener.get() is not None or _fraction_listener.get() is not None:
        yield
    else:
        with status("sonic_bullet"), progress_to(fraction=percent(report_progress) if in_percent else None):
            yield


def percent(listener: Callable[[str], None]) -> Callable[[float], None]:
    """Make a function of the fraction done that reports only new per cents: it is called every physics step."""
    before = -1

    def report(done: float) -> None:
        nonlocal before
        if int(100 * done) != before:
            before = int(100 * done)
            listener(f"{before} %")

    return report


def in_every_process() -> bool:
    """Return whether a process that is forked from here reaches whoever listens by itself."""
    return progress_listener() is ignore_progress or isinstance(progress_listener(), PipeProgress)


def is_shown() -> bool:
    """Return whether progress is shown at all."""
    return sys.stderr is not None and os.environ.get("SONIC_BULLET_PROGRESS") != "0"  # None: a program without console


def on_terminal() -> bool:
    """Return whether stderr is a terminal, where one line is rewritten."""
    return sys.stderr is not None and sys.stderr.isatty()


def open_sink(fd: int) -> None:
    """Set the pipe for messages, read by another process."""
    _sink.fd = fd


def forward(message: str) -> None:
    """Forward another process's message."""
    _write(f"stage {message}\n")


def clear_stage(process: int | None = None) -> None:
    """Report that a process, this one for None, has nothing to show."""
    _send(os.getpid() if process is None else process, "", "")


@contextmanager
def waiting_for(process: int) -> Iterator[None]:
    """Show only the other process's messages while this one waits for it."""
    last = _sink.last
    clear_stage()
    try:
        yield
    finally:
        clear_stage(process)
        if _shown and any(last):
            _send(os.getpid(), *last)


def write_line(line: str) -> None:
    """Write a line to stderr; drop it where nobody reads, as writing would block."""
    with suppress(Exception):  # a stream that is closed, or no stream
        stream = sys.stderr
        with suppress(OSError, ValueError):  # a notebook's has no number
            if not select.select([], [stream.fileno()], [], 0)[1]:
                return
        stream.write(line + "\n")
        stream.flush()


def _send(process: int, label: str, text: str) -> None:
    no_print = re.compile(r"[\x00-\x1f\x7f-\x9f]")
    label, text = (no_print.sub("?", " ".join(part.split()))[:LONGEST] for part in (label, text))
    _write(f"stage {process}\t{label}\t{text}\n")


def _write(message: str) -> None:
    if _sink.fd >= 0:
        with suppress(OSError):
            os.write(_sink.fd, message.encode("utf-8", "surrogateescape"))


@contextmanager
def _reader_of_pipe() -> Iterator[None]:
    """Ensure a reader of the pipe within the context: an existing one, or a thread."""
    if _sink.fd >= 0:
        yield
        return
    out, into = os.pipe()
    thread = threading.Thread(target=_print_lines, args=(out,), daemon=True, name="sonic_bullet progress")
    with ExitStack() as stack:
        stack.callback(os.close, out)
        stack.callback(os.close, into)
        with suppress(RuntimeError):  # no thread can be started
            thread.start()
            stack.callback(thread.join, 1.0)
            stack.callback(os.write, into, b"end\n")
            open_sink(into)
            stack.callback(open_sink, -1)
        yield


def _print_lines(out: int) -> None:
    """Run the thread: read until the end message."""
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
