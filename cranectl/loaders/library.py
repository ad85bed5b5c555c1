"""A library with a law, by way of `ctypes` alone: what it declares, whether it keeps to it, how it prepares.

Run as a program of its own, `python library.py FILE`, so that whatever the library does ends that program
only: it reads a line of JSON and answers with one.
"""

import ctypes
import json
import math
import os
import random
import sys
from collections.abc import Iterable
from ctypes import POINTER, Structure, c_char_p, c_double, c_int32, c_int64, c_uint32, cast
from typing import Any

TRIAL_STEPS = 500  # of two memories in turn, to see whether anything is kept elsewhere
Doubles = POINTER(c_double)
Plain = dict[str, Any]  # data that JSON knows


class CParameter(Structure):
    """cranectl_parameter."""

    _fields_ = (
        *((name, c_char_p) for name in ("name", "unit", "description")),
        *((name, c_double) for name in ("initial", "lowest", "highest")),
    )


class CTunable(CParameter):
    """cranectl_parameter since version 2."""

    _fields_ = (("search", c_double * 2), ("length_power", c_double))


class CSignal(Structure):
    """cranectl_signal."""

    _fields_ = (*((name, c_char_p) for name in ("name", "unit", "description")), ("place", c_int64))


PARAMETERS = {1: CParameter, 2: CTunable, 3: CTunable}  # by version of the interface


class CDeclaration(Structure):
    """cranectl_declaration."""

    _fields_ = (
        ("abi", c_uint32),
        ("size", c_uint32),
        ("name", c_char_p),
        ("title", c_char_p),
        *((name, c_int32) for name in ("command", "follows", "measures", "every", "preview")),
        *((name, c_int32) for name in ("memory", "numbers", "parameter_count", "signal_count")),
        ("parameters", POINTER(CParameter)),
        ("signals", POINTER(CSignal)),
    )


class CReading(CDeclaration):
    """cranectl_declaration since version 3."""

    _fields_ = (("reads", c_char_p),)


NUMBERS = ("gravity", "bridge_mass", "trolley_mass", "winch_mass", "load_mass")
OF_RIG = (*NUMBERS, "time_constants")


class CNominal(Structure):
    """cranectl_nominal."""

    _fields_ = (
        *((name, c_double) for name in NUMBERS),
        ("time_constants", c_double * 3),
        ("period", c_double),
        ("state", c_double * 10),
        ("reference", c_double * 15),
    )


def load(path: str) -> ctypes.CDLL:
    """The library; raises OSError."""
    return ctypes.CDLL(path)


def symbol(library: ctypes.CDLL, name: str) -> Any:
    """A function; raises ValueError where there is none."""
    try:
        return getattr(library, name)
    except AttributeError:
        raise ValueError(f"it has no function {name}") from None


def step_of(library: ctypes.CDLL) -> Any:
    """Its step."""
    step = symbol(library, "cranectl_step")
    step.restype, step.argtypes = c_int64, [Doubles] * 5
    return step


def declaration(library: ctypes.CDLL) -> Plain:
    """What it declares, as plain data; raises ValueError for what cannot be."""
    tell = symbol(library, "cranectl_controller")
    tell.restype = POINTER(CDeclaration)
    step_of(library)
    pointer = tell()
    if not pointer:
        raise ValueError("cranectl_controller returns no declaration")
    told = pointer.contents
    if told.abi not in PARAMETERS:
        raise ValueError(f"it was built for version {told.abi} of the interface, this is {max(PARAMETERS)}")
    kind = CReading if told.abi >= 3 else CDeclaration
    if told.size != ctypes.sizeof(kind):
        raise ValueError(f"its declaration has {told.size} bytes, it should have {ctypes.sizeof(kind)}")
    found: Plain = {"name": text(told.name), "title": text(told.title)}
    found |= {name: getattr(told, name) for name in ("command", "follows", "measures", "every", "preview")}
    found |= {"memory": told.memory, "numbers": max(told.numbers, told.parameter_count)}
    limits = {"command": 2, "follows": 1, "measures": 1, "preview": 10**6, "memory": 10**6, "numbers": 10**6}
    limits |= {"parameter_count": 10**4, "signal_count": 10**4, "every": 10**6}
    for name, highest in limits.items():
        if not (name == "every") <= getattr(told, name) <= highest:
            raise ValueError(
                f"{name} = {getattr(told, name)}, allowed is {int(name == 'every')} to {highest}"
            )
    parameters = cast(told.parameters, POINTER(PARAMETERS[told.abi]))
    found["parameters"] = [
        [text(p.name), p.initial, text(p.unit), text(p.description), p.lowest, p.highest, *tuning(p)]
        for p in parameters[: told.parameter_count]
    ]
    found["reads"] = read_fields(library, cast(pointer, POINTER(kind)).contents)
    found["signals"] = [
        [s.place, text(s.name), text(s.unit), text(s.description)] for s in told.signals[: told.signal_count]
    ]
    return found


def read_fields(library: ctypes.CDLL, told: Any) -> list[str] | None:
    """Return the fields of the rig that it declares to read, None where it does not say."""
    if not hasattr(library, "cranectl_prepare"):
        return []
    raw = getattr(told, "reads", None)
    names = None if raw is None else text(raw).split()
    for name in names or ():
        if name not in OF_RIG:
            raise ValueError(f"reads names '{name}', allowed is {', '.join(OF_RIG)}")
    return names


def tuning(parameter: Any) -> tuple[float, float, float]:
    """Both ends of the search, 0 for none, and the power of the length; raises ValueError for no search."""
    low, high = getattr(parameter, "search", (0.0, 0.0))
    if not 0.0 < low < high < math.inf and (low, high) != (0.0, 0.0):
        name = text(parameter.name)
        raise ValueError(f"search of {name} from {low:g} to {high:g}, allowed is 0 < low < high, or 0 to 0")
    return low, high, getattr(parameter, "length_power", 0.0)


def text(raw: bytes | None) -> str:
    """Of a C string."""
    return "" if raw is None else raw.decode("utf-8", "replace")


def prepare(library: ctypes.CDLL, told: Plain, values: list[float], nominal: Plain | None) -> Plain:
    """Parameters and memory at the start; `nominal`: by name."""
    parameters = (c_double * max(told["numbers"], 1))(*values)
    memory = (c_double * max(told["memory"], 1))()
    if nominal is not None and hasattr(library, "cranectl_prepare"):
        given = CNominal()
        for name, value in nominal.items():
            if isinstance(value, list):
                getattr(given, name)[:] = value
            else:
                setattr(given, name, value)
        library.cranectl_prepare.restype = c_int64
        library.cranectl_prepare.argtypes = [POINTER(CNominal), Doubles, Doubles]
        if (code := library.cranectl_prepare(given, parameters, memory)) != 0:
            raise ValueError(f"cranectl_prepare returns {code}: it cannot be prepared for this crane")
    return {"parameters": list(parameters), "memory": list(memory)}


def check(library: ctypes.CDLL, told: Plain, start: Plain) -> None:
    """Raise ValueError where a step writes what it must not, or remembers anything outside of its memory."""
    step, width = step_of(library), 15 * (1 + told["preview"])
    dice = random.Random(1)
    measured = [[0.9, 0.1, 0.7, 0.1, 0.8, 0.1, 0.1, 0.1, 0.1, 0.1, 0.0, 0.0] for _ in range(TRIAL_STEPS)]
    for row in measured:
        row[:] = [value * dice.uniform(0.8, 1.2) for value in row]
    rows = [(c_double * len(row))(*row) for row in measured]
    path = (c_double * width)(*(dice.uniform(0.4, 0.6) for _ in range(width)))
    parameters = (c_double * len(start["parameters"]))(*start["parameters"])

    def run(order: list[int]) -> list[list[list[float | str]]]:
        """Steps of two laws in `order`, with the commands of each."""
        memories = [(c_double * len(start["memory"]))(*start["memory"]) for _ in range(2)]
        done = [0, 0]
        commands: list[list[list[float | str]]] = [[], []]
        for which in order:
            inputs = (parameters, rows[(done[which] + 7 * which) % TRIAL_STEPS], path)
            before, command = [bytes(values) for values in inputs], (c_double * 3)()
            step(*inputs, memories[which], command)
            for values, name in zip(inputs, ("parameters", "measured", "reference"), strict=True):
                if bytes(values) != before.pop(0):
                    raise ValueError(f"its step writes to {name}")
            done[which] += 1
            commands[which].append(bits(command))
        return commands

    alone, in_turn = run([0] * TRIAL_STEPS + [1] * TRIAL_STEPS), run([0, 1] * TRIAL_STEPS)
    if alone != in_turn:
        raise ValueError(
            "it remembers something outside of its memory, which two cranes would share; "
            "for generated code with global states 'cranectl new generated-controller NAME' writes a wrapper"
        )


def bits(values: Iterable[float]) -> list[float | str]:
    """Comparable, NaN too."""
    return ["nan" if math.isnan(value) else value for value in values]


def main() -> None:
    """Answer the question on standard input."""
    answering = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what the library prints is no answer
    asked = json.loads(sys.stdin.readline())
    try:
        library = load(sys.argv[1])
        told = declaration(library)
        answer = dict(told)
        if asked["values"] is None:
            check(library, told, prepare(library, told, [p[1] for p in told["parameters"]], None))
        else:
            answer |= {"start": prepare(library, told, asked["values"], asked["nominal"])}
    except (OSError, ValueError) as error:
        answer = {"error": str(error)}
    answering.write(json.dumps(answer))
    answering.close()


if __name__ == "__main__":
    main()
