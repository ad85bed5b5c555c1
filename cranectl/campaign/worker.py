"""Run one batch of a campaign. Its rows depend on the campaign only, to the last bit."""

import functools
import threading
from collections.abc import Callable, Sequence
from typing import NamedTuple

from cranectl.campaign.definition import PERIOD, Batch, Campaign, nominal_scenario, sampled_scenario
from cranectl.campaign.sampling import sample_values
from cranectl.campaign.table import FAILED, Row, metric_values
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.metrics import Accumulator, RunMetrics
from cranectl.plants import PLANTS, PhysicsStep, Plant
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.simulate import Loop, PlannedReference, PreparedController, RunMemory
from cranectl.support import Array, InputError, MachineError

Stop = Callable[[], bool]

SAMPLE_BLOCK = 8192  # samples drawn at a time, because some methods need as long for a single one
CACHED_PERIODS = 16  # control periods whose references and controllers are cached
BLOCK = 1000  # control samples of a run in memory at a time
DESIGN_LOCK = threading.Lock()  # some design libraries are not safe for several threads


class PreparedCampaign:
    """The samples of a campaign, with controllers and references for the nominal crane, for all workers."""

    def __init__(self, campaign: Campaign, controllers: Sequence[str] | None = None) -> None:
        """Design all controllers; raise InputError if one of them cannot run."""
        self.campaign = campaign
        names = campaign.settings.controllers if controllers is None else controllers
        self._sample_block = functools.lru_cache(maxsize=4)(self._draw)
        self._reference = functools.lru_cache(maxsize=CACHED_PERIODS)(PlannedReference.of)
        self._controller = functools.lru_cache(maxsize=CACHED_PERIODS * len(names))(self._prepare)
        self._lock = threading.Lock()
        RunMemory(campaign.nominal).check_planned(others=_cached_periods(campaign))
        with DESIGN_LOCK:
            self._designs = {name: ALL_CONTROLLERS.design(name, campaign.nominal) for name in names}
            for name in names:
                self._controller(name, campaign.nominal)

    def controller(self, name: str, sampled: Scenario) -> PreparedController:
        """Return the controller `name` for the control period of a sample.

        Raises InputError if the controller refuses that period.
        """
        with self._lock:
            return self._controller(name, nominal_scenario(self.campaign, sampled))

    def values(self, sample: int) -> Array:
        """Return the values (d,) of one sample."""
        with self._lock:
            row: Array = self._sample_block(sample // SAMPLE_BLOCK)[sample % SAMPLE_BLOCK]
        return row

    def _draw(self, block: int) -> Array:
        first = block * SAMPLE_BLOCK
        return sample_values(self.campaign, first, min(first + SAMPLE_BLOCK, self.campaign.runs))

    def _prepare(self, name: str, nominal: Scenario) -> PreparedController:
        design, reference = self._designs[name], self._reference(nominal)
        return PreparedController.of(nominal, design, self.campaign.settings.drive, reference)


def _cached_periods(campaign: Campaign) -> list[Scenario]:
    """Return the nominal scenario with each of the CACHED_PERIODS shortest control periods of its runs."""
    uncertain = [parameter for parameter in campaign.parameters if parameter.name == PERIOD]
    periods = sorted(
        {float(p) for parameter in uncertain for p in parameter.values(parameter.distribution.grid())}
    )
    controls = [
        campaign.nominal.control.model_copy(update={"period": period}) for period in periods[:CACHED_PERIODS]
    ]
    return [campaign.nominal.model_copy(update={"control": control}) for control in controls]


class StoppedError(Exception):
    """A batch stopped before its end, on request."""


class RunEnd(NamedTuple):
    """How a run ended."""

    status: str
    reason: str  # why it stopped or failed; empty if it completed
    end_s: float = 0.0  # simulated time [s]
    metrics: RunMetrics | None = None


class Worker:
    """Runs batches in one thread; its rows do not depend on what it has run before."""

    def __init__(self, prepared: PreparedCampaign) -> None:
        self._prepared = prepared
        self._plants: dict[tuple[str, int, int], Plant] = {}  # by name, control period, steps in it
        self._records: dict[str, tuple[Array, Array]] = {}  # by controller

    def run_batch(self, batch: Batch, stop: Stop = lambda: False) -> list[Row]:
        """Return the rows of `batch`; repeat a run if the machine fails, for example for lack of memory.

        Raises StoppedError soon after `stop` returns True, and MachineError if the machine fails again.
        """
        samples = range(batch.first, batch.last)
        return [
            MachineError.retry(functools.partial(self._run_sample, batch, sample, stop)) for sample in samples
        ]

    def close(self) -> None:
        """Do nothing: this worker has no process to end."""

    def _run_sample(self, batch: Batch, sample: int, stop: Stop) -> Row:
        """Run one sample; an error of controller or plant gives a failed row with its reason."""
        campaign, values = self._prepared.campaign, self._prepared.values(sample)
        try:
            scenario = sampled_scenario(campaign, values, f"sample {sample}")
            end = self._run(batch, scenario, stop)
        except StoppedError:
            raise
        except Exception as error:
            self._plants.clear()  # the plant of this run is in an unknown state
            if MachineError.is_cause_of(error):
                text = f"{_reason(error)}, in sample {sample} with {batch.controller} on {batch.plant}"
                raise MachineError.of(text) from error
            end = RunEnd(FAILED, _reason(error))
        return row_of(self._prepared, batch, sample, end)

    def _run(self, batch: Batch, scenario: Scenario, stop: Stop) -> RunEnd:
        controller = self._prepared.controller(batch.controller, scenario)
        plan = controller.reference.plan(scenario)
        plant = self._plant(batch.plant, scenario)
        if batch.controller not in self._records:
            self._records[batch.controller] = controller.records(BLOCK)
        loop = Loop(plan, plant, controller, records=self._records[batch.controller])
        accumulator = Accumulator(scenario, plant.drive)
        while not (is_asked_to_stop := stop()) and not loop.is_finished:
            accumulator.add(*loop.advance(BLOCK))
        if is_asked_to_stop:
            raise StoppedError
        status, end_ns = loop.status, loop.end_ns
        metrics = accumulator.finish(status, end_ns)
        reason = status.explanation if status.stopped else ""
        return RunEnd(status.label, reason, end_ns / NANOSECONDS, metrics)

    def _plant(self, name: str, scenario: Scenario) -> Plant:
        """Return a plant for `scenario`; reuse an earlier one with new parameters if possible."""
        drive = self._prepared.campaign.settings.drive
        kind = name, scenario.period_ns, PhysicsStep(scenario, drive).per_period
        plant = self._plants.get(kind)
        if plant is not None:
            PLANTS.entry(name).check_scenario(scenario, drive)
            if plant.retune(scenario.rig, scenario.effects_on_plant):
                return plant
        self._plants[kind] = new = PLANTS.make(name, scenario, drive)
        return new


def row_of(prepared: PreparedCampaign, batch: Batch, sample: int, end: RunEnd) -> Row:
    """Return the row of a run with this `end` in the table of results."""
    return {
        "sample": sample,
        "plant": batch.plant,
        "controller": batch.controller,
        "status": end.status,
        "reason": end.reason,
        "end_s": end.end_s,
        **dict(zip(prepared.campaign.names, map(float, prepared.values(sample)), strict=True)),
        **metric_values(end.metrics),
    }


def _reason(error: Exception) -> str:
    """Return the type and text of an error on one line."""
    text = (
        f"{error.found}; {error.allowed}" if isinstance(error, InputError) else " ".join(str(error).split())
    )
    return f"{type(error).__name__}: {text}".rstrip(":; ")
