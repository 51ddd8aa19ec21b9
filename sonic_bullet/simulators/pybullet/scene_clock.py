"""The clock that a scene reads: the simulation's, where this package owns the process.

    import time, datetime in the script and in modules below its folder -> stand-ins of the modules
        -> SceneClock while a scene runs, else the real clock

    step(dt)    now += dt, less what the script has waited for it                   render, film, play, compare, doctor
    sleep(d)    now += d                                                               own the process; `attach` does
    look()      now += 2 µs, so that a loop that only looks ends                       not, and nothing is touched there

Loops mean the same seconds whether they step until the clock says 2 s, wait (look, sleep) for each step's time to come,
or sleep for as long as their steps were. So a step is first paid with what was waited before it, and a sleep with the
steps before it that were not; a wait of over a quarter of a second is a pause and pays for nothing. Computing takes no
time, so that modes that are solved meanwhile, or a slow machine, change no bit of the sound. The standard library,
installed packages and this package keep the real clock.
"""

from __future__ import annotations

import builtins
import datetime as real_datetime
import sys
import sysconfig
import time as real_time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

LOOK_S = 2e-6
"""What a look at the clock takes: about one round of a loop of Python that looks and compares."""
PAUSE_S = 0.25
"""A longer wait is a pause, not the pace of a loop: policies and controllers run at 4 Hz and more."""
EPOCH_S = 946_684_800
"""When every scene begins: 2000-01-01 00:00 UTC, so that a seed that is made of the date is the same each time."""
UPTIME_S = 86_400
"""What `monotonic` and `perf_counter` begin with: a day, as a machine's that has run for a while."""
NS = 1_000_000_000


class SceneClock:
    """The time of one scene.

    Attributes
    ----------
    now_s
        Since it began.
    on_wait
        Called with the seconds of every wait: real-time simulation steps meanwhile. None: nobody is.
    looks
        How often each line (file, line) has looked.
    real_time
        The lines that turned real-time simulation on.
    """

    def __init__(self) -> None:
        self.now_s = 0.0
        self.on_wait: Callable[[float], None] | None = None
        self.looks: Counter[tuple[str, int]] = Counter()
        self.real_time: set[tuple[str, int]] = set()
        self._paid_s = 0.0  # waited, and not yet stepped
        self._ahead_s = 0.0  # stepped since the last sleep, and not waited for
        self._waited_s = 0.0  # since the last step
        self._stepped = False

    def look(self) -> float:
        """Return the time since the scene began in s, and let a little pass."""
        caller = sys._getframe(2)
        self.looks[caller.f_code.co_filename, caller.f_lineno] += 1
        self._wait(LOOK_S)
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        """Let time pass."""
        if duration_s < 0:
            raise ValueError("sleep length must be non-negative")
        if self._stepped:
            self._paid_s, self._stepped = 0.0, False
        known_s = min(duration_s, self._ahead_s) if duration_s <= PAUSE_S else 0.0
        self._ahead_s = 0.0
        self._wait(max(duration_s - known_s, LOOK_S))

    def step(self, dt_s: float) -> None:
        """Take in a physics step of that length."""
        paid_s = min(self._paid_s, dt_s)
        self._paid_s -= paid_s
        self.now_s += dt_s - paid_s
        self._ahead_s += dt_s - paid_s
        self._waited_s, self._stepped = 0.0, True

    def _wait(self, duration_s: float) -> None:
        self.now_s += duration_s
        self._waited_s += duration_s
        self._paid_s = self._paid_s + duration_s if self._waited_s <= PAUSE_S else 0.0
        if self.on_wait is not None:
            self.on_wait(duration_s)


_running: list[SceneClock] = []


def running_clock() -> SceneClock | None:
    """Return the clock of the scene that runs, None where none does."""
    return _running[-1] if _running else None


@contextmanager
def scene_clock(scene: Path) -> Iterator[SceneClock]:
    """Let a scene and the modules below its folder read the simulation's clock within the block."""
    clock, folder = SceneClock(), scene.resolve().parent
    importing, owned = builtins.__import__, dict[str, bool]()

    def of_scene(file: object) -> bool:
        if not isinstance(file, str):
            return False
        if file not in owned:
            owned[file] = _belongs(Path(file), folder)
        return owned[file]

    def imported(
        name: str,
        globals: Mapping[str, object] | None = None,
        locals: Mapping[str, object] | None = None,
        fromlist: Any = (),
        level: int = 0,
    ) -> Any:
        if level == 0 and name in STAND_INS and globals is not None and of_scene(globals.get("__file__")):
            return STAND_INS[name]
        return importing(name, globals, locals, fromlist, level)

    _running.append(clock)
    try:
        with patch.object(builtins, "__import__", imported):
            yield clock
    finally:
        _running.remove(clock)


def _belongs(file: Path, folder: Path) -> bool:
    """Tell whether a module's file is the scene's own: below its folder, of no installation and not of ours."""
    file = file.resolve()
    installed = {"site-packages", "dist-packages"} & set(file.parts)
    libraries = [Path(sysconfig.get_path(one)).resolve() for one in ("stdlib", "platstdlib")]
    others = {Path(__file__).resolve().parents[2], *libraries} & set(file.parents)
    return folder in file.parents and not installed and not others


def _with(real: ModuleType, names: Mapping[str, Any]) -> ModuleType:
    """Return a module like ``real``, of which some names are ours."""
    made = ModuleType(real.__name__, real.__doc__)
    vars(made).update({**vars(real), **names})
    return made


def _seconds(real: Callable[[], float], begin_s: int) -> Callable[[], float]:
    def read() -> float:
        clock = running_clock()
        return real() if clock is None else begin_s + clock.look()

    return read


def _nanoseconds(real: Callable[[], int], begin_s: int) -> Callable[[], int]:
    def read() -> int:
        clock = running_clock()
        return real() if clock is None else begin_s * NS + round(clock.look() * NS)

    return read


def _sleep(seconds: float) -> None:
    clock = running_clock()
    return real_sleep(seconds) if clock is None else clock.sleep(seconds)


real_sleep = real_time.sleep


class _DatetimeKind(type):
    """What others made is an instance, too."""

    def __instancecheck__(cls, one: object) -> bool:
        return isinstance(one, real_datetime.datetime)


class SceneDatetime(real_datetime.datetime, metaclass=_DatetimeKind):
    """`datetime.datetime` whose present is the scene's."""

    @classmethod
    def now(cls, tz: real_datetime.tzinfo | None = None) -> SceneDatetime:
        """Return the scene's present."""
        clock = running_clock()
        return cls.fromtimestamp(real_time.time() if clock is None else EPOCH_S + clock.look(), tz)

    @classmethod
    def today(cls) -> SceneDatetime:
        """Return the scene's present, local."""
        return cls.now()

    @classmethod
    def utcnow(cls) -> SceneDatetime:
        """Return the scene's present in UTC, without a zone."""
        return cls.now(real_datetime.UTC).replace(tzinfo=None)


_CLOCKS: dict[str, Any] = {
    "time": _seconds(real_time.time, EPOCH_S),
    "monotonic": _seconds(real_time.monotonic, UPTIME_S),
    "perf_counter": _seconds(real_time.perf_counter, UPTIME_S),
    "time_ns": _nanoseconds(real_time.time_ns, EPOCH_S),
    "monotonic_ns": _nanoseconds(real_time.monotonic_ns, UPTIME_S),
    "perf_counter_ns": _nanoseconds(real_time.perf_counter_ns, UPTIME_S),
    "sleep": _sleep,
}
STAND_INS: dict[str, ModuleType] = {
    "time": _with(real_time, _CLOCKS),
    "datetime": _with(real_datetime, {"datetime": SceneDatetime}),
}
