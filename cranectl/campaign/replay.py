"""Run some runs of a result again, with everything logged, and prove that they are the same."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.campaign.definition import nominal_scenario, sampled_scenario
from cranectl.campaign.manifest import software_of
from cranectl.campaign.results import Results
from cranectl.campaign.sampling import sample_values
from cranectl.campaign.summary import worst_first
from cranectl.campaign.table import FAILED, METRIC_COLUMNS, metric_values
from cranectl.log.writer import write_log
from cranectl.metrics import run_metrics
from cranectl.simulate import simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError, unknown_name
from cranectl.support.provenance import provenance_differences


@dataclass(frozen=True)
class Replay:
    """One run that was run again."""

    sample: int
    plant: str
    controller: str
    log: Path
    status: str
    max_error_m: float | None
    differences: tuple[str, ...]  # from what the result says, a phrase for each figure
    software_differences: tuple[str, ...]  # what is installed and has not made the run, a phrase each

    @property
    def same(self) -> bool:
        """Whether every figure is that of the result, to the last bit."""
        return not self.differences

    @property
    def text(self) -> str:
        """The run in a line."""
        error = "" if self.max_error_m is None else f", error at most {self.max_error_m:.4f} m"
        return f"run {self.sample} with {self.controller} on {self.plant}: {self.status}{error}"

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {**asdict(self), "log": str(self.log), "same": self.same}


def chosen_rows(
    results: Results,
    *,
    samples: Sequence[int],
    worst: int,
    metric: str,
    plants: Sequence[str] = (),
    controllers: Sequence[str] = (),
) -> list[int]:
    """Rows of the result's table: all runs of `samples`, or without them the `worst` by `metric`.

    Only those on `plants` and with `controllers`, where given. Raises InputError for what the result lacks.
    """
    settings = results.campaign.settings
    if metric not in METRIC_COLUMNS:
        raise unknown_name("metric", metric, METRIC_COLUMNS)
    chosen = np.ones(len(results), dtype=np.bool_)
    requested = (("plant", plants, settings.plants), ("controller", controllers, settings.controllers))
    for kind, names, known in requested:
        for name in names:
            if name not in known:
                raise unknown_name(kind, name, known)
        if names:
            chosen &= np.isin(results.column(kind).astype(str), names)
    if not samples:
        rows = worst_first(results, metric, np.flatnonzero(chosen))[:worst]
        return [int(row) for row in rows]
    column = results.column("sample")
    for sample in samples:
        if sample not in column[chosen]:
            raise InputError(
                f"the result in {results.directory} has no run {sample}",
                allowed=f"samples from 0 to {results.campaign.runs - 1} that have been run",
                remedy="choose another with --run",
            )
    return np.flatnonzero(np.isin(column, samples) & chosen).tolist()


def replay_run(
    results: Results,
    row: int,
    directory: Path,
    *,
    every: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Replay:
    """Run the run of one row of the result's table again and log it.

    The log is PLANT-CONTROLLER-SAMPLE.mcap in `directory`. Raises InputError for a run that could not be run
    in the first place, and if the log cannot be written.
    """
    recorded, origin = results.row(row), results.origins[results.made_by[row]]
    campaign = results.campaign
    sample, plant, controller = recorded["sample"], recorded["plant"], recorded["controller"]
    if recorded["status"] == FAILED:
        raise InputError(
            f"run {sample} with {controller} on {plant} could not be run: {recorded['reason']}",
            allowed="runs that were simulated",
            remedy="choose another with --run",
        )
    (values,) = sample_values(campaign, sample, sample + 1)
    sampled = sampled_scenario(campaign, values, f"sample {sample}")
    run = simulate_run(
        sampled,
        nominal=nominal_scenario(campaign, sampled),
        plant=plant,
        drive=campaign.settings.drive,
        controller=controller,
        progress=progress,
    )
    if run.status == RunStatus.INTERRUPTED:
        raise KeyboardInterrupt
    metrics = run_metrics(run)
    again = {
        **dict(zip(campaign.names, map(float, values), strict=True)),
        **metric_values(metrics),
        "status": run.status.label,
        "end_s": run.end_s,
    }
    installed = software_of(campaign.settings.plants, campaign.settings.controllers)
    log = write_log(directory / f"{plant}-{controller}-{sample:07d}.mcap", [run], every=every)
    return Replay(
        sample=sample,
        plant=plant,
        controller=controller,
        log=log,
        status=run.status.label,
        max_error_m=None if metrics is None else metrics.max_error_m,
        differences=tuple(differences(recorded, again)),
        software_differences=tuple(provenance_differences(origin.versions, installed)),
    )


def differences(recorded: Mapping[str, Any], again: Mapping[str, Any]) -> list[str]:
    """Return in short phrases which values of `again` are not the recorded ones, compared to the bit."""
    return [
        f"{name} is {value!r}, was {recorded[name]!r}"
        for name, value in again.items()
        if _exact(value) != _exact(recorded[name])
    ]


def _exact(value: Any) -> Any:
    """Return a text that differs wherever a bit of the value differs, as for the two zeros."""
    return repr(float(value)) if isinstance(value, float) else value
