"""The plants there are: what the package knows of each without loading it, where its class is.

Other packages declare a `PlantEntry` with an entry point of the group `cranectl.plants`, which every process
finds, or call `register_plant`, which is known where their module is imported. Effects that a plant
and its drives cannot show are refused rather than left out silently.
"""

from collections.abc import Iterable, Iterator, Mapping, MutableMapping
from dataclasses import dataclass, field
from importlib.util import find_spec

from cranectl.plants.plant import DRIVES, Drive, Plant
from cranectl.scenario.effects import NO_LIMIT, DriveLimits, EffectSettings
from cranectl.support import extensions
from cranectl.support.errors import InputError, unknown_name
from cranectl.support.extensions import check_free, check_name, loaded, with_extensions
from cranectl.support.provenance import source_digests

REFERENCE_PLANT = "mujoco"  # the plant that others are compared against


@dataclass(frozen=True)
class PlantEntry:
    """A plant by name."""

    name: str  # of its topics and columns: lower case letters, digits, hyphens
    label: str  # for people
    colour: str  # a series of `support.colours`
    where: str  # module:class, imported only when asked for: engines take a while
    batch: int  # samples of a campaign's batch: some seconds of runs like the thesis's; 0: none, too slow
    drives: tuple[Drive, ...] = ("ideal", "velocity")
    servos: bool = False  # its velocity drives feel the load, as those of `plants.elastic` and the engine do
    # Why it cannot show rope, body, frame; force, or of that only limits.force, friction.coulomb, ...
    lacks: Mapping[str, str] = field(default_factory=dict)
    by_default: bool = True  # where a command is not told which plants
    package: str = ""  # that it needs, and that only the extra of its name installs

    def __post_init__(self) -> None:
        check_name("plant", self.name)

    def check_installed(self) -> None:
        """Raise InputError if the package that it needs is not there."""
        if self.package and find_spec(self.package) is None:
            raise InputError(
                f"the {self.label} plant without {self.package}, which is not installed",
                allowed=_labels(entry for entry in PLANTS.values() if not entry.package),
                remedy=f"pip install 'cranectl[{self.name}]'",
            )

    def check_campaigns(self) -> None:
        """Raise InputError if it is too slow for campaigns."""
        if not self.batch:
            able = [entry for entry in PLANTS.values() if entry.batch]
            raise InputError(
                f"a campaign on the {self.label} plant, which is too slow for thousands of runs",
                allowed=_labels(able),
                remedy=f"take '--plants {REFERENCE_PLANT}', and {self.name} for single runs",
            )

    def load(self) -> type[Plant]:
        """Its class; raises InputError as `check_installed` does."""
        self.check_installed()
        found: type[Plant] = loaded(self.where)
        return found


class Plants(MutableMapping[str, PlantEntry]):
    """Entries by name, in the order of a log; those of other packages are looked for when first asked."""

    def __init__(self, *own: PlantEntry) -> None:
        self._entries = {entry.name: entry for entry in own}
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
        return self._entries[name] if name in self._entries else self._known()[name]

    def __setitem__(self, name: str, entry: PlantEntry) -> None:
        self._known()[name] = entry

    def __delitem__(self, name: str) -> None:
        del self._known()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._known())

    def __len__(self) -> int:
        return len(self._known())


_RIGID = "which has a rigid rope without mass, a point load and a rigid frame"
_POINT = "which has a rigid rope without mass and a point load"
_SLIDES = "whose joints have viscous friction only"

PLANTS = Plants(
    PlantEntry(
        name="analytic",
        label="analytic",
        colour="series-1",
        where="cranectl.plants.analytic:AnalyticPlant",
        batch=64,
        drives=DRIVES,
        lacks={"rope": _RIGID, "body": _RIGID, "frame": _RIGID, "force": "whose axes know no such forces"},
    ),
    PlantEntry(
        name="elastic",
        label="elastic",
        colour="series-3",
        where="cranectl.plants.elastic.plant:ElasticPlant",
        batch=32,
        drives=DRIVES,
        servos=True,
    ),
    PlantEntry(
        name="mujoco",
        label="MuJoCo",
        colour="series-2",
        where="cranectl.plants.mujoco.plant:MujocoPlant",
        batch=16,
        drives=DRIVES,
        servos=True,
    ),
    PlantEntry(
        name="drake",
        label="Drake",
        colour="series-4",
        where="cranectl.plants.drake.plant:DrakePlant",
        batch=0,
        drives=DRIVES,
        servos=True,
        lacks={
            "rope": _POINT,
            "body": _POINT,
            "limits.force": "whose drives give any force",
            "friction.coulomb": _SLIDES,
            "friction.pivot_coulomb": _SLIDES,
        },
        by_default=False,
        package="pydrake",
    ),
)


def default_plants() -> tuple[str, ...]:
    """What is run where no plants are named."""
    return tuple(name for name, entry in PLANTS.items() if entry.by_default)


def register_plant(entry: PlantEntry) -> None:
    """Make a plant known to this process; raises InputError for a name that is taken.

    Worker processes of `validate` know it too where the module of its class calls this.
    """
    check_free("plant", entry.name, PLANTS)
    PLANTS[entry.name] = entry


def plant_sources(names: Iterable[str]) -> dict[str, str]:
    """Digests of the sources of those plants that come from outside the package, as `provenance` has them."""
    modules = {PLANTS[name].where.partition(":")[0] for name in names if name in PLANTS}
    return source_digests(modules)


def plant_entry(name: str) -> PlantEntry:
    """The plant `name`; raises InputError that lists the known ones, nearest first."""
    if name not in PLANTS:
        raise unknown_name("plant", name, PLANTS)
    return PLANTS[name]


def in_order(names: Iterable[str]) -> tuple[str, ...]:
    """Plants in the order of a log; raises InputError for an unknown one."""
    wanted = {plant_entry(name).name for name in names}
    return tuple(name for name in PLANTS if name in wanted)


def plants_to_run(names: Iterable[str]) -> tuple[str, ...]:
    """`in_order`, without names the usual plants; raises InputError as well for one that is not installed."""
    chosen = in_order(names) or default_plants()
    for name in chosen:
        PLANTS[name].check_installed()
    return chosen


def reference_plant(names: Iterable[str]) -> str:
    """The plant that the others are compared against: REFERENCE_PLANT, or the last where it is absent."""
    ordered = in_order(names)
    return REFERENCE_PLANT if REFERENCE_PLANT in ordered else ordered[-1]


USE_VELOCITY = "take '--drive velocity'"


def check_effects(effects: EffectSettings, *, plant: str, drive: str) -> None:
    """Raise InputError for an unknown plant, drives it lacks, effects that it cannot show with `drive`.

    Friction of the cardan joint, wind, sensing and delay suit every plant and drive; limits of velocity and
    acceleration are of set-points, which velocity drives have on both plants. Friction of the axes and limits
    of force suit velocity and force drives, on plants that know them.
    """
    entry = plant_entry(plant)
    if drive not in entry.drives:
        raise InputError(
            f"{drive} drives on the {entry.label} plant",
            allowed=f"{' and '.join(entry.drives)} drives",
            remedy=f"take '--drive {entry.drives[0]}'",
        )
    if effects.limits is not None and drive == "ideal":
        raise InputError(
            "[effects.limits] with ideal drives, which take accelerations and realise any",
            allowed="velocity drives; force drives with limits of force alone",
            remedy=f"{USE_VELOCITY}, or leave the effect out",
        )
    if effects.limits is not None and drive == "force":
        _check_no_set_points(effects.limits)
    for name in ("rope", "body", "frame"):
        if getattr(effects, name) is not None and name in entry.lacks:
            capable, remedy = _capable(name)
            raise InputError(
                f"[effects.{name}] on the {entry.label} plant, {entry.lacks[name]}",
                allowed=f"{capable} for rope, body and frame",
                remedy=remedy,
            )
    for name, zero in _forces(effects):
        setting, on_axis = f"effects.{name} = {zero}", name in AXIS_FORCES
        if reason := _lack(entry, name):
            capable, remedy = _capable(name)
            raise InputError(
                f"effects.{name} on the {entry.label} plant, {reason}",
                allowed=f"{setting}, or {capable}{' with velocity or force drives' if on_axis else ''}",
                remedy=f"{remedy}; or set {setting}",
            )
        if drive == "ideal" and on_axis:
            raise InputError(
                f"effects.{name} with ideal drives, which move as commanded whatever the force",
                allowed=f"{setting}, or velocity or force drives",
                remedy=f"{USE_VELOCITY} or '--drive force'; or set {setting}",
            )


def _check_no_set_points(limits: DriveLimits) -> None:
    for name in ("velocity", "acceleration"):
        if min(getattr(limits, name)) < NO_LIMIT:
            raise InputError(
                f"effects.limits.{name} with force drives, which take no set-points",
                allowed=f"effects.limits.{name} = {[NO_LIMIT] * 3}, or velocity drives",
                remedy=f"{USE_VELOCITY}; or set effects.limits.{name} = {[NO_LIMIT] * 3}",
            )


def _capable(effect: str) -> tuple[str, str]:
    """The plants that show `effect`, and what to do to have it, in words."""
    able = [entry for entry in PLANTS.values() if not _lack(entry, effect)]
    names = ",".join(entry.name for entry in able if not entry.package)
    return _labels(able), f"take '--plants {names}', or leave the effect out"


def _labels(entries: Iterable[PlantEntry]) -> str:
    return f"the {' or '.join(entry.label for entry in entries)} plant"


AXIS_FORCES = ("limits.force", "friction.coulomb", "friction.viscous")  # what `force` among lacks means


def _lack(entry: PlantEntry, effect: str) -> str | None:
    """Why a plant cannot show an effect or a force, None if it can."""
    return entry.lacks.get(effect) or (entry.lacks.get("force") if effect in AXIS_FORCES else None)


def _forces(effects: EffectSettings) -> list[tuple[str, str]]:
    """Settings of forces on single joints, and the value that means none."""
    found: list[tuple[str, str]] = []
    if effects.limits and min(effects.limits.force) < NO_LIMIT:
        found.append(("limits.force", str([NO_LIMIT] * 3)))
    if effects.friction:
        acting = [kind for kind in ("coulomb", "viscous") if any(getattr(effects.friction, kind))]
        found += [(f"friction.{kind}", str([0.0] * 3)) for kind in acting]
        if effects.friction.pivot_coulomb:
            found.append(("friction.pivot_coulomb", "0.0"))
    return found
