"""Load controllers from shared libraries with the interface of `cranectl.h`, in C or other languages.

This process never loads a library itself. A separate process reads the declaration and prepares the
controller. The child process of a run then calls the step of the library by its address.
"""

import ctypes
import shlex
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.controllers import Controller, Logged, Nominal, Parameter
from cranectl.loaders import library
from cranectl.loaders.declaration_process import ask_declaration
from cranectl.loaders.opening import ControllerFile, copy_of
from cranectl.signals import Signal
from cranectl.support import Array, InputError

HEADER = Path(__file__).parent / "cranectl.h"  # interface of controllers in C
COMPILERS = {".c": "cc", ".cc": "c++", ".cpp": "c++", ".cxx": "c++"}  # by ending of the source
# The last forbids to fuse a product and a sum, which rounds differently on some processors.
FLAGS = ("-O2", "-shared", "-fPIC", "-ffp-contract=off")
DECLARED = ("name", "title", "command", "follows", "measures", "every", "preview", "period")


def compile_command(source: Path) -> str:
    """Return the command that compiles a controller into a library beside its source, as it is typed."""
    folder = () if (source.parent / HEADER.name).is_file() else (f"-I{HEADER.parent}",)
    files = ("-o", str(source.with_suffix(".so")), str(source))
    return shlex.join([COMPILERS[source.suffix], *FLAGS, *folder, *files, "-lm"])


def check_compiled(path: Path) -> None:
    """Raise InputError if `path` is a file with the source of a controller, not with the library."""
    if path.suffix in COMPILERS and path.is_file():
        raise InputError(
            f"{path} is the source of a controller",
            allowed="the library that a compiler makes of it",
            remedy=f"compile it, and name {path.with_suffix('.so')}: {compile_command(path)}",
        )


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
        step=Controller.called_by_address,
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
        return ask_declaration(library.__file__, copy_of(file), {"values": values, "nominal": nominal})
    except ValueError as error:
        sources = [source for ending in COMPILERS if (source := file.path.with_suffix(ending)).is_file()]
        again = f" and compile it again: {compile_command(sources[0])}" if sources else ""
        raise InputError(
            # The process has read a copy, of which the user knows nothing.
            f"{file.reference}: {error}".replace(str(copy_of(file)), str(file.path)),
            allowed=f"a library for this machine with the interface of {HEADER}",
            remedy=f"correct it{again}; 'cranectl new c-controller NAME' writes one that works",
        ) from None


@cache
def _address(file: ControllerFile) -> int:
    step = library.step_of(ctypes.CDLL(str(copy_of(file))))
    return ctypes.cast(step, ctypes.c_void_p).value or 0
