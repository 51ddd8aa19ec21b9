"""Whole-program jit: a kernel and all kernels it calls, optimised and compiled once.

    kernel called by Python    -> Whole: its code and that of all below it, linked, optimised together, kept
    kernel called by a kernel  -> Part: typed and lowered, no more; two processes may do so for one Whole

numba itself optimises a kernel with all that it calls, compiles that, and links it into each of its callers, which are
optimised with it anew: code six calls deep is compiled six times. Which of the two a kernel is depends on its caller,
so it may be both. This uses inner parts of numba, and `sonic_bullet.machine.compiled` does without in any release but
the one that they are known of.
"""

from __future__ import annotations

import gc
import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pickle import loads
from typing import Any

import numba
from llvmlite import binding
from numba import types
from numba.core.bytecode import FunctionIdentity
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, compile_result
from numba.core.serialize import dumps

from sonic_bullet.machine.progress import show_stage


class _Environments:
    """Store of a part's constants, in place of the code generator: kept until its code has a place."""

    def __init__(self) -> None:
        self.found: list[tuple[str, Any]] = []

    def set_env(self, name: str, environment: Any) -> None:
        """Store a constant's environment."""
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
        """Link parts one by one, each once, whatever calls them."""
        if isinstance(library, Part):
            for bare in library.closure():
                if bare not in self._linking_libraries:
                    self._linking_libraries.append(bare)
        else:
            super().add_linking_library(library)


class Part(_Linking):
    """Lowered code, neither optimised nor loaded."""

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self.bare, self.environments = _Bare(self), _Environments()
        self._owned = False

    @property
    def codegen(self) -> Any:
        """The store of constants, in place of the code generator."""
        return self.environments

    def closure(self) -> Iterator[Any]:
        """Yield the part, and what it links."""
        yield self.bare
        yield from self._linking_libraries

    def own_module(self) -> Any:
        """Return its functions, to be merged with equal ones and dropped where they are not called."""
        module = self._final_module
        for function in () if self._owned else module.functions:
            if not function.is_declaration and function.linkage == binding.Linkage.external:
                function.linkage = binding.Linkage.linkonce_odr
        self._owned = True
        return module

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout

    def finalize(self) -> None:
        """Mark the part as complete; nothing is compiled here."""
        self._raise_if_finalized()
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """Return all of it, for a caller that does not know parts."""
        module = self.own_module().clone()
        for library in self._linking_libraries:
            module.link_in(library._get_module_for_linking(), preserve=True)
        return module

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: a part has no address."""
        return 0

    def serialize_using_object_code(self) -> tuple[str, bytes]:
        """Return what another process needs to link it."""
        return self.name, self._get_module_for_linking().as_bitcode()


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
        """Return machine code, and the names in it; it is never linked, so its sources are not kept."""
        self._ensure_finalized()
        names = [f.name for f in self._final_module.functions if not f.is_declaration]
        text = "".join(f'define void @"{name}"() {{\n ret void\n}}\n' for name in names)
        return self.name, "object", (self._get_compiled_object(), binding.parse_assembly(text).as_bitcode())


class _Compiler(Compiler):  # type: ignore[misc]
    library: type[_Linking]

    def define_pipelines(self) -> Any:
        """Compile into a library of this compiler's kind."""
        state = self.state
        if state.library is None:
            state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()
        return super().define_pipelines()


class _WholeCompiler(_Compiler):
    library = Whole

    def compile_extra(self, function: Callable[..., Any]) -> Any:
        """Compile, with progress shown."""
        with _undisturbed(), show_stage(f"compiling {function.__name__}"):
            return super().compile_extra(function)


class _PartCompiler(_Compiler):
    library = Part


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Switch off garbage collection while kernels are compiled: it would take a sixth of the time."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def whole_program_jit(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Make the function a kernel; its ``part`` is what kernels call.

    Raises whatever numba's inner parts raise where they have changed.
    """
    inner = {**options, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    kernel = numba.njit(**{**options, "no_cfunc_wrapper": True}, pipeline_class=_WholeCompiler)(function)
    part = numba.njit(**inner, pipeline_class=_PartCompiler)(function)
    ask = part.get_call_template

    def get_call_template(arguments: Any, keywords: Any) -> Any:
        """Call numba's, with literal numbers as plain types."""
        return ask(
            tuple(types.unliteral(one) for one in arguments),
            {name: types.unliteral(one) for name, one in keywords.items()},
        )

    kernel.get_call_template, kernel.get_overload, kernel.part = get_call_template, part.get_overload, part
    return kernel


def is_kept(kernel: Any, arguments: tuple[Any, ...]) -> bool:
    """Return whether the kernel has machine code for arguments of these types; load it from the cache if there."""
    if arguments in kernel.overloads:
        return True
    found = kernel._cache.load_overload(arguments, kernel.targetctx)
    if found is not None:
        kernel.targetctx.insert_user_function(found.entry_point, found.fndesc, [found.library])
        kernel.add_overload(found)
    return found is not None


def write(kernel: Any, arguments: tuple[Any, ...]) -> None:
    """Compile the part of a kernel for arguments of these types, with all that it calls."""
    kernel.typingctx.refresh(), kernel.targetctx.refresh()
    with _undisturbed():
        kernel.part.compile(arguments)


def written(kernel: Any, arguments: tuple[Any, ...]) -> bytes:
    """Serialise that part for another process."""
    return bytes(dumps(kernel.part.overloads[arguments]._reduce()))


def take_in(kernel: Any, content: bytes) -> None:
    """Add a part that a process forked from this one has `written`."""
    (name, bitcode), description, environment, signature, _, _, annotation, reload_init, others = loads(content)
    part, target = kernel.part, kernel.part.targetctx
    library = Part(target.codegen(), name)
    library._final_module, library._finalized = binding.parse_bitcode(bitcode), True
    entry = target.get_executable(library, description, environment)
    for one in others:
        library.environments.set_env(one.env_name, one)
    target.insert_user_function(entry, description, [library])
    known = {"typing_context": part.typingctx, "target_context": target, "entry_point": entry, "library": library}
    known |= {"signature": signature, "fndesc": description, "environment": environment, "type_annotation": annotation}
    known |= {"reload_init": reload_init, "objectmode": False, "lifted": (), "referenced_envs": others}
    part.add_overload(compile_result(**known))


def name_apart() -> None:
    """Give code that this process compiles from now on other names than its parent's."""
    FunctionIdentity._unique_ids = itertools.count(1_000_000)
