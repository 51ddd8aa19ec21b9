"""A world that stores the records of the steps hidden in one env.step, whatever simulates."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from sonic_bullet.listener.world import World
from sonic_bullet.records.contacts import Step


class EpisodeWorld(World):
    """Base of the worlds of episodes.

    Attributes
    ----------
    client
        What is read.
    steps
        Those made since the list was last emptied.
    hooked
        Whether every step is observed.
    """

    client: Any
    steps: list[Step]
    hooked: bool = False

    def likeness(self, body: int, link: int) -> Any:
        """Return what tells a link from another that reuses its id."""
        raise NotImplementedError

    def listen(self, after: Callable[[], object]) -> bool:
        """Call ``after`` after every step, if the simulator can; return whether it does."""
        self.hooked = super().listen(after)
        return self.hooked

    def after_step(self) -> Step:
        """Return the record of the step just made, and store it; raises SceneError."""
        step = super().after_step()  # type: ignore[safe-super]
        if self.stepped:
            self.steps.append(step)
        return step

    def hearing(self, after: Callable[[], object]) -> AbstractContextManager[None]:
        """Call ``after`` after every step within the block, also where the client has no instance to hook."""
        return nullcontext()
