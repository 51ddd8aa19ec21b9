"""What numba asks again and again while it types kernels, asked once; it stands on inner parts of numba.

    kernel -> numba's passes, without those for what no kernel has (closures, unrolled literals)
           -> types: a + b of two doubles is looked for among all that "+" may be the first time only

Nothing here says anything about code: the same types, the same machine code, in two thirds of the time.
"""

from __future__ import annotations

from types import CodeType
from typing import Any

from numba import types
from numba.core.compiler import Flags

NEEDLESS = {
    "InlineClosureLikes", "MakeFunctionToJitFunction", "InlineInlinables", "FindLiterallyCalls", "LiteralUnroll",
    "LiteralPropagationSubPipelinePass", "RewriteDynamicRaises", "DumpParforDiagnostics",
}  # fmt: skip
"""Passes for code within code, for `literally` and `literal_unroll`, for functions that are inlined as they are typed,
and for raising what is computed.
"""
PLAIN = (types.Number, types.Boolean, types.Array, types.Record)
"""What a call is remembered for: types that say everything."""


class QuickFlags(Flags):  # type: ignore[misc]
    """numba's options of a compilation, which it compares some hundred thousand times: those that are set, first."""

    _HASH = hash(Flags())

    def __hash__(self) -> int:
        return self._HASH

    def __eq__(self, other: object) -> bool:
        same = isinstance(other, Flags) and self._values == other._values
        return same or bool(super().__eq__(other))


class Typing:
    """A typing context that remembers what calls of plain types are."""

    def __init__(self, context: Any, known: dict[Any, Any]) -> None:
        self._context, self._known = context, known

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def refresh(self) -> None:
        """Nothing: the kernel that began has done it."""

    def resolve_function_type(self, function: Any, arguments: Any, keywords: Any) -> Any:
        """The signature of a call; as numba's, it also says which code is meant."""
        if keywords or not all(isinstance(types.unliteral(one), PLAIN) for one in arguments):
            return self._context.resolve_function_type(function, arguments, keywords)
        key = function, tuple(arguments)
        found = self._known.get(key)
        if found is None:
            signature = self._context.resolve_function_type(function, arguments, keywords)
            kind = function if isinstance(function, types.Type) else self._context._lookup_global(function)
            if signature is not None and isinstance(kind, types.BaseFunction):
                self._known[key] = signature, kind, kind._impl_keys[signature.args]
            return signature
        signature, kind, code = found
        kind._impl_keys[signature.args] = code
        return signature


class RememberingTarget:
    """A target context that is up to date."""

    def __init__(self, context: Any) -> None:
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def refresh(self) -> None:
        """Nothing: the kernel that began has done it."""


def without_needless(pipelines: list[Any], code: CodeType) -> list[Any]:
    """numba's passes for a function that has no code within its code."""
    if not any(isinstance(constant, CodeType) for constant in code.co_consts):
        for pipeline in pipelines:
            pipeline.passes = [one for one in pipeline.passes if one[0].__name__ not in NEEDLESS]
    return pipelines
