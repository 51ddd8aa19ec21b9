"""See every step of a MuJoCo world, also those that one call makes.

    mujoco.mj_step(model, data, nstep) -> watchers of data: before_step, one step, tell_step, nstep times

`mj_step` and `mj_step2` of the module are replaced while anybody listens: gymnasium's environments, dm_control and
scripts call them there. A script that imported a function by name before is not observed; it calls `Listener.step`.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any, Protocol

import mujoco


class StepWatcher(Protocol):
    """What is called around each step."""

    def before_step(self) -> None:
        """Prepare for a step that is about to be made."""

    def tell_step(self) -> None:
        """Take the step just made."""


_watchers: dict[int, list[weakref.ref[Any]]] = {}
_real: dict[str, Callable[..., Any]] = {}


def watch(data: Any, watcher: StepWatcher) -> Callable[[], None]:
    """Call a watcher around every step of an MjData, while it lives; return what ends it, harmless when ended."""
    key, here = id(data), mujoco
    if not _watchers:
        _real.update({name: getattr(here, name) for name in ("mj_step", "mj_step2")})
        vars(here).update(mj_step=_step, mj_step2=_step2)
    one = weakref.ref(watcher, lambda dead: _leave(key, dead))
    _watchers.setdefault(key, []).append(one)
    return lambda: _leave(key, one)


def _leave(key: int, one: weakref.ref[Any]) -> None:
    mine = _watchers.get(key, [])
    if one in mine:
        mine.remove(one)
        if not mine:
            del _watchers[key]
        if not _watchers and mujoco.mj_step is _step:
            vars(mujoco).update(_real)


def _step(m: Any, d: Any, nstep: int = 1) -> None:
    if id(d) not in _watchers:
        _real["mj_step"](m, d, nstep)
        return
    for _ in range(nstep):
        _watch_step(_real["mj_step"], m, d)


def _step2(m: Any, d: Any) -> None:
    _watch_step(_real["mj_step2"], m, d)


def _watch_step(step: Callable[..., object], m: Any, d: Any) -> None:
    watchers = [one for one in (ref() for ref in _watchers.get(id(d), [])) if one is not None]
    for one in watchers:
        one.before_step()
    step(m, d)
    for one in watchers:
        one.tell_step()
