"""Define the trials of a benchmark; a trial is a campaign of one controller on one scenario, set and plant.

Sample k is the same crane in all trials of a scenario and set, for every controller and plant. The rules have
a digest, and results of different rules are never compared.
"""

import hashlib
import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, Literal, NamedTuple

import cranectl.metrics
from cranectl.campaign import Campaign, CampaignSettings, is_distribution, unchecked_campaign
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.metrics import Limits
from cranectl.plants import PhysicsStep
from cranectl.scenario import ScenarioFile
from cranectl.support import InputError, Provenance, Shipped, Tree
from cranectl.tools.benchmark.settings import (
    RADIUS_PREFIX,
    SINGLE_PREFIX,
    Benchmark,
    BenchmarkScenario,
    CraneSet,
)

Division = Literal["published", "tuned"]  # controllers with default numbers, or with tuned ones
DIVISIONS: tuple[Division, ...] = ("tuned", "published")  # in the order of reports


class Trial(NamedTuple):
    """One controller on one plant, set of cranes and scenario."""

    division: Division
    plant: str
    crane_set: str
    scenario: str
    controller: str

    @property
    def folder(self) -> Path:
        """Folder of its result, relative to that of the benchmark."""
        return Path(*self)


def follows(controller: str) -> str:
    """Return what a controller follows, "path" or "set-point"; raise InputError if it is unknown."""
    return ALL_CONTROLLERS[ALL_CONTROLLERS.checked(controller)].follows


def sets_of(benchmark: Benchmark) -> dict[str, CraneSet]:
    """Return all sets of cranes: for the ranking, the robustness radius, and with one uncertainty each."""
    return {**benchmark.sets, **radius_sets(benchmark), **single_sets(benchmark)}


def radius_sets(benchmark: Benchmark) -> dict[str, CraneSet]:
    """Return the sets that find the robustness radius, the smallest spread first."""
    common: dict[str, Any] = {"draws": benchmark.radius.draws, "scenarios": (benchmark.radius.scenario,)}
    return {f"{RADIUS_PREFIX}{s:g}": CraneSet(spread=s, **common) for s in benchmark.radius.spreads}


def single_sets(benchmark: Benchmark) -> dict[str, CraneSet]:
    """Return the sets on which only one uncertainty acts."""
    if (singles := benchmark.singles) is None:
        return {}
    common: dict[str, Any] = {
        "spread": singles.spread,
        "draws": singles.draws,
        "scenarios": (singles.scenario,),
    }
    return {f"{SINGLE_PREFIX}{name}": CraneSet(only=only, **common) for name, only in singles.effects.items()}


def trials_of(
    benchmark: Benchmark,
    controllers: Sequence[str],
    sets: Sequence[str] = (),
    scenarios: Sequence[str] = (),
    *,
    division: Division = "published",
) -> list[Trial]:
    """Return all trials of these controllers, restricted to `sets` and `scenarios` if any are named.

    Their order is by set, scenario and plant, so that trials with common data follow each other.
    """
    known = sets_of(benchmark)
    for kind, names, allowed in (("set", sets, known), ("scenario", scenarios, benchmark.scenarios)):
        InputError.check_known(f"{kind} of {benchmark.name}", names, allowed)
    plants = (benchmark.plant, benchmark.second_plant)
    return [
        Trial(division, plant, name, scenario, controller)
        for name in sets or known
        for (scenario, measured), plant, controller in product(
            benchmark.scenarios.items(), plants, controllers
        )
        if scenario in (known[name].scenarios or benchmark.scenarios)
        and scenario in (scenarios or benchmark.scenarios)
        and (plant == benchmark.plant or name in benchmark.sets)
        and follows(controller) in measured.suits
    ]


def campaign_of(
    benchmark: Benchmark,
    trial: Trial,
    *,
    max_cranes: int | None = None,
    tuned: Callable[[str, float], Sequence[str]] = lambda _controller, _length: (),
) -> Campaign:
    """Return the campaign of `trial` with at most `max_cranes` cranes.

    `tuned(name, length)` returns the settings of a tuned controller, on a crane `length` times as large as
    the laboratory rig. Raises InputError as `unchecked_campaign`.
    """
    cranes = sets_of(benchmark)[trial.crane_set]
    draws = cranes.draws if max_cranes is None else min(max_cranes, cranes.draws)
    if trial.plant == benchmark.second_plant:
        draws = max(1, round(benchmark.second_share * draws))
    numbers: Sequence[str] = ()
    if trial.division == "tuned":
        numbers = tuned(trial.controller, crane_length(benchmark, trial.scenario))
    return trial_campaign(
        benchmark,
        trial.scenario,
        trial.controller,
        plant=trial.plant,
        runs=draws,
        seed=benchmark.seed,
        spread=cranes.spread,
        numbers=numbers,
        uncertain=_uncertain(benchmark, cranes, benchmark.scenarios[trial.scenario]),
    )


def crane_length(benchmark: Benchmark, scenario: str) -> float:
    """Return the size of the crane of `scenario` relative to the laboratory rig.

    Raises InputError if the scenario cannot be read.
    """
    return ScenarioFile.read(scenario_source(benchmark, scenario)).rig.design_scale


def _uncertain(benchmark: Benchmark, cranes: CraneSet, measured: BenchmarkScenario) -> dict[str, Any]:
    distributions = _flat(benchmark.uncertain, cranes.uncertain, measured.uncertain)
    if not cranes.only:
        return distributions
    selected = {
        name: distribution
        for name, distribution in distributions.items()
        if any(f"{name}.".startswith(f"{only}.") for only in cranes.only)
    }
    if not selected:
        raise InputError(
            f"{', '.join(cranes.only)}: no uncertain parameter has such a name",
            allowed=", ".join(distributions),
            remedy="name one of these, or a table that contains some of them",
        )
    return selected


def trial_campaign(
    benchmark: Benchmark,
    scenario: str,
    controller: str,
    *,
    plant: str,
    numbers: Sequence[str] = (),
    **settings: Any,
) -> Campaign:
    """Make a campaign of one controller on a scenario of the benchmark, with `numbers` as key=value.

    All controllers get the same cranes. Raises InputError as `unchecked_campaign`.
    """
    measured = benchmark.scenarios[scenario]
    file = scenario_source(benchmark, scenario)
    table = {
        "name": scenario,
        "scenario": file,
        "controllers": [controller],
        "plants": [plant],
        "drive": benchmark.drive,
        "sampling": "monte-carlo",
        "set": [*benchmark.set, *measured.set, *numbers],
        "uncertain": _flat(benchmark.uncertain, measured.uncertain),
        "limits": Limits.by_plant(ScenarioFile.read(file), [plant])[plant],
        **settings,
    }
    campaign = unchecked_campaign(CampaignSettings.parse(table, benchmark.name))
    # All cranes have the step of the nominal one, so that judged runs do not depend on how steps are chosen.
    return replace(campaign, nominal=PhysicsStep(campaign.nominal, campaign.settings.drive).stated())


def scenario_source(benchmark: Benchmark, scenario: str) -> str:
    """Return the name of a scenario of the benchmark, or the path of its file.

    Raises InputError if the file does not exist.
    """
    file = benchmark.scenarios[scenario].file
    if not Shipped.is_path(file):
        return file
    path = benchmark.file.parent / file
    if not path.is_file():
        raise InputError(
            f"{path}, a scenario of the benchmark, is not a file",
            allowed="the name of a scenario, or the path of its file from the benchmark's",
            remedy="correct the path",
        )
    return str(path)


def stated_rules(benchmark: Benchmark) -> str:
    """Return the rules that files state: the benchmark without controllers and seed, scenarios and rigs.

    Raises InputError for a scenario that cannot be read.
    """
    scenarios = {}
    for name in benchmark.scenarios:
        scenario = ScenarioFile.read(scenario_source(benchmark, name))
        stated = scenario.model_dump(mode="json", exclude_unset=True, exclude={"title"})
        scenarios[name] = [stated, scenario.rig.model_dump(mode="json")]
    table = benchmark.model_dump(mode="json", exclude={"laws", "seed", "title"})
    return json.dumps([table, scenarios], sort_keys=True)


def rules_of(benchmark: Benchmark) -> str:
    """Return a digest of the rules, on which all comparisons depend.

    Rules are those that files state, and the code of the metrics without comments and docstrings. Raises
    InputError for a scenario that cannot be read.
    """
    text = stated_rules(benchmark)
    for path in sorted(Path(inspect.getfile(cranectl.metrics)).parent.glob("*.py")):
        text += Provenance.syntax_of(path.read_bytes()).decode()
    return hashlib.sha256(text.encode()).hexdigest()[: Provenance.DIGITS]


def _flat(*tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return distributions by the dotted names of their parameters; later tables replace earlier ones."""
    return {name: found for table in tables for name, found in Tree(table).leaves(is_leaf=is_distribution)}
