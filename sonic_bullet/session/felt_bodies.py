"""Whose links a run is to describe, for sensors on surfaces: those of the sensors it has, or of any put there later."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

from sonic_bullet.records import Sensor, felt_bodies

_every: ContextVar[bool] = ContextVar("every", default=False)


@contextmanager
def feeling_all() -> Iterator[None]:
    """Let listeners attached in the block describe the links of every jointed body: its log serves any sensor."""
    token = _every.set(True)
    try:
        yield
    finally:
        _every.reset(token)


def felt_now(sensors: Sequence[Sensor]) -> Collection[int]:
    """Return the ids of bodies of which a listener with these sensors describes the links."""
    every_body = range(1 << 31)
    return every_body if _every.get() else felt_bodies(sensors)
