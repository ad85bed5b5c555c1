"""Load libraries with the interface of `cranectl.h`, from C or whatever makes such functions.

This process never loads one: a program of its own tells what it declares and prepares it, and the child in
which a run goes calls its step by address.
"""

import ctypes
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.controllers.controller import Controller, Logged, Nominal, Parameter, by_address
from cranectl.loaders import library
from cranectl.loaders.asking import answer
from cranectl.loaders.law_file import LawFile, copy_of
from cranectl.signals import Signal
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

HEADER = Path(__file__).parent / "cranectl.h"


def open_library(file: LawFile) -> Controller:
    """The law of a library; raises InputError where it is none, or does not keep to what it declares."""
    told = _ask(file, None, None)

    def prepare(nominal: Nominal) -> tuple[Array, Array]:
        values = [float(value) for value in nominal.parameters.values()]
        start = _ask(file, values, _plain(nominal, told["reads"]))["start"]
        return np.array(start["parameters"]), np.array(start["memory"])

    return Controller(
        name=told["name"],
        title=told["title"],
        step=by_address,
        prepare=prepare,
        command=("acceleration", "velocity", "force")[told["command"]],
        follows=("path", "set-point")[told["follows"]],
        measures=("state", "encoders")[told["measures"]],
        every=told["every"],
        preview=told["preview"],
        reads=None if told["reads"] is None else tuple(told["reads"]),
        parameters=tuple(_parameter(*declared) for declared in told["parameters"]),
        logged=tuple(
            Logged(place, Signal(name, name, unit, description))
            for place, name, unit, description in told["signals"]
        ),
        entry=lambda *_: _address(file),
    )


def _parameter(*told: Any) -> Parameter:
    *declared, low, high, length_power = told
    search = (low, high) if high else None
    return replace(Parameter(*declared), search=search, length_power=length_power)


def _plain(nominal: Nominal, reads: list[str] | None) -> dict[str, Any]:
    """Return the nominal crane for `cranectl_prepare`, with NaN for what it does not declare to read."""
    known = {name: np.asarray(getattr(nominal.rig, name)) for name in library.OF_RIG}
    for name in known.keys() - (known if reads is None else reads):
        known[name] = known[name] * np.nan
    return {
        **{name: value.tolist() for name, value in known.items()},
        "period": nominal.period,
        "state": nominal.state.tolist(),
        "reference": nominal.reference[0].tolist(),
    }


def _ask(file: LawFile, values: list[float] | None, nominal: dict[str, Any] | None) -> dict[str, Any]:
    """What the library says, in a program of its own; raises InputError with what is wrong with it."""
    try:
        return answer(library.__file__, copy_of(file), {"values": values, "nominal": nominal})
    except ValueError as error:
        raise _wrong(file, str(error).replace(str(copy_of(file)), str(file.path))) from None


def _wrong(file: LawFile, what: str) -> InputError:
    return InputError(
        f"{file.reference}: {what}",
        allowed=f"a library for this machine with the interface of {HEADER}",
        remedy="correct it; 'cranectl new c-controller' writes one that works",
    )


@cache
def _address(file: LawFile) -> int:
    step = library.step_of(library.load(str(copy_of(file))))
    address = ctypes.cast(step, ctypes.c_void_p).value
    assert address is not None
    return address
