"""Runs samples one after the other, on plants of its own whose parameters are changed in place."""

import functools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.definition import Batch, sampled_scenario
from cranectl.campaign.prepared import Prepared
from cranectl.campaign.table import FAILED, Key, Row, make_row
from cranectl.metrics import Accumulator, MetricsSetup, accumulate, empty_accumulator, finish, metrics_setup
from cranectl.plants.applicable import check_effects
from cranectl.plants.plant import Plant
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import PATH_WIDTH
from cranectl.simulate import make_plant, plan_run
from cranectl.simulate.blocks import Block, stream_run
from cranectl.simulate.runner import start_run
from cranectl.support.errors import InputError

Array = NDArray[np.float64]
Stop = Callable[[], bool]

BLOCK = 1000  # samples of a run that are kept at a time


class StoppedError(Exception):
    """A batch was told to stop before its end."""


def never() -> bool:
    """Do not stop."""
    return False


class Worker:
    """For one thread. Gives the same rows as any other worker, whatever it ran before."""

    def __init__(self, prepared: Prepared) -> None:
        self._prepared = prepared
        self._plants: dict[tuple[str, int], Plant] = {}  # by name and steps of a control period
        self._records: dict[int, Array] = {}  # by width
        self._path_record = np.zeros((BLOCK, PATH_WIDTH))

    def run_batch(self, batch: Batch, stop: Stop = never) -> list[Row]:
        """The rows of `batch`; raises StoppedError soon after `stop` says so."""
        return [
            self._row(Key(sample, batch.plant, batch.controller), stop)
            for sample in range(batch.first, batch.last)
        ]

    def _row(self, key: Key, stop: Stop) -> Row:
        """One run; whatever goes wrong in it is the reason of a failed row."""
        values = self._prepared.values(key.sample)
        row = functools.partial(make_row, self._prepared.campaign, key, values)
        try:
            return self._run(key, values, row, stop)
        except StoppedError:
            raise
        except Exception as error:
            self._plants.clear()  # one of them is in an unknown state
            return row(None, status=FAILED, reason=reason_of(error), end_s=0.0)

    def _run(self, key: Key, values: Array, row: Callable[..., Row], stop: Stop) -> Row:
        scenario = sampled_scenario(self._prepared.campaign, values, f"sample {key.sample}")
        controller = self._prepared.controller(key.controller, scenario)
        plan = plan_run(controller.reference, scenario)
        crane = self._plant(key.plant, scenario)
        run = start_run(
            crane,
            scenario,
            controller.tracker,
            plan,
            nominal=controller.nominal,
            path_record=self._path_record,
        )
        setup, accumulator = metrics_setup(scenario, crane.drive), empty_accumulator()
        record = self._record(controller.width)
        end_ns, status = stream_run(run, plan, record, _measurement(setup, accumulator, stop))
        metrics = finish(setup, accumulator, status, end_ns)
        reason = status.explanation if status.stopped else ""
        return row(metrics, status=status.label, reason=reason, end_s=end_ns / NANOSECONDS)

    def _plant(self, name: str, scenario: Scenario) -> Plant:
        """The plant of `scenario`: one used before, changed in place, where that can be."""
        drive = self._prepared.campaign.settings.drive
        plant = self._plants.get((name, scenario.substeps))
        if plant is not None:
            check_effects(scenario.effects, plant=name, drive=drive)
            if plant.retune(scenario.rig, scenario.effects):
                return plant
        self._plants[name, scenario.substeps] = made = make_plant(name, scenario, drive)
        return made

    def _record(self, width: int) -> Array:
        return self._records.setdefault(width, np.zeros((BLOCK, width)))


def reason_of(error: Exception) -> str:
    """An error on one line, with its type."""
    text = (
        f"{error.found}; {error.allowed}" if isinstance(error, InputError) else " ".join(str(error).split())
    )
    return f"{type(error).__name__}: {text}".rstrip(":; ")


def _measurement(setup: MetricsSetup, accumulator: Accumulator, stop: Stop) -> Callable[[Block], None]:
    def look(block: Block) -> None:
        accumulate(setup, accumulator, block.time_ns, block.record, block.reference, block.path)
        if stop():
            raise StoppedError

    return look
