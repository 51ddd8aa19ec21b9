"""Output of the commands: JSON, tables and progress.

result -> JSON  -> PATH, or stdout and nothing else there
       -> text  -> stdout
warnings        -> stderr, a line each
progress        -> stderr: on a terminal one line, rewritten, else a line a stage and every 4 s
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonic_bullet.machine.progress import is_shown, on_terminal, percent, shown_by, status
from sonic_bullet.records.errors import FileError

if TYPE_CHECKING:
    from sonic_bullet.files import AudioReport, ContactLog

__all__ = [
    "clean_stdout",
    "described_render",
    "places",
    "progress_bar",
    "quiet_stderr",
    "status",
    "table",
    "write_json",
]


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


def write_json(json_to: str | None, value: Any) -> None:
    """Write ``value`` as strict JSON to a path, to stdout for "-", nowhere for None; raises FileError."""
    if json_to is None:
        return
    from sonic_bullet.storage.json_text import json_bytes

    text = json_bytes(value, indent=2)
    if json_to == "-":
        sys.stdout.write(text.decode())
        sys.stdout.flush()
        return
    from sonic_bullet.files import replacing

    with replacing(json_to) as file:
        file.write(text)


@contextmanager
def progress_bar(label: str) -> Iterator[tuple[Callable[[float], None], Callable[[str], None]]]:
    """Yield functions for the fraction done and for the current task, shown on stderr; in a pipe as of `status`."""
    if not (is_shown() and on_terminal()):
        with status(label) as say:
            yield percent(say), say
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
        with shown_by(lambda text: progress.update(task, description=escape(f"{label}: {text}"))) as say:
            yield (lambda share: progress.update(task, description=label, completed=share)), say


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


def described_render(
    log: ContactLog,
    report: AudioReport,
    notes: tuple[str, ...],
    lifted: Mapping[str, tuple[int, int]] | None = None,
) -> dict[str, Any]:
    """Convert a render to JSON values. lifted: see `Listener.lifted`; None: not counted."""
    return {
        "output": report.path,
        "format": report.format,
        "subtype": report.subtype,
        "sr": report.sr,
        "channels": report.channels,
        "frames": report.frames,
        "seconds": report.seconds,
        "peak_pa": report.peak_pa,
        "rms_pa": report.rms_pa,
        "gain_per_pa": report.gain_per_pa,
        "clipped": report.clipped,
        "steps": len(log.steps),
        "contacts": len(log),
        "bodies": _bodies(log),
        "events": [{"kind": x.kind, "step": x.step, "body": x.body} for x in log.events],
        "changes": [{"step": x.step, "body": x.body, "values": dict(x.values)} for x in log.changes],
        "supports": log.supports,
        "image": log.image,
        "lifted": None if lifted is None else {name: list(of) for name, of in lifted.items()},
        "engine": dict(log.engine),
        "versions": dict(log.versions),
        "notes": list(notes),
    }


def _bodies(log: ContactLog) -> list[dict[str, Any]]:
    return [
        {
            "body": body.body_id,
            "link": body.link,
            "name": body.name.encode("utf-8", "replace").decode(),
            "material": None if body.material is None else body.material.name,
            "modes": None if body.model is None else body.model.mode_count,
            "dropped": None if body.model is None else body.model.dropped,
            "since_step": body.since_step,
            "until_step": body.until_step,
            "mounting": body.mounting,
            "options": None if body.options is None else asdict(body.options),
            "dynamics": dict(body.dynamics),
        }
        for body in log.bodies
    ]
