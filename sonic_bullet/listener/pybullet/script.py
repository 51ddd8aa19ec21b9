"""Run an ordinary PyBullet script as it stands, with ears and without a window.

While it runs, pybullet.connect turns every window into DIRECT, stepSimulation tells the hooks and counts physics time,
disconnect waits, and time.sleep returns at once (with real-time simulation on, it steps for as long as it would have
slept). The script ends where it ends, or at the step that completes ``seconds``. Everything is put back afterwards.
"""

from __future__ import annotations

import functools
import sys
import time
import traceback
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pybullet
from pybullet_utils.bullet_client import BulletClient

from sonic_bullet.files.reading import refuse_lfs_pointer
from sonic_bullet.listener.pybullet.clients import disconnect as end
from sonic_bullet.listener.pybullet.colliding.given_bodies import ENDERS, MAKERS, begin, remembering
from sonic_bullet.listener.quiet import quiet_stdout
from sonic_bullet.machine.worker import mark_step, stop_word
from sonic_bullet.records.errors import SceneError, SonicBulletError, exception_words

ClientHook = Callable[[int], None]
MOST_CLIENTS = 1024
"""As many as PyBullet has room for (its MAX_PHYSICS_CLIENTS)."""


class _TimeIsUp(BaseException):
    """Unwinds the user's script; no `except Exception` of theirs catches it."""


@contextmanager
def own_clients() -> Iterator[None]:
    """Clients that are opened while this lasts end with it: a script's that stays open would be client 0 to the next
    script's calls, which name none.
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
    return {number for number in range(MOST_CLIENTS) if pybullet.isConnected(number)}


def run_script(
    path: str | Path,
    hooks: tuple[ClientHook, ClientHook | None] | ClientHook | None,
    seconds: float,
    *,
    names: dict[str, Any] | None = None,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Any]:
    """Run a script for at most ``seconds`` of physics time; its top-level names.

    hooks: (before, after) each step, or after alone, called with the client id of the first client that steps. Clients
    that the script opened stay connected, so that what it built can be looked at. names: a dictionary that its
    top-level names go into, there also when it breaks. progress: given the share of ``seconds`` that is done. Raises
    SceneError that names the line where the script breaks, what the hooks raise, and SceneError where the file cannot
    be read or a client is stepped that the script did not open.
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
    with (
        _stage(before, after, seconds, progress) as observed,
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
            if stop_word():  # what an interrupt became on its way out
                raise KeyboardInterrupt(stop_word()) from error
            if isinstance(error, SystemExit) and not error.code and observed:
                return names
            lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
            raise SceneError(
                f"scene '{path.name}' line {lines[-1] if lines else 1}: {exception_words(error)}",
                "mend the scene",
            ) from error
    return names


@contextmanager
def _stage(
    before: ClientHook | None, after: ClientHook | None, seconds: float, progress: Callable[[float], None] | None
) -> Iterator[list[int]]:
    """Gives a list that the client is in once it steps."""
    real_connect, real_step = pybullet.connect, pybullet.stepSimulation
    opened: set[int] = set()
    observed: list[int] = []
    real_time: set[int] = set()
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
        if not observed:
            if physicsClientId not in opened:
                raise SceneError(
                    f"the scene steps client {physicsClientId}, which it did not open",
                    "connect in it, and disconnect what was open before it, where its calls go that name no client",
                )
            observed.append(physicsClientId)
        if physicsClientId != observed[0]:
            mark_step()
            return real_step(physicsClientId=physicsClientId)
        if elapsed_s >= seconds - 1e-9:
            raise _TimeIsUp
        if before is not None:
            before(physicsClientId)
        dt = pybullet.getPhysicsEngineParameters(physicsClientId=physicsClientId)["fixedTimeStep"]
        result = real_step(physicsClientId=physicsClientId)
        mark_step()
        elapsed_s += dt
        if after is not None:
            after(physicsClientId)
        if progress is not None:
            progress(min(elapsed_s / seconds, 1.0))
        if elapsed_s >= seconds - 1e-9:
            raise _TimeIsUp
        return result

    def disconnect(physicsClientId: int = 0) -> None:
        return None

    def set_real_time(enableRealTimeSimulation: int, physicsClientId: int = 0) -> None:
        (real_time.add if enableRealTimeSimulation else real_time.discard)(physicsClientId)

    def sleep(duration: float) -> None:
        for client in real_time:
            dt = pybullet.getPhysicsEngineParameters(physicsClientId=client)["fixedTimeStep"]
            for _ in range(max(1, round(duration / dt))):
                step(client)

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
        "disconnect": disconnect,
        "setRealTimeSimulation": set_real_time,
        "addUserDebugParameter": add_slider,
        "readUserDebugParameter": read_slider,
        **{name: remembering(name, getattr(pybullet, name)) for name in (*MAKERS, *ENDERS)},
    }
    forward = BulletClient.__getattr__

    def forward_stand_ins(self: Any, name: str) -> Any:
        """BulletClient passes its client id to built-in functions only, and ours are none."""
        if name in stand_ins and name != "connect":
            return functools.partial(stand_ins[name], physicsClientId=self._client)
        return forward(self, name)

    with (
        patch.dict(vars(pybullet), stand_ins),
        patch.object(BulletClient, "__getattr__", forward_stand_ins),
        patch.object(time, "sleep", sleep),
    ):
        yield observed
