"""Load controllers from shared libraries with the interface of `cranectl.h`, in C or other languages.

This process never loads a library itself. A separate process reads the declaration and prepares the
controller. The child process of a run then calls the step of the library by its address.
"""

import ctypes
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.controllers.controller import Controller, Logged, Nominal, Parameter, called_by_address
from cranectl.loaders import library
from cranectl.loaders.asking import ask
from cranectl.loaders.opening import ControllerFile, copy_of
from cranectl.signals import Signal
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

HEADER = Path(__file__).parent / "cranectl.h"
DECLARED = ("name", "title", "command", "follows", "measures", "every", "preview", "period")


def open_library(file: ControllerFile) -> tuple[Controller, ControllerFile]:
    """Return the controller of a library; raise InputError if it does not do what it declares."""
    declared = _ask(file, None, None)

    def prepare(nominal: Nominal) -> tuple[Array, Array]:
        values = [float(value) for value in nominal.parameters.values()]
        start = _ask(file, values, _plain(nominal, declared["reads"]))["start"]
        return np.array(start["parameters"]), np.array(start["memory"])

    searched = [
        parameter | {"search": parameter["search"] and tuple(parameter["search"])}
        for parameter in declared["parameters"]
    ]
    controller = Controller(
        **{key: declared[key] for key in DECLARED},
        step=called_by_address,
        prepare=prepare,
        reads=None if declared["reads"] is None else tuple(declared["reads"]),
        parameters=tuple(Parameter(**parameter) for parameter in searched),
        logged=tuple(Logged(place, Signal(texts[0], *texts)) for place, *texts in declared["signals"]),
        entry=lambda *_: _address(file),
    )
    return controller, file


def _plain(nominal: Nominal, reads: list[str] | None) -> dict[str, Any]:
    """Return the nominal crane for `cranectl_prepare`, with NaN in fields that `reads` leaves out."""
    known = {name: np.asarray(getattr(nominal.rig, name)) for name in library.OF_RIG}
    for name in known.keys() - (known if reads is None else reads):
        known[name] = known[name] * np.nan
    return {
        **{name: value.tolist() for name, value in known.items()},
        "period": nominal.period,
        "state": nominal.state.tolist(),
        "reference": nominal.reference[0].tolist(),
    }


def _ask(file: ControllerFile, values: list[float] | None, nominal: dict[str, Any] | None) -> dict[str, Any]:
    """Return the library's declaration, read in a separate process; raise InputError for errors."""
    try:
        return ask(library.__file__, copy_of(file), {"values": values, "nominal": nominal})
    except ValueError as error:
        raise InputError(
            f"{file.reference}: {error}".replace(str(copy_of(file)), str(file.path)),
            allowed=f"a library for this machine with the interface of {HEADER}",
            remedy="correct it; 'cranectl new c-controller' writes one that works",
        ) from None


@cache
def _address(file: ControllerFile) -> int:
    step = library.step_of(ctypes.CDLL(str(copy_of(file))))
    return ctypes.cast(step, ctypes.c_void_p).value or 0
