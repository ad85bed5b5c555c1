"""Which variable of an FMU is what: by its name, or by a table in TOML beside it."""

import re
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

from pydantic import Field

from cranectl.controllers.controller import Parameter
from cranectl.controllers.doors.fmu_step import MEASURED
from cranectl.controllers.doors.law_file import LawFile
from cranectl.scenario.settings import Settings, parse_settings
from cranectl.signals import MEASUREMENT, REFERENCE, STATE, Signal
from cranectl.support.documents import parse_toml
from cranectl.support.errors import InputError, did_you_mean

ENCODERS = {f"encoders.{name}": k for k, name in enumerate(STATE.names[::2])}
STATES = {f"state.{name}": k for k, name in enumerate(STATE.names)}
STATES |= {f"measurement.{name}": k for k, name in enumerate(MEASUREMENT.names)}
REFERENCES = {f"reference.{name}": MEASURED + k for k, name in enumerate(REFERENCE.names)}
COMMANDS = ("command.bridge", "command.trolley", "command.rope")
REAL = ("Real", "Float64")


class FmuTable(Settings):
    """The file beside an FMU: what FMI has no place for, and what its variables are called here."""

    name: str = Field("", description="of the controller; by default that of the model")
    title: str = Field("", description="one line for people; by default the model's description")
    command: Literal["acceleration", "velocity", "force"] = "acceleration"
    follows: Literal["path", "set-point"] = "path"
    every: int = Field(1, ge=1, description="control periods between two steps")
    inputs: dict[str, str] = Field({}, description="of the FMU, and which signal each gets")
    outputs: dict[str, str] = Field({}, description="of the FMU, and what each commands")


class Variables(NamedTuple):
    """Those that the step exchanges, by value reference, and those that are set before."""

    table: FmuTable
    measures: Literal["state", "encoders"]
    input_references: list[int]
    sources: list[int]  # of each input, as `fmu_step` has them
    output_references: list[int]  # the three commands, then those logged
    logged: tuple[Signal, ...]
    parameters: tuple[Parameter, ...]
    parameter_references: list[int]


def variables_of(file: LawFile, declared: Sequence[Any]) -> Variables:
    """Of the variables that FMPy has read; raises InputError for one without a meaning or of another type."""
    source = str(file.path.with_suffix(".toml"))
    parsed = parse_toml(file.table.decode("utf-8", "replace"), source)
    table = parse_settings(FmuTable, parsed, source)
    of = {cause: [each for each in declared if each.causality == cause] for cause in ("input", "output")}
    meant = {cause: _meant(getattr(table, f"{cause}s"), of[cause], cause, source) for cause in of}
    encoders = any(signal in ENCODERS for signal in meant["input"].values())
    known = {**(ENCODERS if encoders else STATES), **REFERENCES}
    for variable in of["input"]:
        _check(variable, meant["input"][variable.name], known, file, source)
    commands = _commands(meant["output"], of["output"], file, source)
    others = [each for each in of["output"] if each not in commands and _is_number(each)]
    parameters = [each for each in declared if each.causality == "parameter" and _is_number(each)]
    return Variables(
        table=table,
        measures="encoders" if encoders else "state",
        input_references=[each.valueReference for each in of["input"]],
        sources=[known[meant["input"][each.name]] for each in of["input"]],
        output_references=[each.valueReference for each in (*commands, *others)],
        logged=tuple(
            Signal(name, name, _of(each, "unit"), each.description or each.name)
            for name, each in _named(others, file).items()
        ),
        parameters=tuple(
            Parameter(
                name,
                float(each.start or 0.0),
                _of(each, "unit"),
                each.description or each.name,
                float(_of(each, "min") or "-inf"),
                float(_of(each, "max") or "inf"),
            )
            for name, each in _named(parameters, file).items()
        ),
        parameter_references=[each.valueReference for each in parameters],
    )


def _meant(table: dict[str, str], variables: Sequence[Any], cause: str, source: str) -> dict[str, str]:
    """By the name of each variable what it is called here; raises InputError for an entry of none."""
    names = [variable.name for variable in variables]
    for name in table:
        if name not in names:
            raise InputError(
                f"{source}: {cause}s: the FMU has no {cause} '{name}'",
                allowed=", ".join(names) or f"it has no {cause}s",
                remedy=did_you_mean(name, names) or "correct the name",
            )
    return {name: table.get(name, name) for name in names}


def _check(variable: Any, signal: str, known: dict[str, int], file: LawFile, source: str) -> None:
    if signal not in known:
        raise InputError(
            f"{file.reference}: input '{variable.name}' is to be '{signal}', which no signal is",
            allowed=", ".join(known),
            remedy=did_you_mean(signal, known) or f"say in {source} what it is: [inputs] NAME = SIGNAL",
        )
    _check_type(variable, file)


def _check_type(variable: Any, file: LawFile) -> None:
    if not _is_number(variable):
        kind = f"an array of {variable.type}" if variable.dimensions else variable.type
        raise InputError(
            f"{file.reference}: {variable.causality} '{variable.name}' is {kind}",
            allowed="single numbers: Real of FMI 2, Float64 of FMI 3",
            remedy="export the model with such a variable",
        )


def _commands(meant: dict[str, str], outputs: Sequence[Any], file: LawFile, source: str) -> list[Any]:
    """The three outputs that command; raises InputError where one has none, or two."""
    found = []
    for command in COMMANDS:
        fitting = [each for each in outputs if meant[each.name] == command]
        if len(fitting) != 1:
            raise InputError(
                f"{file.reference}: {len(fitting) or 'no'} output{'s are' if fitting else ' is'} {command}",
                allowed=f"one each for {', '.join(COMMANDS)}, of {', '.join(meant) or 'no outputs'}",
                remedy=f"say in {source} which: [outputs] NAME = '{command}'",
            )
        _check_type(fitting[0], file)
        found += fitting
    for name, signal in meant.items():
        if signal not in (*COMMANDS, name):
            raise InputError(f"{source}: outputs: {name} = '{signal}'", allowed=", ".join(COMMANDS))
    return found


def _is_number(variable: Any) -> bool:
    return variable.type in REAL and not variable.dimensions


def _of(variable: Any, attribute: str) -> str:
    """Its own, or that of its type."""
    declared = getattr(variable.declaredType, attribute, None)
    return getattr(variable, attribute) or declared or ""


def _named(variables: Sequence[Any], file: LawFile) -> dict[str, Any]:
    """By names that signals and settings can have; raises InputError where two would have one."""
    named: dict[str, Any] = {}
    for variable in variables:
        name = re.sub(r"\W+|^(?=\d)", "_", variable.name, flags=re.ASCII)
        if name in named:
            raise InputError(
                f"{file.reference}: '{named[name].name}' and '{variable.name}' would both be called {name}",
                remedy="give one of them another name in the model",
            )
        named[name] = variable
    return named
