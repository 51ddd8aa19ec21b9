"""Where bodies were: as far back as sound may still come from."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sonic_bullet._engine import FARTHEST_M
from sonic_bullet.records import Array

SMALLEST = 256


@dataclass(slots=True, eq=False)
class PoseHistory:
    """time_s (h,) and position_m (h, b, 3) of the starts of steps so far, those of ``first`` … ``stop`` in use."""

    time_s: Array = field(default_factory=lambda: np.zeros(SMALLEST))
    position_m: Array = field(default_factory=lambda: np.zeros((SMALLEST, 0, 3)))
    first: int = 0
    stop: int = 0

    def append(self, time_s: Array, position_m: Array, speed_m_s: float) -> None:
        """Append starts of steps (k,), (k, b, 3); what is older than sound from the farthest body may be goes."""
        if self.stop + len(time_s) > len(self.time_s):
            oldest_s = (self.time_s[self.stop - 1] if self.stop else 0.0) - FARTHEST_M / speed_m_s
            self.first = max(self.first, int(np.searchsorted(self.time_s[: self.stop], oldest_s)) - 1)
            held = self.stop - self.first
            size = max(SMALLEST, 2 * (held + len(time_s)))
            times, places = np.zeros(size), np.zeros((size, *self.position_m.shape[1:]))
            times[:held], places[:held] = self.known_places()
            self.time_s, self.position_m, self.first, self.stop = times, places, 0, held
        here = slice(self.stop, self.stop + len(time_s))
        self.time_s[here], self.position_m[here] = time_s, position_m
        self.stop = here.stop

    def known_places(self) -> tuple[Array, Array]:
        """Return times (h,) and places (h, b, 3)."""
        return self.time_s[self.first : self.stop], self.position_m[self.first : self.stop]

    def with_bodies(self, position_m: Array) -> None:
        """Add bodies (k, 3), which came where they are."""
        came = np.broadcast_to(position_m, (len(self.time_s), *position_m.shape))
        self.position_m = np.concatenate([self.position_m, came], axis=1)

    def copy(self) -> PoseHistory:
        """Copy the history."""
        return PoseHistory(self.time_s.copy(), self.position_m.copy(), self.first, self.stop)
