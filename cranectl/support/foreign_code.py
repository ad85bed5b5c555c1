"""Run foreign code in this process, without letting it end or change the process silently.

Foreign code may change the floating-point environment when it is loaded or in any call. That environment
holds how this thread rounds and how it treats very small numbers. All later results would then differ.
"""

import contextlib
import ctypes
import functools
import os
import sys
import threading
from collections.abc import Iterator
from typing import Any

from cranectl.support.interrupts import reported_when_slow
from cranectl.support.turns import held_in_forks

_BYTES = 64  # of a fenv_t; no machine's is larger than 32
_KEPT: list[object] = []  # compiled code is called by address, so it must not be collected
_lock = threading.Lock()
held_in_forks(_lock.acquire, _lock.release)
_inside: list[int] = []  # the threads that run foreign code, one entry for each block
_before: list[Any] = []  # standard output, `os._exit`, the process and `sys.path` before the first block


def _refuse(code: int) -> None:
    """Raise SystemExit in a thread that runs foreign code; elsewhere, as in a fork, end the process."""
    _, leave, process, _ = _before
    if os.getpid() != process or threading.get_ident() not in _inside:
        leave(code)
    raise SystemExit(code)


@functools.cache
def _functions() -> tuple[Any, Any]:
    """Return the C functions fegetenv and fesetenv."""
    if sys.platform == "win32":
        library = ctypes.CDLL("ucrtbase")
    else:
        library = ctypes.CDLL(None)
        if not hasattr(library, "fegetenv"):  # not linked into this interpreter
            library = ctypes.CDLL("libm.so.6")
    return library.fegetenv, library.fesetenv


class ForeignCode:
    """What protects this process from foreign code that runs in it."""

    @staticmethod
    @contextlib.contextmanager
    def contained(doing: str) -> Iterator[None]:
        """Protect this process from the foreign code in the block; several threads may be in blocks at once.

        The output of the code goes to standard error, because standard output is reserved for results. The
        floating-point environment, the working directory and `sys.path` are restored afterwards. `os._exit`
        raises SystemExit. If the block takes long, `doing` is reported as in `reported_when_slow`.
        """
        here = threading.get_ident()
        with _lock:
            if not _inside:
                _before[:] = [sys.stdout, os._exit, os.getpid(), sys.path[:]]
                sys.stdout, os._exit = sys.stderr, _refuse  # type: ignore[assignment]
            _inside.append(here)
        try:
            with ForeignCode.environment_kept(), contextlib.ExitStack() as stack:
                stack.enter_context(reported_when_slow(doing))
                with contextlib.suppress(OSError):  # the working directory was removed
                    stack.enter_context(contextlib.chdir("."))  # which returns to the present one at the end
                yield
        finally:
            with _lock:
                _inside.remove(here)
                if not _inside:
                    sys.stdout, os._exit, _, sys.path[:] = _before

    @staticmethod
    @contextlib.contextmanager
    def environment_kept() -> Iterator[None]:
        """Restore this thread's floating-point environment at the end of the block."""
        get, put = _functions()
        before = ctypes.create_string_buffer(_BYTES)
        get(before)
        try:
            yield
        finally:
            put(before)

    @staticmethod
    @functools.cache
    def keeping_environment(step: int) -> int:
        """Return the address of a C function that calls `step` and restores the floating-point environment.

        `step` is the address of a controller's step. Both functions take five pointers and return an int64.
        """
        from llvmlite import binding, ir  # 100 MB, in each process that reads a file

        pointer, whole = ir.IntType(8).as_pointer(), ir.IntType(64)
        signature = ir.FunctionType(whole, [pointer] * 5)
        of_environment = ir.FunctionType(ir.IntType(32), [pointer])
        module = ir.Module("float_environment")
        module.triple = binding.get_process_triple()
        function = ir.Function(module, signature, f"keeping_{step:x}")
        builder = ir.IRBuilder(function.append_basic_block("entry"))

        def called(address: int, kind: Any, arguments: Any) -> Any:
            return builder.call(builder.inttoptr(ir.Constant(whole, address), kind.as_pointer()), arguments)

        get, put = (ctypes.cast(function, ctypes.c_void_p).value or 0 for function in _functions())
        room = builder.alloca(ir.ArrayType(ir.IntType(8), _BYTES))
        room.align = 16
        before = builder.bitcast(room, pointer)
        called(get, of_environment, [before])
        result = called(step, signature, function.args)
        called(put, of_environment, [before])
        builder.ret(result)
        target = binding.Target.from_default_triple().create_target_machine()
        engine = binding.create_mcjit_compiler(binding.parse_assembly(str(module)), target)
        engine.finalize_object()
        _KEPT.append(engine)
        return int(engine.get_function_address(function.name))
