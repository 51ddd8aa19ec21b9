"""Hook that sees what a listener is made with, and may substitute it.

attach(options) -> Direction.attached -> options          Listener.add(…) -> Direction.added -> what is added
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from sonic_bullet.session.body_requests import BodyRequest
    from sonic_bullet.session.listening import Listener
    from sonic_bullet.simulators.world import World


class AttachHook(Protocol):
    """A hook on `attach` and `Listener.add`."""

    def attach_options(self, options: dict[str, Any]) -> dict[str, Any]:
        """Return the options to attach a listener with: sensors, seed, air."""
        ...

    def listens(self, listener: Listener) -> None:
        """Receive the listener that was made."""
        ...

    def absent(self, body: Any) -> bool:
        """Tell whether that id is of a body that was left out."""
        ...

    def replace_requests(self, world: World, wanted: Sequence[BodyRequest]) -> Sequence[BodyRequest]:
        """Return the bodies to add, and their materials."""
        ...


_direction: ContextVar[AttachHook | None] = ContextVar("direction", default=None)


@contextmanager
def use_hook(direction: AttachHook) -> Iterator[None]:
    """Use a hook for listeners that are made, and bodies that are added, within the block."""
    before = _direction.set(direction)
    try:
        yield
    finally:
        _direction.reset(before)


def absent(who: Any) -> bool:
    """Tell whether the hook left out a body, or (body, link)."""
    director = _direction.get()
    return director is not None and director.absent(who[0] if isinstance(who, tuple) else who)


def direction() -> AttachHook | None:
    """Return the hook in use, or None."""
    return _direction.get()
