"""Records whose fields are their JSON output."""

from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import Any, ClassVar, cast


class JSONRecord:
    """A base of dataclasses, whose JSON output has all fields in their order, and then properties."""

    JSON_PROPERTIES: ClassVar[tuple[str, ...]] = ()  # names of the properties that follow the fields

    def to_json(self) -> dict[str, Any]:
        """Return fields and properties as plain data, also those of records within them."""
        names = [field.name for field in fields(cast(Any, self))]
        return {name: _plain(getattr(self, name)) for name in (*names, *self.JSON_PROPERTIES)}


def _plain(value: Any) -> Any:
    if hasattr(value, "to_json"):
        return value.to_json()
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    return str(value) if isinstance(value, Path) else value
