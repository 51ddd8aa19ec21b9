"""Store the contact log of a run, and the frames not read yet.

    StepTables -> StepLog -> LogSteps             frame -> unread frames -> read

Both are spools, in memory only while they are short. Where the disk is full the run continues: a warning and a note say
that no more is stored, and what was stored stays.
"""

from __future__ import annotations

import warnings

from sonic_bullet.files.rows.log_steps import LogSteps, StepLog
from sonic_bullet.files.storage.spooled_sound import SoundSpool
from sonic_bullet.machine.package_version import find_version
from sonic_bullet.records import Array
from sonic_bullet.records.contacts import Event
from sonic_bullet.records.errors import FileError, SceneError, SceneWarning
from sonic_bullet.records.step_tables import StepTables


class RunRecorder:
    """The log, its events, and unread frames of so many channels.

    Attributes
    ----------
    count
        Number of steps so far.
    notes
        What is no longer stored, and why.
    unsaid
        Those notes without a warning yet.
    """

    def __init__(self, channels: int, *, keep_log: bool) -> None:
        self.events: list[Event] = []
        self.notes: tuple[str, ...] = ()
        self.unsaid: tuple[str, ...] = ()
        self._channels = channels
        self._log = StepLog("attach with keep_log=False") if keep_log else None
        self._unread = SoundSpool(channels, "call read() more often")
        self.count = 0
        self._moved: frozenset[int] = frozenset()
        self._given_up: set[str] = set()

    def steps_made(self, steps: StepTables) -> None:
        """Store steps, and an event for each body moved by hand before one of them and not before the last one."""
        begin, self.count = self.count, self.count + len(steps)
        if self._log is None:
            return
        if self._moved or steps.teleported.any():
            for number, mask in enumerate(steps.teleported, begin):
                moved = frozenset(steps.body[mask].tolist())
                for body in sorted(moved - self._moved):
                    self.event("moved", body, number)
                self._moved = moved
        if "contact log" not in self._given_up:
            try:
                self._log.append(steps)
            except FileError as error:
                self.give_up("contact log", error)

    def event(self, kind: str, body: int | None = None, step: int | None = None) -> None:
        """Store an event before that step, None: the next; body: the one concerned, None: all."""
        if self._log is not None and "contact log" not in self._given_up:
            self.events.append(Event(kind, self.count if step is None else step, body))

    @property
    def has_log(self) -> bool:
        """Whether the log has every step so far."""
        return self._log is not None and "contact log" not in self._given_up

    def frame(self, frame: Array) -> None:
        """Store a frame (channels, n) until it is read."""
        if "unread frames" not in self._given_up:
            try:
                self._unread.add(frame)
            except FileError as error:
                self.give_up("unread frames", error)

    def read(self) -> Array:
        """Return all frames (channels, n) since the last read."""
        unread, self._unread = self._unread, SoundSpool(self._channels, self._unread.instead)
        self._given_up.discard("unread frames")
        return unread.finish().samples()

    def steps(self) -> LogSteps:
        """Return the steps so far; SceneError where the log is not kept."""
        if self._log is None:
            raise SceneError("the contact log is not kept", "attach with keep_log=True")
        return self._log.steps()

    def give_up(self, what: str, error: FileError) -> None:
        """Note, once, that no more of it is stored."""
        if what not in self._given_up:
            self._given_up.add(what)
            note = f"from step {self.count} on the {what} {'are' if what.endswith('s') else 'is'} not kept: {error}"
            self.notes, self.unsaid = (*self.notes, note), (*self.unsaid, note)

    def say(self) -> None:
        """Warn of the new notes, at the end of a step, as a warning may be raised as an error."""
        notes, self.unsaid = self.unsaid, ()
        for note in notes:
            warnings.warn(note, SceneWarning, stacklevel=4)


def package_versions() -> dict[str, str]:
    """Return the versions of the packages that a render's numbers depend on."""
    return {name: find_version(name) for name in ("sonic_bullet", "numpy")}
