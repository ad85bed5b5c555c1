"""Run the trials of a benchmark, each into a result of its own, a campaign's; make one table of all results.

A result can be replayed.
"""

import functools
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from cranectl.campaign.benchmark.declared import information
from cranectl.campaign.benchmark.settings import Benchmark
from cranectl.campaign.benchmark.table import BenchmarkTable, runs_of
from cranectl.campaign.benchmark.trials import DIVISIONS, Trial, campaign_of, crane_length, trials_of
from cranectl.campaign.benchmark.tuned import tuned_facts, tuned_settings
from cranectl.campaign.definition import Campaign
from cranectl.campaign.load import check_values
from cranectl.campaign.manifest import differences, manifest_of
from cranectl.campaign.results import MANIFEST_FILE, Results, Store, open_store, read_results
from cranectl.campaign.table import FAILED
from cranectl.campaign.worker import Prepared, StoppedError
from cranectl.campaign.workers import Engine
from cranectl.controllers.registry import controller_digests
from cranectl.design import CONTROLLERS as FLAT_FAMILY
from cranectl.support.documents import Table
from cranectl.support.errors import InputError, MachineError
from cranectl.support.provenance import provenance_differences

ANY = FLAT_FAMILY[0]  # law, where it does not matter which


class Ended(NamedTuple):
    """A trial that is whole."""

    trial: Trial
    not_run: str = ""  # why its law could not be run at all, "" where it could
    quarantined: tuple[str, ...] = ()  # what was damaged and has been run again, a phrase each


def run_trials(
    trials: Sequence[Trial],
    campaign_for: Callable[[Trial], Campaign],
    directory: Path,
    engine: Engine,
    *,
    workers: int,
    despite_differences: bool = False,
) -> Iterator[Ended]:
    """Run what is missing of `trials` below `directory`, `workers` at a time; yields each that is whole.

    Batches that ended are kept when the caller leaves. Raises InputError as `open_store` and campaigns do,
    but for a controller that refuses the crane.
    """
    left = threading.Event()

    def write_missing(campaign: Campaign, store: Store) -> None:
        if store.missing:
            with closing(engine(campaign, store.missing, stop=left.is_set)) as finished:
                for batch, rows in finished:
                    store.write(batch, rows)

    def run(trial: Trial) -> Ended:
        if left.is_set():
            raise StoppedError
        campaign = campaign_for(trial)
        folder = directory / trial.place
        whole = _whole_result(campaign, folder)
        if whole is not None:
            return Ended(trial, _not_run(whole))
        check_values(campaign)
        try:
            with open_store(campaign, folder, resume=True, despite_differences=despite_differences) as store:
                write_missing(campaign, store)
        except MachineError:  # no result: the trial is run again the next time
            raise
        except InputError:
            if refused := _refusal(campaign):
                return Ended(trial, refused)
            raise
        return Ended(trial, _not_run(read_results(folder)), store.quarantined)

    with ThreadPoolExecutor(workers, thread_name_prefix="trial") as pool:
        try:
            for future in as_completed([pool.submit(run, trial) for trial in trials]):
                yield future.result()
        finally:
            left.set()
            pool.shutdown(cancel_futures=True)


def _whole_result(campaign: Campaign, directory: Path) -> Results | None:
    """Return the finished result of `campaign` in `directory` by the installed software, else None.

    It says what `open_store` would make it say, and is neither held nor written.
    """
    if not (directory / MANIFEST_FILE).exists():
        return None
    try:
        results = read_results(directory)
    except InputError:  # which `open_store` mends, or says
        return None
    wanted = manifest_of(campaign)
    stated = {name: value for name, value in wanted.items() if name not in ("versions", "accepted")}
    made_here = any(not provenance_differences(o.versions, wanted["versions"]) for o in results.origins)
    return results if made_here and results.manifest | stated == results.manifest else None


def _refusal(campaign: Campaign) -> str:
    """Return why the controller of `campaign` cannot run on the nominal crane, or an empty text."""
    try:
        Prepared(campaign)
    except InputError as error:
        return error.found
    return ""


def _not_run(results: Results) -> str:
    return str(results.column("reason")[0]) if set(results.column("status")) == {FAILED} else ""


def begun_trials(benchmark: Benchmark, directory: Path, controllers: Sequence[str]) -> list[Trial]:
    """Return the trials of these controllers that were begun below `directory`, in all divisions."""
    trials = (
        trial for division in DIVISIONS for trial in trials_of(benchmark, controllers, division=division)
    )
    return [trial for trial in trials if (directory / trial.place / MANIFEST_FILE).exists()]


def collected(
    benchmark: Benchmark,
    rules: str,
    directory: Path,
    *,
    begun: Iterable[Trial],
    tuned: Path,
    advance: Callable[[float], None],
) -> BenchmarkTable:
    """Collect the complete ones of the trials `begun` below `directory`; call `advance(1)` for each.

    `rules`: digest of those of `benchmark`; `tuned`: where the numbers of tuned controllers are. Raises
    InputError where no trial is whole, where one is damaged, and where controllers have run on other cranes
    than the benchmark's, were others, or had other numbers than these. A trial may have fewer cranes.
    """
    trials, nominal, made_by = {}, {}, {}
    wanted_of = functools.cache(lambda trial: manifest_of(campaign_of(benchmark, trial)))
    lengths = {name: crane_length(benchmark, name) for name in benchmark.scenarios}
    for trial in begun:
        advance(1.0)
        results = read_results(directory / trial.place, unfinished=True)
        if results.missing:
            continue
        _check_same(results, wanted_of(trial._replace(law=ANY)), trial.law)
        trials[trial] = runs_of(results.column, results.campaign.settings.limits.given)
        for origin in results.origins:
            software = {
                name: version for name, version in origin.versions.items() if not name.startswith("law ")
            }
            made_by[tuple(software.items())] = software
        nominal[trial.scenario] = results.campaign.nominal
        if trial.division == "tuned":
            numbers = tuned_settings(tuned, rules, trial.law, lengths[trial.scenario], str(benchmark.file))
            wanted = (*benchmark.set, *benchmark.scenarios[trial.scenario].set, *numbers)
            if tuple(results.campaign.settings.set) != wanted:
                raise InputError(
                    f"{results.directory} was run with other numbers than those in {tuned}",
                    allowed="results of the numbers that are there",
                    remedy="name their directory, --tuned, or run the controller again in another one, --out",
                )
    if not trials:
        raise InputError(
            f"{directory} holds no whole result of these controllers",
            allowed="a directory that 'cranectl benchmark run' has written",
            remedy="check the place, or run the benchmark",
        )
    about = {
        "rules": rules,
        "seed": benchmark.seed,
        "made_by": list(made_by.values()),
        "durations": {name: scenario.duration for name, scenario in nominal.items()},
        "laws": {trial.law: information(trial.law) for trial in trials},
        "tuned": {
            controller: tuned_facts(tuned, rules, controller, str(benchmark.file))
            for controller in dict.fromkeys(trial.law for trial in trials if trial.division == "tuned")
        },
    }
    return BenchmarkTable(about, trials)


def _check_same(results: Results, wanted: Table, controller: str) -> None:
    """Raise InputError unless `results` are those of the campaign `wanted` with this `controller`.

    What is the controller's own is not looked at, nor how many cranes there are.
    """
    manifest = results.manifest
    alike = {
        **manifest,
        "campaign": manifest["campaign"] | {own: wanted["campaign"][own] for own in ("controllers", "runs")},
        "scenario": manifest["scenario"] | {own: wanted["scenario"][own] for own in ("controller", "design")},
        "runs": wanted["runs"],
    }
    other = differences(alike, wanted)
    known = controller_digests([controller]).items()
    other += [f"{controller} was another" for o in results.origins if not known <= o.versions.items()][:1]
    if other:
        raise InputError(
            f"{results.directory} was not run by this benchmark: {'; '.join(other)}",
            allowed="results of the scenarios, cranes and controllers as they are",
            remedy="run it again in another directory, --out",
        )
