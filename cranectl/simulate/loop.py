"""Advance a run of a scenario on a plant: in one piece, in blocks, or by single samples.

Every run is made here: whole ones, those of campaigns and live sessions, replays, and those that a program
steps. They give the same bits, because a sample depends only on the state, the memories and its rows of the
plan.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from cranectl.controllers import ALL_CONTROLLERS, MEMORY, Controller
from cranectl.plants import DRIVES, Plant
from cranectl.signals import COLUMN
from cranectl.simulate.actuation import Actuation, UnloadedDrives, initial_integral
from cranectl.simulate.child import BLOCK_TIMEOUT, CAN_FORK, blocks_here, blocks_in_child, shared_zeros
from cranectl.simulate.loops import LoopInputs, compiled_loop, python_loop
from cranectl.simulate.plan import Plan, rows_between
from cranectl.simulate.prepared import PreparedController
from cranectl.simulate.run import Run
from cranectl.simulate.signal_path import SignalPath
from cranectl.status import RunStatus
from cranectl.support import Array

Progress = Callable[[float], None]  # called with the simulated seconds since the last call
Rows = tuple[Array, Array, Array]  # of some samples: reference (n, 15), disturbance (n, 2), wind (n, 6)
Samples = tuple[NDArray[np.int64], Array, Array, Array]  # time_ns, record, reference, record of the path

BLOCK = 1000  # samples of a whole run per call of the loop: a few milliseconds of computing


class Loop:
    """Hold a run under way: plant, controller, plan, signal path, memories and record.

    Making a loop puts the plant at the start of the plan. A loop waits after its last sample, and for ever
    once the run has stopped.

    Parameters
    ----------
    plan : Plan
        What is run: a scenario with its reference, disturbances, and the state at the start.
    plant : Plant
        A plant of the scenario, as `PLANTS.make` returns it. Only one loop at a time may use it.
    controller : PreparedController
        The controller, prepared for the reference of the plan; several loops may share it.
    compiled : bool
        Whether the compiled loop runs; the one in Python is slower and easy to debug.
    endless : bool
        Whether the run goes on after the end of the plan, whose last rows are then repeated.
    records : tuple of ndarray, shapes (n, columns) and (n, COLUMN.path_width), optional
        Where samples are recorded, without and with the signal path; `PreparedController.records` makes them.
        Once these rows are full, the next samples overwrite them. By default each call of `advance` returns
        new arrays.

    Attributes
    ----------
    samples : int
        Complete samples since the start.
    status : RunStatus
        RUNNING, COMPLETED at the end of a plan, or why the run stopped.
    origin_ns : int
        Time of the first sample of an endless run [ns].
    inputs, path, memory : LoopInputs, SignalPath or None, ndarray
        What the loop reads besides the plant, and the memory of the controller.

    Raises
    ------
    InputError
        If effects or steps do not allow the shortest rope of the plan.
    """

    TIMEOUT = BLOCK_TIMEOUT  # [s] of a block of samples with a controller from outside, by default

    def __init__(
        self,
        plan: Plan,
        plant: Plant,
        controller: PreparedController,
        *,
        compiled: bool = True,
        endless: bool = False,
        records: tuple[Array, Array] | None = None,
    ) -> None:
        plan.begin(plant)
        self.scenario, self.plant, self.plan, self.controller = plan.scenario, plant, plan, controller
        self.block = compiled_loop(plant) if compiled else python_loop(plant)
        self.inputs = self._loop_inputs()
        self.path = self._signal_path(None if records is None else records[1])
        self.memory = controller.compiled.start.copy()
        self.samples, self.status, self.origin_ns = 0, RunStatus.RUNNING, 0
        self._compiled, self._endless, self._records = compiled, endless, records
        self._row = 0  # of the records, where the next sample is recorded
        self._end = 0  # the last sample, or the one at which the run stopped

    @property
    def is_finished(self) -> bool:
        """Whether the run has completed its plan, or stopped."""
        return self.status != RunStatus.RUNNING

    @property
    def end_ns(self) -> int:
        """Time of the last sample, or of the one at which the run stopped [ns]."""
        if self._endless:
            return self.origin_ns + self._end * self.scenario.period_ns
        return int(self.plan.time_ns[self._end])

    def bind(self) -> None:
        """Give a controller from outside an address in this process; the first sample does it at the latest.

        Raises InputError if the controller cannot be opened.
        """
        if not self.inputs.controller.address:
            self.inputs = self.inputs._replace(controller=self.inputs.controller.bound())

    def use(self, controller: PreparedController) -> None:
        """Continue with another controller.

        The set-points carry over. Between two controllers of the flat family, the dynamic extension carries
        over too. So do the states of the robustifier, if both use the same one. Any other controller begins
        at the present reference.
        """
        own, memory = controller.compiled.with_own_memory().bound(), controller.compiled.start.copy()
        carried = 0
        before, after = self.controller.design.axis_design, controller.design.axis_design
        if before is not None and after is not None:
            carried = len(memory) if after.robustifier is before.robustifier else MEMORY.robustifier
        own.clock[0] = self.samples  # rows of the reference are counted from the start of the run
        memory[:carried] = self.memory[:carried]
        self.inputs = self.inputs._replace(controller=own)
        self.memory, self.controller = memory, controller

    def follow(self, reference: Array) -> None:
        """Let the controller read `reference` (n, 15) in place of the one that it was prepared for."""
        controller = self.inputs.controller._replace(reference=reference, samples=len(reference))
        self.inputs = self.inputs._replace(controller=controller)

    def advance(self, samples: int, rows: Rows | None = None) -> Samples:
        """Run the next samples, and return views of them.

        There are fewer if the run stops, if its plan ends, or if the records have fewer rows.

        Parameters
        ----------
        samples : int
            How many samples to run.
        rows : tuple of ndarray, optional
            Reference, disturbance and wind at each of them, in place of those of the plan.

        Returns
        -------
        tuple of ndarray
            Times [ns] (n,), the record without the signal path (n, columns), the reference (n, 15), and the
            record of the signal path (n, COLUMN.path_width), or the record itself without such a path.
        """
        samples = self._possible(samples)
        reference, disturbance, wind = rows or self._rows(samples)
        record, path = self._free_rows(samples)
        first, complete = self.samples, 0
        if samples:
            self.bind()
            inputs = self.inputs._replace(reference=reference, disturbance=disturbance, wind=wind)
            complete, end, code = self.block(inputs, path, record, self.memory, 0, samples)
            status = RunStatus(code)
            if status == RunStatus.RUNNING:
                end = samples - 1  # a block that does not end the run returns the sample after its last
                if not self._endless and first + samples == len(self.plan.time_ns):
                    status = RunStatus.COMPLETED
            self.samples, self._end, self.status = first + complete, first + end, status
        path_record = record if path is None else path.record
        return self._times(first, complete), record[:complete], reference[:complete], path_record[:complete]

    def part(self, samples: int, rows: Rows | None = None) -> Run:
        """Run the next samples, and return them as a run; arguments are those of `advance`.

        It has no rows if the run had stopped before.
        """
        rows = rows or self._rows(self._possible(samples))
        return self._as_run(self.advance(samples, rows), rows[2])

    def run(self, *, timeout: float = TIMEOUT, progress: Progress | None = None) -> Run:
        """Run to the end of the plan, and return the samples from here on.

        A controller from outside runs in a child process, where `timeout` [s] is the longest time of a block
        of samples. Its loop is only good for one run. `progress` is called with the simulated seconds since
        its last call. After Ctrl-C the run is interrupted, and has the samples up to there.
        """
        first, total = self.samples, len(self.plan.time_ns)
        design = self.controller.design
        is_outside = design.origin and self._compiled and CAN_FORK
        outside = ALL_CONTROLLERS.of_design(design) if is_outside else None
        zeros = np.zeros if outside is None else shared_zeros
        record = zeros((total - first, design.record_width))
        path_record = record if self.path is None else zeros((total - first, COLUMN.path_width))
        self._records, self._row = (record, path_record), 0
        if self.path is not None:
            self.path = self.path._replace(record=path_record)
        before = first
        try:
            if outside is not None:  # compile the loop before the time limit counts
                self.block(self.inputs, self.path, record, self.memory, 0, 0)
            for rows, end, code in self._blocks(outside, timeout):
                self.samples, self._end, self.status = rows, end, RunStatus(code)
                if progress is not None:
                    progress((rows - before) * self.inputs.actuation.period)
                before = rows
        except KeyboardInterrupt:
            self._end, self.status = max(self.samples - 1, 0), RunStatus.INTERRUPTED
        piece, rows = slice(first, self.samples), self.samples - first
        samples = self.plan.time_ns[piece], record[:rows], self.plan.reference[piece], path_record[:rows]
        return self._as_run(samples, self.plan.wind[piece])

    def _blocks(self, outside: Controller | None, timeout: float) -> Iterator[tuple[int, int, int]]:
        """Advance to the end of the plan; yield samples, last sample and status after each block.

        The child process of a controller from `outside` advances its own copy of this loop.
        """

        def advance(_: int) -> tuple[int, int, int]:
            self.advance(BLOCK)
            return self.samples, self._end, int(self.status)

        total = len(self.plan.time_ns)
        if outside is None:
            return blocks_here(advance, total)
        return blocks_in_child(advance, total, outside.name, timeout)

    def _possible(self, samples: int) -> int:
        """Return how many of the next `samples` can run in one call."""
        if self.is_finished:
            return 0
        if self._records is not None:
            samples = min(samples, len(self._records[0]))
        return samples if self._endless else min(samples, len(self.plan.time_ns) - self.samples)

    def _times(self, first: int, samples: int) -> NDArray[np.int64]:
        """Return the times of samples [ns]."""
        if not self._endless:
            return self.plan.time_ns[first : first + samples]
        return self.origin_ns + np.arange(first, first + samples) * self.scenario.period_ns

    def _rows(self, samples: int) -> Rows:
        """Return the rows of the plan at the next samples."""
        plan, first, last = self.plan, self.samples, self.samples + samples
        reference, disturbance = rows_between(plan.reference, first, last), plan.disturbance
        return reference, rows_between(disturbance, first, last), rows_between(plan.wind, first, last)

    def _free_rows(self, samples: int) -> tuple[Array, SignalPath | None]:
        """Return the rows of the record for the next samples, and the signal path with its rows."""
        if self._records is None:
            record = np.zeros((samples, self.controller.design.record_width))
            path_record = np.zeros((0 if self.path is None else samples, COLUMN.path_width))
        else:
            record, path_record = self._records
            if self._row + samples > len(record):
                self._row = 0
            first, self._row = self._row, self._row + samples
            if first == 0:  # the rows of the signal path are those of `records`
                return record, self.path
            record, path_record = record[first : self._row], path_record[first : self._row]
        return record, None if self.path is None else self.path._replace(record=path_record)

    def _as_run(self, samples: Samples, wind: Array) -> Run:
        """Return samples as a run; `wind` has the rows at them, or more."""
        time_ns, record, reference, path_record = samples
        path = None if self.path is None else path_record
        return Run(
            scenario=self.scenario,
            design=self.controller.design,
            plant=self.plant.name,
            drive=self.plant.drive,
            model=self.plant.description,
            time_ns=time_ns,
            table=Run.whole_record(self.scenario, record, path, wind[: len(record)]),
            reference=reference,
            status=self.status,
            end_ns=self.end_ns,
        )

    def _loop_inputs(self) -> LoopInputs:
        """Return what the loop reads besides the plant, with the rows of the whole plan."""
        scenario, plan, nominal, drive = self.scenario, self.plan, self.controller.nominal, self.plant.drive
        return LoopInputs(
            controller=self.controller.compiled.with_own_memory(),
            actuation=Actuation.of(nominal, drive),
            integral=initial_integral(plan.initial_state),
            unloaded=UnloadedDrives.of(nominal, drive, plan.initial_state),
            reference=plan.reference,
            disturbance=plan.disturbance,
            wind=plan.wind,
            workspace=scenario.reach,
            stop_outside=scenario.workspace.on_exit == "stop",
            command_column=COLUMN.input + (DRIVES[drive].column or 0),  # forces are read from the path
            recover=scenario.effects.rope is not None and scenario.effects.rope.on_slack == "recover",
            slack=np.zeros(1),
        )

    def _signal_path(self, record: Array | None) -> SignalPath | None:
        """Return the signal path, which writes to `record`, or None if the run needs none."""
        scenario, plan, drive = self.scenario, self.plan, self.plant.drive
        if not DRIVES[drive].has_signal_path(scenario.effects):
            return None
        path = SignalPath.of(
            scenario,
            plan.initial_state,
            drive=drive,
            nominal=self.controller.nominal,
            samples=len(plan.time_ns),
        )
        return path if record is None else path._replace(record=record)
