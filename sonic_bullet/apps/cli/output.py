"""Output of the commands: JSON, tables and progress.

Report -> to_json -> PATH, or stdout and nothing else there
       -> lines   -> stdout
warnings        -> stderr, a line each
progress        -> stderr: on a terminal one line, rewritten, else a line a stage and every 4 s
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import Any, Protocol

from sonic_bullet.machine.progress import (
    is_shown,
    on_terminal,
    percent,
    progress_to,
    report_progress,
    shown_by,
    status,
)
from sonic_bullet.records.errors import FileError

__all__ = [
    "Report",
    "clean_stdout",
    "places",
    "print_report",
    "progress_bar",
    "quiet_stderr",
    "status",
    "table",
    "write_json",
]


class Report(Protocol):
    """What a command found. Each command has one, and prints and writes nothing else on stdout."""

    def to_json(self) -> dict[str, Any]:
        """Return the values of its JSON."""
        ...

    def lines(self) -> list[str]:
        """Return what it prints: a line each, or a table."""
        ...


@contextmanager
def clean_stdout(json_to: str | None) -> Iterator[Callable[[str], None]]:
    """Yield a printer to stdout; with JSON to stdout, send other output (a scene, a C library) to stderr."""
    if json_to != "-":
        yield print
        return
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        with redirect_stdout(sys.stderr):
            yield lambda text: None
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def warn(lines: Iterable[str]) -> None:
    """Print a warning a line on stderr."""
    for line in lines:
        print("sonic-bullet: warning: " + " ".join(line.split()), file=sys.stderr)


def warn_of_assumed_wall(mesh: str, wall_m: float) -> None:
    """Warn of the wall that an open surface was given because nobody stated one; 0: none."""
    if wall_m:
        assumed = f"open surface: a wall of {1000 * wall_m:.2g} mm is assumed, pitch goes with it"
        warn([f"{mesh}: {assumed}; give --thickness"])


@contextmanager
def quiet_stderr() -> Iterator[None]:
    """Discard stderr within the block, also from C: PyBullet prints its build time when it is imported."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def places(*asked: str | None) -> tuple[str | None, ...]:
    """Return each output's absolute path, tried before anything runs, as a scene may change the folder.

    None (not asked for) and "-" (stdout) stay as they are. Raises FileError where one cannot be written or two are one
    file.
    """
    from sonic_bullet.files import check_output

    real = [check_output(place) for place in asked if place is not None and place != "-"]
    if len(set(real)) < len(real):
        raise FileError("two outputs have one name", "give each its own")
    return tuple(place if place is None or place == "-" else os.path.join(os.getcwd(), place) for place in asked)


def folder_place(asked: str, *inside: str) -> str:
    """Return the absolute path of a folder for outputs, after a trial of it and the folders ``inside``.

    The trial leaves nothing behind. Raises FileError.
    """
    from sonic_bullet.files import cannot, check_output

    folder = Path(os.path.join(os.getcwd(), asked))
    missing = [
        place for place in (*(folder / name for name in inside), folder, *folder.parents) if not os.path.lexists(place)
    ]
    try:
        for name in inside or ("",):
            (folder / name).mkdir(parents=True, exist_ok=True)
            check_output(folder / name / "sound.wav")
    except OSError as error:
        raise cannot("make the folder", str(Path(asked, name)), error) from error
    finally:
        for place in missing:
            with suppress(OSError):
                place.rmdir()
    return str(folder)


def print_report(report: Report, echo: Callable[[str], None]) -> None:
    """Print the lines of a report."""
    echo("\n".join(report.lines()))


def write_json(json_to: str | None, value: Any) -> None:
    """Write ``value`` as strict JSON to a path, to stdout for "-", nowhere for None; raises FileError."""
    if json_to is None:
        return
    from sonic_bullet.files.storage.json_text import json_bytes

    text = json_bytes(value, indent=2)
    if json_to == "-":
        sys.stdout.write(text.decode())
        sys.stdout.flush()
        return
    from sonic_bullet.files import replace_file

    with replace_file(json_to) as file:
        file.write(text)


@contextmanager
def progress_bar(label: str) -> Iterator[None]:
    """Show the fraction done and the current task within the context, on stderr; in a pipe as of `status`."""
    if not (is_shown() and on_terminal()):
        with status(label), progress_to(fraction=percent(report_progress)):
            yield
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import (
        BarColumn,
        Progress,
        SpinnerColumn,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(label, total=1.0)

        def rewrite(text: str) -> None:
            progress.update(task, description=escape(f"{label}: {text}"))

        def move(done: float) -> None:
            progress.update(task, description=label, completed=done)

        with shown_by(rewrite), progress_to(rewrite, move):
            yield


def table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """Format columns padded with spaces, right-aligned except the first and the last."""
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    last = len(head) - 1

    def line(row: tuple[str, ...]) -> str:
        cells = [
            cell if i == last and i > 0 else cell.ljust(widths[i]) if i == 0 else cell.rjust(widths[i])
            for i, cell in enumerate(row)
        ]
        return "  ".join(cells).rstrip()

    return "\n".join(line(row) for row in [head, *rows])
