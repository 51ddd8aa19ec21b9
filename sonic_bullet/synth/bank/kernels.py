"""How the bank's kernels are compiled. They allocate nothing, so nobody counts references: each array that crosses a
call would cost nanoseconds. Inner ones have no door to Python, which takes longer to compile than they do.
"""

from __future__ import annotations

from typing import Any

from sonic_bullet.machine.compiled import njit

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}

outer = njit(**_OPTIONS)
"""Called from Python too."""
inner = njit(**_OPTIONS, no_cpython_wrapper=True)
"""Called from other kernels alone."""
merged = njit(**_OPTIONS, no_cpython_wrapper=True, inline="always")
"""Written into its one caller: a kernel within a kernel is optimised once more at every level."""
