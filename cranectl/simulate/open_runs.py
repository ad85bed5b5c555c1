"""Many cranes that a program steps together, in one call of compiled code."""

import ctypes
import functools
import hashlib
import itertools
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
from numba import types
from numpy.typing import NDArray

from cranectl.design import ControllerDesign
from cranectl.plants import REFERENCE_PLANT, Plant, measure_addressed
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import COLUMN, TENSION, SignalGroup
from cranectl.simulate.loops import CompiledLoop, LoopInputs, advance_block, measure, shared_loop
from cranectl.simulate.memory import check_several_plans
from cranectl.simulate.open_run import (
    SteppedMemory,
    begin,
    check_samples,
    checked_numbers,
    plant_to_step,
)
from cranectl.simulate.plan import plan_scenario
from cranectl.simulate.run import record_width
from cranectl.simulate.signal_path import SignalPath
from cranectl.status import RunStatus
from cranectl.support import Arguments, Array, Block, CompiledStep, InputError, Specialised, jit

MAX_CRANES = 100_000  # that a program steps together

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
    clock: NDArray[np.int64]  # (1,) samples since its reset
    status: NDArray[np.int64]  # (1,)
    state: Array  # (10,)
    load: Array  # (7,) at the last sample


class OpenRuns(SteppedMemory):
    """Runs that a program advances together with commands of its own; `open_runs` makes them.

    `scenarios` has the scenario of each crane. Commands and threads act as in `OpenRun`.
    """

    def __init__(self, scenarios: Sequence[Scenario], plants: Sequence[Plant]) -> None:
        self.scenarios, self._plants = tuple(scenarios), tuple(plants)
        self._period = scenarios[0].period_ns / NANOSECONDS
        plan = functools.cache(plan_scenario)
        self._plans = [plan(scenario) for scenario in self.scenarios]
        count = len(self._plants)
        self._cranes: list[Any] = [None] * count  # of class Crane; they keep the packed arrays alive
        self._blocks: list[Any] = [(None, np.zeros(0))] * count  # Numba's type of each, and its numbers
        self._references = [plan.reference for plan in self._plans]
        widths = record_width(ControllerDesign("")), COLUMN.path_width
        self._records = np.zeros((ROWS, widths[0])), np.zeros((ROWS, widths[1]))
        self._commands = np.zeros((count, 3))
        self._clock, self._status = np.zeros((2, count), dtype=np.int64)
        self._states, self._loads = (
            np.zeros((count, len(SignalGroup.STATE))),
            np.full((count, TENSION + 1), np.nan),
        )
        self._rows = [np.zeros((ROWS, columns)) for columns in (15, 2, 6)]
        self.reset()

    def __len__(self) -> int:
        return len(self._plants)

    def reset(
        self,
        states: Array | None = None,
        *,
        seeds: Iterable[int] | None = None,
        targets: Array | None = None,
        cranes: Sequence[int] | NDArray[np.integer[Any] | np.bool_] | None = None,
    ) -> Array:
        """Begin again with all cranes, or with some; return the states of all.

        Parameters
        ----------
        states : array_like, shape (n, 10), optional
            The states at the start; by default those of the scenarios, or drawn.
        seeds : iterable of int, optional
            One for each crane that begins, as in `OpenRun.reset`.
        targets : array_like, shape (n, 3), optional
            Where the loads shall come to rest [m], in place of the references.
        cranes : sequence of int or mask, optional
            Which cranes begin, by their numbers or by True for each that begins; by default all.

        Returns
        -------
        ndarray, shape (cranes, 10)
            The states of all cranes.

        Raises
        ------
        InputError
            If a state or target is outside the workspace, or numbers of states, seeds and cranes differ.
            Cranes before a refused one have begun again.
        """
        chosen = self._chosen(cranes)
        starts = [
            [None] * len(chosen)
            if values is None
            else list(Arguments.check(name, values, Iterable[Any] | None))
            for name, values in (("states", states), ("seeds", seeds), ("targets", targets))
        ]
        if any(len(values) != len(chosen) for values in starts):
            raise InputError(
                f"{', '.join(str(len(values)) for values in starts)} states, seeds and targets "
                f"for {len(chosen)} cranes",
                allowed="one of each for each crane, or none",
                remedy="give as many as cranes begin",
            )
        try:
            for crane, state, seed, target in zip(chosen, *starts, strict=True):
                self._begin(crane, state, seed, target)
        finally:  # also if one is refused: blocks of the others before it would refer to freed memory
            self._groups = [
                (kind, np.stack([block for own, block in self._blocks if own == kind]), list(self._cranes))
                for kind in dict.fromkeys(kind for kind, _ in self._blocks)
            ]
        return self.states

    def step(self, commands: Array, samples: int = 1) -> Array:
        """Hold commands for some samples, and return the states after them.

        A crane that has stopped waits until it is reset.

        Parameters
        ----------
        commands : array_like, shape (cranes, 3)
            As in `OpenRun.step`.
        samples : int
            Control samples.

        Returns
        -------
        ndarray, shape (cranes, 10)
            The states.

        Raises
        ------
        InputError
            If a command is not finite or the shape is wrong, or `samples` is below one.
        """
        check_samples(samples)
        self._commands[:] = checked_numbers("commands", commands, len(self), 3)
        for kind, blocks, cranes in self._groups:  # which keep each other's memory
            if kind is None:
                for crane in cranes:
                    advance_crane(crane, samples)
            else:
                _compiled(kind)(blocks.ctypes.data, blocks.shape[1], len(blocks), samples)
        return self.states

    @property
    def states(self) -> Array:
        """The present states, shape (cranes, 10), in the order of `signals.STATE`."""
        return self._states.copy()

    @property
    def measured(self) -> Array:
        """Measurements of the controllers, shape (cranes, 12), as in `OpenRun.measured`."""
        return np.array([crane.inputs.controller.measured for crane in self._cranes])

    @property
    def loads(self) -> Array:
        """Positions and velocities of the loads [m, m/s], shape (cranes, 6), each at its last sample."""
        return self._loads[:, :TENSION].copy()

    @property
    def tensions(self) -> Array:
        """Tensions of the ropes at the last samples [N], shape (cranes,)."""
        return self._loads[:, TENSION].copy()

    @property
    def statuses(self) -> list[RunStatus]:
        """For each crane RUNNING, or why it has stopped."""
        return [RunStatus(code) for code in self._status.tolist()]

    @property
    def time(self) -> Array:
        """Times since the last resets [s], shape (cranes,)."""
        return np.array(self._clock * self._period)

    @property
    def references(self) -> Array:
        """Desired positions of the loads with four derivatives, shape (cranes, 15)."""
        samples = zip(self._references, self._clock.tolist(), strict=True)
        return np.array([reference[min(k, len(reference) - 1)] for reference, k in samples])

    def _chosen(self, cranes: Sequence[int] | NDArray[np.integer[Any] | np.bool_] | None) -> list[int]:
        """Return the numbers of the cranes that `reset` names; raise InputError if it names none of ours."""
        count = len(self)
        try:
            numbers = np.arange(count) if cranes is None else np.asarray(cranes)
        except ValueError:  # lists of different lengths
            numbers = np.zeros(())
        if numbers.shape == (count,) and numbers.dtype == bool:
            numbers = np.flatnonzero(numbers)
        chosen: list[int] = numbers.tolist()
        if (
            numbers.ndim != 1
            or (chosen and numbers.dtype.kind not in "iu")  # an empty list has no type
            or len(set(chosen)) < len(chosen)
            or not set(chosen) <= set(range(count))
        ):
            raise InputError(
                f"cranes = {InputError.shown(cranes)}",
                allowed=f"different numbers from 0 to {count - 1}, or {count} times True or False",
                remedy="name the cranes that begin again",
            )
        return chosen

    def _begin(self, i: int, state: Array | None, seed: int | None, target: Array | None) -> None:
        """Put crane `i` at its start."""
        plant, (reference, disturbance, wind) = self._plants[i], self._rows
        loop = begin(
            plant, self.scenarios[i], self._plans[i], state, seed, target=target, records=self._records
        )
        self._references[i] = loop.plan.reference
        self._clock[i], self._status[i], self._loads[i] = 0, RUNNING, np.nan
        plant.measure(self._states[i])
        is_compiled = isinstance(loop.block, CompiledLoop) and not CompiledStep.UNCOMPILED
        self._cranes[i] = crane = Crane(
            plant=cast(CompiledLoop, loop.block).plant if is_compiled else plant,
            inputs=loop.inputs._replace(reference=reference, disturbance=disturbance, wind=wind),
            path=loop.path,
            record=self._records[0],
            memory=loop.memory,
            reference=loop.plan.reference,
            disturbance=loop.plan.disturbance,
            wind=loop.plan.wind,
            command=self._commands[i],
            clock=self._clock[i : i + 1],
            status=self._status[i : i + 1],
            state=self._states[i],
            load=self._loads[i],
        )
        block = Block(crane) if is_compiled else None
        self._blocks[i] = (block.kind, block.numbers) if block else (None, np.zeros(0))


@Arguments.checked
def open_runs(
    scenarios: Iterable[Scenario], *, plant: str = REFERENCE_PLANT, drive: str = "ideal"
) -> OpenRuns:
    """Open runs without a controller, to be stepped together by a program.

    Parameters
    ----------
    scenarios : iterable of Scenario
        One for each crane, all with the same control period; the same scenario may occur often.
    plant, drive : str
        Plant and kind of drive of all cranes.

    Returns
    -------
    OpenRuns
        The runs, at their start.

    Raises
    ------
    InputError
        If there is no scenario or there are too many, if control periods differ, or if a plant cannot show
        its scenario.

    Examples
    --------
    >>> import cranectl
    >>> import numpy as np
    >>> scenario = cranectl.load_scenario("fixed-position")
    >>> cranes = cranectl.open_runs([scenario] * 3, drive="velocity")
    >>> states = cranes.reset(seeds=range(3))
    >>> states = cranes.step(np.full((3, 3), 0.01), samples=20)
    >>> states.shape, cranes.time
    ((3, 10), array([0.02, 0.02, 0.02]))
    """
    chosen = list(itertools.islice(scenarios, MAX_CRANES + 1))  # also of a sequence without an end
    if len(chosen) > MAX_CRANES:
        raise InputError(
            f"more than {MAX_CRANES} cranes",
            allowed=f"1 to {MAX_CRANES} cranes, which are stepped together",
            remedy="open several runs of fewer cranes",
        )
    check_several_plans(dict.fromkeys(chosen))
    periods = {scenario.period_ns for scenario in chosen}
    if len(periods) != 1:
        raise InputError(
            f"{len(periods)} control periods in {len(chosen)} scenarios",
            allowed="one or more scenarios with the same control.period",
            remedy="give scenarios that differ in other settings only",
        )
    return OpenRuns(chosen, [plant_to_step(plant, scenario, drive) for scenario in chosen])


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
        complete, _, status = advance_block(
            crane.plant, crane.inputs, crane.path, crane.record, crane.memory, 0, rows
        )
        crane.status[0] = status
        crane.clock[0] += complete
        done += rows
        if complete > 0:
            for i in range(7):
                crane.load[i] = crane.record[complete - 1, COLUMN.load + i]
    measure(crane.plant, crane.state)


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
    callees = {"advance_block": shared_loop(), "measure": measure_addressed}
    advance = Specialised(advance_crane, "compiled", **callees).loop()
    arguments = (types.CPointer(types.float64), *[types.int64] * 3)
    name = hashlib.sha256(str(kind).encode()).hexdigest()[:16]
    whole = Specialised(_advance_all, name, unpack=Block.unpacker(kind), advance_crane=advance)
    address = whole.address(arguments)
    return ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, *[ctypes.c_int64] * 3)(address)
