"""A kernel and all kernels it calls, optimised and made machine code once; it stands on inner parts of numba, and
`sonic_bullet.machine.compiled` does without where they moved.

    kernel called by Python    -> Whole: its code and that of all below it, linked, optimised together, kept
    kernel called by a kernel  -> Part: typed and written down, no more

numba itself optimises a kernel with all that it calls, makes machine code of that, and links it into each of its
callers, which are optimised with it anew: code six calls deep is compiled six times. Which of the two a kernel is hangs
on who asks, so it may be both.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from typing import Any

import numba
from llvmlite import binding
from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags


class _Environments:
    """Stands where a part's code generator would be told where its constants lie: kept until its code has a place."""

    def __init__(self) -> None:
        self.found: list[tuple[str, Any]] = []

    def set_env(self, name: str, environment: Any) -> None:
        self.found.append((name, environment))


class _Bare:
    """A part without what it calls, as numba links it."""

    def __init__(self, part: Part) -> None:
        self.part, self._reload_init = part, part._reload_init

    def _ensure_finalized(self) -> None:
        self.part._ensure_finalized()

    def _get_module_for_linking(self) -> Any:
        return self.part.own_module()


class _Linking(JITCodeLibrary):  # type: ignore[misc]
    def add_linking_library(self, library: Any) -> None:
        """Link parts one by one, each once, whoever calls them."""
        if isinstance(library, Part):
            for bare in library.closure():
                if bare not in self._linking_libraries:
                    self._linking_libraries.append(bare)
        else:
            super().add_linking_library(library)


class Part(_Linking):
    """Code as it was written down, neither optimised nor loaded."""

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self.bare, self.environments = _Bare(self), _Environments()
        self._owned = False

    @property
    def codegen(self) -> Any:
        return self.environments

    def closure(self) -> Iterator[Any]:
        """The part, and what it links."""
        yield self.bare
        yield from self._linking_libraries

    def own_module(self) -> Any:
        """Its functions, to be merged with equal ones and dropped where nobody calls them."""
        module = self._final_module
        for function in () if self._owned else module.functions:
            if not function.is_declaration and function.linkage == binding.Linkage.external:
                function.linkage = binding.Linkage.linkonce_odr
        self._owned = True
        return module

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout

    def finalize(self) -> None:
        """Say that no more is written: there is nothing to be made of it here."""
        self._raise_if_finalized()
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """All of it, for a caller that knows nothing of parts."""
        module = self.own_module().clone()
        for library in self._linking_libraries:
            module.link_in(library._get_module_for_linking(), preserve=True)
        return module

    def get_pointer_to_function(self, name: str) -> int:
        return 0


class Whole(_Linking):
    """Code that Python calls, with all that it calls."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout  # it is optimised with the rest

    def _finalize_specific(self) -> None:
        super()._finalize_specific()
        there = {variable.name for variable in self._final_module.global_variables}
        for library in self._linking_libraries:
            for name, environment in library.part.environments.found if isinstance(library, _Bare) else ():
                if name in there:
                    self._codegen.set_env(name, environment)

    def serialize_using_object_code(self) -> tuple[str, str, tuple[bytes, bytes]]:
        """Machine code, and the names in it; nobody links it, so what it was made of is not kept."""
        self._ensure_finalized()
        names = [f.name for f in self._final_module.functions if not f.is_declaration]
        text = "".join(f'define void @"{name}"() {{\n ret void\n}}\n' for name in names)
        return self.name, "object", (self._get_compiled_object(), binding.parse_assembly(text).as_bitcode())


class _Flags(Flags):  # type: ignore[misc]
    """numba's options of a compilation, which it compares some hundred thousand times: those that are set, first."""

    _HASH = hash(Flags())

    def __hash__(self) -> int:
        return self._HASH

    def __eq__(self, other: object) -> bool:
        same = isinstance(other, Flags) and self._values == other._values
        return same or bool(super().__eq__(other))


class _Compiler(Compiler):  # type: ignore[misc]
    library: type[_Linking]

    def define_pipelines(self) -> Any:
        state = self.state
        if state.library is None:
            state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()
        return super().define_pipelines()


class _WholeCompiler(_Compiler):
    library = Whole

    def compile_extra(self, function: Callable[..., Any]) -> Any:
        """As numba has it, but for the collector: it would look for garbage among millions of objects that stay."""
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(function)
        finally:
            if collects:
                gc.enable()


class _PartCompiler(_Compiler):
    library = Part


def linked_once(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """The function as a kernel. Raises whatever numba's inner parts raise where they are not what they were."""
    inner = {**options, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    kernel = numba.njit(**{**options, "no_cfunc_wrapper": True}, pipeline_class=_WholeCompiler)(function)
    part = numba.njit(**inner, pipeline_class=_PartCompiler)(function)
    for one in (kernel, part):
        one._compiler._customize_flags = _Flags
    ask, overload = part.get_call_template, part.get_overload

    def get_call_template(arguments: Any, keywords: Any) -> Any:
        """As numba has it, but for numbers that stand in the code: they are no types of their own."""
        return ask(
            tuple(types.unliteral(one) for one in arguments),
            {name: types.unliteral(one) for name, one in keywords.items()},
        )

    kernel.get_call_template, kernel.get_overload = get_call_template, overload
    return kernel
