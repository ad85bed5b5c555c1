"""Cranes that a program steps together, in one call of compiled code; each alone takes the same steps."""

import ctypes
import functools
import hashlib
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, NoReturn, cast

import numpy as np
from numba import types
from numpy.typing import NDArray

from cranectl.design import ControllerDesign
from cranectl.plants import ADDRESSED, Plant
from cranectl.scenario import Scenario
from cranectl.signals import COLUMN, TENSION, SignalGroup
from cranectl.simulate.loop import Loop
from cranectl.simulate.loops import CompiledLoop, LoopInputs, advance_block, measure, shared_loop
from cranectl.simulate.open_start import begin
from cranectl.simulate.plan import Plan
from cranectl.simulate.run import Run
from cranectl.simulate.signal_path import SignalPath
from cranectl.status import RunStatus
from cranectl.support import Array, Block, CompiledStep, InputError, Specialised, TakesTurns, jit

MAX_STEPPED = 10**7  # samples in one step

RUNNING = int(RunStatus.RUNNING)
ROWS = 256  # samples of a crane that are computed at a time


class Crane(NamedTuple):
    """One of many cranes, with views of its rows of what all of them share."""

    plant: Any  # AddressedPlant, or Plant for those that are stepped from Python
    inputs: LoopInputs  # whose rows are those of the next samples
    path: SignalPath | None
    record: Array  # (ROWS, columns)
    memory: Array
    reference: Array  # (N, 15) of the plan
    disturbance: Array  # (N, 2) of the plan
    wind: Array  # (N, 6) of the plan
    command: Array  # (3,)
    clock: NDArray[np.int64]  # (2,) samples since its reset, and the one at which it stopped
    status: NDArray[np.int64]  # (1,)
    state: Array  # (10,)
    load: Array  # (7,) at the last sample


class SteppedCranes(TakesTurns):
    """Cranes that are stepped together, each with a scenario and a plant.

    Compiled code refers to their memory, so threads take turns, and a copy would change it.
    """

    def __init__(self, scenarios: Sequence[Scenario], plants: Sequence[Plant]) -> None:
        self._plants, count = list(plants), len(plants)
        self._period_ns = scenarios[0].period_ns
        plan = functools.cache(Plan.of)  # cranes of equal scenarios share a plan, which may be large
        self._plans = [plan(scenario) for scenario in scenarios]
        self._loops: list[Loop] = [
            cast(Any, None)
        ] * count  # at their starts, from which compiled code goes on
        self._cranes: list[Any] = [None] * count  # of class Crane; they keep the packed arrays alive
        self._blocks: list[Any] = [(None, np.zeros(0))] * count  # Numba's type of each, and its numbers
        widths = ControllerDesign("").record_width, COLUMN.path_width  # repeated commands log nothing
        self._records = np.zeros((ROWS, widths[0])), np.zeros((ROWS, widths[1]))
        self._commands = np.zeros((count, 3))
        self._clock, self._status = np.zeros((count, 2), dtype=np.int64), np.zeros(count, dtype=np.int64)
        self._states = np.zeros((count, len(SignalGroup.STATE)))
        self._loads = np.full((count, TENSION + 1), np.nan)
        self._rows = [np.zeros((ROWS, columns)) for columns in (15, 2, 6)]

    def __reduce__(self) -> NoReturn:
        """Raise TypeError when the run is to be copied or pickled."""
        raise TypeError("an open run cannot be copied or pickled; open another one, and reset it to `state`")

    def _begin(self, starts: Iterable[tuple[int, Any, Any, Any]]) -> None:
        """Put cranes at their starts: number, state, seed and target of each, as in `OpenRun.reset`."""
        try:
            for i, state, seed, target in starts:
                plan, plant = self._plans[i], self._plants[i]
                self._place(i, begin(plant, plan, state, seed, target=target, records=self._records))
        finally:  # also if one is refused: blocks of the others before it would refer to freed memory
            self._groups = [
                (kind, np.stack([block for own, block in self._blocks if own == kind]), list(self._cranes))
                for kind in dict.fromkeys(kind for kind, _ in self._blocks)
            ]

    def _place(self, i: int, loop: Loop) -> None:
        """Let crane `i` go on with a loop at its start."""
        plant, plan, (reference, disturbance, wind) = loop.plant, loop.plan, self._rows
        self._loops[i] = loop
        self._clock[i], self._status[i], self._loads[i] = 0, RUNNING, np.nan
        plant.measure(self._states[i])
        is_compiled = isinstance(loop.block, CompiledLoop) and not CompiledStep.UNCOMPILED
        self._cranes[i] = crane = Crane(
            plant=cast(CompiledLoop, loop.block).plant if is_compiled else plant,
            inputs=loop.inputs._replace(reference=reference, disturbance=disturbance, wind=wind),
            path=loop.path,
            record=self._records[0],
            memory=loop.memory,
            reference=plan.reference,
            disturbance=plan.disturbance,
            wind=plan.wind,
            command=self._commands[i],
            clock=self._clock[i],
            status=self._status[i : i + 1],
            state=self._states[i],
            load=self._loads[i],
        )
        block = Block(crane) if is_compiled else None
        self._blocks[i] = (block.kind, block.numbers) if block else (None, np.zeros(0))

    def _advance(self, commands: Array, samples: int) -> None:
        """Hold `commands` (cranes, 3) for some samples; a crane that has stopped waits."""
        self._commands[:] = commands
        for kind, blocks, cranes in self._groups:  # which keep each other's memory
            if kind is None:
                for crane in cranes:
                    advance_crane(crane, samples)
            else:
                _compiled(kind)(blocks.ctypes.data, blocks.shape[1], len(blocks), samples)

    def _last_rows(self, i: int, samples: int) -> tuple[Array, Array]:
        """Return the last samples, at most ROWS, of crane `i`: signals and reference.

        No other crane may have been stepped since.
        """
        path, wind, reference = self._loops[i].path, self._rows[2][:samples], self._rows[0][:samples]
        path_record = None if path is None else path.record[:samples]
        record = Run.whole_record(self._loops[i].scenario, self._records[0][:samples], path_record, wind)
        return record.copy(), reference.copy()


def check_samples(samples: int) -> None:
    """Raise InputError unless `samples` is a whole number from 1."""
    InputError.check_whole("samples", samples, 1, MAX_STEPPED, "how many control samples a step lasts")


@jit
def copy_rows(source, first, rows, target):
    """Copy `rows` rows of `source` from `first` on; after its end the last row is repeated."""
    for row in range(rows):
        k = min(first + row, source.shape[0] - 1)
        for i in range(source.shape[1]):
            target[row, i] = source[k, i]


def advance_crane(crane, samples):
    """Advance one crane by `samples`, or until it stops; compiled code has other names for the callees."""
    done = 0
    for axis in range(3):
        crane.inputs.controller.reference[0, axis] = crane.command[axis]
    while done < samples and crane.status[0] == RUNNING:
        rows = min(samples - done, crane.record.shape[0])
        copy_rows(crane.reference, crane.clock[0], rows, crane.inputs.reference)
        copy_rows(crane.disturbance, crane.clock[0], rows, crane.inputs.disturbance)
        copy_rows(crane.wind, crane.clock[0], rows, crane.inputs.wind)
        complete, end, status = advance_block(
            crane.plant, crane.inputs, crane.path, crane.record, crane.memory, 0, rows
        )
        crane.status[0] = status
        crane.clock[1] = crane.clock[0] + end
        crane.clock[0] += complete
        done += rows
        if complete > 0:
            for i in range(7):
                crane.load[i] = crane.record[complete - 1, COLUMN.load + i]
    measure(crane.plant, crane.state)  # the record has the states before its periods; this is after the last


# `_compiled` replaces this name by a function that reads a crane from its block.
unpack: Any = None
pointer_after = Block.pointer_after  # compiled code looks up no members


def _advance_all(blocks, words, cranes, samples):
    """Advance all cranes, whose blocks of `words` numbers lie one after the other."""
    for i in range(cranes):
        advance_crane(unpack(pointer_after(blocks, i * words)), samples)
    return 0


@functools.cache
def _compiled(kind: Any) -> Any:
    """Compile `_advance_all` for cranes of Numba's type `kind`."""
    callees = {"advance_block": shared_loop(), "measure": ADDRESSED.measure}
    advance = Specialised(advance_crane, "compiled", **callees).loop()
    arguments = (types.CPointer(types.float64), *[types.int64] * 3)
    name = hashlib.sha256(str(kind).encode()).hexdigest()[:16]
    whole = Specialised(_advance_all, name, unpack=Block.unpacker(kind), advance_crane=advance)
    address = whole.address(arguments)
    return ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, *[ctypes.c_int64] * 3)(address)
