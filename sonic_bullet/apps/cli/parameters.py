"""Types of values and options that several commands share."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import wraps
from typing import Any

import click

from sonic_bullet.apps.cli.commands import Numbers

csv_option = click.option(
    "--csv",
    "csv_to",
    metavar="NAME.csv",
    help="Also write the lines: frequency, decay, T60, η and Q with their spreads.",
)

uff_option = click.option(
    "--uff",
    "uff_to",
    metavar="NAME.uff",
    help="Also write modal shapes at points, with frequency and damping, as a UFF file (dataset 55). Extra: uff.",
)

json_option = click.option(
    "--json",
    "json_to",
    is_flag=False,
    flag_value="-",
    metavar="[PATH.json]",
    help="Write the result as JSON to PATH.json, or alone to stdout.",
)

channel_option = click.option(
    "--channel",
    type=click.IntRange(0),
    metavar="N",
    help="Which channel of a file of several, counted from 0. [default: the first, 0]",
)


def strike_options(command: Any) -> Any:
    """Add the options that describe one recorded strike, as a case does."""
    for option in reversed(
        (
            click.option("--mesh", metavar="M", help="Mesh of what was struck; needs --strike and --material."),
            click.option("--strike", type=Numbers("X,Y,Z"), help="Where it was struck, in m, mesh frame."),
            click.option(
                "--direction", type=Numbers("X,Y,Z"), help="Direction of the impulse. [default: into the surface]"
            ),
            click.option(
                "--impulse",
                type=click.FloatRange(0, min_open=True),
                metavar="J",
                help="Impulse in N·s; without it sigma stands for gain times impulse.",
            ),
            click.option(
                "--material",
                metavar="GUESS",
                help="A name ('sonic-bullet materials') or a preset file: E and density good to 30 %.",
            ),
            click.option(
                "--scale",
                type=float,
                metavar="S",
                help="Metres per mesh unit: 0.001 for a mesh in millimetres. [default: 1]",
            ),
            click.option(
                "--sensor",
                type=click.Choice(["sum", "pressure", "velocity"]),
                help="What was recorded: plain sum of modes, a microphone, a surface. [default: pressure]",
            ),
            click.option(
                "--sensor-at",
                type=Numbers("X,Y,Z"),
                help="Where the surface was measured, in m, for --sensor velocity.",
            ),
            click.option(
                "--sensor-direction",
                type=Numbers("X,Y,Z"),
                help="Along which, for --sensor velocity. [default: out of the surface]",
            ),
            click.option(
                "--medium",
                type=click.Choice(["air", "none", "unknown"]),
                help="What it rang in: 'none' loses nothing to radiation, 'unknown' leaves it open. "
                "[default: air; with --sensor sum unknown]",
            ),
            click.option(
                "--onset",
                "onset_s",
                type=click.FloatRange(0),
                metavar="S",
                help="When the impulse arrives. [default: found]",
            ),
            channel_option,
            click.option(
                "--fix",
                "fixed",
                type=Numbers("X,Y,Z,R"),
                multiple=True,
                help="Clamp all within R of a point, in m, mesh frame; repeatable.",
            ),
        )
    ):
        command = option(command)
    return command


def many_options(command: Any) -> Any:
    """Add the options of a command that takes many cases; it is called with a `ManyOptions` as ``many``."""

    @wraps(command)
    def called(*, workers: int | None, limit_s: float | None, scheduler: str | None, **options: Any) -> None:
        command(many=ManyOptions(workers, limit_s, scheduler), **options)

    for option in reversed(
        (
            click.option(
                "--workers",
                type=click.IntRange(1, 1024),
                metavar="N",
                help="Of several cases: processes at once. [default: one a core]",
            ),
            click.option(
                "--scheduler", metavar="tcp://HOST:PORT", help="Of a Dask cluster whose workers do the cases."
            ),
            click.option(
                "--limit",
                "limit_s",
                type=click.FloatRange(0, min_open=True),
                metavar="S",
                help="Of several cases: wall time that each may take. [default: 3600]",
            ),
        )
    ):
        called = option(called)
    return called


@dataclass(frozen=True, slots=True)
class ManyOptions:
    """How many cases are done. workers, limit_s: None: not given."""

    workers: int | None
    limit_s: float | None
    scheduler: str | None

    @property
    def given(self) -> bool:
        """Whether any of them was given."""
        return any(one is not None for one in (self.workers, self.limit_s, self.scheduler))


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
