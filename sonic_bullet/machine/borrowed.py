"""Arrays without reference count for a kernel's helpers: the same memory.

numba counts references of each array that one compiled function passes to another, atomically: some 5 ns a time and a
third of a kernel whose parts are small. A borrowed array has nothing to count, nor has a slice of it.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def borrowed(typingctx, value):
    """Return an array, or a tuple of arrays and others, without its count.

    Only for an argument of the kernel: its caller keeps the memory.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return without_count(context, builder, signature.return_type, args[0])

    return value(value), codegen


def without_count(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Write the code of `borrowed` for a value of a type."""
    if isinstance(kind, types.Array):
        view = cgutils.create_struct_proxy(kind)(context, builder, value=value)
        for owner in ("meminfo", "parent"):
            setattr(view, owner, cgutils.get_null_value(getattr(view, owner).type))
        return view._getvalue()
    if isinstance(kind, types.BaseTuple):
        parts = cgutils.unpack_tuple(builder, value, len(kind))
        bare = [without_count(context, builder, one, part) for one, part in zip(kind.types, parts, strict=True)]
        return context.make_tuple(builder, kind, bare)
    return value
