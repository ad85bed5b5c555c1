"""Advance a run on one plant by any number of samples at a time, without a fixed end."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.controllers import CompiledController, Controller, Nominal, compile_controller
from cranectl.design import ControllerDesign
from cranectl.plants import Drive, Plant
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import PATH, REFERENCE
from cranectl.simulate.run import Run, record_width
from cranectl.simulate.runner import PreparedRun
from cranectl.simulate.signal_path import whole_record
from cranectl.status import RunStatus
from cranectl.support import Array


def rows_at(rows: Array, index: NDArray[np.integer[Any]]) -> Array:
    """Return the rows at samples `index` (n,), as a copy; after the end the last row is repeated."""
    chosen: Array = rows[np.minimum(index, len(rows) - 1)]
    return chosen


def prepare_repetition(
    controller: Controller, scenario: Scenario, drive: Drive, rows: Array, start: Array
) -> tuple[ControllerDesign, CompiledController]:
    """Prepare a controller of `repeated` for a run from the state `start` (10,).

    Each sample repeats its row of `rows`, shape (N, 3) or (N, 9).
    """
    padded = np.zeros((len(rows), len(REFERENCE)))
    padded[:, : rows.shape[1]] = rows
    nominal = Nominal(scenario.limited_rig, drive, scenario.period_ns / NANOSECONDS, padded, start, {})
    design = ControllerDesign(controller.name)
    return design, compile_controller(controller, nominal, sum(map(len, design.groups)))


@dataclass
class SteppedRun:
    """A run that has begun; it waits after its last sample, and for ever once it has stopped."""

    scenario: Scenario
    design: ControllerDesign
    plant: Plant
    run: PreparedRun
    end_ns: int  # of the last sample, or where it stopped
    status: RunStatus = RunStatus.RUNNING

    def advance(self, time_ns: NDArray[np.int64], reference: Array, disturbance: Array, wind: Array) -> Run:
        """Return the run at the next samples, each with its row of reference, disturbance and wind.

        It has fewer rows if it stops, and none if it had stopped before.
        """
        record = np.zeros((len(time_ns), record_width(self.design)))
        path, rows = self.run.path, 0
        if path is not None:
            path = path._replace(record=np.zeros((len(time_ns), PATH.width)))
        if not self.status.stopped and len(time_ns):
            inputs = self.run.inputs._replace(reference=reference, disturbance=disturbance, wind=wind)
            rows, end, code = self.run.advance(inputs, path, record, self.run.memory, 0, len(time_ns))
            self.status = RunStatus(code)
            self.end_ns = int(time_ns[end if self.status.stopped else -1])
        return Run(
            scenario=self.scenario,
            design=self.design,
            plant=self.plant.name,
            drive=self.plant.drive,
            model=self.plant.description,
            time_ns=time_ns[:rows],
            table=whole_record(self.scenario, record, path, wind)[:rows],
            reference=reference[:rows],
            status=self.status,
            end_ns=self.end_ns,
        )
