"""Read campaign files and check their form: one scenario, run many times under stated uncertainty."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from cranectl.campaign.distributions import DISTRIBUTIONS, AnyDistribution, Distribution
from cranectl.metrics import Limits
from cranectl.plants import PLANTS, Drive
from cranectl.scenario import RigFile, RuleError, Settings, override
from cranectl.support import MAX_RUNS, TOML, InputError, Shipped, Tree

COUNTED = ("grid", "one-at-a-time")  # samplings whose number of runs follows from the parameters
INDEPENDENT = ("monte-carlo", "latin-hypercube", "sobol")  # samplings whose runs represent the distribution

Sampling = Literal["monte-carlo", "latin-hypercube", "sobol", "saltelli", "grid", "one-at-a-time"]


class Correlation(Settings):
    """Spearman's rank correlation between two parameters."""

    between: Annotated[tuple[str, str], Field(strict=False)] = Field(
        description="dotted names of two uncertain parameters"
    )
    value: Annotated[float, Field(gt=-1.0, lt=1.0)] = Field(description="rank correlation")

    def __str__(self) -> str:
        return f"{' and '.join(self.between)}: {self.value:g}"


class CampaignSettings(Settings):
    """Settings of a campaign: its runs, and the uncertain parameters of their scenario."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$")] = Field(
        description="lower case letters, digits and hyphens"
    )
    title: str = Field("", description="one line for people")
    scenario: str = Field(description="name or path of the scenario")
    rig: str | None = Field(
        None, description="name of a rig or path of its file from the campaign's; default: the scenario's"
    )
    controllers: Annotated[tuple[str, ...], Field(strict=False, min_length=1)] = Field(
        description="names of controllers"
    )
    plants: Annotated[tuple[str, ...], Field(strict=False, min_length=1)] = (PLANTS.REFERENCE,)
    drive: Drive = "velocity"
    runs: Annotated[int, Field(ge=1, le=MAX_RUNS)] | None = Field(
        None, description="number of samples, each run with every controller on every plant"
    )
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0  # from which parameters and noise are drawn
    sampling: Sampling = "latin-hypercube"
    spread: Annotated[float, Field(ge=0.0, le=100.0)] = Field(
        1.0,
        description="factor on how far all values are from the nominal ones, of log-uniform ones as a "
        "power of their ratio; seeds, choices and fixed values stay",
    )
    set: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="settings of the scenario that all runs share, key=value"
    )
    uncertain: Annotated[dict[str, AnyDistribution], Field(min_length=1)] = Field(
        description="a table with a distribution for each uncertain parameter, [uncertain.rig.load_mass]"
    )
    correlation: Annotated[tuple[Correlation, ...], Field(strict=False)] = ()
    limits: Limits = Field(Limits(), description="beyond which a run that completed counts as failed")

    @field_validator("controllers", "plants")
    @classmethod
    def _differ(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(names)) < len(names):
            raise RuleError(
                f"{', '.join(names)}: one is named twice", allowed="each name once", remedy="name it once"
            )
        return names

    @model_validator(mode="after")
    def _runs_are_known(self) -> "CampaignSettings":
        if self.runs is None and self.sampling not in COUNTED:
            raise RuleError(
                f"'runs' is missing, which {self.sampling} sampling needs",
                allowed=f"runs from 1 to {MAX_RUNS}",
                remedy="add 'runs'",
            )
        return self

    @staticmethod
    def shipped_names() -> list[str]:
        """Return the names of the shipped campaigns."""
        return Shipped.CAMPAIGNS.names()

    @staticmethod
    def file_of(name_or_path: str | Path) -> Path:
        """Return the file of a campaign; raise InputError if there is none."""
        return Shipped.CAMPAIGNS.file(str(name_or_path))

    @staticmethod
    def read(name_or_path: str | Path, *, overrides: Sequence[str] = ()) -> "CampaignSettings":
        """Read a campaign by name or from a TOML file; `overrides` are settings such as `"runs=100"`.

        Raises InputError for mistakes in the file itself; `load_campaign` checks it against the scenario.
        """
        path = CampaignSettings.file_of(name_or_path)
        table = TOML.read(path)
        if isinstance(table.get("rig"), str):
            table["rig"] = str(RigFile.place(table["rig"], path.parent))
        if isinstance(table.get("plants"), list):
            table["plants"] = [str(RigFile.place(str(name), path.parent)) for name in table["plants"]]
        return CampaignSettings.parse(table, path.name, overrides)

    @staticmethod
    def parse(stated: Mapping[str, Any], source: str, overrides: Sequence[str] = ()) -> "CampaignSettings":
        """Return the settings in the table of a campaign, changed by `overrides` such as `"runs=100"`.

        Raises InputError that names the mistake in `source`.
        """
        table = override(stated, overrides) if overrides else dict(stated)
        if isinstance(table.get("uncertain"), Mapping):
            table["uncertain"] = _distributions(table["uncertain"], source)
        settings = CampaignSettings.from_table(table, source, overrides=overrides, before=stated)
        plants = tuple(PLANTS.find(name).name for name in settings.plants)
        for name in plants:
            PLANTS.entry(name).check_campaigns()
        return settings if plants == settings.plants else settings.model_copy(update={"plants": plants})


def is_distribution(value: Any) -> bool:
    """Return True for a distribution below [uncertain], and for a value that cannot contain one."""
    return not isinstance(value, Mapping) or not value or "distribution" in value


def _distributions(node: Mapping[str, Any], source: str) -> dict[str, Distribution]:
    """Return the distributions below [uncertain] by the dotted names of their parameters."""
    distributions: dict[str, Distribution] = {}

    for name, table in Tree(node).leaves(is_leaf=is_distribution):
        if name in distributions:
            raise InputError(
                f"{source}: parameter '{name}' appears twice under [uncertain]",
                allowed="one distribution for each parameter",
                remedy="remove one of the two tables",
            )
        distributions[name] = _distribution(name, table, source)
    return distributions


def _distribution(name: str, table: Any, source: str) -> Distribution:
    if not isinstance(table, Mapping) or not table:
        above = name.rpartition(".")[0] or name
        raise InputError(
            f"{source}: uncertain.{name} = {table!r} is not a distribution",
            allowed=f"a table with a distribution: {', '.join(DISTRIBUTIONS)}",
            remedy=f"write [uncertain.{name}] with 'distribution = ...' below it, "
            f"or check that [uncertain.{above}] has a 'distribution'",
        )
    kind = table["distribution"]
    if not isinstance(kind, str) or kind not in DISTRIBUTIONS:
        raise InputError.unknown("distribution", str(kind), DISTRIBUTIONS)
    return DISTRIBUTIONS[kind].from_table(table, f"{source}: uncertain.{name}")
