"""Runs samples one after the other, on plants of its own whose parameters are changed in place."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.definition import Batch, sampled_scenario
from cranectl.campaign.prepared import Prepared
from cranectl.campaign.table import FAILED, Row, metric_values
from cranectl.metrics import RunMetrics, accumulate, empty_accumulator, finish, metrics_setup
from cranectl.plants.plant import Plant
from cranectl.plants.registry import check_effects
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


class Outcome(NamedTuple):
    """How a run ended; `metrics` are None where there was none."""

    status: str
    reason: str
    end_s: float
    metrics: RunMetrics | None


class Worker:
    """For one thread. Gives the same rows as any other worker, whatever it ran before."""

    def __init__(self, prepared: Prepared) -> None:
        self._prepared = prepared
        self._plants: dict[tuple[str, int], Plant] = {}  # by name and steps of a control period
        self._records: dict[int, Array] = {}  # by width
        self._path_record = np.zeros((BLOCK, PATH_WIDTH))

    def run_batch(self, batch: Batch, stop: Stop = never) -> list[Row]:
        """The rows of `batch`; raises StoppedError soon after `stop` says so."""
        return [self._row(batch, sample, stop) for sample in range(batch.first, batch.last)]

    def _row(self, batch: Batch, sample: int, stop: Stop) -> Row:
        """One run; whatever goes wrong in it is the reason of a failed row."""
        campaign, values = self._prepared.campaign, self._prepared.values(sample)
        try:
            scenario = sampled_scenario(campaign, values, f"sample {sample}")
            outcome = self._run(batch, scenario, stop)
        except StoppedError:
            raise
        except Exception as error:
            self._plants.clear()  # one of them is in an unknown state
            outcome = Outcome(FAILED, _reason(error), 0.0, None)
        return {
            "sample": sample,
            "plant": batch.plant,
            "controller": batch.controller,
            "status": outcome.status,
            "reason": outcome.reason,
            "end_s": outcome.end_s,
            **dict(zip(campaign.names, map(float, values), strict=True)),
            **metric_values(outcome.metrics),
        }

    def _run(self, batch: Batch, scenario: Scenario, stop: Stop) -> Outcome:
        controller = self._prepared.controller(batch.controller, scenario)
        plan = plan_run(controller.reference, scenario)
        plant = self._plant(batch.plant, scenario)
        run = start_run(
            plant,
            scenario,
            controller.law,
            plan,
            nominal=controller.nominal,
            path_record=self._path_record,
        )
        setup, accumulator = metrics_setup(scenario, plant.drive), empty_accumulator()

        def measure(block: Block) -> None:
            accumulate(setup, accumulator, block.time_ns, block.record, block.reference, block.path)
            if stop():
                raise StoppedError

        record = self._records.setdefault(controller.width, np.zeros((BLOCK, controller.width)))
        end_ns, status = stream_run(run, plan, record, measure)
        metrics = finish(setup, accumulator, status, end_ns)
        reason = status.explanation if status.stopped else ""
        return Outcome(status.label, reason, end_ns / NANOSECONDS, metrics)

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


def _reason(error: Exception) -> str:
    """An error on one line, with its type."""
    text = (
        f"{error.found}; {error.allowed}" if isinstance(error, InputError) else " ".join(str(error).split())
    )
    return f"{type(error).__name__}: {text}".rstrip(":; ")
