"""How the bank's kernels are compiled: they allocate nothing, so references are not counted.

Counting would cost nanoseconds for each array that crosses a call.
"""

from __future__ import annotations

from sonic_bullet.machine.compiled import njit

uncounted = njit(nogil=True, error_model="numpy", _nrt=False)
