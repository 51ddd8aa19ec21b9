"""`compare` and `baseline`: two versions of a scene, log or recording; what a version sounds like, kept.

Exit 0: samples equal, or --audible was given and nothing stands out; 1: samples differ, or a partner is missing; 2:
wrong use; 130: stopped, and what was known by then is printed.
"""

from __future__ import annotations

import sys
from typing import Any

import click

from sonic_bullet.cli.output import clean_stdout, places, quiet_stderr, status, write_json
from sonic_bullet.cli.parameters import json_option


@click.command()
@click.argument("a", metavar="A")
@click.argument("b", metavar="[B]", required=False)
@json_option
def compare(a: str, b: str | None, json_to: str | None) -> None:
    """Say whether two versions sound the same, and if not, which input is the cause.

    A, B: scenes (.py), contact logs (.npz), recordings.
    """
    from sonic_bullet.compare import compare as compare_both

    assert b is not None
    (to,) = places(json_to)
    with clean_stdout(to) as say:
        with quiet_stderr(), status("compare") as tell:
            found = compare_both(a, b, say=tell)
        for line in found.lines():
            say(line)
    write_json(to, found.described())
    if not found.passed:
        sys.exit(1)


COMMANDS: tuple[Any, ...] = (compare,)
