"""Run an ordinary PyBullet script unchanged, hooked and without a window.

While it runs, pybullet.connect opens DIRECT in place of a window, stepSimulation calls the hooks and counts physics
time, disconnect waits, and the script reads the simulation's clock (`scene_clock`): a sleep returns at once, and with
real-time simulation on, each wait steps for as long as it lasts. The script ends at its end, or at the step that
completes ``seconds``. All functions are restored afterwards.
"""

from __future__ import annotations

import sys
import time
import traceback
import weakref
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pybullet
from pybullet_utils.bullet_client import BulletClient

from sonic_bullet.files.storage.reading import refuse_lfs_pointer
from sonic_bullet.machine.progress import report_fraction
from sonic_bullet.machine.worker import mark_step, stop_word
from sonic_bullet.records.errors import SceneError, SonicBulletError, exception_words
from sonic_bullet.simulators.pybullet.clients import disconnect as end
from sonic_bullet.simulators.pybullet.colliding.given_bodies import ENDERS, MAKERS, begin, remember_arguments
from sonic_bullet.simulators.pybullet.hooks import replaced_functions
from sonic_bullet.simulators.pybullet.scene_clock import SceneClock, real_sleep, running_clock, scene_clock
from sonic_bullet.simulators.quiet import quiet_stdout

ClientHook = Callable[[int], None]


class _TimeIsUp(BaseException):
    """Ends the user's script; no `except Exception` of the script catches it."""


@contextmanager
def own_clients() -> Iterator[None]:
    """Disconnect at the end of the block the clients that were opened in it.

    A client that stays open would be client 0 of the next script's calls without a client id.
    """
    before, objects, init = _open_clients(), weakref.WeakSet[BulletClient](), BulletClient.__init__

    def made(client: Any, *args: Any, **kwargs: Any) -> None:
        init(client, *args, **kwargs)
        objects.add(client)

    try:
        with patch.object(BulletClient, "__init__", made):
            yield
    finally:
        for client in list(objects):
            end(client)
        for number in _open_clients() - before:
            pybullet.disconnect(number)
            begin(number)


def _open_clients() -> set[int]:
    most_clients = 1024  # limit of PyBullet's clients (its MAX_PHYSICS_CLIENTS)
    return {number for number in range(most_clients) if pybullet.isConnected(number)}


def run_script(
    path: str | Path,
    hooks: tuple[ClientHook, ClientHook | None] | ClientHook | None,
    seconds: float,
    *,
    names: dict[str, Any] | None = None,
    client: int | None = None,
    others: Counter[int] | None = None,
) -> dict[str, Any]:
    """Run a script for at most ``seconds`` of physics time.

    Clients that the script opened stay connected, so that its world can be inspected.

    Parameters
    ----------
    hooks
        (before, after) each step, or after alone, called with the client id of the client that is listened to.
    names
        A dictionary to receive the script's top-level names, also where it fails.
    client
        Id of the client that is listened to; None: the first that steps.
    others
        Receives how many steps every other client made.

    Returns
    -------
    dict
        The script's top-level names.

    Raises
    ------
    SceneError
        The script fails (it names the line), its file cannot be read, or it steps a client that it did not open. What
        the hooks raise passes through.
    """
    path = Path(path)
    refuse_lfs_pointer(path, SceneError)
    try:
        code = compile(path.read_bytes(), str(path), "exec")
    except OSError as error:
        raise SceneError(f"scene '{path}' cannot be read: {error.strerror}", "give the path of a Python file") from None
    except (SyntaxError, ValueError) as error:
        raise SceneError(
            f"scene '{path.name}' line {getattr(error, 'lineno', None) or 1}: {error}", "mend the scene"
        ) from None
    before, after = hooks if isinstance(hooks, tuple) else (None, hooks)
    names = {} if names is None else names
    names |= {"__name__": "__main__", "__file__": str(path), "__builtins__": __builtins__}
    running = running_clock()
    with (
        nullcontext(running) if running is not None else scene_clock(path) as clock,
        _stage(before, after, seconds, clock, client, Counter() if others is None else others) as observed,
        patch.object(sys, "argv", [str(path)]),
        patch.object(sys, "path", [str(path.resolve().parent), *sys.path]),
    ):
        try:
            exec(code, names)
        except _TimeIsUp:
            pass
        except (SonicBulletError, KeyboardInterrupt):
            raise
        except BaseException as error:
            if stop_word():  # an interrupt that became another exception
                raise KeyboardInterrupt(stop_word()) from error
            if isinstance(error, SystemExit) and not error.code and observed:
                return names
            lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
            raise SceneError(
                f"scene '{path.name}' line {lines[-1] if lines else 1}: {exception_words(error)}",
                "mend the scene",
            ) from error
    return names


def _stay_connected(physicsClientId: int = 0) -> None:
    """Stand in for `disconnect`: the world is looked at afterwards."""


class _RealTime:
    """Clients with real-time simulation on, which step for as long as the script waits. steps: whether one does now."""

    def __init__(self, clock: SceneClock, step: Callable[[int], object]) -> None:
        self.steps = False
        self._clock, self._step = clock, step
        self._due_s: dict[int, float] = {}  # of each client, what it has not yet stepped

    def switch(self, enableRealTimeSimulation: int, physicsClientId: int = 0) -> None:
        """Do what setRealTimeSimulation is called for."""
        if enableRealTimeSimulation:
            caller = sys._getframe(1)
            self._clock.real_time.add((caller.f_code.co_filename, caller.f_lineno))
            self._due_s.setdefault(physicsClientId, 0.0)
        else:
            self._due_s.pop(physicsClientId, None)
        self._clock.on_wait = self._wait if self._due_s else None

    def _wait(self, duration_s: float) -> None:
        shortest_s = 1e-4  # of steps: so long nobody is asked for the length of one
        for client in list(self._due_s):
            self._due_s[client] += duration_s
            if self._due_s[client] < shortest_s or self.steps:
                continue
            dt_s = pybullet.getPhysicsEngineParameters(physicsClientId=client)["fixedTimeStep"]
            self.steps = True
            try:
                while self._due_s[client] >= dt_s - 1e-12:
                    self._due_s[client] -= dt_s
                    self._step(client)
            finally:
                self.steps = False


@contextmanager
def _stage(
    before: ClientHook | None,
    after: ClientHook | None,
    seconds: float,
    clock: SceneClock,
    client: int | None,
    others: Counter[int],
) -> Iterator[list[int]]:
    """Replace PyBullet's functions; yield a list that gets the client's id once it steps.

    client, others: as of `run_script`.
    """
    real_connect, real_step = pybullet.connect, pybullet.stepSimulation
    opened: set[int] = set()
    observed: list[int] = []
    sliders: list[float] = []
    elapsed_s = 0.0

    def connect(method: int = pybullet.DIRECT, *_: Any, **__: Any) -> int:
        with quiet_stdout():
            number = int(real_connect(pybullet.DIRECT))
        opened.add(number)
        begin(number)
        return number

    def step(physicsClientId: int = 0) -> Any:
        nonlocal elapsed_s
        if physicsClientId not in opened and not observed:
            raise SceneError(
                f"the scene steps client {physicsClientId}, which it did not open",
                "connect in it, and disconnect what was open before it, where its calls go that name no client",
            )
        if not observed and client in (None, physicsClientId):
            observed.append(physicsClientId)
        if physicsClientId not in observed:
            others[physicsClientId] += 1
            mark_step()
            return real_step(physicsClientId=physicsClientId)
        if elapsed_s >= seconds - 1e-9:
            raise _TimeIsUp
        if before is not None:
            before(physicsClientId)
        dt = pybullet.getPhysicsEngineParameters(physicsClientId=physicsClientId)["fixedTimeStep"]
        result = real_step(physicsClientId=physicsClientId)
        mark_step()
        if not waiting.steps:
            clock.step(dt)
        elapsed_s += dt
        if after is not None:
            after(physicsClientId)
        report_fraction(min(elapsed_s / seconds, 1.0))
        if elapsed_s >= seconds - 1e-9:
            raise _TimeIsUp
        return result

    waiting = _RealTime(clock, step)

    def sleep(duration: float) -> None:
        """Sleep, for code of other packages; that of the standard library and of this package sleeps indeed."""
        caller = str(sys._getframe(1).f_globals.get("__name__", "")).partition(".")[0]
        (real_sleep if caller in sys.stdlib_module_names or caller == "sonic_bullet" else clock.sleep)(duration)

    def add_slider(
        paramName: str = "", rangeMin: float = 0, rangeMax: float = 1, startValue: float = 0, physicsClientId: int = 0
    ) -> int:
        sliders.append(float(startValue))
        return len(sliders) - 1

    def read_slider(itemUniqueId: int, physicsClientId: int = 0) -> float:
        return sliders[itemUniqueId]

    stand_ins: dict[str, Callable[..., Any]] = {
        "connect": connect,
        "stepSimulation": step,
        "disconnect": _stay_connected,
        "setRealTimeSimulation": waiting.switch,
        "addUserDebugParameter": add_slider,
        "readUserDebugParameter": read_slider,
        **{name: remember_arguments(name, getattr(pybullet, name)) for name in (*MAKERS, *ENDERS)},
    }
    with (
        patch.dict(vars(pybullet)),  # what the script itself replaces ends with it
        replaced_functions(stand_ins),
        patch.object(time, "sleep", sleep),
    ):
        yield observed
