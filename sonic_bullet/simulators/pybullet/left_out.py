"""Bodies and contacts that the sound leaves out; each is reported once, as a warning and as a note.

muted
    a body whose pose, speed, mass or inertia is no longer a number: its record ends, its contacts are dropped, its
    modes decay. It stays muted until it is removed or added anew, even where its numbers come back, as its state is
    not known then.
soft
    a soft body: PyBullet reports neither its mass nor its speed (its answer is uninitialised memory), so it neither
    sounds nor strikes.

A contact whose force or place is not a number is dropped, and its pair reported once.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.errors import SceneWarning
from sonic_bullet.records.simulated import with_body_id
from sonic_bullet.simulators.frames import LINK_SPAN
from sonic_bullet.simulators.polling import Touches


class BodiesLeftOut:
    """The bodies left out of one world. notes: the messages, in order."""

    def __init__(self) -> None:
        self.muted: set[int] = set()
        self.soft: set[int] = set()
        self.notes: list[str] = []
        self._pairs: set[tuple[int, int]] = set()

    def mute(self, bodies: Mapping[int, str], what: str) -> None:
        """Leave bodies, by id and name, out from now on. what: their fault."""
        self.muted.update(bodies)
        who = ", ".join(with_body_id(name, body) for body, name in bodies.items())
        subject, be, them = (f"{who} has", "it is", "it") if len(bodies) == 1 else (f"{who} have", "they are", "them")
        self._say(
            f"{subject} {what}: {be} mute until removed or added anew; check mass, inertia and what touches {them}"
        )

    def meet_soft(self, soft: Mapping[int, str]) -> None:
        """Note the soft bodies of the world, by id and name."""
        for body, name in soft.items():
            if body not in self.soft:
                self._say(
                    f"{with_body_id(name, body)} is soft: PyBullet tells neither its mass nor its speed, so it "
                    "neither sounds nor strikes"
                )
        self.soft = set(soft)

    def meet_drawn(self, body: int, name: str) -> None:
        """Note a body whose visual shape replaces its collision shape."""
        who = with_body_id(name, body)
        self.say_once(f"{who} sounds as what is drawn, which fills the same space: how it was made was not seen")

    def say_once(self, text: str) -> None:
        """Report something that the sound leaves out, once."""
        if text not in self.notes:
            self._say(text)

    def forget(self, body: int | None) -> None:
        """Drop a removed body (None: all); its id may be reused."""
        for group in (self.muted, self.soft):
            group.intersection_update(() if body is None else group - {body})
        self._pairs = {pair for pair in self._pairs if body is not None and body not in pair}

    def name_pairs(self, touches: Touches) -> None:
        """Report the pairs of these contacts, except those of bodies left out already."""
        for a, b in zip(touches.code_a // LINK_SPAN, touches.code_b // LINK_SPAN, strict=True):
            pair = int(min(a, b)), int(max(a, b))
            if pair not in self._pairs and not (self.muted | self.soft).intersection(pair):
                self._pairs.add(pair)
                self._say(
                    f"a contact of bodies {pair[0]} and {pair[1]} holds a force or place that is not a "
                    "number, or beyond 1e9: left out; check both masses"
                )

    def mark_contacts(self, touches: Touches) -> Array:
        """Mark the contacts (k,) of a body that is left out."""
        out = list(self.muted | self.soft)
        return np.isin(touches.code_a // LINK_SPAN, out) | np.isin(touches.code_b // LINK_SPAN, out)

    def _say(self, text: str) -> None:
        self.notes.append(text)
        warnings.warn(text, SceneWarning, stacklevel=3)
