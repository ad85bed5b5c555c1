"""Compile a controller's step to a C function that reports an exception and returns a failure code.

The C functions of Numba print an exception and return an arbitrary number, so a run would go on after it.
"""

import ctypes
import functools
import os
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba.core import callconv, cgutils
from numba.core.ccallback import CFunc
from numba.core.errors import TypingError
from numba.core.registry import cpu_target
from numba.core.types import Boolean, CPointer, Integer, IntEnumMember, float64, int64

from cranectl.support.arrays import Array
from cranectl.support.compilers import UNCOMPILED, PausingCompiler
from cranectl.support.errors import MAX_PHRASE, InputError, printable
from cranectl.support.kernel_cache import KernelCache
from cranectl.support.parent import Parent
from cranectl.support.sources import PACKAGE

_POINTER: Any = CPointer  # Numba has no types
_TOOLS: Any = cgutils
_ENVIRONMENTS: list[Any] = []  # compiled code points to them
_CALLBACKS: list[Any] = []  # to uncompiled steps, whose addresses are in use


class WholeNumberModel(callconv.NumpyErrorModel):
    """Numba's model of errors for steps from outside: only whole numbers raise an exception.

    A whole number divided by zero would become 0 without a word. With floating point, the result is infinite
    or NaN as in NumPy, and the run ends if a command becomes so.
    """

    def fp_zero_division(self, builder: Any, exc_args: Any = None, loc: Any = None) -> bool:
        """Generate code that raises ZeroDivisionError for whole numbers, and return True for them."""
        if not (exc_args and exc_args[0].startswith("integer")):
            return False
        self.call_conv.return_user_exc(builder, ZeroDivisionError, exc_args, loc)
        return True


OUTSIDE = "whole numbers"  # name of this model
callconv.error_models[OUTSIDE] = WholeNumberModel


class _StepTarget:
    """Numba's target for this processor, with another wrapper around the compiled function."""

    options = cpu_target.options

    def __init__(self, report: Callable[..., None]) -> None:
        """Prepare a target whose wrapper has the code that `report` generates, for an exception."""
        self.report = report

    @property
    def typing_context(self) -> Any:
        """Numba's own typing context, so that a step can call functions compiled elsewhere."""
        return cpu_target.typing_context

    @property
    def target_context(self) -> Any:
        """A shallow copy of Numba's own target context: it shares all code and replaces one method."""
        context: Any = cpu_target.target_context.subtarget()
        context.create_cfunc_wrapper = functools.partial(_wrap_step, context, report=self.report)
        return context


MATHEMATICAL = {
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "pow",
}  # fmt: skip
STEP_ARGUMENTS = (_POINTER(float64),) * 5  # of all controllers


class CompiledStep(CFunc):
    """A compiled controller step, or another compiled function that returns an int64."""

    UNCOMPILED = UNCOMPILED  # whether Numba's compiler is switched off
    FAILED = -1  # status of a step that raised an exception
    C_TYPE = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.POINTER(ctypes.c_double)] * 5)
    _targetdescr = _StepTarget(lambda *arguments: _report(*arguments))  # it is defined below

    def __init__(
        self, step: Callable[..., int], arguments: tuple[Any, ...] = STEP_ARGUMENTS, **options: Any
    ) -> None:
        """Prepare `step`, which `compile` then compiles for `arguments` of these types, with `options`."""
        whole = {"nopython": True, "error_model": "numpy", **options}
        super().__init__(step, (arguments, int64), {}, whole, pipeline_class=PausingCompiler)
        self._compiled_here: Any = None

    def compile(self) -> None:
        """Compile the step, and let it find what its exceptions are made with, which Numba's own cannot."""
        super().compile()
        if (compiled := self._compiled_here) is not None:
            _ENVIRONMENTS.append(compiled.environment)
            cpu_target.target_context.codegen().set_env(compiled.fndesc.env_name, compiled.environment)

    def _compile_uncached(self) -> Any:
        self._compiled_here = self._compiler.compile(self._sig.args, None)  # type: ignore[attr-defined]
        return self._compiled_here

    @staticmethod
    @functools.cache
    def address_of(step: Callable[..., int]) -> int:
        """Compile `step` to a C function of five pointers to doubles that returns an int64.

        Returns its address. An exception in the step is reported, and the function returns a failure code. A
        step from outside raises one where it divides a whole number by zero.

        Only the package's own steps are cached on disk. A foreign step may use other files, which are not
        known, so a changed gain in one of them would go unnoticed.
        """
        if UNCOMPILED:
            callback = CompiledStep.C_TYPE(step)
            _CALLBACKS.append(callback)
            return ctypes.cast(callback, ctypes.c_void_p).value or 0
        is_ours = Path(step.__code__.co_filename).is_relative_to(PACKAGE)
        compiled: Any = CompiledStep(step) if is_ours else CompiledStep(step, error_model=OUTSIDE)
        if is_ours:
            KernelCache.attach(compiled, step)
        compiled.compile()
        return int(compiled.address)

    @classmethod
    def call(cls, address: int, *arrays: Array) -> int:
        """Call the C function of a step from Python, and return its status."""
        pointer = ctypes.POINTER(ctypes.c_double)
        return int(cls.C_TYPE(address)(*(array.ctypes.data_as(pointer) for array in arrays)))

    @staticmethod
    def why_not(step: Callable[..., int], error: Exception) -> tuple[str, str]:
        """Return Numba's reason for not compiling `step`, on one line, and the file and line it names."""
        lines = [line.strip() for line in str(error).splitlines() if line.strip()] or [type(error).__name__]
        # The reason comes after this line.
        first = 1 if lines[0].startswith("Failed in nopython mode") and len(lines) > 1 else 0
        said = lines[first]
        if said.endswith(":") and len(lines) > first + 1:  # the next line holds the detail
            said = f"{said} {lines[first + 1].removeprefix('>>> ')}"
        loc = getattr(error, "loc", None)
        return printable(said), f"{loc.filename}:{loc.line}" if loc else step.__code__.co_filename

    @staticmethod
    def report(name: str, error: BaseException, raised: TracebackType | None = None) -> None:
        """Write which step failed, in which line, and why.

        A forked process must not wait for the lock of `sys.stderr`, so the text goes to the file descriptor.
        An error of the machine does not count as a failure of the step: a process that only runs controllers
        ends.
        """
        frames = traceback.extract_tb(raised or error.__traceback__)
        where = f" in {frames[-1].filename.rpartition('/')[2]}:{frames[-1].lineno}" if frames else ""
        if isinstance(error, OSError):  # its line is one of ours, such as the one that reads a socket
            where = ""
        text = printable(f"{name} failed{where}: {InputError.describe(error)}", longest=MAX_PHRASE)
        with suppress(OSError):  # the step may have closed it
            os.write(2, f"cranectl: {text}\n".encode())
        Parent.report_machine_failure(error)


class BareStep(CompiledStep):
    """A compiled function that reports no exception, so that it needs no Python."""

    _targetdescr = _StepTarget(lambda *_: None)

    def object_code(self, name: str) -> bytes:
        """Return an object file for Linux on x86-64 with the function `name`, hidden from other libraries.

        It must not call functions by address. Raises TypeError if it needs more than C's mathematics.
        """
        self.compile()
        module = llvm.parse_bitcode(self._library._final_module.as_bitcode())  # type: ignore[attr-defined]
        needed = set()
        for place, part in enumerate((*module.functions, *module.global_variables)):
            if part.name == self.native_name:
                part.name, part.visibility = name, "hidden"
            elif not part.is_declaration:
                part.linkage, part.name = "internal", f"{name}_{place}"  # Numba's names count compilations
            elif not part.name.startswith("llvm."):
                needed.add(part.name)
        if needed := needed - MATHEMATICAL:
            raise TypeError(f"{self.__name__} needs {', '.join(sorted(needed))}")
        target = llvm.Target.from_triple("x86_64-unknown-linux-gnu")
        machine = target.create_target_machine(cpu="x86-64", opt=3, reloc="pic", codemodel="default")
        return bytes(machine.emit_object(module))


def _wrap_step(context: Any, library: Any, described: Any, *_: Any, report: Callable[..., None]) -> None:
    """Add to `library` the C function that calls the compiled step, as Numba's `create_cfunc_wrapper`."""
    if not isinstance(described.restype, Integer | Boolean | IntEnumMember):  # NaN would become the status 0
        raise TypingError(f"the step returns {described.restype}, which is no whole number")
    module = context.create_module("step_wrapper")
    signature = context.call_conv.get_function_type(described.restype, described.argtypes)
    compiled = ir.Function(module, signature, described.llvm_func_name)
    pointers = [context.get_value_type(argtype) for argtype in described.argtypes]
    result = context.get_value_type(int64)
    wrapper = ir.Function(module, ir.FunctionType(result, pointers), described.llvm_cfunc_wrapper_name)
    builder = ir.IRBuilder(wrapper.append_basic_block("entry"))
    status, returned = context.call_conv.call_function(
        builder, compiled, described.restype, described.argtypes, wrapper.args, attrs=("noinline",)
    )
    with builder.if_then(status.is_error, likely=False):
        report(context, builder, status, described.qualname)
        builder.ret(ir.Constant(result, CompiledStep.FAILED))
    builder.ret(context.cast(builder, returned, described.restype, int64))
    library.add_ir_module(module)


def _report(context: Any, builder: Any, status: Any, name: str) -> None:
    """Generate code that acquires the interpreter's lock and reports the exception."""
    api = context.get_python_api(builder)

    def constant(text: str) -> Any:
        return context.insert_const_string(builder.module, text)

    lock = api.gil_ensure()
    context.call_conv.raise_error(builder, api, status)
    parts = [_TOOLS.alloca_once_value(builder, api.get_null_object()) for _ in range(3)]
    api.err_fetch(*parts)  # kind, value, traceback; the last ones may be null, which ends the arguments
    reporting = api.import_module(constant(__name__))
    with builder.if_then(_TOOLS.is_not_null(builder, reporting)):
        function = api.object_getattr_string(reporting, report_compiled_failure.__name__)
        arguments = [api.string_from_string(constant(name)), *map(builder.load, parts)]
        api.call_function_objargs(function, arguments)
    api.err_clear()
    api.gil_release(lock)


def report_compiled_failure(
    name: str, kind: type[BaseException], value: object = None, raised: TracebackType | None = None
) -> None:
    """Report the exception that a compiled step has set; C code calls this with its three parts."""
    if isinstance(value, BaseException):
        error = value
    else:  # C code may set an exception without making it
        arguments = value if isinstance(value, tuple) else () if value is None else (value,)
        error = kind(*arguments)
    CompiledStep.report(name, error, raised)
