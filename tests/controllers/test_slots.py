"""Named slots give offsets, initial numbers and logged signals, in compiled code and in Python."""

from typing import Any

import numpy as np
import pytest
from numba import carray

from cranectl import Logged, RunStatus, Signal, Slots
from cranectl.controllers.addressed import _call
from cranectl.controllers.slots import per_axis
from cranectl.support.compiled_step import CompiledStep
from cranectl.support.jit import jit

MEMORY = Slots(error=3, begun=1, ring=0)
PARAMETERS = Slots(gain=1, limit=2)


@jit
def gained(parameters, axis):  # type: ignore[no-untyped-def]
    return parameters[PARAMETERS.gain] * parameters[PARAMETERS.limit + axis]


def step(parameters, _measured, _reference, memory, command):  # type: ignore[no-untyped-def]
    """Write to each slot, and stop when it has begun."""
    numbers = carray(memory, (MEMORY.size + 2,))
    if numbers[MEMORY.begun] != 0.0:
        return RunStatus.SLACK_ROPE
    numbers[MEMORY.begun] = 1.0
    numbers[MEMORY.error : MEMORY.begun][2] = gained(parameters, 1)
    numbers[MEMORY.ring + 1] = 7.0
    command[0] = parameters[PARAMETERS.limit]
    return RunStatus.RUNNING


@jit
def called(address, parameters, memory, command):  # type: ignore[no-untyped-def]
    return _call(address, parameters, command, command, memory, command)


def test_offsets_follow_from_sizes() -> None:
    assert (MEMORY.error, MEMORY.begun, MEMORY.ring, MEMORY.size) == (0, 3, 4, 4)
    assert (PARAMETERS.gain, PARAMETERS.limit, PARAMETERS.size) == (0, 1, 3)
    assert all(type(offset) is int for offset in MEMORY)


def test_arrays_have_numbers_by_slot_and_zeros_elsewhere() -> None:
    np.testing.assert_array_equal(MEMORY.array(), np.zeros(4))
    np.testing.assert_array_equal(PARAMETERS.array(limit=(2, 3)), [0.0, 2.0, 3.0])
    assert PARAMETERS.array(limit=(2, 3)).dtype == float
    numbers = MEMORY.array(begun=1, ring=np.array([[5.0, 6.0], [7.0, 8.0]]))
    np.testing.assert_array_equal(numbers, [0, 0, 0, 1, 5, 6, 7, 8])


def test_compiled_code_reads_and_writes_by_name() -> None:
    memory, command = MEMORY.array(ring=np.zeros(2)), np.zeros(3)
    address, parameters = CompiledStep.address_of(step), PARAMETERS.array(gain=3.0, limit=[4.0, 5.0])
    assert called(address, parameters, memory, command) == 0
    np.testing.assert_array_equal(memory, MEMORY.array(error=[0, 0, 15.0], begun=1, ring=[0, 7.0]))
    assert command[0] == 4.0
    assert called(address, parameters, memory, command) == int(RunStatus.SLACK_ROPE)


def test_signals_are_logged_from_the_start_of_their_slot() -> None:
    begun = Signal("begun", "b", "", "")
    error = per_axis("error", "e", "m", "of the drive", "xl")
    assert error[1] == Signal("error_l", "e_l", "m", "of the drive, l")
    numbers = MEMORY.logged(begun=[begun], error=error)
    assert numbers == (Logged(3, begun), Logged(0, error[0]), Logged(1, error[1]))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda: Slots(size=1), "named 'size'"),
        (lambda: Slots(_a=1), "named '_a'"),
        (lambda: Slots(a=0, b=1), "'a' has 0 numbers"),
        (lambda: Slots(a=1, b=-1), "'b' has -1 numbers"),
        (lambda: Slots(a=1.5), "'a' has 1.5 numbers"),
        (lambda: MEMORY.array(eror=1.0), "no slot 'eror', there are error, begun, ring"),
        (lambda: MEMORY.array(error=1.0), "1 numbers for the slot 'error', which has 3"),
    ],
)
def test_mistakes_are_refused_with_a_message(wrong: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        wrong()
    with pytest.raises(AttributeError, match="no slot 'eror', there are error, begun, ring"):
        _ = MEMORY.eror
