"""Compile scalar kernels with Numba, cached on disk until any of their source files changes."""

import functools
from collections.abc import Callable, Iterable
from types import FunctionType
from typing import Any, Generic, TypeVar, cast, overload

import numba

from cranectl.support.compiled_step import BareStep, CompiledStep
from cranectl.support.compilers import UNCOMPILED, LinkedCompiler, PausingCompiler
from cranectl.support.kernel_cache import KernelCache

F = TypeVar("F", bound=Callable[..., Any])


@overload
def jit(function: F) -> F: ...
@overload
def jit(*, inline: bool) -> Callable[[F], F]: ...
def jit(function: F | None = None, *, inline: bool = True) -> F | Callable[[F], F]:
    """Compile `function` without the GIL, IEEE semantics, cached; callees must be module globals.

    Compiled callers inline it. A call would copy every array of the NamedTuples that are passed, which often
    takes longer than the kernel itself. Long functions with many callers are not inlined.
    """
    return functools.partial(_jit, inline=inline) if function is None else _jit(function, inline=inline)


def _jit(function: F, *, inline: bool) -> F:
    """Prepare two compilations, each at its first call: one for Python, one for compiled callers."""
    compiled: Any = _compiled(function)
    if UNCOMPILED:
        return cast(F, compiled)

    @functools.cache
    def inner() -> Any:  # most kernels are never called from Python, whose wrapper takes a fifth of the time
        return _compiled(
            _copied(function, "inner"),
            forceinline=inline,
            pipeline_class=LinkedCompiler,
            no_cpython_wrapper=True,
            no_cfunc_wrapper=True,
        )

    compiled.get_call_template = lambda *types: inner().get_call_template(*types)
    compiled.get_overload = lambda types: inner().get_overload(types)
    return cast(F, compiled)


def _compiled(function: F, callees: Iterable[Any] = (), **options: Any) -> F:
    whole = {"nogil": True, "error_model": "numpy", "pipeline_class": PausingCompiler, **options}
    compiled: Any = numba.njit(**whole)(function)
    if not UNCOMPILED:
        KernelCache.attach(compiled, function, *callees)
    return cast(F, compiled)


def _copied(function: F, name: str, **replaced: Any) -> F:
    """Return a copy of `function` with replaced globals and its own name, and so with its own cache."""
    scope = {**function.__globals__, **replaced} if replaced else function.__globals__
    copy = FunctionType(function.__code__, scope, function.__name__)
    copy.__qualname__ = f"{function.__qualname__}-{name}"
    return cast(F, copy)


class Specialised(Generic[F]):
    """A function in which other functions replace callees, so that its code contains them.

    It makes no arrays; its callees must make none either, and must not return views. The compiled code counts
    no references, because the caller holds the arrays. Counting would take an atomic instruction for each
    view in each callee, as long as all the rest of a control step.
    """

    def __init__(self, function: F, name: str, **callees: Any) -> None:
        """Replace the globals of `function` by `callees`; each `name` has its own cache."""
        self._name, self._callees = name, callees.values()
        self._function = _copied(function, name, **callees)

    def loop(self) -> F:
        """Return the function, which Python calls."""
        return _compiled(self._function, self._callees, no_cfunc_wrapper=True, _nrt=False)

    def address(self, arguments: tuple[Any, ...]) -> int:
        """Compile it to a C function of Numba types `arguments` that returns an int64; return its address.

        Exceptions are handled as in a `CompiledStep`.
        """
        compiled: Any = CompiledStep(self._function, arguments, _nrt=False)
        KernelCache.attach(compiled, self._function, *self._callees)
        compiled.compile()
        return int(compiled.address)

    def object_code(self, arguments: tuple[Any, ...]) -> bytes:
        """Compile it as `address` does, but return an object file; see `BareStep.object_code`."""
        return BareStep(self._function, arguments, _nrt=False).object_code(self._name)
