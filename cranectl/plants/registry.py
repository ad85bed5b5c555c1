"""The plants there are: what the package knows of each without loading it, and where its class is."""

import importlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from cranectl.plants.plant import DRIVES, Drive, Plant
from cranectl.support.errors import InputError, unknown_name

REFERENCE_PLANT = "mujoco"  # the plant that others are compared against


@dataclass(frozen=True)
class PlantEntry:
    """A plant by name."""

    name: str  # of its topics and columns: lower case letters, digits, hyphens
    label: str  # for people
    colour: str  # a series of `support.colours`
    where: str  # module:class, imported only when asked for: engines take a while
    batch: int  # samples of a campaign's batch: some seconds of runs like the thesis's
    drives: tuple[Drive, ...] = DRIVES
    lacks: Mapping[str, str] = field(default_factory=dict)  # why it cannot show rope, body, frame, force

    def load(self) -> type[Plant]:
        """Its class."""
        module, _, name = self.where.partition(":")
        found: type[Plant] = getattr(importlib.import_module(module), name)
        return found


PLANTS: dict[str, PlantEntry] = {}  # in the order of a log


def register_plant(entry: PlantEntry) -> None:
    """Make a plant known; raises InputError for a name that is taken or is none.

    Worker processes know it too where the module of its class calls this.
    """
    if entry.name in PLANTS or not re.fullmatch(r"[a-z][a-z0-9-]*", entry.name):
        raise InputError(
            f"a plant named '{entry.name}'",
            allowed=f"lower case letters, digits, hyphens; not {', '.join(PLANTS)}",
            remedy="take another name",
        )
    PLANTS[entry.name] = entry


def plant_entry(name: str) -> PlantEntry:
    """The plant `name`; raises InputError that lists the known ones, nearest first."""
    if name not in PLANTS:
        raise unknown_name("plant", name, PLANTS)
    return PLANTS[name]


def in_order(names: Iterable[str]) -> tuple[str, ...]:
    """Plants in the order of a log; raises InputError for an unknown one."""
    wanted = {plant_entry(name).name for name in names}
    return tuple(name for name in PLANTS if name in wanted)


def reference_plant(names: Iterable[str]) -> str:
    """The plant that the others are compared against: REFERENCE_PLANT, or the last where it is absent."""
    ordered = in_order(names)
    return REFERENCE_PLANT if REFERENCE_PLANT in ordered else ordered[-1]


_RIGID = "which has a rigid rope without mass, a point load and a rigid frame"

register_plant(
    PlantEntry(
        name="analytic",
        label="analytic",
        colour="series-1",
        where="cranectl.plants.analytic:AnalyticPlant",
        batch=64,
        lacks={"rope": _RIGID, "body": _RIGID, "frame": _RIGID, "force": "whose drives know no forces"},
    )
)
register_plant(
    PlantEntry(
        name="mujoco",
        label="MuJoCo",
        colour="series-2",
        where="cranectl.plants.mujoco.plant:MujocoPlant",
        batch=16,
    )
)
