"""A `World` whose steps are tables: poses and twists at the start of a step, and what touched during it.

    who derives: described(body, link) -> Body        made_step(Motion, Touches) -> Step
    Motion (n links) + TOUCH (k contacts) -> START -> records of links in their first contact
                                             START -> CONTACT rows in body frames -> Step

The same tables as PyBullet's (listener.memory, known_bodies, start, rows). A contact given is a contact: nothing is
taken for asleep or made inside another.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sonic_bullet.records import Array, Body, Material, ModalModel, Shape
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.mounting import Mounting
from sonic_bullet.records.simulated import Values, with_body_id
from sonic_bullet.simulators.frames import LINK_SPAN, Motion, Roster, decode, encode
from sonic_bullet.simulators.known_bodies import KnownBodies, sounding_body
from sonic_bullet.simulators.memory import Memory
from sonic_bullet.simulators.polling import Touches
from sonic_bullet.simulators.properties import Properties
from sonic_bullet.simulators.start import hooked_start
from sonic_bullet.simulators.tables.known_world import KnownWorld
from sonic_bullet.simulators.tables.soft_impacts import SoftImpacts


class MotionWorld(KnownWorld):
    """Records, names and steps of a world that is read as tables; no body is ever removed."""

    impacts: SoftImpacts | None = None
    """Where contacts are soft: the impacts under way."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Clear all state, as before the first step."""
        self.step_count = 0
        self.stepped = False
        self._known = KnownBodies()
        self._memory = Memory()
        self._added: dict[int, dict[str, Any]] = {}
        self.properties = Properties(self.dynamics_of, self.engine)
        self._past: Motion | None = None

    @property
    @abstractmethod
    def roster(self) -> Roster:
        """The links in the world."""

    @abstractmethod
    def describe(self, body: int, link: int) -> Body:
        """Return the silent record of a link.

        Raises
        ------
        SceneError
            There is no such link.
        """

    def own(self, body: int, link: int) -> tuple[int, int]:
        """Return (body, link) as records have them, where a user may say it otherwise; raises SceneError."""
        return body, link

    def dynamics_of(self, body: int, link: int) -> Values:
        """Return the properties of a link under the simulator's names."""
        return self.describe(body, link).dynamics

    def engine(self) -> Values:
        """Return the settings of the simulator."""
        return {}

    @property
    def untouched(self) -> frozenset[int]:
        """Ids of the bodies in the world that have had no contact yet."""
        return frozenset(one for one, _, _ in self.roster.bodies) - {one.body_id for one in self.living}

    @property
    def has_bodies(self) -> bool:
        """Whether there is any body in the world."""
        return bool(self.roster.bodies)

    def all_links(self) -> tuple[tuple[int, int], ...]:
        """List (body, link) of every link in the world."""
        return tuple(decode(code) for code in self.roster.code.tolist())

    def name_of(self, body: int, link: int = -1) -> str:
        """Return a link's name and its body's id for messages; raises SceneError."""
        record = self.describe(*self.own(body, link))
        called = self.properties.names.name_link(self._code(body, link), record.name)
        return with_body_id(called, record.body_id)

    def record_names(self, links: Sequence[tuple[int, int, str | None]]) -> list[str]:
        """Return the names that records of links (body, link, given name) would have if all were added now."""
        return self.properties.names.predict_names(
            [(self._code(body, link), self.describe(body, link).name, given) for body, link, given in links]
        )

    def add(
        self,
        body: int,
        link: int = -1,
        *,
        material: Material | None = None,
        model: ModalModel | None = None,
        shapes: Sequence[Shape] = (),
        options: ModalOptions | None = None,
        mounting: Mounting | None = None,
    ) -> Body:
        """Register a link with its material or model; return its record. See `World.add`."""
        how: dict[str, Any] = {"material": material, "model": model, "shapes": tuple(shapes)}
        how |= {"options": options, "mounting": mounting}
        code = self._code(body, link)
        record = replace(sounding_body(self.describe(body, link), **how), since_step=self.step_count)
        self._close([code])
        self._added.pop(code, None)
        self._added[code] = how
        return self._append(code, record)

    def reset(self) -> None:
        """Restart with the links added: see `World.reset`."""
        added, before = self._added, self.properties
        self.begin()
        before.names.hand_over(added, self.properties.names)
        self._added = added
        for code, how in added.items():
            self._append(code, sounding_body(self.describe(*decode(code)), **how))

    def unhook(self) -> None:
        """Do nothing: there is no hook."""

    def made_step(
        self,
        now: Motion,
        touches: Touches,
        dt_s: float,
        gravity_m_s2: tuple[float, ...],
        moved: Collection[int] = (),
    ) -> Step:
        """Return the record of a step.

        Parameters
        ----------
        now
            At its start.
        touches
            Loaded contacts; all numbers are finite.
        dt_s, gravity_m_s2
            Its length, and gravity during it.
        moved
            Ids of bodies set elsewhere by hand since the step before.
        """
        if self._past is None:
            self.properties.first_step()
        start = hooked_start(self._past, now, moved, dt_s)
        start["born"] = 0
        row, made = self._rows(start, touches, None, dt_s, lambda code: self.describe(*decode(code)))
        if self.impacts is not None:
            row = self._collect_rows(row[:made], dt_s, gravity_m_s2)
            made = len(row)
        step = self._memory.unusual(self._known, start, row, made, dt_s, gravity_m_s2)
        self._past, self.stepped = now, True
        self.step_count += 1
        return step

    def empty_step(self, dt_s: float, gravity_m_s2: tuple[float, ...]) -> Step:
        """Return a step in which nothing happened, and say that there was none (`stepped`)."""
        self.stepped = False
        return self._memory.empty_step(dt_s, gravity_m_s2)

    def _collect_rows(self, row: Array, dt_s: float, gravity_m_s2: tuple[float, ...]) -> Array:
        """Return the rows that a step gives out, of bodies whose records have not ended."""
        assert self.impacts is not None
        records = self._known.records
        masses = [
            (records[a].mass_kg, records[b].mass_kg) for a, b in zip(row["a"].tolist(), row["b"].tolist(), strict=True)
        ]
        lighter = np.array([min(one or two, two or one) for one, two in masses], float)
        row = self.impacts.collect(row, dt_s, gravity_m_s2, lighter)
        there = np.isin(row["a"], self._known.body) & np.isin(row["b"], self._known.body)
        return row if there.all() else row[there]

    def _code(self, body: int, link: int) -> int:
        return int(encode(*self.own(body, link)))


def roster_of(code: Sequence[int], static: Sequence[bool]) -> Roster:
    """Make a roster of links, ascending in code; static: mass 0."""
    bodies = tuple((one, 0, False) for one in dict.fromkeys(one // LINK_SPAN for one in code))
    return Roster(bodies, np.array(code, np.int64), np.array(static, bool), count=len(bodies))
