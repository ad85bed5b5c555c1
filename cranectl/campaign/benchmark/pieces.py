"""The pieces of a benchmark: one law on one scenario, set of cranes and plant, each a campaign.

Sample k is the same crane in every piece of a scenario and set, whatever law or plant.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, Literal, NamedTuple

from cranectl.campaign.benchmark.settings import RADIUS, SINGLE, Benchmark, CraneSet, MeasuredScenario
from cranectl.campaign.definition import Campaign
from cranectl.campaign.load import stated_campaign
from cranectl.campaign.settings import parse_campaign
from cranectl.controllers.registry import checked_controller, load_controller
from cranectl.metrics.limits import limits_of
from cranectl.scenario.load import read_scenario
from cranectl.scenario.similarity import size_of
from cranectl.support import resources
from cranectl.support.documents import leaves
from cranectl.support.errors import InputError, unknown_name

Division = Literal["published", "tuned"]  # its defaults, or what tuning has found
DIVISIONS: tuple[Division, ...] = ("tuned", "published")  # as they are shown


class Trial(NamedTuple):
    """A campaign of one law."""

    division: Division
    plant: str
    crane_set: str
    scenario: str
    law: str  # name of the controller

    @property
    def place(self) -> Path:
        """Of its result below that of the benchmark."""
        return Path(*self)


def follows(law: str) -> str:
    """What a law follows, "path" or "set-point"; raises InputError for an unknown one."""
    return load_controller(checked_controller(law)).follows


def sets_of(benchmark: Benchmark) -> dict[str, CraneSet]:
    """The sets that are judged, then those that find the radius and what one uncertainty does."""
    return {**benchmark.sets, **radius_sets(benchmark), **single_sets(benchmark)}


def radius_sets(benchmark: Benchmark) -> dict[str, CraneSet]:
    """Those that find the radius, the least spread first."""
    radius = benchmark.radius
    return {
        f"{RADIUS}{s:g}": CraneSet(spread=s, draws=radius.draws, scenarios=(radius.scenario,))
        for s in radius.spreads
    }


def single_sets(benchmark: Benchmark) -> dict[str, CraneSet]:
    """Those on which one uncertainty is alone."""
    singles = benchmark.singles
    if singles is None:
        return {}
    return {
        f"{SINGLE}{name}": CraneSet(
            spread=singles.spread, draws=singles.draws, scenarios=(singles.scenario,), only=only
        )
        for name, only in singles.effects.items()
    }


def pieces_of(
    benchmark: Benchmark,
    laws: Sequence[str],
    sets: Sequence[str] = (),
    scenarios: Sequence[str] = (),
    *,
    division: Division = "published",
) -> list[Trial]:
    """All pieces of `laws`, names of controllers; of `sets` and `scenarios` only, where any are named.

    By set, scenario and plant, so that what all laws have in common comes together.
    """
    known = sets_of(benchmark)
    for kind, names, there in (("set", sets, known), ("scenario", scenarios, benchmark.scenarios)):
        for name in names:
            if name not in there:
                raise unknown_name(f"{kind} of {benchmark.name}", name, there)
    pieces = (piece for name in sets or known for piece in _pieces(benchmark, name, laws, division))
    return [piece for piece in pieces if not scenarios or piece.scenario in scenarios]


def _pieces(benchmark: Benchmark, name: str, laws: Sequence[str], division: Division) -> Iterator[Trial]:
    cranes = sets_of(benchmark)[name]
    judged = name in benchmark.sets
    plants = (benchmark.plant, benchmark.second_plant) if judged else (benchmark.plant,)
    scenarios = [each for each in benchmark.scenarios if not cranes.scenarios or each in cranes.scenarios]
    for scenario, plant, law in product(scenarios, plants, laws):
        if follows(law) in benchmark.scenarios[scenario].suits:
            yield Trial(division, plant, name, scenario, law)


def campaign_of(
    benchmark: Benchmark,
    directory: Path,
    piece: Trial,
    *,
    most: int | None = None,
    tuned: Callable[[str, float], Sequence[str]] = lambda _law, _length: (),
) -> Campaign:
    """The campaign of `piece`, of `most` draws at most; `directory` is that of the benchmark's file.

    `tuned` gives the settings of a law that was tuned, on a crane so many times as large as the laboratory's.

    Raises InputError as `stated_campaign`; values are not yet checked.
    """
    cranes = sets_of(benchmark)[piece.crane_set]
    draws = cranes.draws if most is None else min(most, cranes.draws)
    if piece.plant == benchmark.second_plant:
        draws = max(1, round(benchmark.second_share * draws))
    numbers: Sequence[str] = ()
    if piece.division == "tuned":
        numbers = tuned(piece.law, crane_length(benchmark, directory, piece.scenario))
    return piece_campaign(
        benchmark,
        directory,
        piece.scenario,
        piece.law,
        plant=piece.plant,
        runs=draws,
        seed=benchmark.seed,
        spread=cranes.spread,
        numbers=numbers,
        uncertain=_uncertain(benchmark, cranes, benchmark.scenarios[piece.scenario]),
    )


def crane_length(benchmark: Benchmark, directory: Path, scenario: str) -> float:
    """How many times as large as the laboratory's the crane of `scenario` is; raises InputError."""
    return size_of(read_scenario(scenario_place(benchmark.scenarios[scenario].file, directory)).rig)


def _uncertain(benchmark: Benchmark, cranes: CraneSet, measured: MeasuredScenario) -> dict[str, Any]:
    found = _flat(benchmark.uncertain, cranes.uncertain, measured.uncertain)
    if not cranes.only:
        return found
    alone = {
        name: each
        for name, each in found.items()
        if any(f"{name}.".startswith(f"{only}.") for only in cranes.only)
    }
    if not alone:
        raise InputError(
            f"{', '.join(cranes.only)}: nothing of it is uncertain",
            allowed=", ".join(found),
            remedy="name one of these, or a table of some",
        )
    return alone


def piece_campaign(
    benchmark: Benchmark,
    directory: Path,
    scenario: str,
    law: str,
    *,
    plant: str,
    numbers: Sequence[str] = (),
    **settings: Any,
) -> Campaign:
    """A campaign of `law` on a scenario of the benchmark, with `numbers` of the law, key=value each.

    As `stated_campaign`: what decides which values there are is the same for all laws.
    """
    measured = benchmark.scenarios[scenario]
    file = scenario_place(measured.file, directory)
    table = {
        "name": scenario,
        "scenario": file,
        "controllers": [law],
        "plants": [plant],
        "drive": benchmark.drive,
        "sampling": "monte-carlo",
        "set": [*benchmark.set, *measured.set, *numbers],
        "uncertain": _flat(benchmark.uncertain, measured.uncertain),
        "limits": limits_of(read_scenario(file), [plant])[plant],
        **settings,
    }
    return stated_campaign(parse_campaign(table, benchmark.name))


def scenario_place(file: str, directory: Path) -> str:
    """A scenario by its name, or the path of its file seen from the benchmark's; raises InputError."""
    if not resources.is_path(file):
        return file
    path = directory / file
    if not path.is_file():
        raise InputError(
            f"{path}, a scenario of the benchmark, is no file",
            allowed="a scenario by its name, or the path of its file from the benchmark's",
            remedy="correct the path",
        )
    return str(path)


def _flat(*tables: Mapping[str, Any]) -> dict[str, Any]:
    """Distributions by the dotted names of their parameters; later tables come before earlier ones."""

    def is_leaf(value: Any) -> bool:
        return not isinstance(value, Mapping) or "distribution" in value

    return {name: found for table in tables for name, found in leaves(table, is_leaf=is_leaf)}
