"""The first failure of each controller, with the commands that show it."""

import os
import shlex
from collections.abc import Iterator, Mapping
from itertools import chain, product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cranectl.campaign import MANIFEST_FILE, Manifest, read_manifest
from cranectl.report import Cell, Section, Table
from cranectl.status import RunStatus
from cranectl.tools.benchmark.declared import controller_files
from cranectl.tools.benchmark.ranking import Judged
from cranectl.tools.benchmark.report.sets import NAMED, TITLES, named
from cranectl.tools.benchmark.trials import Trial
from cranectl.tools.benchmark.tuned import DEFAULT

FILE = "FILE"  # of a controller, where it is not known
REPEATED = Path("failures")  # where a trial runs again


class FirstFailure(NamedTuple):
    """The failed run of a controller on a set that takes the fewest runs to repeat."""

    trial: Trial
    sample: int
    status: str


def failures_section(divisions: list[Judged], result: Path | None) -> Iterator[Section]:
    """Yield the first failure of each controller on each judged set, and how to look at it."""
    headings = (*NAMED, "set", "scenario", "crane", "ended", "to see it")
    tables = []
    for judged in divisions:
        files = controller_files(judged.benchmark)
        trials = product(judged.best_first, judged.benchmark.sets)
        failures = filter(None, (first_failure(judged, controller, name) for controller, name in trials))
        rows = []
        for failure in failures:
            trial, status = failure.trial, failure.status
            ended = "beyond a limit" if status == RunStatus.COMPLETED.label else status
            places = trial.crane_set, trial.scenario, str(failure.sample), ended
            command = Cell(_command(judged, failure, result, files), "code")
            rows.append(Cell.row(*named(judged, trial.controller), *places, command))
        if rows:
            tables.append(Table(TITLES[judged.division], headings, tuple(rows), labels=7, folded=True))
    if tables:
        text = "The first failure of each on each set."
        if any("benchmark run" in row[-1].text for table in tables for row in table.rows):
            text += " In a checkout of cranectl the commands run the cranes up to that one, and show it."
        if any(FILE in shlex.split(row[-1].text) for table in tables for row in table.rows):
            text += f" {FILE} is that of the controller; one that is built anew must be tuned anew."
        yield Section("failures", "Failures to look at", (text,), tuple(tables))


def first_failure(judged: Judged, controller: str, crane_set: str) -> FirstFailure | None:
    """Return the failure with the lowest crane of all scenarios, or None if no run failed."""
    failures = []
    for scenario in judged.benchmark.scenarios:
        runs = judged.runs(crane_set, scenario, controller)
        if runs is not None and runs.failed.any():
            sample = int(np.flatnonzero(runs.failed)[0])
            trial = judged.trial(crane_set, scenario, controller)
            failures.append(FirstFailure(trial, sample, runs.status[sample]))
    return min(failures, key=lambda failure: failure.sample, default=None)


def _command(judged: Judged, failure: FirstFailure, result: Path | None, files: Mapping[str, str]) -> str:
    """Return the commands that show a failure; without its result the trial runs again before."""
    trial, controller, benchmark = failure.trial, failure.trial.controller, judged.benchmark
    is_file = bool(judged.table.about["laws"][controller]["file"])
    place = os.path.relpath(benchmark.file.parent / files[controller]) if controller in files else FILE
    folder, commands = REPEATED / trial.folder, []
    if result and (result / trial.folder / MANIFEST_FILE).exists():
        folder = result / trial.folder
        known = Manifest.controller(read_manifest(folder), folder, controller)
        place = FILE if known == controller else known
    else:
        own = [] if benchmark.name == DEFAULT else [os.path.relpath(benchmark.file)]
        options = {
            "--division": trial.division,
            "--controller": place if is_file else controller,
            "--set-of-cranes": trial.crane_set,
            "--scenario": trial.scenario,
            "--draws": str(failure.sample + 1),
            "--out": str(REPEATED),
        }
        commands.append(shlex.join(["cranectl", "benchmark", "run", *own, *chain(*options.items())]))
    replay = ["cranectl", "campaign", "replay", str(folder), "--run", str(failure.sample)]
    commands.append(shlex.join([*replay, *(["--controller", place] if is_file else [])]))
    return " && ".join(commands)
