"""The list of all plants: what is known of each without importing it, and where its class is.

Another package adds a plant in one of two ways. It declares a `PlantEntry` as an entry point of the group
`cranectl.plants`, which every process finds. Or it calls `register_plant`, in each process that needs it.
"""

from collections.abc import Iterable, Iterator, Mapping, MutableMapping, Sequence
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from cranectl import scenario as scenario_files
from cranectl import support
from cranectl.plants.plant import DRIVES, Drive, Plant
from cranectl.support import Extensions, InputError

if TYPE_CHECKING:
    from cranectl.plants.entry import PlantEntry
    from cranectl.scenario import RigParameters, Scenario


class Plants(MutableMapping[str, "PlantEntry"]):
    """All entries by name, in the order of a log. Plants of other packages are loaded at first use.

    Plants that only a log describes can be looked up, so that their runs can be shown. Iteration leaves them
    out, since they cannot be run.
    """

    REFERENCE = "mujoco"  # the plant that others are compared against
    MODEL_ENDING = ".xml"  # of the name of a model file
    ALL = (("all",), ("both",))  # values that stand for every plant; "both" dates from when there were two

    def __init__(self, *own: "PlantEntry", **declared: Mapping[str, Any]) -> None:
        """List plants by their entries, then by the arguments of entries that are made at first use."""
        # None for an entry that has not been made: names alone take no import of what checks entries.
        self._entries: dict[str, PlantEntry | None] = {entry.name: entry for entry in own}
        self._entries |= dict.fromkeys(declared)
        self._declared = declared
        self._logged: dict[str, PlantEntry] = {}
        self._complete = False

    def _known(self) -> "dict[str, PlantEntry | None]":
        if not self._complete:
            self._complete = True  # at once: loading another package may look up plants itself
            try:
                self._entries.update(self._added())
            except InputError:
                self._complete = False
                raise
        return self._entries

    def _added(self) -> "dict[str, PlantEntry]":
        """Return the plants of other packages."""
        if not Extensions.PLANTS.entries:
            return {}
        from cranectl.plants.entry import PlantEntry

        return Extensions.PLANTS.join({}, PlantEntry, taken=tuple(self._entries))

    def __getitem__(self, name: str) -> "PlantEntry":
        # A module of another package may look up one of our plants while it is being loaded.
        if name not in self._entries and name not in self._known():
            return self._logged[name]
        entry = self._entries[name]
        if entry is None:
            from cranectl.plants.entry import PlantEntry

            entry = self._entries[name] = PlantEntry(name, **self._declared[name])
        return entry

    def remember(self, entry: "PlantEntry") -> None:
        """Add a plant that a log describes, unless one of its name is known."""
        if entry.name not in self:
            self._logged[entry.name] = entry

    def entry(self, name: str) -> "PlantEntry":
        """Return the entry of the plant `name`; an InputError lists the known ones, nearest first."""
        InputError.check_known("plant", [name], self)
        return self[name]

    def find(self, name: str, rig: "RigParameters | None" = None) -> "PlantEntry":
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
            entry, rig.model_names
        )
        if complete != entry:
            self[entry.name] = complete
        return self[entry.name]

    def make(self, name: str, scenario: "Scenario", drive: Drive) -> Plant:
        """Make a plant for a scenario; raise InputError if it is unknown or cannot show the scenario."""
        from cranectl.plants.steps import PhysicsStep

        entry = self.find(name, scenario.rig)
        entry.check_scenario(scenario, drive)
        if not entry.is_own:
            from cranectl.plants.trials import check_honest

            check_honest(entry.name, drive)
        steps = PhysicsStep(scenario, drive).per_period
        return entry.load()(
            scenario.rig,
            drive=drive,
            step=scenario.period_ns / scenario_files.NANOSECONDS / steps,
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

    def to_run(self, names: Iterable[str], rig: "RigParameters | None" = None) -> tuple[str, ...]:
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
        return support.Provenance.sources_of({entry.where.partition(":")[0] for entry in entries}) | models

    @property
    def model_files(self) -> "dict[str, PlantEntry]":
        """The plants from model files that this process knows."""
        return {name: entry for name, entry in self.items() if entry.is_model_file}

    def forget_model_files(self) -> None:
        """Remove the plants from model files."""
        for name in self.model_files:
            del self[name]

    def __setitem__(self, name: str, entry: "PlantEntry") -> None:
        self._known()[name] = entry

    def __delitem__(self, name: str) -> None:
        del self._known()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._known())

    def __len__(self) -> int:
        return len(self._known())


_RIGID = "which has a rigid rope without mass, a point load and a rigid frame"
_SLIDES = "whose joints have viscous friction only"

_OWN = {"drives": tuple(DRIVES), "servos": True}

PLANTS = Plants(  # by name, each with the arguments of its entry
    analytic={
        **_OWN,
        "label": "analytic",
        "colour": "series-1",
        "where": "cranectl.plants.analytic:AnalyticPlant",
        "batch": 64,
        "lacks": {"rope": _RIGID, "body": _RIGID, "frame": _RIGID, "force": "whose axes have no forces"},
    },
    elastic={
        **_OWN,
        "label": "elastic",
        "colour": "series-3",
        "where": "cranectl.plants.elastic.plant:ElasticPlant",
        "batch": 32,
    },
    mujoco={
        **_OWN,
        "label": "MuJoCo",
        "colour": "series-2",
        "where": "cranectl.plants.mujoco.plant:MujocoPlant",
        "batch": 16,
    },
    drake={
        **_OWN,
        "label": "Drake",
        "colour": "series-4",
        "where": "cranectl.plants.drake.plant:DrakePlant",
        "batch": 0,
        "lacks": {
            "rope": "which has a rigid rope without mass",
            "limits.force": "whose drives have no limit of force",
            "friction.coulomb": _SLIDES,
            "friction.pivot_coulomb": _SLIDES,
        },
        "by_default": False,
        "package": "pydrake",
    },
)


def register_plant(entry: "PlantEntry") -> None:
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
    from cranectl.plants.entry import PlantEntry

    support.Arguments.check("entry", entry, PlantEntry)
    InputError.check_name("plant", entry.name, taken=PLANTS)
    PLANTS[entry.name] = entry


def labels_of(entries: "Iterable[PlantEntry]") -> str:
    """Return the labels of plants as a phrase for an error: "the MuJoCo or elastic plant"."""
    return f"the {' or '.join(entry.label for entry in entries)} plant"
