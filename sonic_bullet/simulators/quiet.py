"""Suppress PyBullet's side effects on the process.

PyBullet prints to the process's own stdout ("argv[0]=", "?"), which would spoil JSON and pipes.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache


@cache
def _c_library() -> ctypes.CDLL:
    return ctypes.CDLL(None)


@contextmanager
def quiet_stdout() -> Iterator[None]:
    """Discard what C code writes to file descriptor 1; Python's own prints belong outside the block."""
    flush = _c_library().fflush
    try:
        sys.stdout.flush()
        kept = os.dup(1)
    except (OSError, ValueError, AttributeError):  # no stdout to protect
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    flush(None)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        flush(None)
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
