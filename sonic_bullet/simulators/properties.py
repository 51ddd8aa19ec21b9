"""Properties of engine and links for the log: names, values when a record begins, and later changes.

the simulator's answers + values that hooks saw being set -> Body.dynamics, Simulator.engine -> Change, where one
is set otherwise
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import replace

from sonic_bullet.records import Body
from sonic_bullet.records.arrays import store
from sonic_bullet.records.simulated import Change, Simulator, Values, finite
from sonic_bullet.simulators.frames import decode
from sonic_bullet.simulators.names import Names, match_name


class SetValues:
    """Values set on engine and links since hooks are installed; a simulator does not report all of them when asked."""

    def __init__(self) -> None:
        self.engine: dict[str, float] = {}
        self._links: dict[int, dict[int | None, dict[str, float]]] = {}

    def set_engine(self, values: dict[str, object]) -> None:
        """Store values set on the engine."""
        self.engine |= finite(values)

    def set_link(self, body: int, link: int, values: dict[str, object]) -> None:
        """Store values set on a link."""
        # Values that PyBullet has once for a body, whatever link they are set on
        of_whole_body = ("linearDamping", "angularDamping")
        for name, value in finite(values).items():
            whom = None if name in of_whole_body else link
            self._links.setdefault(body, {}).setdefault(whom, {})[name] = value

    def of(self, body: int, link: int) -> Values:
        """Return the values set on a link."""
        links = self._links.get(body, {})
        return links.get(None, {}) | links.get(link, {})

    def forget(self, body: int | None = None) -> None:
        """Drop the values of a body; None: of all bodies, and of the engine, which has its defaults again."""
        if body is None:
            self.engine.clear()
            self._links.clear()
        else:
            self._links.pop(body, None)


class Properties:
    """Names and properties in one world. ask_link, ask_engine: query the simulator."""

    def __init__(self, ask_link: Callable[[int, int], Values], ask_engine: Callable[[], Values]) -> None:
        self.names = Names()
        self.set_values = SetValues()
        self._ask_link, self._ask_engine = ask_link, ask_engine
        self._engine: Values = {}
        self._now: dict[int | None, Values] = {}
        self._changes: dict[tuple[int, int | None], dict[str, float | None]] = {}

    def begin(self, code: int, index: int, record: Body) -> Body:
        """Return the record of a link with its name and all values known; index: its own among the bodies."""
        dynamics = {**self.set_values.of(*decode(code)), **record.dynamics}
        self._now[index] = dynamics
        made = copy(record) if record.dynamics == dynamics else replace(record, dynamics=dynamics)
        name = self.names.of(code, record.name)
        store(made, name=name, silent=match_name(name, self.names.silent) is not None)
        return made

    def end(self, indices: Iterable[int]) -> None:
        """End these records."""
        for index in indices:
            self._now.pop(index, None)

    def first_step(self) -> None:
        """Read the engine's settings, with which the first step is made."""
        self._engine = self._now[None] = self._engine_now()

    def link_changed(self, code: int, index: int, step: int) -> None:
        """Note that values of a link were set before that step."""
        body, link = decode(code)
        self._note(index, {**self.set_values.of(body, link), **self._ask_link(body, link)}, step)

    def engine_changed(self, step: int) -> None:
        """Note that values of the engine were set before that step; those before the first are no change."""
        if None in self._now:
            self._note(None, self._engine_now(), step)

    def simulator(self, versions: dict[str, str]) -> Simulator:
        """Return engine, versions and changes so far."""
        changes = tuple(Change(step, index, values) for (step, index), values in self._changes.items())
        return Simulator(self._engine, versions, changes)

    def _engine_now(self) -> Values:
        return {**self.set_values.engine, **self._ask_engine()}

    def _note(self, index: int | None, now: Values, step: int) -> None:
        before = self._now.get(index, {})
        other = {name: now.get(name) for name in {**before, **now} if before.get(name) != now.get(name)}
        self._now[index] = now
        if other:
            self._changes.setdefault((step, index), {}).update(other)
