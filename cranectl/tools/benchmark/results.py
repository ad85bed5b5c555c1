"""Run the trials of a benchmark, and collect their results in one table.

The result of a trial is that of a campaign, so `cranectl campaign replay` can repeat its runs.
"""

import functools
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from cranectl.campaign import (
    FAILED,
    MANIFEST_FILE,
    Campaign,
    Engine,
    Manifest,
    PreparedCampaign,
    Results,
    StoppedError,
    Store,
    check_values,
    read_results,
)
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.design import CONTROLLERS as FLAT_FAMILY
from cranectl.support import InputError, MachineError, Provenance, Table
from cranectl.tools.benchmark.declared import information
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.table import BenchmarkTable, Runs
from cranectl.tools.benchmark.trials import DIVISIONS, Trial, campaign_of, crane_length, trials_of
from cranectl.tools.benchmark.tuned import TunedResult

ANY_CONTROLLER = FLAT_FAMILY[0]  # stands for all where a result does not depend on the controller


class FinishedTrial(NamedTuple):
    """A trial with all its runs."""

    trial: Trial
    not_run: str = ""  # why its controller could not run at all; empty if it ran
    quarantined: tuple[str, ...] = ()  # a phrase for each damaged part that was run again


def run_trials(
    trials: Sequence[Trial],
    campaign_for: Callable[[Trial], Campaign],
    directory: Path,
    engine: Engine,
    *,
    workers: int,
    despite_differences: bool = False,
) -> Iterator[FinishedTrial]:
    """Run all missing batches of `trials`, `workers` trials at a time, and yield each finished trial.

    The results are below `directory`. If the caller stops the iteration, finished batches stay there. Raises
    InputError as `Store.open` and campaigns do, except for a controller that refuses the crane.
    """
    stopped = threading.Event()

    def write_missing(campaign: Campaign, store: Store) -> None:
        if store.missing:
            with closing(engine(campaign, store.missing, stop=stopped.is_set)) as finished:
                for batch, rows in finished:
                    store.write(batch, rows)

    def run(trial: Trial) -> FinishedTrial:
        if stopped.is_set():
            raise StoppedError
        campaign = campaign_for(trial)
        result_directory = directory / trial.folder
        results = _finished_result(campaign, result_directory)
        if results is not None:
            return FinishedTrial(trial, _not_run(results))
        check_values(campaign)
        try:
            with Store.open(
                campaign, result_directory, resume=True, despite_differences=despite_differences
            ) as store:
                write_missing(campaign, store)
        except MachineError:  # not caused by the controller, so it must not count as a refusal
            raise
        except InputError:
            if reason := _refusal(campaign):
                return FinishedTrial(trial, reason)
            raise
        return FinishedTrial(trial, _not_run(read_results(result_directory)), store.quarantined)

    with ThreadPoolExecutor(workers, thread_name_prefix="trial") as pool:
        try:
            for future in as_completed([pool.submit(run, trial) for trial in trials]):
                yield future.result()
        finally:
            stopped.set()
            pool.shutdown(cancel_futures=True)


def _finished_result(campaign: Campaign, directory: Path) -> Results | None:
    """Return the finished result of `campaign` by the installed software; None if `Store.open` changes it."""
    if not (directory / MANIFEST_FILE).exists():
        return None
    try:
        results = read_results(directory)
    except InputError:  # `Store.open` repairs it or raises the error
        return None
    expected = Manifest.of(campaign)
    settings = {name: value for name, value in expected.items() if name not in ("versions", "accepted")}
    is_own = any(not Provenance.differences(o.versions, expected["versions"]) for o in results.origins)
    return results if is_own and results.manifest | settings == results.manifest else None


def _refusal(campaign: Campaign) -> str:
    """Return why the controller of `campaign` cannot run on the nominal crane, or an empty text."""
    try:
        PreparedCampaign(campaign)
    except InputError as error:
        return error.found
    return ""


def _not_run(results: Results) -> str:
    return str(results.column("reason")[0]) if set(results.column("status")) == {FAILED} else ""


def find_begun_trials(benchmark: Benchmark, directory: Path, controllers: Sequence[str]) -> list[Trial]:
    """Return all trials of these controllers that have a result below `directory`, finished or not."""
    trials = (
        trial for division in DIVISIONS for trial in trials_of(benchmark, controllers, division=division)
    )
    return [trial for trial in trials if (directory / trial.folder / MANIFEST_FILE).exists()]


def collect_results(
    benchmark: Benchmark,
    rules: str,
    directory: Path,
    *,
    begun: Iterable[Trial],
    tuned: Path,
    advance: Callable[[float], None],
) -> BenchmarkTable:
    """Collect the results below `directory` of those trials in `begun` that are finished.

    `rules` is the digest of the benchmark's rules, and `tuned` the directory with the numbers of tuned
    controllers. A trial may have fewer cranes than the benchmark. Calls `advance(1)` for each trial. Raises
    InputError in these cases:

    - No trial is finished, or one is damaged.
    - A trial has other cranes than the benchmark, another version of a controller, or other tuned numbers.
    """
    trials, nominal, made_by = {}, {}, {}
    expected_manifest = functools.cache(lambda trial: Manifest.of(campaign_of(benchmark, trial)))
    lengths = {name: crane_length(benchmark, name) for name in benchmark.scenarios}
    for trial in begun:
        advance(1.0)
        results = read_results(directory / trial.folder, unfinished=True)
        if results.missing:
            continue
        _check_same(results, expected_manifest(trial._replace(controller=ANY_CONTROLLER)), trial.controller)
        trials[trial] = Runs.of(results.column, results.campaign.settings.limits.given)
        for origin in results.origins:
            software = {
                name: version for name, version in origin.versions.items() if not name.startswith("law ")
            }
            made_by[tuple(software.items())] = software
        nominal[trial.scenario] = results.campaign.nominal
        if trial.division == "tuned":
            numbers = TunedResult.settings(
                tuned, rules, trial.controller, lengths[trial.scenario], str(benchmark.file)
            )
            expected = (*benchmark.set, *benchmark.scenarios[trial.scenario].set, *numbers)
            if tuple(results.campaign.settings.set) != expected:
                raise InputError(
                    f"{results.directory} was run with other numbers than those in {tuned}",
                    allowed="results of the numbers in that directory",
                    remedy="name their directory with --tuned, or run the controller again with a new --out",
                )
    if not trials:
        raise InputError(
            f"{directory} holds no finished result of these controllers",
            allowed="a directory that 'cranectl benchmark run' has written",
            remedy="check the path, or run the benchmark",
        )
    about = {
        "rules": rules,
        "seed": benchmark.seed,
        "made_by": list(made_by.values()),
        "durations": {name: scenario.duration for name, scenario in nominal.items()},
        "laws": {trial.controller: information(trial.controller) for trial in trials},
        "tuned": {
            controller: TunedResult.facts(tuned, rules, controller, str(benchmark.file))
            for controller in dict.fromkeys(trial.controller for trial in trials if trial.division == "tuned")
        },
    }
    return BenchmarkTable(about, trials)


def _check_same(results: Results, expected: Table, controller: str) -> None:
    """Raise InputError unless `results` are those of `expected`, but for controller and number of cranes."""
    manifest = results.manifest
    adapted = {
        **manifest,
        "campaign": manifest["campaign"]
        | {key: expected["campaign"][key] for key in ("controllers", "runs")},
        "scenario": manifest["scenario"]
        | {key: expected["scenario"][key] for key in ("controller", "design")},
        "runs": expected["runs"],
    }
    phrases = Manifest.differences(adapted, expected)
    digest = ALL_CONTROLLERS.digests([controller]).items()
    phrases += [f"{controller} has changed" for o in results.origins if not digest <= o.versions.items()][:1]
    if phrases:
        raise InputError(
            f"{results.directory} was not run by this benchmark: {'; '.join(phrases)}",
            allowed="results of the present scenarios, cranes and controllers",
            remedy="run it again in another directory with --out",
        )
