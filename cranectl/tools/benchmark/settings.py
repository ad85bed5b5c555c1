"""Read benchmark files: controllers, scenarios, sets of cranes, and the rules of tuning."""

import itertools
import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, model_validator

from cranectl.plants import Drive
from cranectl.scenario import RuleError, Settings
from cranectl.support import MAX_DRAWS, MAX_RUNS, TOML, Shipped

# Prefixes of the names of generated sets: for the robustness radius, and with one uncertainty each.
RADIUS_PREFIX, SINGLE_PREFIX = "spread-", "only-"
Overrides = Annotated[tuple[str, ...], Field(strict=False)]
NAME_PATTERN = r"^[a-z0-9][a-z0-9-]*$"  # because names are also names of directories
Names = Annotated[tuple[str, ...], Field(strict=False, min_length=1)]
Draws = Annotated[int, Field(ge=1, le=MAX_DRAWS)]
Spread = Annotated[float, Field(ge=0.0, le=100.0)]
Seed = Annotated[int, Field(ge=0, lt=2**63)]
Follows = Literal["path", "set-point"]


class BenchmarkScenario(Settings):
    """A scenario on which controllers are measured."""

    file: str = Field(description="name of a scenario, or path of its file from the benchmark's")
    suits: Annotated[tuple[Follows, ...], Field(strict=False, min_length=1)] = Field(
        description="what controllers must follow to run on it: path, set-point or both"
    )
    set: Overrides = Field((), description="settings of the scenario, key=value")
    uncertain: dict[str, Any] = Field(
        {}, description="further distributions; they replace those of the benchmark"
    )


class CraneSet(Settings):
    """A set of random cranes, which differ from the nominal crane that controllers know."""

    spread: Spread = Field(description="factor on the deviations of all uncertain values from nominal ones")
    draws: Draws = Field(description="number of cranes, which are the same for all controllers")
    uncertain: dict[str, Any] = Field({}, description="distributions that replace those of the benchmark")
    scenarios: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="names of its scenarios; all if empty"
    )
    only: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="the only uncertain parameters, or tables of parameters; all if empty"
    )


class Radius(Settings):
    """Sets of cranes with increasing spreads, which find the spread at which runs begin to fail."""

    scenario: str
    spreads: Annotated[tuple[Spread, ...], Field(strict=False, min_length=2)]
    draws: Draws


class Singles(Settings):
    """Sets of cranes with one uncertainty each, which show its effect."""

    scenario: str
    spread: Spread
    draws: Draws
    effects: Annotated[dict[str, Names], Field(min_length=1)] = Field(
        description="by name: the only uncertain parameters, or tables of parameters"
    )


class ValidationCranes(Settings):
    """Cranes on which tuned numbers compete with the published ones; neither search nor ranking uses them."""

    draws: Draws = Field(description="number of cranes per scenario and spread")
    seed: Seed = Field(description="seed of these cranes")


class Tuning(Settings):
    """Rules for tuning the numbers of controllers, on cranes that the ranking does not use."""

    scenarios: Names
    plant: str | None = Field(None, description="plant of the search; by default that of the benchmark")
    spreads: Annotated[tuple[Spread, ...], Field(strict=False, min_length=1)] = (1.0,)
    draws: Draws = Field(description="number of cranes per scenario and spread")
    seed: Seed = Field(description="seed of these cranes and of the search")
    runs: Annotated[int, Field(ge=1, le=MAX_RUNS)] = Field(
        description="number of simulated runs per controller"
    )
    variation_price: Annotated[float, Field(ge=0.0, le=1e6)] = Field(
        description="cost of commands that vary by g per second"
    )
    validation: ValidationCranes | None = Field(
        None,
        description="cranes that choose between published numbers and those found with half and with all of "
        "the budget; without them the last are taken",
    )

    @property
    def validation_runs(self) -> int:
        """Number of runs of the validation of one controller, at most."""
        draws = 0 if self.validation is None else self.validation.draws
        return 3 * draws * len(self.scenarios) * len(self.spreads)


class Benchmark(Settings):
    """Controllers, scenarios and cranes of a benchmark, with the rules of tuning."""

    name: Annotated[str, Field(pattern=NAME_PATTERN)]
    title: str = ""
    edition: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        1, description="number of these rules, for people"
    )
    seed: Seed = Field(description="seed of the cranes of the ranking")
    laws: Names = Field(
        description="names of controllers, or FILE.py:NAME with a path relative to the benchmark's file"
    )
    baseline: str = Field(description="controller with which all others are compared")
    plant: str = "mujoco"
    second_plant: str = Field("elastic", description="plant that repeats a share of the runs")
    second_share: Annotated[float, Field(gt=0.0, le=1.0)] = 0.1
    drive: Drive = "velocity"
    set: Overrides = Field((), description="settings of every scenario, key=value")
    uncertain: dict[str, Any] = Field(description="distribution of each uncertain parameter")
    scenarios: Annotated[dict[str, BenchmarkScenario], Field(min_length=1)]
    sets: Annotated[dict[str, CraneSet], Field(min_length=1)]
    radius: Radius
    singles: Singles | None = None
    tuning: Tuning
    _file: Path = PrivateAttr(Path())

    @property
    def file(self) -> Path:
        """The file of this benchmark; paths in it are relative to its folder."""
        return self._file

    @property
    def tuning_plant(self) -> str:
        """The plant on which the search for numbers runs."""
        return self.tuning.plant or self.plant

    @model_validator(mode="after")
    def _names_are_known(self) -> "Benchmark":
        used = {self.radius.scenario, *self.tuning.scenarios}
        used.update({self.singles.scenario} if self.singles else ())
        used.update(name for cranes in self.sets.values() for name in cranes.scenarios)
        unknown = used - self.scenarios.keys()
        if unknown:
            raise RuleError(
                f"{', '.join(sorted(unknown))}: not a scenario of this benchmark",
                allowed=", ".join(self.scenarios),
                remedy="name one of these, or add it to [scenarios]",
            )
        return self

    @model_validator(mode="after")
    def _rules_agree(self) -> "Benchmark":
        spreads = self.radius.spreads
        if any(b <= a for a, b in itertools.pairwise(spreads)):
            raise RuleError(
                f"radius.spreads = {list(spreads)}",
                allowed="radius.spreads must increase",
                remedy="state them in increasing order, each once",
            )
        if self.plant == self.second_plant:
            raise RuleError(
                f"plant = second_plant = '{self.plant}'",
                allowed="plant and second_plant must differ",
                remedy="name another second_plant",
            )
        invalid = [name for name in self.sets if not re.match(NAME_PATTERN, name)]
        if invalid:
            raise RuleError(
                f"sets {', '.join(invalid)}",
                allowed="names of small letters, digits and hyphens",
                remedy="rename them",
            )
        reserved = [name for name in self.sets if name.startswith((RADIUS_PREFIX, SINGLE_PREFIX))]
        if reserved:
            raise RuleError(
                f"sets {', '.join(reserved)}",
                allowed=f"names that do not begin with {RADIUS_PREFIX} or {SINGLE_PREFIX}, both reserved",
                remedy="rename them",
            )
        if self.seed == self.tuning.seed:
            raise RuleError(
                f"tuning.seed = seed = {self.seed}",
                allowed="tuning.seed must not be seed, because tuning must not use the cranes of the ranking",
                remedy="change tuning.seed",
            )
        validation = self.tuning.validation
        if validation is not None and validation.seed in (self.seed, self.tuning.seed):
            raise RuleError(
                f"tuning.validation.seed = {validation.seed}",
                allowed=f"a seed other than {self.seed} of the ranking and {self.tuning.seed} of the search",
                remedy="change tuning.validation.seed",
            )
        return self

    @staticmethod
    def read(name_or_path: str) -> "Benchmark":
        """Read a benchmark by name or from a TOML file; raise InputError if it is missing or invalid."""
        path = benchmark_file(name_or_path)
        benchmark = Benchmark.from_table(TOML.read(path), path.name)
        benchmark._file = path
        return benchmark


def benchmark_file(name_or_path: str) -> Path:
    """Return the file of a benchmark; raise InputError if there is none."""
    return Shipped.BENCHMARKS.file(name_or_path)
