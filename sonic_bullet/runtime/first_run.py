"""Machine code of the run time, made before the first step: where none is cached, by two processes.

values of driver.advance_steps -> types of its groups -> each stage compiled by one of the two
    -> the driver: linked with them, optimised, cached
"""

from __future__ import annotations

import inspect
import os
from contextlib import suppress
from typing import Any

import numba
from numba import types

from sonic_bullet.machine.grouping import group_types
from sonic_bullet.machine.progress import show_stage
from sonic_bullet.parallel import parallel_map
from sonic_bullet.runtime import driver
from sonic_bullet.runtime.groups import Groups

STAGES = (driver.excite, driver.ring, driver.finish, driver.take, driver.track_supports)
"""Stages, the slowest to compile first. Whatever types they get here, the driver compiles those that it needs."""


def make_driver(values: tuple[Any, ...]) -> None:
    """Load or compile the driver's machine code for such values."""
    kinds = numba.typeof(values)
    with show_stage("machine code of the run time"):
        with suppress(Exception):  # numba's inner parts have changed: one process compiles
            _make_stages(kinds)
        driver.advance_steps.compile((kinds,))


def _make_stages(kinds: Any) -> None:
    from sonic_bullet.machine.whole_program_jit import is_kept, name_apart, take_in, write, written

    if is_kept(driver.advance_steps, (kinds,)):
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


def stage_types(stage: Any, kinds: Any) -> tuple[Any, ...]:
    """Return the types of a stage's arguments where the driver's values have the types ``kinds``."""
    # arguments of stages that are not groups
    inner = {
        **dict.fromkeys(("i", "number", "quench"), types.int64),
        "x": types.Array(types.float64, 1, "C"),
        "sr": types.float64,
    }
    known = inner | dict(zip(Groups._fields, group_types(Groups, kinds.types), strict=True))
    known["step"] = known["given"].types[0].dtype
    return tuple(known[name] for name in inspect.signature(stage.py_func).parameters)
