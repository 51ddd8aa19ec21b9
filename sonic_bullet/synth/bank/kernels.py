"""How the bank's kernels are compiled. They allocate nothing, so nobody counts references: each array that crosses a
call would cost nanoseconds.
"""

from __future__ import annotations

from sonic_bullet.machine.compiled import njit

uncounted = njit(nogil=True, error_model="numpy", _nrt=False)
