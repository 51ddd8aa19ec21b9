"""Machine code of the run time, made before the first step: where none is cached, by two processes.

arguments of driver.advance_steps -> types of those of its stages -> each stage compiled by one of the two
    -> the driver: linked with them, optimised, cached
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numba
from numba import types

from sonic_bullet.machine.progress import show_stage
from sonic_bullet.parallel import parallel_map
from sonic_bullet.render import driver

STAGES = (driver.excite, driver.ring, driver.finish, driver.take, driver.settle)
"""Stages, the slowest to compile first. Whatever types they get here, the driver compiles those that it needs."""
SAMPLES = types.Array(types.float64, 1, "C")
INNER = {
    **dict.fromkeys(("slot", "number", "quench", "found", "drives", "start"), types.int64),
    "x": SAMPLES,
    "force": SAMPLES.copy(ndim=2),
}
"""Arguments of stages that are not those of the driver with the same name."""
OF_A_STEP = ("position", "quaternion", "teleported")
"""Arguments of `take` for one step, of the driver for many."""


def make_driver(arguments: Sequence[Any]) -> None:
    """Load or compile the driver's machine code for such arguments."""
    kinds = tuple(numba.typeof(one) for one in arguments)
    with show_stage("machine code of the run time"):
        with suppress(Exception):  # numba's inner parts have changed: one process compiles
            _make_stages(kinds)
        driver.advance_steps.compile(kinds)


def _make_stages(kinds: tuple[Any, ...]) -> None:
    from sonic_bullet.machine.linked_once import is_kept, name_apart, take_in, write, written

    if is_kept(driver.advance_steps, kinds):
        return
    process = os.getpid()

    def do(stage: Any) -> bytes | None:
        """Compile a stage; return its code to the first process, which has its own."""
        here, stage_kinds = os.getpid() == process, stage_types(stage, kinds)
        if not here:
            name_apart()
        write(stage, stage_kinds)
        return None if here else written(stage, stage_kinds)

    for stage, content in zip(STAGES, parallel_map(do, STAGES), strict=True):
        if content is not None:
            take_in(stage, content)


def stage_types(stage: Any, kinds: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the types of a stage's arguments where the driver's have the types ``kinds``."""
    known = dict(zip(_names(driver.advance_steps.py_func), kinds, strict=True))
    known |= INNER | {"step": known["steps"].dtype}
    if stage is driver.take:
        known |= {name: known[name].copy(ndim=known[name].ndim - 1) for name in OF_A_STEP}
    return tuple(known[name] for name in _names(stage.py_func))


def _names(function: Callable[..., Any]) -> list[str]:
    return list(inspect.signature(function).parameters)
