"""A crane that a program steps itself: reset, give a command, read the state."""

from collections.abc import Sequence

import numpy as np

from cranectl.plants import DRIVES, PLANTS, Plant
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import TENSION
from cranectl.simulate.open_start import checked_numbers
from cranectl.simulate.plan import rows_at
from cranectl.simulate.run import Run
from cranectl.simulate.stepped import ROWS, RUNNING, SteppedCranes, check_samples
from cranectl.status import RunStatus
from cranectl.support import Arguments, Array, InputError


class OpenRun(SteppedCranes):
    """A run that a program advances with commands of its own; `open_run` makes it.

    A command is held until the next one. Effects on the way to the drives act on it: limits, dead zone, gain
    and delay. After the end of the scenario, reference, disturbances and wind keep their last values. Threads
    take turns: a call waits until that of another thread has ended.
    """

    def __init__(self, scenario: Scenario, plant: Plant) -> None:
        super().__init__([scenario], [plant])
        self._parts: list[tuple[Array, Array]] = []  # rows of the record, and of the reference
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
            The state at the start, in the order of `SignalGroup.STATE`; by default the scenario's, or drawn.
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
        self._begin([(0, state, seed, target)])
        self._parts = []
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
        commands, before = checked_numbers("command", command, 3)[np.newaxis], self._clock[0, 0]
        for first in range(0, samples, ROWS):  # the record has no more rows, and is then overwritten
            self._advance(commands, min(ROWS, samples - first))
            if rows := self._clock[0, 0] - before:
                self._parts.append(self._last_rows(0, rows))
            before += rows
            if self._status[0] != RUNNING:
                break
        return self.state

    @property
    def state(self) -> Array:
        """The present state, shape (10,), in the order of `SignalGroup.STATE`."""
        state: Array = self._states[0].copy()
        return state

    @property
    def measured(self) -> Array:
        """Measurements of a controller at the last sample (12,), in the order of `SignalGroup.MEASUREMENT`.

        They differ from the state only if the scenario has encoders. NaN before the first step.
        """
        measured: Array = self._cranes[0].inputs.controller.measured.copy()
        return measured

    @property
    def load(self) -> Array:
        """Position and velocity of the load in the world [m, m/s], shape (6,), at the last sample.

        NaN before the first step.
        """
        return self._loads[0, :TENSION].copy()

    @property
    def tension(self) -> float:
        """Tension of the rope at the last sample [N], under the command of that sample; NaN before it."""
        return float(self._loads[0, TENSION])

    @property
    def status(self) -> RunStatus:
        """RUNNING, or why the run has stopped."""
        return RunStatus(int(self._status[0]))

    @property
    def time(self) -> float:
        """Time since the last reset [s]."""
        return int(self._clock[0, 0]) * self._period_ns / NANOSECONDS

    @property
    def reference(self) -> Array:
        """Desired load position and four derivatives (15,), in the order of `SignalGroup.REFERENCE`."""
        return rows_at(self._loops[0].plan.reference, self._clock[0, 0])

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
        loop, (tables, references) = self._loops[0], zip(*self._parts, strict=True)
        samples, period_ns = loop.scenario.steps + 1, loop.scenario.period_ns
        table = np.concatenate(tables)[:samples]
        status, end = self.status, int(self._clock[0, 1])
        # A stop after the end of the scenario is in samples that are cut off.
        if not status.stopped or self._clock[0, 0] > samples:
            status = RunStatus.COMPLETED if len(table) == samples else RunStatus.INTERRUPTED
            end = len(table) - 1
        return Run(
            scenario=loop.scenario,
            design=loop.controller.design,
            plant=loop.plant.name,
            drive=loop.plant.drive,
            model=loop.plant.description,
            time_ns=np.arange(len(table), dtype=np.int64) * period_ns,
            table=table,
            reference=np.concatenate(references)[:samples],
            status=status,
            end_ns=end * period_ns,
        )


@Arguments.checked
def open_run(scenario: Scenario, *, plant: str = PLANTS.REFERENCE, drive: str = "ideal") -> OpenRun:
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
    return OpenRun(scenario, PLANTS.make(plant, scenario, DRIVES.checked(drive)))
