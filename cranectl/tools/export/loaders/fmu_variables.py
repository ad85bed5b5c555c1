"""Map the variables of an FMU to signals and commands, by name or by a TOML table beside the FMU."""

import re
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, Literal, NamedTuple

from pydantic import Field

from cranectl.controllers import Controller, Parameter
from cranectl.loaders import ControllerFile
from cranectl.scenario import Settings
from cranectl.signals import Signal, SignalGroup
from cranectl.support import TOML, InputError
from cranectl.tools.export.loaders.fmu_step import HELD, MEASURED
from cranectl.tools.export.loaders.fmu_units import Conversion

ENCODERS = {f"encoders.{name}": k for k, name in enumerate(SignalGroup.STATE.names[::2])}
STATES = {f"state.{name}": k for k, name in enumerate(SignalGroup.STATE.names)}
STATES |= {f"measurement.{name}": k for k, name in enumerate(SignalGroup.MEASUREMENT.names)}
REFERENCES = {f"reference.{name}": MEASURED + k for k, name in enumerate(SignalGroup.REFERENCE.names)}
COMMANDS = ("command.bridge", "command.trolley", "command.rope")
_GROUPS = {"encoders": SignalGroup.STATE, "state": SignalGroup.STATE}
_GROUPS |= {"measurement": SignalGroup.MEASUREMENT, "reference": SignalGroup.REFERENCE}
UNITS = {f"{name}.{signal.name}": signal.unit for name, group in _GROUPS.items() for signal in group.signals}
MAX_REFERENCE = 2**32 - 1
HOLD = "held"  # marks an axis that no output commands
OUR_NAMES = re.compile(r"(encoders|state|measurement|reference)\b")
REAL = ("Real", "Float64")


class FmuTable(Settings):
    """The file beside an FMU: what FMI has no place for, and what its variables are called here."""

    name: str = Field("", description="of the controller; by default that of the model")
    title: str = Field("", description="one line for people; by default the model's description")
    command: Literal["acceleration", "velocity", "force"] = "acceleration"
    follows: Literal["path", "set-point"] = "path"
    every: int = Field(1, ge=1, description="control periods between two steps")
    inputs: dict[str, str | float] = Field(
        {}, description="of the FMU, and the signal or the constant that each gets"
    )
    outputs: dict[str, str] = Field(
        {}, description="of the FMU, and what each commands; or a command, and that its axis is held"
    )
    units: dict[str, float] = Field(
        {}, description="of inputs and outputs, how many SI units one of their own is"
    )


class Variables(NamedTuple):
    """The variables that the step exchanges, by value reference, and those that are set before."""

    table: FmuTable
    measures: Literal["state", "encoders"]
    input_references: list[int]
    sources: list[int]  # source of each input, numbered as in `fmu_step`
    output_references: list[int]  # outputs that command, then outputs that are logged
    commands: list[int]  # for each axis its place among these outputs, or HELD
    factors: list[float]  # SI units in one unit of the FMU, for each input, then for each axis
    logged: tuple[Signal, ...]
    parameters: tuple[Parameter, ...]
    constants: tuple[float, ...]  # values of inputs that are set once
    fixed_references: list[int]  # references of the parameters, then of the constants


def variables_of(file: ControllerFile, description: Any) -> Variables:
    """Return the meaning of each variable in the description of an FMU, as FMPy has read it.

    Raises InputError for a variable without a meaning, of another type or in another unit.
    """
    declared = description.modelVariables
    source = str(file.path.with_suffix(".toml"))
    table = FmuTable.from_table(TOML.parse(file.table.decode("utf-8", "replace"), source), source)
    all_inputs, all_outputs = (
        [variable for variable in declared if variable.causality == cause] for cause in ("input", "output")
    )
    # The table maps outputs to commands, but a held axis has no output: there the command stands at the left.
    held_axes = _held(table, all_outputs, source)
    outputs = {name: meant for name, meant in table.outputs.items() if name not in held_axes}
    meant = _meant(outputs, all_outputs, "output", source)
    signals = _meant(table.inputs, all_inputs, "input", source)
    constant = [variable for variable in all_inputs if not isinstance(signals[variable.name], str)]
    free = [variable for variable in all_inputs if _keeps_its_start(variable, table)]
    inputs = [variable for variable in all_inputs if variable not in constant and variable not in free]
    # A step gets one array of measurements: an FMU that reads one encoder cannot read the state too.
    encoders = any(signals[variable.name] in ENCODERS for variable in inputs)
    known = {**(ENCODERS if encoders else STATES), **REFERENCES}
    for variable in (*inputs, *constant):
        _check_type(variable, file)
        signal = signals[variable.name]
        if signal not in known and variable in inputs:
            raise InputError(
                f"{file.reference}: input '{variable.name}' is to be '{signal}', which no signal is",
                allowed=", ".join(known),
                remedy=InputError.did_you_mean(signal, known)
                or f"say in {source} what it is: [inputs] NAME = SIGNAL, or a number",
            )
    commands = _commands(meant, all_outputs, held_axes, file, source)
    commanding = [output for output in commands if output is not None]
    definitions = {unit.name: unit for unit in description.unitDefinitions}
    conversion = Conversion(file, source, definitions, table.units)
    conversion.check_stated([*inputs, *commanding])
    # The group goes on with the signals that say whether a limit acts, so it is longer than COMMANDS.
    drives = zip(COMMANDS, SignalGroup.command(table.command).signals, strict=False)
    in_si = UNITS | {command: drive.unit for command, drive in drives}
    exchanged = [
        *((variable, signals[variable.name]) for variable in inputs),
        *zip(commands, COMMANDS, strict=True),
    ]
    others = [variable for variable in all_outputs if variable not in commanding and _is_number(variable)]
    # What is connected is set at each step or once; as a parameter it would be set a second time.
    parameters = _settable(declared, free, connected=[*inputs, *constant])
    return Variables(
        table=table,
        measures="encoders" if encoders else "state",
        input_references=_references(inputs, file),
        sources=[known[signals[variable.name]] for variable in inputs],
        output_references=_references([*commanding, *others], file),
        commands=[HELD if output is None else commanding.index(output) for output in commands],
        factors=[
            1.0 if variable is None else conversion.factor(variable, in_si[signal], signal)
            for variable, signal in exchanged
        ],
        logged=tuple(
            Signal(name, name, _of(variable, "unit"), variable.description or variable.name)
            for name, variable in _named(others, file).items()
        ),
        parameters=tuple(
            Parameter(
                name,
                _number(variable, "start", 0.0, file),
                _of(variable, "unit"),
                variable.description or variable.name,
                _number(variable, "min", -inf, file),
                _number(variable, "max", inf, file),
            )
            for name, variable in _named(parameters, file).items()
        ),
        constants=tuple(float(signals[variable.name]) for variable in constant),
        fixed_references=_references([*parameters, *constant], file),
    )


def _held(table: FmuTable, outputs: Sequence[Any], source: str) -> list[str]:
    """Return the outputs that the table maps to a held axis; raise InputError if an axis cannot be held."""
    names = [name for name, meant in table.outputs.items() if meant == HOLD]
    for name in names:
        if name not in COMMANDS:
            raise InputError(
                f"{source}: outputs: {name} = '{HOLD}'",
                allowed=f"'{HOLD}' for one of {', '.join(COMMANDS)}",
                remedy=f"write the command whose axis is held: 'command.trolley' = '{HOLD}'",
            )
        if table.command == "force":
            raise InputError(
                f"{source}: outputs: {name} = '{HOLD}' with command = 'force'",
                allowed=f"'{HOLD}' where accelerations or velocities are commanded: no force does not hold",
                remedy="let the model command this axis too, or export it with accelerations",
            )
    if len(names) == len(COMMANDS):
        raise InputError(
            f"{source}: outputs: all axes are '{HOLD}'",
            allowed="one output at least that commands an axis",
            remedy=f"say which of {', '.join(output.name for output in outputs) or 'no outputs'} commands",
        )
    return names


def _keeps_its_start(variable: Any, table: FmuTable) -> bool:
    """Return True for an input with a start value that is connected neither by the table nor by its name."""
    is_ours = variable.name in table.inputs or OUR_NAMES.match(variable.name)
    return variable.start is not None and not is_ours


def _meant(table: Mapping[str, Any], variables: Sequence[Any], cause: str, source: str) -> dict[str, Any]:
    """Return the name used here for each variable; raise InputError for an entry without a variable."""
    names = [variable.name for variable in variables]
    for name in table:
        if name not in names:
            raise InputError(
                f"{source}: {cause}s: the FMU has no {cause} '{name}'",
                allowed=", ".join(names) or f"it has no {cause}s",
                remedy=InputError.did_you_mean(name, names) or "correct the name",
            )
    return {name: table.get(name, name) for name in names}  # without an entry, a name means itself


def _check_type(variable: Any, file: ControllerFile) -> None:
    if not _is_number(variable):
        kind = f"an array of {variable.type}" if variable.dimensions else variable.type
        raise InputError(
            f"{file.reference}: {variable.causality} '{variable.name}' is {kind}",
            allowed="single numbers: Real of FMI 2, Float64 of FMI 3",
            remedy="export the model with such a variable",
        )


def _commands(
    meant: dict[str, str], outputs: Sequence[Any], held_axes: Sequence[str], file: ControllerFile, source: str
) -> list[Any]:
    """Return the output of each command, or None if its axis is held; raise InputError for none or two."""
    result: list[Any] = []
    for command in COMMANDS:
        fitting = [output for output in outputs if meant[output.name] == command]
        is_held = command in held_axes
        if is_held and not fitting:
            result.append(None)
            continue
        if len(fitting) != 1 or is_held:
            number = f"{len(fitting)} outputs are" if len(fitting) > 1 else "no output is"
            number = f"an output is '{HOLD}' and" if is_held else number
            raise InputError(
                f"{file.reference}: {number} {command}",
                allowed=f"one each for {', '.join(COMMANDS)}, of {', '.join(meant) or 'no outputs'}",
                remedy=f"say in {source} which: [outputs] NAME = '{command}'; "
                f"or that its axis is not moved: [outputs] '{command}' = '{HOLD}'",
            )
        _check_type(fitting[0], file)
        result += fitting
    for name, signal in meant.items():
        if signal not in (*COMMANDS, name):  # an output that means itself is logged
            raise InputError(
                f"{source}: outputs: {name} = '{signal}'",
                allowed=", ".join(COMMANDS),
                remedy="choose one of these, or leave the line out: the output is logged then",
            )
    return result


def _references(variables: Sequence[Any], file: ControllerFile) -> list[int]:
    """Return the value references; raise InputError for a reference that FMI does not allow."""
    references = [variable.valueReference for variable in variables]
    for reference, variable in zip(references, variables, strict=True):
        if not 0 <= reference <= MAX_REFERENCE:
            raise InputError(
                f"{file.reference}: {variable.causality} '{variable.name}' has valueReference = {reference}",
                allowed=f"0 to {MAX_REFERENCE}, a number of 32 bits",
                remedy="correct the model's description, or export it again",
            )
    return references


def _settable(declared: Sequence[Any], free: Sequence[Any], connected: Sequence[Any]) -> list[Any]:
    """Return the parameters and free inputs, each once, because aliases share the value of a variable."""
    taken = {variable.valueReference for variable in connected}
    settable: dict[int, Any] = {}
    for variable in (*(variable for variable in declared if variable.causality == "parameter"), *free):
        if _is_number(variable) and variable.valueReference not in taken:
            settable.setdefault(variable.valueReference, variable)
    return list(settable.values())


def _number(variable: Any, attribute: str, otherwise: float, file: ControllerFile) -> float:
    text = _of(variable, attribute)
    try:
        return float(text) if text else otherwise
    except ValueError:
        raise InputError(
            f"{file.reference}: {variable.causality} '{variable.name}' has {attribute} = '{text}'",
            allowed="a number",
            remedy="correct the model's description, or export it again",
        ) from None


def _is_number(variable: Any) -> bool:
    return variable.type in REAL and not variable.dimensions


def _of(variable: Any, attribute: str) -> str:
    """Return an attribute of a variable, or else of its declared type."""
    declared = getattr(variable.declaredType, attribute, None)
    return getattr(variable, attribute) or declared or ""


def _named(variables: Sequence[Any], file: ControllerFile) -> dict[str, Any]:
    """Return the variables by names that signals allow; raise InputError if two would be equal."""
    named: dict[str, Any] = {}
    for variable in variables:
        # FMI allows names such as `axis[1].der(x)`; a name that begins with a digit gets _ before it.
        name = re.sub(r"\W+|^(?=\d)", "_", variable.name, flags=re.ASCII)[: Controller.MAX_SIGNAL_NAME]
        if name in named:
            raise InputError(
                f"{file.reference}: '{named[name].name}' and '{variable.name}' would both be called {name}",
                remedy="give one of them another name in the model",
            )
        named[name] = variable
    return named
