"""The one line that shows on a terminal what is being done; in a pipe nothing is shown.

A terminal has room for one such line: what starts while another is shown writes into that one.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Say = Callable[[str], None]

_SHOWN: list[Say] = []


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
    """A function of the present activity, drawn as a spinner on a terminal's stderr; in a pipe it does nothing."""
    if sys.stderr is None or not sys.stderr.isatty():  # None: a program without a console
        yield lambda text: None
        return
    if _SHOWN:
        yield _SHOWN[-1]
        return
    from rich.console import Console
    from rich.markup import escape

    with (
        Console(stderr=True).status(escape(label)) as line,
        shown_by(lambda text: line.update(escape(f"{label}: {text}"))) as say,
    ):
        yield say
