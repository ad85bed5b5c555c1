"""The C functions of an FMU for co-simulation, FMI 2.0 and 3.0, by way of `ctypes` alone.

Run as a program of its own, `python fmi.py BINARY`, so that whatever the FMU does ends that program only: it
reads the model as a line of JSON, initialises an instance and answers with a line.
"""

import ctypes
import json
import os
import sys
from collections import deque
from collections.abc import Iterable
from ctypes import CFUNCTYPE, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

Plain = dict[str, Any]  # data that JSON knows: fmi, name, token, resources, references, values
Functions = dict[str, Any]  # by their names without fmi2 and fmi3, a set and a get as Set and Get

STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
ERROR, FATAL = 3, 4
_EXCHANGE = {2: [c_void_p, c_void_p, c_size_t, c_void_p]}
_EXCHANGE[3] = [*_EXCHANGE[2], c_size_t]
_BOOL = {2: c_int, 3: c_bool}
_START = {fmi: [c_void_p, bool_, c_double, c_double, bool_, c_double] for fmi, bool_ in _BOOL.items()}
_COMMON = {"ExitInitializationMode": (c_int, [c_void_p]), "FreeInstance": (None, [c_void_p])}
_SIGNATURES: dict[int, dict[str, tuple[Any, list[Any]]]] = {
    2: {
        "Instantiate": (c_void_p, [c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int]),
        "SetupExperiment": (c_int, _START[2]),
        "EnterInitializationMode": (c_int, [c_void_p]),
        "DoStep": (c_int, [c_void_p, c_double, c_double, c_int]),
        "SetReal": (c_int, _EXCHANGE[2]),
        "GetReal": (c_int, _EXCHANGE[2]),
        **_COMMON,
    },
    3: {
        "InstantiateCoSimulation": (
            c_void_p,
            [*[c_char_p] * 3, *[c_bool] * 4, c_void_p, c_size_t, *[c_void_p] * 3],
        ),
        "EnterInitializationMode": (c_int, _START[3]),
        "DoStep": (c_int, [c_void_p, c_double, c_double, c_bool, *[c_void_p] * 4]),
        "SetFloat64": (c_int, _EXCHANGE[3]),
        "GetFloat64": (c_int, _EXCHANGE[3]),
        **_COMMON,
    },
}


class Callbacks(ctypes.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = tuple((name, c_void_p) for name in ("logger", "allocate", "free", "finished", "environment"))


def functions(path: str, fmi: int) -> Functions:
    """Those of a binary; raises OSError or ValueError where there are none."""
    binary, found = ctypes.CDLL(path), {}
    for name, (result, arguments) in _SIGNATURES[fmi].items():
        try:
            function = getattr(binary, f"fmi{fmi}{name}")
        except AttributeError:
            raise ValueError(f"its binary has no function fmi{fmi}{name}") from None
        function.restype, function.argtypes = result, arguments
        found[name.removesuffix("Real").removesuffix("Float64")] = function
    return found


def initialised(known: Functions, model: Plain, values: Iterable[float]) -> int:
    """A new instance in initialisation mode, at time 0, with `values` of the parameters.

    Raises ValueError that tells which function fails.
    """
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
    """Which function has returned what, and what the FMU says of it."""
    exact = name + {2: "Real", 3: "Float64"}[fmi] if name in ("Set", "Get") else name
    told = f"fmi{fmi}{STATUS[status]}" if 0 <= status < len(STATUS) else f"{status}, which is no status"
    return f"fmi{fmi}{exact} returns {told}{_because()}"


_said: deque[str] = deque(maxlen=1)  # by an FMU, of errors


def _because() -> str:
    return f": {_said[-1]}" if _said else ""


@cache
def say(text: str) -> None:
    """On standard error, once; a forked process may not wait for the lock of sys.stderr."""
    os.write(2, f"cranectl: {text}\n".encode())


@cache
def _logger(fmi: int) -> Any:
    """Called by the FMU; what FMI 2 would complete the message with is not looked at."""

    def log(*given: Any) -> None:
        status, _, message = given[-3:]
        if status >= ERROR and message is not None:
            text = message.decode("utf-8", "replace")
            _said.append("".join(c if c.isprintable() else " " for c in text.strip()))

    names = (c_char_p,) if fmi == 2 else ()
    return CFUNCTYPE(None, c_void_p, *names, c_int, c_char_p, c_char_p)(log)


@cache
def _callbacks() -> Callbacks:
    libc = ctypes.CDLL("msvcrt" if sys.platform == "win32" else None)
    return Callbacks(address(_logger(2)), address(libc.calloc), address(libc.free), None, None)


def address(function: Any) -> int:
    """Of a C function."""
    found = ctypes.cast(function, c_void_p).value
    assert found is not None
    return found


def main() -> None:
    """Answer the question on standard input."""
    answering = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what the library prints is no answer
    model = json.loads(sys.stdin.readline())
    answer = {}
    try:
        known = functions(sys.argv[1], model["fmi"])
        known["FreeInstance"](initialised(known, model, model["values"]))
    except (OSError, ValueError) as error:
        answer = {"error": str(error)}
    answering.write(json.dumps(answer))
    answering.close()


if __name__ == "__main__":
    main()
