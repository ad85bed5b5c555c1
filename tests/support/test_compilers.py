"""The compilers compile less than Numba's own, and their code does the same."""

import gc
from typing import Any, cast

import numba
import pytest
from numba.extending import intrinsic

from cranectl.support.compilers import LinkedCompiler, PausingCompiler

paused: list[bool] = []


@cast(Any, intrinsic)
def look_at_collector(_typing, number):  # type: ignore[no-untyped-def]
    """Return `number`; notes whether the collector is paused while this is compiled."""
    paused.append(not gc.isenabled())
    return number(number), lambda _context, _builder, _signature, arguments: arguments[0]


@numba.njit(pipeline_class=LinkedCompiler, no_cpython_wrapper=True, no_cfunc_wrapper=True)  # type: ignore[untyped-decorator]
def root(number):  # type: ignore[no-untyped-def]
    if number < 0.0:
        raise ValueError("no root of a negative number")
    return look_at_collector(number) ** 0.5


@numba.njit(pipeline_class=PausingCompiler)  # type: ignore[untyped-decorator]
def twice(number):  # type: ignore[no-untyped-def]
    return 2.0 * root(number)


def functions(compiled: Any) -> int:
    """How many functions the engine gets of `compiled`."""
    (result,) = compiled.overloads.values()
    return len(list(result.library.get_defined_functions()))


def test_the_engine_gets_linked_code_with_its_callers_only() -> None:
    assert twice(9.0) == 6.0
    assert functions(root) == 0
    assert functions(twice) > 0
    with pytest.raises(ValueError, match="no root of a negative number"):
        twice(-1.0)


def test_the_collector_is_paused_while_compiling_only() -> None:
    twice(4.0)
    assert paused
    assert all(paused)
    assert gc.isenabled()
