"""Repeat runs of a campaign with a full log each, and check that they give the same numbers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.campaign.definition import nominal_scenario, sampled_scenario
from cranectl.campaign.manifest import Manifest
from cranectl.campaign.results import RESUME, Results
from cranectl.campaign.sampling import sample_values
from cranectl.campaign.summary import worst_first
from cranectl.campaign.table import FAILED, METRIC_COLUMNS, metric_values
from cranectl.log import write_log
from cranectl.metrics import run_metrics
from cranectl.plants import PLANTS
from cranectl.simulate import simulate_run
from cranectl.status import RunStatus
from cranectl.support import InputError, JSONRecord


@dataclass(frozen=True)
class Replay(JSONRecord):
    """One repeated run."""

    JSON_PROPERTIES = ("same",)

    sample: int
    plant: str
    controller: str
    log: Path
    status: str
    max_error_m: float | None
    differences: tuple[str, ...]  # a phrase for each number that differs from the result
    software_differences: tuple[str, ...]  # a phrase for each package that has changed since

    @property
    def same(self) -> bool:
        """Whether every number equals that of the result, to the last bit."""
        return not self.differences

    @property
    def text(self) -> str:
        """The run and its outcome in one line."""
        error = "" if self.max_error_m is None else f", error at most {self.max_error_m:.4f} m"
        return f"run {self.sample} with {self.controller} on {self.plant}: {self.status}{error}"


def chosen_rows(
    results: Results,
    *,
    samples: Sequence[int],
    worst: int,
    metric: str,
    plants: Sequence[str] = (),
    controllers: Sequence[str] = (),
) -> list[int]:
    """Return the rows of all runs of `samples`; without samples, of the `worst` runs by `metric`.

    `plants` and `controllers` restrict the rows, if any are named. Raises InputError for names and samples
    that the result lacks, and if there is no run at all.
    """
    settings = results.campaign.settings
    InputError.check_known("metric", [metric], METRIC_COLUMNS)
    chosen = np.ones(len(results), dtype=np.bool_)
    requested = (("plant", plants, settings.plants), ("controller", controllers, settings.controllers))
    for kind, names, known in requested:
        InputError.check_known(kind, names, known)
        if names:
            chosen &= np.isin(results.column(kind).astype(str), names)
    if not chosen.any():
        raise InputError(
            f"{results.directory} has no such run yet",
            allowed="runs that have been run",
            remedy=f"complete it with {Manifest.resume_command(results.manifest) or RESUME}",
        )
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


def check_models(results: Results, rows: Sequence[int]) -> None:
    """Raise InputError if a run of `rows` was on a model file that has changed since."""
    for row in rows:
        plant = results.row(row)["plant"]
        was = results.origins[results.made_by[row]].versions.get(f"model {plant}")
        entry = PLANTS.entry(plant)
        now = entry.digest
        if was and now and was != now:
            raise InputError(
                f"the model file {entry.argument} has changed: its digest is {now}, that of the "
                f"result is {was}",
                allowed="the file with which the campaign was run, or runs on other plants",
                remedy="restore the file, or run the campaign again with --overwrite",
            )


def replay_run(
    results: Results,
    row: int,
    directory: Path,
    *,
    every: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Replay:
    """Repeat the run of one row of the result's table, and log it as PLANT-CONTROLLER-SAMPLE.mcap.

    `directory` is the folder of the log. Raises InputError if the campaign could not run this sample, or if
    the log cannot be written.
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
    repeated = {
        **dict(zip(campaign.names, map(float, values), strict=True)),
        **metric_values(metrics),
        "status": run.status.label,
        "end_s": run.end_s,
    }
    settings = campaign.settings
    log = write_log(directory / f"{plant}-{controller}-{sample:07d}.mcap", [run], every=every)
    return Replay(
        sample=sample,
        plant=plant,
        controller=controller,
        log=log,
        status=run.status.label,
        max_error_m=None if metrics is None else metrics.max_error_m,
        differences=tuple(differences(recorded, repeated)),
        software_differences=Manifest.changes_of_software(
            origin.versions, settings.plants, settings.controllers
        ),
    )


def differences(recorded: Mapping[str, Any], repeated: Mapping[str, Any]) -> list[str]:
    """Return a short phrase for each repeated value that differs from the recorded one in any bit."""
    return [
        f"{name} is {value!r}, was {recorded[name]!r}"
        for name, value in repeated.items()
        if _exact(value) != _exact(recorded[name])
    ]


def _exact(value: Any) -> Any:
    """Return a text that differs if any bit of the value differs; 0.0 and -0.0 differ too."""
    return repr(float(value)) if isinstance(value, float) else value
