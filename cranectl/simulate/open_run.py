"""A crane that a program steps itself: reset, give a command, read the state."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np

from cranectl.controllers import repeated_commands
from cranectl.plants import DRIVES, FORCE, REFERENCE_PLANT, Plant, air_velocity
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import TENSION, SignalGroup, State
from cranectl.simulate.loop import Loop
from cranectl.simulate.plan import Plan, check_start, plan_scenario, rows_at
from cranectl.simulate.run import Run
from cranectl.simulate.runner import checked_drive, make_plant
from cranectl.status import RunStatus
from cranectl.support import Arguments, Array, InputError, TakesTurns

DRAWN_MARGIN = 0.1  # share of each range of the workspace, at both ends, where no drawn start lies
MAX_STEPPED = 10**7  # samples in one step


class SteppedMemory(TakesTurns):
    """A run whose compiled code refers to its memory: threads take turns, and a copy would change it."""

    def __reduce__(self) -> NoReturn:
        """Raise TypeError when the run is to be copied or pickled."""
        raise TypeError("an open run cannot be copied or pickled; open another one, and reset it to `state`")


class OpenRun(SteppedMemory):
    """A run that a program advances with commands of its own; `open_run` makes it.

    A command is held until the next one. Effects on the way to the drives act on it: limits, dead zone, gain
    and delay. After the end of the scenario, reference, disturbances and wind keep their last values. Threads
    take turns: a call waits until that of another thread has ended.
    """

    def __init__(self, scenario: Scenario, plant: Plant) -> None:
        self._scenario, self._plan, self._plant = scenario, plan_scenario(scenario), plant
        self.reset()

    def reset(
        self,
        state: Sequence[float] | Array | None = None,
        *,
        seed: int | None = None,
        target: Sequence[float] | Array | None = None,
    ) -> Array:
        """Begin again, and return the state.

        Parameters
        ----------
        state : array_like, shape (10,), optional
            The state at the start, in the order of `signals.STATE`; by default the scenario's, or drawn.
        seed : int, optional
            Draws noise and gusts anew. Without `state` it also draws where the crane begins at rest: uniform
            over the workspace, less a tenth of each range at both ends.
        target : array_like, shape (3,), optional
            Where the load shall come to rest [m], in place of the scenario's reference.

        Returns
        -------
        ndarray, shape (10,)
            The state.

        Raises
        ------
        InputError
            If state or target is outside the workspace, or the state is no state of a crane.
        """
        self._loop = begin(self._plant, self._scenario, self._plan, state, seed, target=target)
        self._parts = list[Run]()
        self._load = np.full(TENSION + 1, np.nan)
        return self.state

    def step(self, command: Sequence[float] | Array, samples: int = 1) -> Array:
        """Hold a command for some samples, and return the state after them.

        Nothing happens once the run has stopped; `status` says why.

        Parameters
        ----------
        command : array_like, shape (3,)
            For bridge, trolley and rope, by the kind of drive: accelerations [m/s²], velocities [m/s] or
            forces [N]. The last one pays out rope if it is positive.
        samples : int
            Control samples, of `scenario.control.period` each.

        Returns
        -------
        ndarray, shape (10,)
            The state.

        Raises
        ------
        InputError
            If the command is not three finite numbers, or `samples` is below one.
        """
        check_samples(samples)
        self._loop.inputs.controller.reference[0, :3] = checked_numbers("command", command, 3)
        part = self._loop.part(samples)
        if len(part.table):
            self._parts.append(part)
            self._load = part.block("load")[-1]
        return self.state

    @property
    def state(self) -> Array:
        """The present state, shape (10,), in the order of `signals.STATE`."""
        state = np.empty(len(SignalGroup.STATE))
        self._plant.measure(state)
        return state

    @property
    def measured(self) -> Array:
        """Measurements of a controller at the last sample, shape (12,), in the order of `MEASUREMENT`.

        They differ from the state only if the scenario has encoders. NaN before the first step.
        """
        return self._loop.inputs.controller.measured.copy()

    @property
    def load(self) -> Array:
        """Position and velocity of the load in the world [m, m/s], shape (6,), at the last sample.

        NaN before the first step.
        """
        return self._load[:TENSION].copy()

    @property
    def tension(self) -> float:
        """Tension of the rope at the last sample [N], under the command of that sample; NaN before it."""
        return float(self._load[TENSION])

    @property
    def status(self) -> RunStatus:
        """RUNNING, or why the run has stopped."""
        return self._loop.status

    @property
    def time(self) -> float:
        """Time since the last reset [s]."""
        return self._loop.samples * self._scenario.period_ns / NANOSECONDS

    @property
    def reference(self) -> Array:
        """Desired position of the load and four derivatives, shape (15,), in the order of `REFERENCE`."""
        row: Array = rows_at(self._loop.plan.reference, np.array([self._loop.samples]))[0]
        return row

    def recorded(self) -> Run:
        """Return all samples since the last reset as a run, to the end of the scenario at most.

        It can be written to a log, plotted and measured like any other run. If the scenario would go on, the
        run is interrupted. The present state is not part of it: it belongs to the next sample.

        Raises
        ------
        InputError
            If there has been no sample.
        """
        if not self._parts:
            raise InputError("no sample since the last reset", allowed="one or more", remedy="take a step")
        samples = self._scenario.steps + 1
        table = np.concatenate([part.table for part in self._parts])[:samples]
        status, end_ns = self.status, self._loop.end_ns
        if not status.stopped or self._loop.samples > samples:
            status = RunStatus.COMPLETED if len(table) == samples else RunStatus.INTERRUPTED
            end_ns = (len(table) - 1) * self._scenario.period_ns
        return replace(
            self._parts[-1],
            time_ns=np.arange(len(table), dtype=np.int64) * self._scenario.period_ns,
            table=table,
            reference=np.concatenate([part.reference for part in self._parts])[:samples],
            status=status,
            end_ns=end_ns,
        )


@Arguments.checked
def open_run(scenario: Scenario, *, plant: str = REFERENCE_PLANT, drive: str = "ideal") -> OpenRun:
    """Open a run without a controller, to be stepped by a program.

    Parameters
    ----------
    scenario : Scenario
        Crane, effects, disturbances, and the state in which the run begins.
    plant, drive : str
        Plant and kind of drive.

    Returns
    -------
    OpenRun
        The run, at its start.

    Raises
    ------
    InputError
        If a name is unknown, or the plant cannot show the scenario.

    Examples
    --------
    >>> import cranectl
    >>> crane = cranectl.open_run(cranectl.load_scenario("fixed-position"), drive="velocity")
    >>> state = crane.step([0.1, 0.0, 0.0], samples=500)  # half a second at 0.1 m/s
    >>> print(f"{crane.time:g} s, bridge {state[0]:.3f} m, {crane.status.label}")
    0.5 s, bridge 1.048 m, running
    """
    return OpenRun(scenario, plant_to_step(plant, scenario, drive))


def plant_to_step(name: str, scenario: Scenario, drive: str) -> Plant:
    """Make a plant that a program steps; its reset raises InputError for a rope too short for its effects."""
    return make_plant(name, scenario, checked_drive(drive))


def begin(
    plant: Plant,
    scenario: Scenario,
    plan: Plan,
    state: Sequence[float] | Array | None = None,
    seed: int | None = None,
    *,
    target: Sequence[float] | Array | None = None,
    records: tuple[Array, Array] | None = None,
) -> Loop:
    """Put a plant at the start of a run that repeats its command: row 0 of `inputs.controller.reference`.

    `plan` is that of the scenario, and `records` are as in `Loop`. `state`, `seed` and `target` are as in
    `OpenRun.reset`.
    """
    if target is not None:
        point = checked_numbers("target", target, 3)
        plan = replace(plan, reference=rest_at(scenario, point))
        rest = scenario.reference.model_copy(update={"start": tuple(point.tolist()), "segments": ()})
        scenario = scenario.model_copy(update={"reference": rest})
    if seed is not None:
        InputError.check_whole(
            "seed", seed, 0, 2**63 - 1, "a whole number, from which noise and starts are drawn"
        )
        draw = np.random.default_rng(seed)
        scenario = _with_seeds(scenario, *draw.integers(2**32, size=2).tolist())
        if state is None:
            state = np.zeros(len(SignalGroup.STATE))
            low, high = scenario.reach.T
            margin = DRAWN_MARGIN * (high - low)
            State(state).axes[:] = draw.uniform(low + margin, high - margin)
        if scenario.effects.wind:
            air = air_velocity(scenario.effects, len(plan.wind), scenario.period_ns / NANOSECONDS)
            plan = replace(plan, wind=np.hstack([air, plan.wind[:, FORCE:]]))
    if state is not None:
        start = checked_numbers("state", state, len(SignalGroup.STATE))
        check_start(scenario, start, remedy="give a state inside it")
        plan = replace(plan, initial_state=start)
    controller = repeated_commands(DRIVES[plant.drive].command, "commands")
    loop = Loop.repeating(controller, np.zeros((1, 3)), scenario, plant, plan, endless=True, records=records)
    loop.inputs.controller.measured[: len(SignalGroup.STATE)] = np.nan
    return loop


def rest_at(scenario: Scenario, target: Array) -> Array:
    """Return the reference (1, 15) that rests at `target` (3,); raise InputError if the load cannot."""
    reference = np.zeros((1, len(SignalGroup.REFERENCE)))
    reference[0, :3] = target
    hanging = np.zeros(len(SignalGroup.STATE))
    State(hanging).axes[:] = target * (1.0, 1.0, -1.0)
    remedy = "give a target below the workspace of bridge and trolley, within reach of the rope"
    check_start(scenario, hanging, remedy=remedy, what="the target is")
    return reference


def _with_seeds(scenario: Scenario, sensing: int, wind: int) -> Scenario:
    """Return the scenario with these seeds of noise and gusts, where it has them."""
    seeds = {"sensing": sensing, "wind": wind}
    effects = {
        name: part.model_copy(update={"seed": seed})
        for name, seed in seeds.items()
        if (part := getattr(scenario.effects, name)) is not None
    }
    return scenario.model_copy(update={"effects": scenario.effects.model_copy(update=effects)})


def checked_numbers(what: str, values: Sequence[float] | Array, *shape: int) -> Array:
    """Return finite numbers of this shape; raise InputError for anything else."""
    try:
        numbers = np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        numbers = np.zeros(0)
    bad = np.argwhere(~np.isfinite(numbers))
    if numbers.shape != shape or len(bad):
        where = f", with {numbers[tuple(bad[0])]} at {bad[0].tolist()}" if len(bad) else ""
        raise InputError(
            f"{what} = {InputError.shown(values)}, of shape {numbers.shape}{where}",
            allowed=f"finite numbers in the shape {shape}",
            remedy=f"give {' times '.join(map(str, shape))} numbers",
        )
    return numbers


def check_samples(samples: int) -> None:
    """Raise InputError unless `samples` is a whole number from 1."""
    InputError.check_whole("samples", samples, 1, MAX_STEPPED, "how many control samples a step lasts")
