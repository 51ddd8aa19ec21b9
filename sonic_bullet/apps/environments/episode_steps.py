"""A world that stores the records of the steps hidden in one env.step, whatever simulates."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from sonic_bullet.records.contacts import Step
from sonic_bullet.records.step_tables import StepTables
from sonic_bullet.simulators.world import World


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
    _waited: list[StepTables]  # stored, and not yet taken

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
        self._store(step)
        return step

    def take_step(self) -> Step | None:
        """Take in the step just made, and store it, unless it waits: then it is stored as it is `taken`."""
        step = super().take_step()
        if step is not None:
            self._store(step)
        return step

    def take_waiting(self) -> list[StepTables]:
        """Return the steps that waited, and store them."""
        self._store_waiting()
        taken, self._waited = self._waited, []
        return taken

    def _store(self, step: Step) -> None:
        """Store a record, after those of the steps that wait."""
        if self.stepped and not (self.steps and self.steps[-1] is step):
            self._store_waiting()
            self.steps.append(step)

    def _store_waiting(self) -> None:
        """Store the steps that wait in the simulator's world."""
        waited = super().take_waiting()
        self._waited += waited
        self.steps += [step for tables in waited for step in tables.steps()]

    def listen_within(self, after: Callable[[], object]) -> AbstractContextManager[None]:
        """Call ``after`` after every step within the block, also where the client has no instance to hook."""
        return nullcontext()
