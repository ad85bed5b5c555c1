"""Strict settings: parse TOML tables into frozen pydantic models, and report all mistakes at once."""

import functools
import json
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, Self, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError
from pydantic_core import ErrorDetails

from cranectl.support import TOML, InputError, Table, Tree, printable


@dataclass(frozen=True)
class Scaled:
    """How a number scales with the size of a crane: powers of its length and of its mass.

    It is an annotation of a field. A list has one annotation for all its numbers, or one for each.
    """

    length: float = 0.0  # power of the relative length
    mass: float = 0.0  # power of the relative mass

    def factor(self, length: float, mass: float = 1.0) -> float:
        """Return the factor on the number if lengths and masses have these factors."""
        factor: float = length**self.length * mass**self.mass
        return factor

    def sized(self, value: float, length: float, mass: float = 1.0) -> float:
        """Return the laboratory rig's number `value` on another crane, to three digits if it differs."""
        factor = self.factor(length, mass)
        return value if factor == 1.0 else float(f"{factor * value:.3g}")


class Settings(BaseModel):
    """Base of all settings: no unknown keys, no silent conversions, no NaN or infinity, frozen."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @classmethod
    def from_table(
        cls,
        table: Mapping[str, Any],
        source: str,
        *,
        overrides: Sequence[str] = (),
        before: Mapping[str, Any] | None = None,
        prefix: str = "",
    ) -> Self:
        """Return `table` as settings; an InputError names every wrong field of `source`.

        If `overrides` have changed the table, its remedies can be typed. They need the table `before` them,
        and the `prefix` of the keys of the settings within that table.
        """
        try:
            return cls.model_validate(dict(table))
        except ValidationError as error:
            assigned = _Assigned(overrides, table if before is None else before, prefix)
            problems = [_explain(cls, details, assigned) for details in error.errors()[:MAX_PROBLEMS]]
            more = error.error_count() - len(problems)
        texts = "; ".join(found for found, _, _ in problems) + (f"; and {more} more" if more else "")
        raise InputError(
            f"{source}: {texts}",
            allowed="; ".join(dict.fromkeys(allowed for _, allowed, _ in problems if allowed)),
            remedy="; ".join(dict.fromkeys(remedy for _, _, remedy in problems if remedy))
            or "correct the fields above",
        ) from None

    @classmethod
    def scale_of(cls, name: str) -> Scaled:
        """Return how a number scales with the size of a crane, by its dotted name.

        Ratios, angles, seeds, electronics, gravity and air have no scale.
        """
        scales = _scales_of(cls)
        return scales.get(name) or scales.get(name.rpartition(".")[0], Scaled())


T = TypeVar("T")
Pair = Annotated[tuple[T, T], Field(strict=False)]  # lists, in TOML
Triple = Annotated[tuple[T, T, T], Field(strict=False)]
Many = Annotated[tuple[T, ...], Field(strict=False)]
# A text or something else. The tags have no letters, so that errors contain only the name of the field.
Text = Annotated[T, Tag("")]
Other = Annotated[T, Tag(" ")]
TEXT_OR_OTHER = Discriminator(lambda value: "" if isinstance(value, str) else " ")

MAX_DURATION = 600.0  # [s]; `simulate.memory` bounds what a run holds in memory
MIN_DURATION = 1e-6  # [s]; the shortest control period, since ends of segments are exact to a nanosecond
Duration = Annotated[float, Field(ge=MIN_DURATION, le=MAX_DURATION)]  # [s]
Position = Annotated[float, Field(ge=-1e4, le=1e4)]
Point2 = Pair[Position]
Point3 = Triple[Position]

LENGTH, MASS, TIME, SPEED, RATE = Scaled(1.0), Scaled(0.0, 1.0), Scaled(0.5), Scaled(0.5), Scaled(-0.5)
FORCE = MASS  # since gravity stays


@functools.cache
def _scales_of(model: type[BaseModel]) -> dict[str, Scaled]:
    """Return how the numbers of `model` scale, by dotted name; constant ones are left out."""
    result: dict[str, Scaled] = {}
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            nested = _scales_of(field.annotation)
            result |= {f"{name}.{key}": scale for key, scale in nested.items()}
        scales = [item for item in field.metadata if isinstance(item, Scaled)]
        names = [name] if len(scales) == 1 else [f"{name}.{k}" for k in range(len(scales))]
        result |= dict(zip(names, scales, strict=True))
    return result


class RuleError(ValueError):
    """A rule across several fields is violated; `Settings.from_table` turns it into an InputError."""

    def __init__(self, found: str, *, allowed: str, remedy: str) -> None:
        """Store the three parts of an InputError."""
        super().__init__(f"{found}; allowed: {allowed}")
        self.found, self.allowed, self.remedy = found, allowed, remedy


MAX_PROBLEMS = 10  # in one message
_LIST_ERRORS = ("tuple_type", "too_long", "too_short")  # of pydantic
_COMPLEX = re.compile(r"(?<=[\[, ])[-+.\de]+[ij](?=[\], ])")  # a complex number in a list


class _Assigned(NamedTuple):
    """What `--set` assigned to a table, for remedies that can be typed."""

    assignments: Sequence[str]
    before: Mapping[str, Any]  # the table before them
    prefix: str = ""  # of the keys of the settings that are parsed, within that table


def override(table: Mapping[str, Any], assignments: Iterable[str]) -> Table:
    """Return a copy of `table` with `key.sub=value` assignments applied.

    Values are parsed as TOML, except that complex numbers in lists need no quotes. Others are strings.
    """
    result: Table = Tree(table).mapped()
    for assignment in assignments:
        key, separator, text = assignment.partition("=")
        parts = key.split(".")
        if not separator or not all(parts) or len(parts) > TOML.MAX_DEPTH:
            raise InputError(
                f"--set {assignment}",
                allowed=f"key=value, with dots between tables, at most {TOML.MAX_DEPTH} parts",
                remedy="for example --set rig.load_mass=2.5",
            )
        text = text.strip()
        if text.startswith("["):
            text = _COMPLEX.sub(r'"\g<0>"', text)
        value = TOML.value(text, f"--set {printable(assignment, longest=80)}")
        Tree(result).assign(key.strip(), value, f"--set {assignment}")
    return result


def _explain(model: type[BaseModel], details: ErrorDetails, assigned: _Assigned) -> tuple[str, str, str]:
    """Return (found, allowed, remedy) for one pydantic error."""
    location, value = details["loc"], details["input"]
    command = _list_command(model, details, assigned)
    such = f", such as {command}" if command else ""
    where = ".".join(str(part) for part in _without_tags(model, location))
    if details["type"] == "extra_forbidden":
        key = str(location[-1])
        parent = _model_at(model, location[:-1])
        fields = parent.model_fields if parent is not None else {}
        known = [field.alias or name for name, field in fields.items()]
        remedy = InputError.did_you_mean(key, known) or f"remove '{where}'"
        return f"unknown key '{where}'", ", ".join(known), remedy
    if details["type"] == "missing":
        return (
            f"'{where}' is missing",
            f"{where}: {describe(model, location)}",
            (f"write a list{such}" if such else f"add '{where}'"),
        )
    if details["type"] == "value_error" and isinstance(rule := details["ctx"]["error"], RuleError):
        return rule.found, rule.allowed, rule.remedy
    message, remedy = details["msg"], str(details.get("ctx", {}).get("remedy", ""))
    if details["type"] == "tuple_type":  # pydantic speaks of a Python tuple
        message = "Input should be a list"
        remedy = (
            "put texts in it in quotes, numbers without" if str(value).startswith("[") else "write a list"
        ) + such
    elif such and not remedy:
        remedy = f"write a list{such}"
    return (
        f"{where} = {printable(repr(value), longest=80)}",
        f"{where}: {message[0].lower()}{message[1:]}",
        remedy,
    )


def _list_command(model: type[BaseModel], details: ErrorDetails, assigned: _Assigned) -> str:
    """Return the option that assigns the list from before a wrong assignment, or else its default."""
    location = _without_tags(model, details["loc"])
    is_of_item = bool(location) and isinstance(location[-1], int)
    names = [str(part) for part in (location[:-1] if is_of_item else location)]
    key = assigned.prefix + ".".join(names)
    given = (assignment.partition("=")[0].strip() for assignment in assigned.assignments)
    if not (is_of_item or details["type"] in _LIST_ERRORS) or not any(
        f"{key}.".startswith(f"{name}.") for name in given
    ):
        return ""
    value = _value_at(assigned.before, key) or _value_at(assigned.before, f"rig.{key}")  # numbers of effects
    if not isinstance(value, list | tuple):
        parent = _model_at(model, names[:-1])
        field = parent.model_fields.get(names[-1]) if parent else None
        value = field.default if field else None
    if not isinstance(value, list | tuple):
        return ""
    plain = [] if any(isinstance(item, Mapping | BaseModel) for item in value) else list(value)
    return f"--set {shlex.quote(f'{key}={json.dumps(plain)}')}"


def _value_at(table: Mapping[str, Any], key: str) -> Any:
    """Return the value at a dotted name, or None."""
    value: Any = table
    for name in key.split("."):
        value = value.get(name) if isinstance(value, Mapping) else None
    return value


def _model_at(model: type[BaseModel], location: Sequence[int | str]) -> type[BaseModel] | None:
    """Return the settings class at `location`, ignoring list indices and union tags."""
    candidates: list[type[BaseModel]] = [model]
    for part in location:
        candidates = _within(candidates, part)
    return candidates[0] if candidates else None


def _without_tags(model: type[BaseModel], location: Sequence[int | str]) -> list[int | str]:
    """Return the keys of `location` as a file has them, without the tags of unions."""
    candidates, keys = [model], []
    for part in location:
        if str(part).strip() and not (isinstance(part, str) and _tagged(candidates, part)):
            keys.append(part)
        candidates = _within(candidates, part)
    return keys


def _within(candidates: list[type[BaseModel]], part: int | str) -> list[type[BaseModel]]:
    """Return the settings classes at `part` of any of `candidates`."""
    if isinstance(part, int) or not part.strip():
        return candidates
    fields = [c.model_fields[part] for c in candidates if part in c.model_fields]
    return _tagged(candidates, part) or [nested for field in fields for nested in _nested(field.annotation)]


def _tagged(candidates: list[type[BaseModel]], tag: str) -> list[type[BaseModel]]:
    return [candidate for candidate in candidates if _tag(candidate) == tag]


def _nested(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [nested for argument in get_args(annotation) for nested in _nested(argument)]


def _tag(model: type[BaseModel]) -> str | None:
    kind = model.model_fields.get("kind")
    return next(iter(get_args(kind.annotation)), "added") if kind is not None else None


def describe(model: type[BaseModel], location: Sequence[int | str]) -> str:
    """Return the description of the setting at `location`, or "a value" if it has none."""
    parent = _model_at(model, location[:-1])
    field = parent.model_fields.get(str(location[-1])) if parent is not None else None
    return (field.description if field is not None else None) or "a value"
