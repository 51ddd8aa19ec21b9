"""Somebody who watches what a listener is made with, and may have it made with something else.

attach(options) -> Direction.attached -> options          Listener.add(…) -> Direction.added -> what is added
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from sonic_bullet.listener.world import World
    from sonic_bullet.session.listening import Listener
    from sonic_bullet.session.wanted_bodies import WantedBody


class Direction(Protocol):
    """Who watches."""

    def attached(self, options: dict[str, Any]) -> dict[str, Any]:
        """What a listener is to be attached with: sensors, seed, air."""
        ...

    def listens(self, listener: Listener) -> None:
        """A listener was made of it."""
        ...

    def absent(self, body: Any) -> bool:
        """Whether that id is of a body that was not made after all."""
        ...

    def added(self, world: World, wanted: Sequence[WantedBody]) -> Sequence[WantedBody]:
        """Who is to sound, and as what."""
        ...


_DIRECTION: ContextVar[Direction | None] = ContextVar("direction", default=None)


@contextmanager
def directed(direction: Direction) -> Iterator[None]:
    """Listeners are made and added to as that one says while this lasts."""
    before = _DIRECTION.set(direction)
    try:
        yield
    finally:
        _DIRECTION.reset(before)


def absent(who: Any) -> bool:
    """Whether a body, or (body, link), was not made after all, because somebody had it so."""
    director = _DIRECTION.get()
    return director is not None and director.absent(who[0] if isinstance(who, tuple) else who)


def direction() -> Direction | None:
    """Who watches, where somebody does."""
    return _DIRECTION.get()
