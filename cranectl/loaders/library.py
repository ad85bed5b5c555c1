"""Read, check and prepare the controller in a shared library, with `ctypes` alone.

`declaration_process` runs this file in a separate process, so it imports nothing of the package.
"""

import ctypes
import math
import random
from ctypes import POINTER, Structure, c_char_p, c_double, c_int32, c_int64, c_uint32
from typing import Any

TRIAL_STEPS = 500  # steps with two memories in turn, to detect state kept elsewhere
Doubles = POINTER(c_double)
Plain = dict[str, Any]  # data that JSON can represent


class CParameter(Structure):
    """cranectl_parameter."""

    _fields_ = (
        *((name, c_char_p) for name in ("name", "unit", "description")),
        *((name, c_double) for name in ("initial", "lowest", "highest")),
        ("search", c_double * 2),
        ("length_power", c_double),
    )


class CSignal(Structure):
    """cranectl_signal."""

    _fields_ = (*((name, c_char_p) for name in ("name", "unit", "description")), ("place", c_int64))


ABI = 5  # version of the interface
CHOICES = {
    "command": ("acceleration", "velocity", "force"),
    "follows": ("path", "set-point"),
    "measures": ("state", "encoders"),
}
MAX_DECLARED = dict.fromkeys(("preview", "memory", "numbers", "every"), 10**6)  # limits of declared numbers
MAX_DECLARED |= {"parameter_count": 10**4, "signal_count": 10**4}
MAX_DECLARED |= {name: len(choices) - 1 for name, choices in CHOICES.items()}


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
        ("reads", c_char_p),
        ("period", c_double),
    )


NUMBERS = ("gravity", "bridge_mass", "trolley_mass", "winch_mass", "load_mass", "trolley_motor_mass")
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


def symbol(library: ctypes.CDLL, name: str) -> Any:
    """Return a function of the library; raise ValueError if it has none of this name."""
    try:
        return getattr(library, name)
    except AttributeError:
        raise ValueError(f"it has no function {name}") from None


def step_of(library: ctypes.CDLL) -> Any:
    """Return the step function of the library."""
    step = symbol(library, "cranectl_step")
    step.restype, step.argtypes = c_int64, [Doubles] * 5
    return step


def declaration(library: ctypes.CDLL) -> Plain:
    """Return the declaration of the library as plain data; raise ValueError for invalid values."""
    tell = symbol(library, "cranectl_controller")
    tell.restype = POINTER(CDeclaration)
    step_of(library)
    pointer = tell()
    if not pointer:
        raise ValueError("cranectl_controller returns no declaration")
    declared = pointer.contents
    if declared.abi != ABI:
        raise ValueError(f"it was built for version {declared.abi} of the interface, this is {ABI}")
    if declared.size != (size := ctypes.sizeof(CDeclaration)):
        raise ValueError(f"its declaration has {declared.size} bytes, it should have {size}")
    plain: Plain = {name: getattr(declared, name) for name in MAX_DECLARED}
    for name, value in plain.items():
        lowest, highest = int(name == "every"), MAX_DECLARED[name]
        if not lowest <= value <= highest:
            raise ValueError(f"{name} = {value}, allowed is {lowest} to {highest}")
    plain |= {name: choices[plain[name]] for name, choices in CHOICES.items()}
    return plain | {
        "name": text(declared.name),
        "title": text(declared.title),
        "numbers": max(declared.numbers, declared.parameter_count),
        "parameters": [parameter(item) for item in declared.parameters[: declared.parameter_count]],
        "reads": read_fields(library, declared),
        "period": declared.period or None,
        "signals": [
            [signal.place, text(signal.name), text(signal.unit), text(signal.description)]
            for signal in declared.signals[: declared.signal_count]
        ],
    }


def read_fields(library: ctypes.CDLL, declared: Any) -> list[str] | None:
    """Return the rig fields that the library declares to read, or None if it does not say."""
    if not hasattr(library, "cranectl_prepare"):
        return []
    names = None if declared.reads is None else text(declared.reads).split()
    for name in names or ():
        if name not in OF_RIG:
            raise ValueError(f"reads names '{name}', allowed is {', '.join(OF_RIG)}")
    return names


def parameter(declared: Any) -> Plain:
    """Return a parameter in the form of `Parameter`; raise ValueError for an invalid search range."""
    low, high = declared.search
    search = None if low == high == 0.0 else (low, high)
    if search and not 0.0 < low < high < math.inf:
        name = text(declared.name)
        raise ValueError(f"search of {name} from {low:g} to {high:g}, allowed is 0 < low < high, or 0 to 0")
    return {
        "name": text(declared.name),
        "default": declared.initial,
        "unit": text(declared.unit),
        "description": text(declared.description),
        "lowest": declared.lowest,
        "highest": declared.highest,
        "search": search,
        "length_power": declared.length_power,
    }


def text(raw: bytes | None) -> str:
    """Return a C string as text."""
    return (raw or b"").decode("utf-8", "replace")


def prepare(library: ctypes.CDLL, declared: Plain, values: list[float], nominal: Plain | None) -> Plain:
    """Return parameters and memory at the start; `nominal` has the fields of `CNominal` by name."""
    parameters = (c_double * max(declared["numbers"], 1))(*values)
    memory = (c_double * max(declared["memory"], 1))()
    if nominal is not None and hasattr(library, "cranectl_prepare"):
        nominal_struct = CNominal(**{k: tuple(v) if isinstance(v, list) else v for k, v in nominal.items()})
        library.cranectl_prepare.restype = c_int64
        library.cranectl_prepare.argtypes = [POINTER(CNominal), Doubles, Doubles]
        if (code := library.cranectl_prepare(nominal_struct, parameters, memory)) != 0:
            raise ValueError(f"cranectl_prepare returns {code}: it cannot be prepared for this crane")
    return {"parameters": list(parameters), "memory": list(memory)}


def check(library: ctypes.CDLL, declared: Plain, start: Plain) -> None:
    """Raise ValueError if a step writes to its inputs, or keeps state outside its memory."""
    step, width = step_of(library), 15 * (1 + declared["preview"])
    dice, near = random.Random(1), (0.9, 0.1, 0.7, 0.1, 0.8, *[0.1] * 5, 0.0, 0.0)
    rows = [[value * dice.uniform(0.8, 1.2) for value in near] for _ in range(TRIAL_STEPS)]
    measured = [(c_double * len(row))(*row) for row in rows]
    path = (c_double * width)(*(dice.uniform(0.4, 0.6) for _ in range(width)))
    parameters = (c_double * len(start["parameters"]))(*start["parameters"])

    def run(order: list[int]) -> list[list[bytes]]:
        """Return the commands of two controllers that are stepped in `order`."""
        memories = [(c_double * len(start["memory"]))(*start["memory"]) for _ in range(2)]
        commands: list[list[bytes]] = [[], []]
        for which in order:
            row = (len(commands[which]) + 7 * which) % TRIAL_STEPS  # the two measure different rows
            inputs = {"parameters": parameters, "measured": measured[row], "reference": path}
            before, command = [bytes(values) for values in inputs.values()], (c_double * 3)()
            step(*inputs.values(), memories[which], command)
            for (name, values), known in zip(inputs.items(), before, strict=True):
                if bytes(values) != known:
                    raise ValueError(f"its step writes to {name}")
            commands[which].append(bytes(command))
        return commands

    alone, in_turn = run([0] * TRIAL_STEPS + [1] * TRIAL_STEPS), run([0, 1] * TRIAL_STEPS)
    if alone != in_turn:
        raise ValueError(
            "it remembers something outside of its memory, which two cranes would share; "
            "for generated code with global states 'cranectl new generated-controller NAME' writes a wrapper"
        )


def answer(path: str, question: Plain) -> Plain:
    """Return the declaration, and for values also the start of a run; raise OSError or ValueError."""
    library = ctypes.CDLL(path)
    declared = declaration(library)
    if question["values"] is not None:
        return declared | {"start": prepare(library, declared, question["values"], question["nominal"])}
    check(
        library,
        declared,
        prepare(library, declared, [item["default"] for item in declared["parameters"]], None),
    )
    return declared
