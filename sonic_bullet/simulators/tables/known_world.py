"""What worlds share whose bodies are `KnownBodies`: records and names, and rows of contacts for links met anew.

START of a step -> known.enter -> Memory.made: rows; a link in its first contact -> its record, and once more
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

from sonic_bullet.records import Array, Body
from sonic_bullet.records.simulated import Simulator
from sonic_bullet.simulators.frames import encode
from sonic_bullet.simulators.known_bodies import KnownBodies
from sonic_bullet.simulators.memory import Memory
from sonic_bullet.simulators.polling import Touches
from sonic_bullet.simulators.properties import Properties
from sonic_bullet.simulators.start import LEFT_OUT
from sonic_bullet.simulators.world import World


class KnownWorld(World):
    """A `World` that keeps its records itself. properties: names and values set; step_count: steps so far."""

    properties: Properties
    step_count: int
    _known: KnownBodies
    _memory: Memory

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies ever met, as Contacts.a and Contacts.b count them; only the living where not `logged`."""
        return tuple(self._known.records.values())

    @property
    def records(self) -> Mapping[int, Body]:
        """The same by index."""
        return self._known.records

    @property
    def living(self) -> tuple[Body, ...]:
        """Those of `bodies` whose records have not ended."""
        return tuple(self._known.records[index] for index in self._known.live.values())

    def versions(self) -> dict[str, str]:
        """Return the versions of the simulator, by name."""
        return {}

    @property
    def simulator(self) -> Simulator:
        """Settings and versions of the simulator, and what changed, as far as it is told."""
        return self.properties.simulator(self.versions())

    def silence(self, names: Collection[str]) -> None:
        """Mark as `silent`, from now on, records of links, or of all links of bodies, of these names."""
        self.properties.names.silent = frozenset(names)

    def call(self, body: int, link: int, name: str) -> None:
        """Give a link a name; SceneError where another living link has it."""
        self.properties.names.call(self._code(body, link), name)

    def _code(self, body: int, link: int) -> int:
        return int(encode(body, link))

    def _close(self, codes: Collection[int]) -> None:
        """End the records of links."""
        self.properties.end(self._known.live[code] for code in codes if code in self._known.live)
        self._known.close(codes, self.step_count, keep=self.logged)

    def _append(self, code: int, record: Body) -> Body:
        record = self.properties.begin(code, self._known.count, record)
        self._known.append(code, record)
        return record

    def _rows(
        self,
        start: Array,
        touches: Touches,
        past_touches: Touches | None,
        dt_s: float,
        silent: Callable[[int], Body | None],
    ) -> tuple[Array, int]:
        """Return rows of contacts and their number; silent(code): the record of a link met for the first time."""
        memory, known = self._memory, self._known
        known.enter(start)
        row, made = memory.fill_contacts(known, start, touches, past_touches, dt_s)
        if made < 0:
            for code in start["code"][start["met"] != 0].tolist():
                record = silent(code)
                if record is not None:
                    self._append(code, replace(record, since_step=self.step_count))
            known.enter(start)
            start["index"][start["index"] < 0] = LEFT_OUT
            row, made = memory.fill_contacts(known, start, touches, past_touches, dt_s)
        return row, made
