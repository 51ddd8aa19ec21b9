"""The run time's first stages by themselves: steps in, pulses out, so that a test sees every strike."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet._engine import CONTACT_PATCH, LOOKAHEAD, SPAN, STRIKE, enter_loads, find_pulses, orient
from sonic_bullet.engine.bank.resonator import build_resonator
from sonic_bullet.engine.runtime.body_table import BodyTable
from sonic_bullet.engine.runtime.channels.body_images import BodyImages
from sonic_bullet.engine.runtime.synthesis_state import TouchingPairs, Window
from sonic_bullet.engine.runtime.tables import CONTACT, PAIR, PULSE, ROW, WINDOW, StepScratch
from sonic_bullet.records import Air, Array, Body
from sonic_bullet.records.contacts import Contacts, Step


def packed(contacts: Contacts) -> Array:
    """The contacts as a table."""
    table = np.zeros(len(contacts), CONTACT)
    for name in CONTACT.names or ():
        table[name] = getattr(contacts, name)
    return table


def body_table(bodies: Sequence[Body], sr: int = 48_000) -> BodyTable:
    """The bodies, without residuals."""
    table = BodyTable()
    for body in bodies:
        table.add(build_resonator(body, (), sr, Air()), np.zeros(0, np.int64), 0)
    return table


class Stages:
    """Rows of four steps, the pairs and their loads; room for ``pairs`` of them and for ``rows`` contacts a step."""

    def __init__(self, bodies: Sequence[Body], pairs: int = 64, rows: int = 256) -> None:
        self.table, self.number, self._most, b = body_table(bodies), 0, rows, len(bodies)
        self.window = Window(
            np.zeros(SPAN, WINDOW), np.zeros((SPAN, b, 3)), np.zeros((SPAN, b, 4)), np.zeros((SPAN, b), bool),
            np.zeros(SPAN * rows, ROW),
        )  # fmt: skip
        self.pairs = TouchingPairs(
            np.zeros(pairs, PAIR), np.zeros(pairs, np.int64), np.array([0, pairs]), np.arange(pairs),
            np.zeros((pairs, 2, 0)), np.zeros(pairs, CONTACT_PATCH),
        )  # fmt: skip
        self.strikes, self.pulses = np.zeros(pairs, STRIKE), np.zeros(2 * pairs, PULSE)
        self.modal_impulse = np.zeros((2 * pairs, 2, self.table.columns))
        self.scratch = StepScratch(pulse=self.pulses, modal_impulse=self.modal_impulse)
        self._steps: list[Step] = []

    def enter(self, step: Step) -> None:
        """The newest step's rows and loads."""
        place = self.number % SPAN
        first = place * self._most
        stop = first + len(step.contacts)
        orient(packed(step.contacts), step.quaternion_xyzw, self.window.row[first:stop])
        self.window.step[place] = step.dt_s, step.gravity_m_s2, (first, stop)
        self.window.quaternion_xyzw[place, : len(step.quaternion_xyzw)] = step.quaternion_xyzw
        enter_loads(self.window.row, first, stop, step.dt_s, self.pairs)
        self._steps = [*self._steps[-LOOKAHEAD:], step]
        self.number += 1

    @property
    def rendered(self) -> int:
        """Number of the step being rendered."""
        return self.number - 1 - LOOKAHEAD

    def pulses_of(self, ahead: int, found: int = 0) -> int:
        """Their number with those of the step ``ahead`` of the one being rendered; ask with 0 first."""
        window = self.window, BodyImages()
        number = self.rendered + ahead
        return find_pulses(ahead, number, found, window, self.table, self.pairs, self.strikes, self.scratch)

    def take(self, step: Step) -> tuple[Array, Array]:
        """Pulses (q,) and their Uᵀj (q, 2, columns) of the step rendered when this one has come, and of the one after
        it: nothing while too few are known.
        """
        self.enter(step)
        if len(self._steps) <= LOOKAHEAD:
            return self.pulses[:0].copy(), self.modal_impulse[:0].copy()
        moved = np.flatnonzero(self._steps[1].teleported)
        self.table.bodies["placed"][moved] = self.number - LOOKAHEAD
        found = self.pulses_of(1, self.pulses_of(0))
        return self.pulses[:found].copy(), self.modal_impulse[:found].copy()
