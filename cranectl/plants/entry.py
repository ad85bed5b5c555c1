"""The declaration of a plant: its names, where its class is, and which settings it honours."""

import functools
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pkgutil import resolve_name
from typing import Any

from cranectl.plants.capabilities import LACKS, Capabilities
from cranectl.plants.plant import Drive, Plant
from cranectl.plants.registry import PLANTS, labels_of
from cranectl.support import Arguments, InputError, Palette

MAX_PLANT_LABEL = 40  # [characters]
PLANT_COLOURS = tuple(role for role in Palette.LIGHT.series_roles if role in Palette.VIEWER)
BUILT_IN = (
    "gravity", "bridge_mass", "trolley_mass", "trolley_motor_mass", "winch_mass", "load_mass",
    "bridge_time_constant", "trolley_time_constant", "winch_time_constant",
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
    delay : float
        Time [s] after which its drives follow a command; `effects.delay` of a scenario must include it.
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
    delay: float = 0.0
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
