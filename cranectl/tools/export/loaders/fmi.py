"""Call the C functions of an FMU for co-simulation, FMI 2.0 or 3.0, with `ctypes` alone.

`declaration_process` runs this file in a separate process, so it imports nothing of the package.
"""

import ctypes
import os
import sys
from collections import deque
from collections.abc import Iterable
from ctypes import CFUNCTYPE, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

Plain = dict[str, Any]  # data for JSON: fmi, name, token, resources, references, values
Functions = dict[str, Any]  # by name without fmi2 or fmi3; SetReal and SetFloat64 are Set, likewise Get

STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
ERROR, FATAL = 3, 4
# All others return a status.
_RESULTS = {"Instantiate": c_void_p, "InstantiateCoSimulation": c_void_p, "FreeInstance": None}
_ARGUMENTS: dict[int, dict[str, list[Any]]] = {
    2: {
        "Instantiate": [c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int],
        "SetupExperiment": [c_void_p, c_int, c_double, c_double, c_int, c_double],
        "EnterInitializationMode": [c_void_p],
        "ExitInitializationMode": [c_void_p],
        "DoStep": [c_void_p, c_double, c_double, c_int],
        "SetReal": [c_void_p, c_void_p, c_size_t, c_void_p],
        "GetReal": [c_void_p, c_void_p, c_size_t, c_void_p],
        "FreeInstance": [c_void_p],
    },
    3: {
        "InstantiateCoSimulation": [*[c_char_p] * 3, *[c_bool] * 4, c_void_p, c_size_t, *[c_void_p] * 3],
        "EnterInitializationMode": [c_void_p, c_bool, c_double, c_double, c_bool, c_double],
        "ExitInitializationMode": [c_void_p],
        "DoStep": [c_void_p, c_double, c_double, c_bool, *[c_void_p] * 4],
        "SetFloat64": [c_void_p, c_void_p, c_size_t, c_void_p, c_size_t],
        "GetFloat64": [c_void_p, c_void_p, c_size_t, c_void_p, c_size_t],
        "FreeInstance": [c_void_p],
    },
}


def functions(path: str, fmi: int) -> Functions:
    """Return the FMI functions of a binary; raise OSError or ValueError if one is missing."""
    binary, known = ctypes.CDLL(path), {}
    for name, arguments in _ARGUMENTS[fmi].items():
        try:
            function = getattr(binary, f"fmi{fmi}{name}")
        except AttributeError:
            raise ValueError(f"its binary has no function fmi{fmi}{name}") from None
        function.restype, function.argtypes = _RESULTS.get(name, c_int), arguments
        known[name.removesuffix("Real").removesuffix("Float64")] = function
    return known


def initialised(known: Functions, model: Plain, values: Iterable[float]) -> int:
    """Return a new instance in initialisation mode at time 0; raise ValueError if a function fails."""
    fmi, name, token = model["fmi"], model["name"].encode(), model["token"].encode()
    resources = Path(model["resources"])
    if fmi == 2:
        uri = resources.as_uri().encode()
        instance = known["Instantiate"](name, 1, token, uri, ctypes.addressof(_callbacks()), 0, 0)
    else:
        directory = os.path.join(resources, "").encode()  # noqa: PTH118 - with a separator at its end
        flags = (False,) * 4  # visible, logging on, event mode, early return
        instance = known["InstantiateCoSimulation"](
            name, token, directory, *flags, None, 0, None, address(_logger(3)), None
        )
    if not instance:
        raise ValueError(f"its fmi{fmi}Instantiate gives no instance{_because()}")
    numbers = (c_double * len(model["references"]))(*values)
    references = (c_uint32 * len(numbers))(*model["references"])
    if len(numbers):
        more = (len(numbers),) if fmi == 3 else ()
        _check(fmi, "Set", known["Set"](instance, references, len(numbers), numbers, *more))
    # No tolerance, start at 0, no end: for SetupExperiment of FMI 2, or EnterInitializationMode of FMI 3.
    start = (instance, 0, 0.0, 0.0, 0, 0.0)
    if fmi == 2:
        _check(fmi, "SetupExperiment", known["SetupExperiment"](*start))
        start = start[:1]  # type: ignore[assignment]
    _check(fmi, "EnterInitializationMode", known["EnterInitializationMode"](*start))
    return int(instance)


def _check(fmi: int, name: str, status: int) -> None:
    if not 0 <= status < STATUS.index("Discard"):
        raise ValueError(f"its {failure(fmi, name, status)}")


def failure(fmi: int, name: str, status: int) -> str:
    """Return a text that says which function returned which status, with the FMU's own message."""
    exact = name + {2: "Real", 3: "Float64"}[fmi] if name in ("Set", "Get") else name
    outcome = f"fmi{fmi}{STATUS[status]}" if 0 <= status < len(STATUS) else f"{status}, which is no status"
    return f"fmi{fmi}{exact} returns {outcome}{_because()}"


_said: deque[str] = deque(maxlen=1)  # the newest error message of an FMU


def _because() -> str:
    return f": {_said[-1]}" if _said else ""


@cache
def say(text: str) -> None:
    """Write a line to standard error, directly: a forked process must not wait for the lock of sys.stderr."""
    os.write(2, f"cranectl: {text}\n".encode())


@cache
def _logger(fmi: int) -> Any:
    """Return the callback that records error messages of the FMU."""

    def log(*arguments: Any) -> None:
        status, _, message = arguments[-3:]
        if status >= ERROR and message is not None:
            text = message.decode("utf-8", "replace")
            _said.append("".join(c if c.isprintable() else " " for c in text.strip()))

    names = (c_char_p,) if fmi == 2 else ()
    return CFUNCTYPE(None, c_void_p, *names, c_int, c_char_p, c_char_p)(log)


@cache
def _callbacks() -> ctypes.Array[c_void_p]:
    """Return a fmi2CallbackFunctions structure: logger, allocate, free, finished, environment."""
    libc = ctypes.CDLL("msvcrt" if sys.platform == "win32" else None)
    return (c_void_p * 5)(address(_logger(2)), address(libc.calloc), address(libc.free), None, None)


def address(function: Any) -> int:
    """Return the address of a C function."""
    return ctypes.cast(function, c_void_p).value or 0


def answer(binary: str, model: Plain) -> Plain:
    """Make and free an instance of `model` as a test; raise OSError or ValueError if that fails."""
    known = functions(binary, model["fmi"])
    known["FreeInstance"](initialised(known, model, model["values"]))
    return {}
