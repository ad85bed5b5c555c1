"""Find the objects that other packages add to this one, as entry points or by registration."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from cranectl.support.errors import InputError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoints


@dataclass(frozen=True)
class Extensions:
    """Objects of one kind that other packages add, as entry points of a group."""

    group: str  # group of entry points

    METRICS: ClassVar["Extensions"]  # metrics
    PLANTS: ClassVar["Extensions"]  # plants
    CONTROLLERS: ClassVar["Extensions"]  # controllers
    SEGMENTS: ClassVar["Extensions"]  # kinds of segments
    EXPORTERS: ClassVar["Extensions"]  # formats of export

    @property
    def entries(self) -> "EntryPoints":
        """The entry points of the group, which are not loaded."""
        from importlib.metadata import entry_points  # slow, and no help text needs it

        return entry_points(group=self.group)

    def join(self, own: Mapping[str, Any], kind: type[Any], *, taken: Collection[str] = ()) -> dict[str, Any]:
        """Return the objects `own` by name, then those that installed packages declare.

        Raises InputError for an object that cannot be loaded, is no `kind`, or has a name already in use.
        """
        objects = dict(own)
        for entry in sorted(self.entries, key=lambda entry: entry.name):
            try:
                added = entry.load()
                if not isinstance(added, kind):
                    raise TypeError(f"{type(added).__name__} is no {kind.__name__}")
                if added.name in objects or added.name in taken:
                    raise ValueError(f"the name '{added.name}' is taken")
            except Exception as error:
                raise InputError(
                    f"{entry.value} of the entry points {self.group}: {error}",
                    allowed=f"a cranectl {kind.__name__} with a name of its own",
                    remedy="correct or remove the package that brings it",
                ) from error
            objects[added.name] = added
        return objects

    def packages(self) -> dict[str, str]:
        """Return the package and version that provides each object, by name of the object."""
        origins = {}
        for entry in self.entries:
            origin = f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value
            origins[entry.load().name] = origin
        return origins


Extensions.METRICS = Extensions("cranectl.metrics")
Extensions.PLANTS = Extensions("cranectl.plants")
Extensions.CONTROLLERS = Extensions("cranectl.controllers")
Extensions.SEGMENTS = Extensions("cranectl.segments")
Extensions.EXPORTERS = Extensions("cranectl.exporters")
# These decide numbers.
COUNTED = (Extensions.METRICS, Extensions.PLANTS, Extensions.CONTROLLERS, Extensions.SEGMENTS)
