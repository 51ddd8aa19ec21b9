"""Bodies in a world and their poses, read from PyBullet before a step and checked to be numbers.

getNumBodies -> the roster, kept while no body comes or goes -> poses and twists -> Motion; bodies with other numbers
    are muted (left_out)
"""

from __future__ import annotations

from collections.abc import Callable, Collection

import pybullet

from sonic_bullet.records import Body
from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators.frames import NO_NUMBER, Motion, Roster, decode
from sonic_bullet.simulators.polling import Touches
from sonic_bullet.simulators.pybullet import body_facts as facts
from sonic_bullet.simulators.pybullet.left_out import BodiesLeftOut
from sonic_bullet.simulators.pybullet.poses import StateReader, body_ids, check_connected, read_roster
from sonic_bullet.simulators.pybullet.questions import no_answer_error


class Census:
    """Roster of one client. on_roster is called with each new roster, on_mute with the bodies muted from now on."""

    def __init__(
        self, client_id: int, on_roster: Callable[[Roster], None], on_mute: Callable[[Collection[int]], None]
    ) -> None:
        self._client_id = client_id
        self._reader: StateReader | None = None
        self._on_roster, self._on_mute = on_roster, on_mute
        self.left_out = BodiesLeftOut()

    @property
    def reader(self) -> StateReader | None:
        """What asks for poses; another one once a body has come or gone, or may be another than before."""
        return self._reader

    hooked = False
    """Whether hooks see who moves a body: see `moved`."""

    def note_move(self) -> None:
        """Note that a body was moved by hand."""
        if self._reader is not None:
            self._reader.forget()

    def stale(self) -> None:
        """Read the roster anew before the next poses."""
        self._reader = None

    def read(self) -> Motion:
        """Read poses and twists; SceneError where the connection is lost."""
        motion = self._read_raw()
        while motion.broken:
            self._mute(motion.broken, NO_NUMBER)
            motion = self._read_raw()
        return motion

    def usable(self, touches: Touches) -> Touches:
        """Select contacts whose numbers are usable and whose bodies are not left out."""
        if not len(touches):
            return touches
        kept = touches.usable
        if not kept.all():
            self.read()  # reports the bodies whose poses this step has broken
            self.left_out.name_pairs(touches.select(~kept))
        if self.left_out.muted or self.left_out.soft:
            kept &= ~self.left_out.mark_contacts(touches)
        return touches if kept.all() else touches.select(kept)

    def describe(self, code: int, epoch: int) -> Body | None:
        """Return the silent record of a link; None, and mute it, where mass or inertia cannot be."""
        body, link = decode(code)
        if body in self.left_out.muted:
            return None
        try:
            return facts.describe(self._client_id, body, link, epoch)
        except SceneError:
            self._mute([body], "a mass or inertia that cannot be")
            return None

    def _known_reader(self) -> StateReader:
        reader = self._reader
        if reader is None or reader.roster.count != _count(self._client_id):
            self.left_out.muted.intersection_update(body_ids(self._client_id))
            roster = read_roster(self._client_id, self.left_out.muted)
            self._reader = reader = StateReader(self._client_id, roster, hooked=self.hooked)
            self.left_out.meet_soft({body: self._name(body) for body in roster.soft})
            self._on_roster(roster)
        return reader

    def _read_raw(self) -> Motion:
        reader = self._known_reader()
        try:
            return reader.read()
        except pybullet.error:
            check_connected(self._client_id)
            self._reader = None
            return self._known_reader().read()

    def _mute(self, bodies: Collection[int], what: str) -> None:
        self._reader = None
        self._on_mute(bodies)
        self.left_out.mute({body: self._name(body) for body in bodies}, what)

    def _name(self, body: int) -> str:
        return facts.link_name(self._client_id, body, -1)


def _count(client_id: int) -> int:
    """Count the bodies; raises SceneError."""
    try:
        return int(pybullet.getNumBodies(client_id))
    except pybullet.error as error:
        raise no_answer_error(client_id, error) from None
