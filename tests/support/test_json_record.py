"""Records as JSON output."""

import json
from dataclasses import dataclass
from pathlib import Path

from cranectl.support.json_record import JSONRecord


@dataclass(frozen=True)
class Inner:
    size: float


@dataclass(frozen=True)
class Renamed(JSONRecord):
    size: float

    def to_json(self) -> dict[str, object]:
        return {"length": self.size}


@dataclass(frozen=True)
class Outer(JSONRecord):
    JSON_PROPERTIES = ("large",)

    name: str
    log: Path | None
    inner: tuple[Inner, ...]
    renamed: Renamed

    @property
    def large(self) -> bool:
        return self.inner[0].size > 1.0


def test_fields_come_in_their_order_and_properties_last() -> None:
    record = Outer("a", Path("a.mcap"), (Inner(2.0),), Renamed(3.0))
    text = (
        '{"name": "a", "log": "a.mcap", "inner": [{"size": 2.0}], "renamed": {"length": 3.0}, "large": true}'
    )
    assert json.dumps(record.to_json()) == text


def test_a_missing_value_stays_none() -> None:
    assert Outer("a", None, (Inner(0.5),), Renamed(3.0)).to_json()["log"] is None
