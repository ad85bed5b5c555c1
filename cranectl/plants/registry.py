"""The plants there are: what the package knows of each without loading it, where its class is.

Other packages declare a `PlantEntry` with an entry point of the group `cranectl.plants`, which every process
finds, or call `register_plant`, which is known where their module is imported.
"""

import functools
from collections.abc import Collection, Iterable, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec

from cranectl.plants.plant import DRIVES, Drive, Plant
from cranectl.scenario.effects import PARTS, WHOLE_EFFECTS
from cranectl.support import extensions
from cranectl.support.colours import COLOURS, VIEWER
from cranectl.support.errors import InputError, unknown_name
from cranectl.support.extensions import check_free, check_name, loaded, with_extensions
from cranectl.support.provenance import source_digests

LONGEST_LABEL = 40  # letters
PLANT_COLOURS = tuple(name for name in COLOURS if name in VIEWER and name.startswith("series-"))
# What a plant may lack: effects and parts of them, all forces on its axes, and what disturbs its load.
LACKS = (*WHOLE_EFFECTS, *PARTS, "force", "disturbances", "disturbances.force")
# Effects that plants show unless they lack them; any other is shown only by plants that declare it.
COMMON = ("limits", "friction", "rope", "body", "wind", "frame", "installation")
BUILT_IN = (
    "gravity", "bridge_mass", "trolley_mass", "winch_mass", "load_mass", "bridge_time_constant",
    "trolley_time_constant", "winch_time_constant",
)  # fmt: skip
REFERENCE_PLANT = "mujoco"  # the plant that others are compared against


@dataclass(frozen=True)
class PlantEntry:
    """Declare a plant by name, and what it honours.

    Parameters
    ----------
    name, label : str
        Name of its topics and columns (lower case letters, digits, hyphens), and name for people.
    colour : str
        A series of `support.colours`.
    where : str
        Its class as module:class, imported only when the plant is used.
    batch : int
        Samples in a batch of a campaign, some seconds of runs; 0: too slow for campaigns.
    drives : tuple of str
        Kinds of drives that it has.
    servos : bool
        Whether its velocity drives feel the load.
    shows : sequence of str or None
        Effects that it honours; None: COMMON, and those in the field `shows` of its class.
    lacks : Mapping of str to str
        What it does not honour, one of LACKS, each with a reason.
    fixed : Mapping of str to float
        Numbers of the rig that are built in, of BUILT_IN.
    by_default : bool
        Whether commands run it where no plants are named.
    package : str
        A package that it needs, which only the extra of its name installs.
    """

    name: str
    label: str
    colour: str
    where: str
    batch: int
    drives: tuple[Drive, ...] = ("ideal", "velocity")
    servos: bool = False
    shows: Sequence[str] | None = None
    lacks: Mapping[str, str] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    by_default: bool = True
    package: str = ""

    def __post_init__(self) -> None:
        check_name("plant", self.name)
        if not 0 < len(self.label) <= LONGEST_LABEL or not self.label.isprintable():
            raise InputError(
                f"the label {self.label[:LONGEST_LABEL]!r} of the plant {self.name}",
                allowed=f"1 to {LONGEST_LABEL} printable characters",
                remedy="take another label",
            )
        if self.colour not in PLANT_COLOURS:
            raise InputError(
                f"the colour '{self.colour}' of the plant {self.name}",
                allowed=", ".join(PLANT_COLOURS),
                remedy="take one of these",
            )
        for declared, known, what in ((self.lacks, LACKS, "lacks"), (self.fixed, BUILT_IN, "fixed")):
            for name in declared:
                if name not in known:
                    raise unknown_name(f"setting in {what} of the plant {self.name}:", name, known)

    @property
    def is_own(self) -> bool:
        """Whether the plant is one of this package, whose tests hold it to the equations."""
        return self.where.startswith("cranectl.")

    def lack(self, setting: str) -> str | None:
        """Return why it does not honour one of LACKS, None if nothing is said against it."""
        effect = setting.partition(".")[0]
        unsaid = setting in (*WHOLE_EFFECTS, *PARTS) and not self._shows(effect)
        return self.lacks.get(setting, "which does not show it" if unsaid else None)

    def _shows(self, effect: str) -> bool:
        """Return True if an effect is declared; load the plant only for one that is not COMMON."""
        if self.shows is not None:
            return effect in self.shows
        if effect in COMMON:
            return True
        try:
            return effect in getattr(self.load(), "shows", ())
        except (InputError, ImportError):  # not installed
            return False

    def check_installed(self) -> None:
        """Raise InputError if the package that it needs, or that brings it, is not there."""
        if not self.where:
            raise InputError(
                f"the {self.label} plant, which no installed package brings",
                allowed=labels_of(PLANTS.values()),
                remedy=f"install the package that brings the plant {self.name}",
            )
        if self.package and find_spec(self.package) is None:
            raise InputError(
                f"the {self.label} plant without {self.package}, which is not installed",
                allowed=labels_of(entry for entry in PLANTS.values() if not entry.package),
                remedy=f"pip install 'cranectl[{self.name}]'",
            )

    def check_campaigns(self) -> None:
        """Raise InputError if it is too slow for campaigns."""
        if not self.batch:
            able = [entry for entry in PLANTS.values() if entry.batch]
            raise InputError(
                f"a campaign on the {self.label} plant, which is too slow for thousands of runs",
                allowed=labels_of(able),
                remedy=f"take '--plants {REFERENCE_PLANT}', and {self.name} for single runs",
            )

    def load(self) -> type[Plant]:
        """Import the class of the plant; raise InputError as `check_installed` does."""
        self.check_installed()
        plant: type[Plant] = loaded(self.where)
        return plant


class Plants(MutableMapping[str, PlantEntry]):
    """Entries by name, in the order of a log; those of other packages are looked for when first asked.

    Plants that only logs tell of can be looked up, to show their runs; nothing lists them, since they cannot
    be run.
    """

    def __init__(self, *own: PlantEntry) -> None:
        self._entries = {entry.name: entry for entry in own}
        self._logged: dict[str, PlantEntry] = {}
        self._complete = False

    def _known(self) -> dict[str, PlantEntry]:
        if not self._complete:
            self._complete = True  # also for what asks meanwhile
            try:
                self._entries.update(with_extensions(self._entries, PlantEntry, extensions.PLANTS))
            except InputError:
                self._complete = False
                raise
        return self._entries

    def __getitem__(self, name: str) -> PlantEntry:
        # A module of another package may ask for one of ours while it is loaded itself.
        if name in self._entries:
            return self._entries[name]
        known = self._known()
        return known[name] if name in known else self._logged[name]

    def __contains__(self, name: object) -> bool:
        return name in self._entries or name in self._known() or name in self._logged

    def remember(self, entry: PlantEntry) -> None:
        """Remember a plant of a log, unless it is known already."""
        if entry.name not in self:
            self._logged[entry.name] = entry

    def forget(self) -> None:
        """Forget the plants that only logs tell of."""
        self._logged.clear()

    def ordered(self, wanted: Collection[str]) -> tuple[str, ...]:
        """Return the names that are `wanted` in the order of a log, those of logs only last."""
        return tuple(name for name in (*self, *self._logged) if name in wanted)

    def __setitem__(self, name: str, entry: PlantEntry) -> None:
        self._known()[name] = entry

    def __delitem__(self, name: str) -> None:
        del self._known()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._known())

    def __len__(self) -> int:
        return len(self._known())


_RIGID = "which has a rigid rope without mass, a point load and a rigid frame"
_SLIDES = "whose joints have viscous friction only"

_own = functools.partial(PlantEntry, drives=tuple(DRIVES), servos=True)

PLANTS = Plants(
    _own(
        "analytic",
        "analytic",
        "series-1",
        "cranectl.plants.analytic:AnalyticPlant",
        batch=64,
        lacks={"rope": _RIGID, "body": _RIGID, "frame": _RIGID, "force": "whose axes know no such forces"},
    ),
    _own("elastic", "elastic", "series-3", "cranectl.plants.elastic.plant:ElasticPlant", batch=32),
    _own("mujoco", "MuJoCo", "series-2", "cranectl.plants.mujoco.plant:MujocoPlant", batch=16),
    _own(
        "drake",
        "Drake",
        "series-4",
        "cranectl.plants.drake.plant:DrakePlant",
        batch=0,
        lacks={
            "rope": "which has a rigid rope without mass",
            "limits.force": "whose drives give any force",
            "friction.coulomb": _SLIDES,
            "friction.pivot_coulomb": _SLIDES,
        },
        by_default=False,
        package="pydrake",
    ),
)


ALL = (("all",), ("both",))  # for every plant; both: as long as there were two


def default_plants() -> tuple[str, ...]:
    """Return the plants that run where none are named."""
    return tuple(name for name, entry in PLANTS.items() if entry.by_default)


def register_plant(entry: PlantEntry) -> None:
    """Make a plant known to this process.

    Worker processes of `validate` know it too where the module of its class calls this.

    Parameters
    ----------
    entry : PlantEntry
        The plant.

    Raises
    ------
    InputError
        If its name is taken.
    """
    check_free("plant", entry.name, PLANTS)
    PLANTS[entry.name] = entry


def plant_sources(names: Iterable[str]) -> dict[str, str]:
    """Digests of the sources of those plants that come from outside the package, as `provenance` has them."""
    modules = {PLANTS[name].where.partition(":")[0] for name in names if name in PLANTS}
    return source_digests(modules)


def plant_entry(name: str) -> PlantEntry:
    """Return the entry of the plant `name`; raise InputError that lists the known ones, nearest first."""
    if name not in PLANTS:
        raise unknown_name("plant", name, PLANTS)
    return PLANTS[name]


def in_order(names: Iterable[str]) -> tuple[str, ...]:
    """Plants in the order of a log; raises InputError for an unknown one."""
    return PLANTS.ordered({plant_entry(name).name for name in names})


def plants_to_run(names: Iterable[str]) -> tuple[str, ...]:
    """Return the plants to run, in order; raise InputError also for one that is not installed."""
    chosen = in_order(names) or default_plants()
    for name in chosen:
        PLANTS[name].check_installed()
    return chosen


def plants_of_logs(names: Sequence[str], logged: Iterable[str]) -> tuple[str, ...]:
    """Return the plants that a user names for logs that were read; `all` are the `logged` ones, if any.

    Raises InputError for one that neither this process nor a log knows.
    """
    if tuple(names) in ALL:
        return in_order(logged) or tuple(PLANTS)
    return tuple(plant_entry(name).name for name in names)


def reference_plant(names: Iterable[str]) -> str:
    """Return the plant that the others are compared with: REFERENCE_PLANT, else the last one."""
    ordered = in_order(names)
    return REFERENCE_PLANT if REFERENCE_PLANT in ordered else ordered[-1]


def labels_of(entries: Iterable[PlantEntry]) -> str:
    """Return the plants as the allowed part of an error."""
    return f"the {' or '.join(entry.label for entry in entries)} plant"
