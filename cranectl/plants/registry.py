"""The list of all plants: what is known of each without importing it, and where its class is.

Another package adds a plant in one of two ways. It declares a `PlantEntry` as an entry point of the group
`cranectl.plants`, which every process finds. Or it calls `register_plant`, in each process that needs it.
"""

import functools
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pkgutil import resolve_name
from typing import Any

from cranectl.plants.capabilities import LACKS, Capabilities
from cranectl.plants.plant import DRIVES, Drive, Plant
from cranectl.plants.steps import PhysicsStep
from cranectl.scenario import NANOSECONDS, RigParameters, Scenario
from cranectl.support import Arguments, Extensions, InputError, Palette, Provenance

MAX_PLANT_LABEL = 40  # [characters]
PLANT_COLOURS = tuple(role for role in Palette.LIGHT.series_roles if role in Palette.VIEWER)
BUILT_IN = (
    "gravity", "bridge_mass", "trolley_mass", "winch_mass", "load_mass", "bridge_time_constant",
    "trolley_time_constant", "winch_time_constant",
)  # fmt: skip
OWN_PLANT = "cranectl.plants.mujoco.own_plant:OwnPlant"  # the class of plants from model files


@dataclass(frozen=True)
class PlantEntry(Capabilities):
    """Declare a plant: its names, where its class is, and which settings it honours.

    Parameters
    ----------
    name, label : str
        Name of its topics and columns (lower case letters, digits, hyphens), and name for people.
    colour : str
        A series of `support.Palette`.
    where : str
        Its class as module:class, imported only when the plant is used.
    batch : int
        Samples in a batch of a campaign, some seconds of runs; 0: too slow for campaigns.
    drives : tuple of str
        Kinds of drives that it has.
    servos : bool
        Whether its velocity drives feel the load.
    shows : sequence of str or None
        Effects that it honours. None means COMMON, and those in the attribute `shows` of its class.
    lacks : Mapping of str to str
        Settings that it does not honour, out of LACKS, each with a reason such as "which has none".
    fixed : Mapping of str to float
        Numbers of the rig that cannot be changed, out of BUILT_IN, with their values.
    by_default : bool
        Whether commands run it where no plants are named.
    package : str
        A package that it needs and that only the extra with the plant's name installs.
    arguments : Mapping
        Further arguments of its class, such as the file of a model.
    differs : str
        How it differs from the crane of the other plants. If not empty, their agreement is not judged.
    digest : str
        Of its model, if a user's file has it.
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
    arguments: Mapping[str, Any] = field(default_factory=dict)
    differs: str = ""
    digest: str = ""

    def __post_init__(self) -> None:
        InputError.check_name("plant", self.name)
        Arguments.check_fields(self)
        if not 0 < len(self.label) <= MAX_PLANT_LABEL or not self.label.isprintable():
            raise InputError(
                f"the label {self.label[:MAX_PLANT_LABEL]!r} of the plant {self.name}",
                allowed=f"1 to {MAX_PLANT_LABEL} printable characters",
                remedy="take another label",
            )
        if self.colour not in PLANT_COLOURS:
            raise InputError(
                f"the colour '{self.colour}' of the plant {self.name}",
                allowed=", ".join(PLANT_COLOURS),
                remedy="take one of these",
            )
        for declared, known, what in ((self.lacks, LACKS, "lacks"), (self.fixed, BUILT_IN, "fixed")):
            InputError.check_known(f"setting in {what} of the plant {self.name}:", declared, known)

    @property
    def is_own(self) -> bool:
        """Whether the plant belongs to this package, whose tests compare it with the equations."""
        return self.where.startswith("cranectl.") and not self.arguments

    @property
    def is_model_file(self) -> bool:
        """Whether the plant is a user's model file."""
        return self.where == OWN_PLANT

    @property
    def argument(self) -> str:
        """The value of `--plants` that means the plant: its name, or the path of its model file."""
        file = self.arguments.get("file")
        return self.name if file is None else os.path.relpath(file)

    @property
    def declared(self) -> dict[str, str]:
        """What a log or a result states of the plant, so that it can be read where the plant is not."""
        stated = {"label": self.label, "colour": self.colour, "servos": str(self.servos).lower()}
        return stated | ({"differs": self.differs} if self.differs else {})

    @classmethod
    def from_declared(cls, name: str, declared: Mapping[str, str], *, batch: int = 0) -> "PlantEntry":
        """Return the entry of a plant that is not installed; old logs declare only its name."""
        return cls(
            name=name,
            label=declared.get("label", name[:MAX_PLANT_LABEL]),
            colour=declared.get("colour", PLANT_COLOURS[-1]),
            where="",
            batch=batch,
            servos=declared.get("servos") == "true",
            by_default=False,
            differs=declared.get("differs", ""),
        )

    def check_installed(self) -> None:
        """Raise InputError if the package that the plant needs, or that defines it, is not installed."""
        if not self.where:
            raise InputError(
                f"the {self.label} plant, which no installed package brings",
                allowed=labels_of(PLANTS.values()),
                remedy=f"install the package that brings the plant {self.name}, or name its model file",
            )
        if self.package and find_spec(self.package) is None:
            raise InputError(
                f"the {self.label} plant without {self.package}, which is not installed",
                allowed=labels_of(entry for entry in PLANTS.values() if not entry.package),
                remedy=f"pip install 'cranectl[{self.name}]'",
            )

    def check_campaigns(self) -> None:
        """Raise InputError if the plant is too slow for campaigns."""
        if not self.batch:
            able = [entry for entry in PLANTS.values() if entry.batch]
            raise InputError(
                f"a campaign on the {self.label} plant, which is too slow for thousands of runs",
                allowed=labels_of(able),
                remedy=f"take '--plants {PLANTS.REFERENCE}', and {self.name} for single runs",
            )

    def load(self) -> Callable[..., Plant]:
        """Return the class of the plant, imported now; raise InputError as `check_installed` does."""
        self.check_installed()
        plant: type[Plant] = resolve_name(self.where)
        return functools.partial(plant, **self.arguments) if self.arguments else plant


class Plants(MutableMapping[str, PlantEntry]):
    """All entries by name, in the order of a log. Plants of other packages are loaded at first use.

    Plants that only a log describes can be looked up, so that their runs can be shown. Iteration leaves them
    out, since they cannot be run.
    """

    REFERENCE = "mujoco"  # the plant that others are compared against
    MODEL_ENDING = ".xml"  # of the name of a model file
    ALL = (("all",), ("both",))  # values that stand for every plant; "both" dates from when there were two

    def __init__(self, *own: PlantEntry) -> None:
        self._entries = {entry.name: entry for entry in own}
        self._logged: dict[str, PlantEntry] = {}
        self._complete = False

    def _known(self) -> dict[str, PlantEntry]:
        if not self._complete:
            self._complete = True  # at once: loading another package may look up plants itself
            try:
                self._entries.update(Extensions.PLANTS.join(self._entries, PlantEntry))
            except InputError:
                self._complete = False
                raise
        return self._entries

    def __getitem__(self, name: str) -> PlantEntry:
        # A module of another package may look up one of our plants while it is being loaded.
        if name in self._entries:
            return self._entries[name]
        return {**self._logged, **self._known()}[name]

    def remember(self, entry: PlantEntry) -> None:
        """Add a plant that a log describes, unless one of its name is known."""
        if entry.name not in self:
            self._logged[entry.name] = entry

    def entry(self, name: str) -> PlantEntry:
        """Return the entry of the plant `name`; an InputError lists the known ones, nearest first."""
        InputError.check_known("plant", [name], self)
        return self[name]

    def find(self, name: str, rig: RigParameters | None = None) -> PlantEntry:
        """Return the entry of a plant, which a name or the path of a model file stands for.

        From now on this process knows the model file. With a `rig`, which gives the names of sites and
        actuators, the entry says what the model has. Raises InputError if there is no such plant or file, or
        if its model is not a crane.
        """
        if name.endswith(self.MODEL_ENDING):
            from cranectl.plants.model_files import entry_of_file

            entry = entry_of_file(name)
        else:
            entry = self.entry(name)
        if rig is None or not entry.is_model_file:
            return entry
        complete: PlantEntry = resolve_name("cranectl.plants.mujoco.own_plant:examined")(
            entry, rig.plant.names
        )
        if complete != entry:
            self[entry.name] = complete
        return self[entry.name]

    def make(self, name: str, scenario: Scenario, drive: Drive) -> Plant:
        """Make a plant for a scenario; raise InputError if it is unknown or cannot show the scenario."""
        entry = self.find(name, scenario.rig)
        entry.check_scenario(scenario, drive)
        if not entry.is_own:
            from cranectl.plants.trials import check_honest

            check_honest(entry.name, drive)
        steps = PhysicsStep(scenario, drive).per_period
        return entry.load()(
            scenario.rig,
            drive=drive,
            step=scenario.period_ns / NANOSECONDS / steps,
            substeps=steps,
            effects=scenario.effects_on_plant,
        )

    def in_order(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return plants in the order of a log; raise InputError for an unknown one."""
        chosen = {self.entry(name).name for name in names}
        return tuple(name for name in (*self, *self._logged) if name in chosen)  # those of logs last

    @property
    def by_default(self) -> tuple[str, ...]:
        """The plants that a command runs if none are named."""
        return tuple(name for name, entry in self.items() if entry.by_default)

    def to_run(self, names: Iterable[str], rig: RigParameters | None = None) -> tuple[str, ...]:
        """Return the plants to run: those in `names`, or the default ones and the model file of the rig.

        Raises InputError for one that is unknown or not installed.
        """
        stated = self.in_order(names)
        chosen = stated or self.by_default
        for name in chosen:
            self[name].check_installed()
        return chosen if stated or rig is None or not rig.model else (*chosen, self.find(rig.model).name)

    def of_logs(self, names: Sequence[str], logged: Iterable[str]) -> tuple[str, ...]:
        """Return the plants that a user names for logs; `all` means those in `logged`, else all known ones.

        Raises InputError for a plant that neither this process nor a log knows.
        """
        if tuple(names) in self.ALL:
            return self.in_order(logged) or tuple(self)
        return tuple(self.entry(name).name for name in names)

    def reference(self, names: Iterable[str]) -> str:
        """Return the plant that the others are compared with: REFERENCE, else the last one."""
        ordered = self.in_order(names)
        return self.REFERENCE if self.REFERENCE in ordered else ordered[-1]

    def shown(self, names: Iterable[str]) -> str:
        """Return the plant whose numbers and picture come first: a user's own, else the reference plant."""
        ordered = self.in_order(names)
        return next((name for name in ordered if not self[name].is_own), self.reference(ordered))

    def sources(self, names: Iterable[str]) -> dict[str, str]:
        """Return the digests of plants that come from other packages or from model files, by name."""
        entries = [self[name] for name in names if name in self]
        models = {f"model {entry.name}": entry.digest for entry in entries if entry.digest}
        return Provenance.sources_of({entry.where.partition(":")[0] for entry in entries}) | models

    @property
    def model_files(self) -> dict[str, PlantEntry]:
        """The plants from model files that this process knows."""
        return {name: entry for name, entry in self.items() if entry.is_model_file}

    def forget_model_files(self) -> None:
        """Remove the plants from model files."""
        for name in self.model_files:
            del self[name]

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

PLANTS = Plants(  # by name
    _own(
        "analytic",
        "analytic",
        "series-1",
        "cranectl.plants.analytic:AnalyticPlant",
        batch=64,
        lacks={"rope": _RIGID, "body": _RIGID, "frame": _RIGID, "force": "whose axes have no forces"},
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
            "limits.force": "whose drives have no limit of force",
            "friction.coulomb": _SLIDES,
            "friction.pivot_coulomb": _SLIDES,
        },
        by_default=False,
        package="pydrake",
    ),
)


@Arguments.checked
def register_plant(entry: PlantEntry) -> None:
    """Make a plant known to this process.

    Worker processes of `validate` know it too if the module of its class makes this call.

    Parameters
    ----------
    entry : PlantEntry
        The plant.

    Raises
    ------
    InputError
        If its name is taken.
    """
    InputError.check_name("plant", entry.name, taken=PLANTS)
    PLANTS[entry.name] = entry


def labels_of(entries: Iterable[PlantEntry]) -> str:
    """Return the labels of plants as a phrase for an error: "the MuJoCo or elastic plant"."""
    return f"the {' or '.join(entry.label for entry in entries)} plant"
