"""Many cranes that a program steps together."""

import functools
import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.plants import DRIVES, PLANTS, PhysicsStep, Plant
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import TENSION
from cranectl.simulate.memory import check_several_plans
from cranectl.simulate.open_start import checked_numbers
from cranectl.simulate.plan import Plan, rows_at
from cranectl.simulate.stepped import SteppedCranes, check_samples
from cranectl.status import RunStatus
from cranectl.support import Arguments, Array, InputError

MAX_CRANES = 100_000  # that a program steps together


class OpenRuns(SteppedCranes):
    """Runs that a program advances together with commands of its own; `open_runs` makes them.

    `scenarios` has the scenario of each crane. Commands and threads act as in `OpenRun`.
    """

    def __init__(self, scenarios: Sequence[Scenario], plants: Sequence[Plant]) -> None:
        super().__init__(scenarios, plants)
        self.scenarios: tuple[Scenario, ...] = tuple(scenarios)
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
        scenarios: Iterable[Scenario] | None = None,
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
        scenarios : iterable of Scenario, optional
            A new scenario for each crane that begins, such as one with another load. From now on it has
            this one. Another mass costs little; other effects need another plant.

        Returns
        -------
        ndarray, shape (cranes, 10)
            The states of all cranes.

        Raises
        ------
        InputError
            If a state or target is outside the workspace, or numbers of states, seeds and cranes differ.
            Cranes before a refused one have begun again. Scenarios with another control period are refused,
            and those that a plant cannot show: then no crane has another one, but some may have begun again.
        """
        chosen = self._chosen(cranes)
        starts = [
            [None] * len(chosen)
            if values is None
            else list(Arguments.check(name, values, Iterable[Any] | None))
            for name, values in (
                ("states", states), ("seeds", seeds), ("targets", targets), ("scenarios", scenarios),
            )
        ]  # fmt: skip
        if any(len(values) != len(chosen) for values in starts):
            raise InputError(
                f"{', '.join(str(len(values)) for values in starts)} states, seeds, targets and scenarios "
                f"for {len(chosen)} cranes",
                allowed="one of each for each crane, or none",
                remedy="give as many as cranes begin",
            )
        if scenarios is not None:
            self._change(dict(zip(chosen, starts[-1], strict=True)))
        self._begin(zip(chosen, *starts[:-1], strict=True))
        return self.states

    def _change(self, changed: Mapping[int, Any]) -> None:
        """Give cranes other scenarios; raise InputError, and change none, if one cannot be shown.

        A plant may refuse only when it is made, and by then others have taken new numbers. They take the
        old ones back and begin again, since new numbers cost a plant its state.
        """
        plan, old = functools.cache(Plan.of), list(self.scenarios)
        for i, scenario in changed.items():
            Arguments.check("scenarios", scenario, Scenario)
            PLANTS.entry(self._plants[i].name).check_scenario(scenario, self._plants[i].drive)
        check_together([*changed.values(), old[0]])
        plans, made, retuned = {i: plan(scenario) for i, scenario in changed.items()}, {}, []
        try:
            for i, scenario in changed.items():
                plant = self._plants[i]
                steps = {PhysicsStep(of, plant.drive).per_period for of in (old[i], scenario)}
                if len(steps) == 1 and plant.retune(scenario.rig, scenario.effects_on_plant):
                    retuned.append(i)
                else:
                    made[i] = PLANTS.make(plant.name, scenario, plant.drive)
        except Exception:
            for i in retuned:
                self._plants[i].retune(old[i].rig, old[i].effects_on_plant)
            self._begin((i, None, None, None) for i in retuned)
            raise
        for i, scenario in changed.items():
            self._plants[i] = made.get(i, self._plants[i])
            self._plans[i], old[i] = plans[i], scenario
        self.scenarios = tuple(old)

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
        self._advance(checked_numbers("commands", commands, len(self), 3), samples)
        return self.states

    @property
    def states(self) -> Array:
        """The present states, shape (cranes, 10), in the order of `SignalGroup.STATE`."""
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
        return np.array(self._clock[:, 0] * self._period_ns / NANOSECONDS)

    @property
    def references(self) -> Array:
        """Desired positions of the loads with four derivatives, shape (cranes, 15)."""
        samples = zip(self._loops, self._clock[:, 0], strict=True)
        return np.array([rows_at(loop.plan.reference, k) for loop, k in samples])

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


def check_together(scenarios: Sequence[Scenario]) -> None:
    """Raise InputError if scenarios of cranes have different control periods, or plans that are too large."""
    check_several_plans(dict.fromkeys(scenarios))  # equal scenarios share one plan
    periods = {scenario.period_ns for scenario in scenarios}
    if len(periods) != 1:
        raise InputError(
            f"{len(periods)} control periods in {len(scenarios)} scenarios",
            allowed="one or more scenarios with the same control.period",
            remedy="give scenarios that differ in other settings only",
        )


@Arguments.checked
def open_runs(
    scenarios: Iterable[Scenario], *, plant: str = PLANTS.REFERENCE, drive: str = "ideal"
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
    check_together(chosen)
    kind = DRIVES.checked(drive)
    return OpenRuns(chosen, [PLANTS.make(plant, scenario, kind) for scenario in chosen])
