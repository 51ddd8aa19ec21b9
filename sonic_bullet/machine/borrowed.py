"""Arrays without reference count for a kernel's helpers: the same memory.

numba counts references of each array that one compiled function passes to another, atomically: some 5 ns a time and a
third of a kernel whose parts are small. A borrowed array has nothing to count, nor has a slice of it.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from typing import Any

from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def borrowed(typingctx, array):
    """Return the array without its count. Only for an argument of the kernel: its caller keeps the memory."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        view = cgutils.create_struct_proxy(signature.return_type)(context, builder, value=args[0])
        for owner in ("meminfo", "parent"):
            setattr(view, owner, cgutils.get_null_value(getattr(view, owner).type))
        return view._getvalue()

    return array(array), codegen
