"""Make Numba compile faster.

Numba optimises each function and generates machine code for it. A caller then links its code and does both
again. With all kernels inlined, this repeats most of the work at each level of calls. Here, a function that
only compiled code calls is not optimised: its callers optimise it.
"""

import gc
from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite.binding.ffi import lib as llvm_library
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_lock import global_compiler_lock

from cranectl.support.turns import held_in_forks

_config: Any = numba.config  # its settings are attributes that no type checker knows
UNCOMPILED = bool(_config.DISABLE_JIT)  # as NUMBA_DISABLE_JIT asks

# Numba acquires its own lock before that of LLVM. Both are reentrant: a thread that compiles may fork.
held_in_forks(llvm_library._lock.__enter__, lambda: llvm_library._lock.__exit__(None, None, None))
held_in_forks(global_compiler_lock.acquire, global_compiler_lock.release)


class LinkedLibrary(JITCodeLibrary):
    """Code for callers to link, not optimised; the execution engine receives only its environments."""

    def _optimize_final_module(self) -> None:
        """Leave that to the callers."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True
        linked = self._get_module_for_linking()
        environments = [
            global_variable
            for global_variable in linked.global_variables
            if global_variable.name.startswith("_ZN08NumbaEnv")  # as Numba mangles their names
        ]
        empty = str(self._codegen._create_empty_module(self.name))
        self._final_module = llvm.parse_assembly("\n".join([empty, *map(str, environments)]))
        super()._finalize_final_module()


class PausingCompiler(Compiler):
    """Numba's compiler without garbage collection, which takes an eighth of the time and frees little."""

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile `func`."""
        if not gc.isenabled():  # or a function that calls `func` is being compiled
            return super().compile_extra(func)
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            gc.enable()


class LinkedCompiler(PausingCompiler):
    """Numba's compiler for functions that only compiled code calls."""

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile `func`."""
        library = LinkedLibrary(self.state.targetctx.codegen(), func.__qualname__)
        library.enable_object_caching()
        self.state.library = library
        return super().compile_extra(func)
