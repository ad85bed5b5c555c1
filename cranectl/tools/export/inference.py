"""Types of a function's variables and expressions, by Numba's own inference."""

import functools
import re
from collections.abc import Callable
from typing import Any, NamedTuple

from numba.core.compiler import Compiler, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.errors import NumbaError
from numba.core.registry import cpu_target
from numba.core.types import CPointer, IntEnumMember, float64, int64, unliteral

from cranectl.support import CompiledStep, InputError

Type = Any  # of Numba, which has no type hints
_POINTER: Any = CPointer
STEP_TYPES = (_POINTER(float64),) * 5  # arguments of every controller's step
_VARIABLE = re.compile(r"(?:arg\.)?([^\W\d]\w*)(?:\.\d+)*")  # with Numba's number of the assignment


class Inferred(NamedTuple):
    """Types of a function for given types of its arguments."""

    variables: dict[str, set[Type]]  # Numba types each assignment of a variable for itself
    returned: Type


@register_pass(mutates_CFG=False, analysis_only=True)
class _KeepTypes(AnalysisPass):
    """Take the inferred types for the result of compilation."""

    _name = "keep_types"

    def __init__(self) -> None:
        AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        state.cr = (dict(state.typemap), state.return_type)
        return False


class _Inference(Compiler):
    """Numba's compiler up to its inference of types."""

    def define_pipelines(self) -> list[Any]:
        passes: Any = DefaultPassBuilder.define_untyped_pipeline(self.state, "nopython")
        typed: Any = DefaultPassBuilder.define_typed_pipeline(self.state)
        passes.passes.extend(typed.passes[:1])
        passes.add_pass(_KeepTypes, "keep types")
        passes.finalize()
        return [passes]


def check_compiler() -> None:
    """Raise InputError if Numba's compiler is switched off."""
    if CompiledStep.UNCOMPILED:
        raise InputError(
            "NUMBA_DISABLE_JIT is set", allowed="an export with Numba's compiler", remedy="unset it"
        )


@functools.cache
def infer_types(function: Callable[..., Any], arguments: tuple[Type, ...]) -> Inferred:
    """Return the types in `function`; raise InputError if Numba cannot compile it."""
    check_compiler()
    flags: Any = Flags()
    flags.error_model, flags.nrt = "numpy", True
    typing: Any = cpu_target.typing_context
    typing.refresh()
    compiler: Any = _Inference(typing, cpu_target.target_context, None, arguments, None, flags, {})
    try:
        typemap, returned = compiler.compile_extra(function)
    except NumbaError as error:
        said, where = CompiledStep.why_not(function, error)
        raise InputError(
            f"{function.__name__} cannot be compiled: {said}",
            allowed="Python that Numba compiles",
            remedy=f"correct {where}",
        ) from error
    variables: dict[str, set[Type]] = {}
    for name, kind in typemap.items():
        if match := _VARIABLE.fullmatch(name):
            variables.setdefault(match[1], set()).add(plain_type(kind))
    return Inferred(variables, plain_type(returned))


def result_type(function: Any, arguments: tuple[Type, ...]) -> Type:
    """Return the type of what an operator or a function of Numba returns, None for unsupported arguments."""
    typing: Any = cpu_target.typing_context
    typing.refresh()
    signature = typing.resolve_function_type(function, arguments, {})
    return None if signature is None else plain_type(signature.return_type)


def common_type(types: set[Type]) -> Type:
    """Return the type to which Numba casts values of all `types`, or None."""
    typing: Any = cpu_target.typing_context
    return plain_type(typing.unify_types(*types)) if len(types) > 1 else next(iter(types))


def plain_type(kind: Type) -> Type:
    """Return a type without the constant that Numba keeps with it; members of an enumeration are integers."""
    kind = unliteral(kind)
    return int64 if isinstance(kind, IntEnumMember) else kind
