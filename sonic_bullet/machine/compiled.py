"""numba's njit for every kernel of this package, with machine code cached between processes in a private folder.

    @njit(...) -> kernel -> first call: kept? -> machine code
                                      no      -> compiled, kept

numba's own cache=True keeps code beside the source or in a shared folder and trusts what it reads there. Here code is
kept in a folder of this user (NUMBA_CACHE_DIR/sonic_bullet, else the user's cache folder), and what cannot be read
there is compiled anew (`sonic_bullet.machine.kept_code`). Where there is no such folder, kernels are compiled in every
process.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba

from sonic_bullet.storage.user_folder import cache_folder, private_folder, start_folder

KNOWN_NUMBA = ["0", "68"]
"""The release of numba whose inner parts `whole_program_jit` uses. With any other, numba's own compilation is used: the
same results, a first run that takes three times as long.
"""


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Apply numba.njit with these options; the machine code is cached."""

    def compiled(function: Callable[..., Any]) -> Any:
        kernel = _kernel(function, options)
        place = folder()
        if place is not None:
            with suppress(Exception):  # numba's inner parts have changed: the kernel is compiled in every process
                from sonic_bullet.machine.kept_code import KernelCache

                kernel._cache = KernelCache(function, place)
        return kernel

    return compiled


def _kernel(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    known = numba.__version__.split(".")[:2] == KNOWN_NUMBA
    if known and os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0"):
        with suppress(Exception):
            from sonic_bullet.machine.whole_program_jit import whole_program_jit

            return whole_program_jit(function, options)
    return numba.njit(**options)(function)


@cache
def folder() -> Path | None:
    """Return the folder of machine code; None for none."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return private_folder(start_folder / given / "sonic_bullet")
    return cache_folder("compiled")
