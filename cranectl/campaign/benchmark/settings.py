"""Read benchmark files: controllers, scenarios, sets of cranes, and the rules of tuning."""

import itertools
import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, model_validator

from cranectl.plants.plant import Drive
from cranectl.scenario.settings import RuleError, Settings, parse_settings
from cranectl.support import resources
from cranectl.support.documents import read_toml

# First letters of generated sets: those that find the robustness radius, and those with one uncertainty.
RADIUS, SINGLE = "spread-", "only-"
Overrides = Annotated[tuple[str, ...], Field(strict=False)]
NAME = r"^[a-z0-9][a-z0-9-]*$"  # such names are names of directories too
Names = Annotated[tuple[str, ...], Field(strict=False, min_length=1)]
Draws = Annotated[int, Field(ge=1, le=100_000)]
Spread = Annotated[float, Field(ge=0.0, le=100.0)]
Follows = Literal["path", "set-point"]


class MeasuredScenario(Settings):
    """A scenario on which controllers are measured."""

    file: str = Field(description="name of a scenario, or path of its file from the benchmark's")
    suits: Annotated[tuple[Follows, ...], Field(strict=False, min_length=1)] = Field(
        description="controllers of what they follow; others are not run"
    )
    set: Overrides = Field((), description="settings of the scenario, key=value")
    uncertain: dict[str, Any] = Field({}, description="distributions besides, or in place of, those of all")


class CraneSet(Settings):
    """How far cranes are from what controllers take them for."""

    spread: Spread = Field(description="factor on how far all uncertain values are from the nominal ones")
    draws: Draws = Field(description="cranes, the same for every controller")
    uncertain: dict[str, Any] = Field({}, description="distributions in place of those of all")
    scenarios: Annotated[tuple[str, ...], Field(strict=False)] = Field((), description="only these, or all")
    only: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="parameters, or tables of some, that alone are uncertain, or all"
    )


class Radius(Settings):
    """By which factor on all spreads runs begin to fail."""

    scenario: str
    spreads: Annotated[tuple[Spread, ...], Field(strict=False, min_length=2)]
    draws: Draws


class Singles(Settings):
    """What one uncertainty does by itself."""

    scenario: str
    spread: Spread
    draws: Draws
    effects: Annotated[dict[str, Names], Field(min_length=1)] = Field(
        description="by name: the parameters, or tables of some, that alone are uncertain"
    )


class Tuning(Settings):
    """How the numbers of a controller are found: on cranes that are never judged."""

    scenarios: Names
    spread: Spread = 1.0
    draws: Draws = Field(description="cranes of each scenario")
    seed: Annotated[int, Field(ge=0, lt=2**63)] = Field(description="of these cranes and of the search")
    runs: Annotated[int, Field(ge=1)] = Field(description="budget of a controller, in simulated runs")
    variation_price: Annotated[float, Field(ge=0.0)] = Field(
        description="cost of a command that varies by g in a second"
    )


class Benchmark(Settings):
    """What is measured, by which rules."""

    name: Annotated[str, Field(pattern=NAME)]
    title: str = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = Field(description="of the cranes that are judged on")
    laws: Names = Field(description="names of controllers, or their files from the benchmark's: law.py:NAME")
    baseline: str = Field(description="the controller with which all are compared")
    plant: str = "mujoco"
    second_plant: str = Field("elastic", description="on which a share of the draws is repeated")
    second_share: Annotated[float, Field(gt=0.0, le=1.0)] = 0.1
    drive: Drive = "velocity"
    set: Overrides = Field((), description="settings of every scenario, key=value")
    uncertain: dict[str, Any] = Field(description="a table with a distribution for each uncertain parameter")
    scenarios: Annotated[dict[str, MeasuredScenario], Field(min_length=1)]
    sets: Annotated[dict[str, CraneSet], Field(min_length=1)]
    radius: Radius
    singles: Singles | None = None
    tuning: Tuning
    _file: Path = PrivateAttr(Path())

    @property
    def file(self) -> Path:
        """The file of this benchmark; paths in it are relative to its folder."""
        return self._file

    @model_validator(mode="after")
    def _names_are_known(self) -> "Benchmark":
        named = {self.radius.scenario, *self.tuning.scenarios}
        named.update({self.singles.scenario} if self.singles else ())
        named.update(name for cranes in self.sets.values() for name in cranes.scenarios)
        unknown = named - self.scenarios.keys()
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
        invalid = [name for name in self.sets if not re.match(NAME, name)]
        if invalid:
            raise RuleError(
                f"sets {', '.join(invalid)}",
                allowed="names of small letters, digits and hyphens",
                remedy="rename them",
            )
        taken = [name for name in self.sets if name.startswith((RADIUS, SINGLE))]
        if taken:
            raise RuleError(
                f"sets {', '.join(taken)}",
                allowed=f"names that do not begin with {RADIUS} or {SINGLE}, which cranectl uses itself",
                remedy="rename them",
            )
        if self.seed == self.tuning.seed:
            raise RuleError(
                f"tuning.seed = seed = {self.seed}",
                allowed="tuning.seed must not be seed: controllers are not tuned on cranes that judge them",
                remedy="change tuning.seed",
            )
        return self


def benchmark_file(name_or_path: str) -> Path:
    """Return the file of a benchmark; raise InputError if there is none."""
    return resources.toml_file("benchmark", name_or_path, resources.BENCHMARK_DIRECTORY)


def read_benchmark(name_or_path: str) -> Benchmark:
    """Read a benchmark by name or from a TOML file; raise InputError for what is wrong in it."""
    path = benchmark_file(name_or_path)
    benchmark = parse_settings(Benchmark, read_toml(path), path.name)
    benchmark._file = path
    return benchmark
