"""What touches what in a step, as PyBullet tells it: asked for once, or read sub-step by sub-step from Bullet's log."""

from __future__ import annotations

import pybullet

from sonic_bullet.listener.polling import Touches, gather, loaded
from sonic_bullet.listener.pybullet.census import ask
from sonic_bullet.listener.pybullet.substeps import SubstepLog, gather_substeps
from sonic_bullet.records.errors import SceneError


class ContactReader:
    """State of that for one client: the contact points of this step and the one before, and the sub-step log."""

    def __init__(self, client_id: int) -> None:
        self.client_id = client_id
        self._points = self._points_before = ask(client_id, pybullet.getContactPoints)
        self._log = SubstepLog(client_id)

    def prepare(self, substeps: int) -> None:
        """Before a step of so many sub-steps: more than one need the log. Raises SceneError where it cannot be."""
        if substeps > 1 and not self._log.is_open:
            self._log.open()

    def touches(self, dt_s: float, substeps: int) -> Touches:
        """Loaded contacts of the step just made. Raises SceneError: lost connection, sub-steps that cannot be heard."""
        last = ask(self.client_id, pybullet.getContactPoints)
        if substeps == 1:
            if self._log.is_open:
                self._log.close()
            if last != self._points:  # polled twice, it tells the same twice
                self._points_before, self._points = self._points, last
            return gather(loaded(last, self._points_before), dt_s)
        if not self._log.is_open:
            self._log.open()
            raise SceneError(
                f"numSubSteps was set to {substeps} after listening began",
                "set it before attaching, or attach to a BulletClient, whose steps are hooked",
            )
        touches, self._log.count = gather_substeps(self._log.records(), last, dt_s, substeps, self._log.count)
        return touches

    def close(self) -> None:
        """End the log and remove its file; harmless where there is none."""
        self._log.close()

    def abandon(self) -> None:
        """Forget a log that Bullet has ended itself, or whose client has gone."""
        self._log.abandon()
