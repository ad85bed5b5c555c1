"""Load controllers in Python: a function, a class or a `Controller` of a file.

A step that Numba can compile runs as fast as a built-in controller. The compiled loop calls any other step
through the Python interpreter. That holds the interpreter's lock and takes microseconds. A warning says so
once, with the reason.
"""

import inspect
import linecache
import multiprocessing
import sys
import traceback
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from cranectl.controllers import Controller, Logged, Nominal, Parameter, Slots, real_numbers
from cranectl.loaders.folder_imports import FolderImports
from cranectl.loaders.interpreted_step import callback_address
from cranectl.loaders.opening import ControllerFile, complete_copy_of, slug
from cranectl.signals import Signal
from cranectl.support import Array, CompiledStep, ForeignCode, InputError, reported_when_slow

ARGUMENTS = ("parameters", "measured", "reference", "memory", "command")
MEMORY = 64  # numbers that a plain function may remember
DECLARED = ("command", "follows", "measures", "every", "preview", "reads", "period")


def open_python(file: ControllerFile) -> tuple[Controller, ControllerFile]:
    """Return the controller `file.symbol` of a file, and the file with all files that it uses.

    Raises InputError if there is no such name, or if it is no controller.
    """
    module, opened = _load(file)
    if not file.symbol:
        raise InputError(
            f"'{file.reference}' does not say which controller",
            allowed=", ".join(f"{file.path}:{name}" for name in _controller_names(module))
            or "a file with a controller",
            remedy=f"name it: {file.path}:NAME",
        )
    value = getattr(module, file.symbol, None)
    step = value if inspect.isfunction(value) else getattr(value, "step", None)
    if inspect.isfunction(value) or (inspect.isclass(value) and callable(step)):
        value = _declared(value, step, file)
    if not isinstance(value, Controller):
        raise InputError(
            f"'{file.reference}': {file.path} has no controller '{file.symbol}'",
            allowed=", ".join(_controller_names(module))
            or "a function, a class with a step, a cranectl.Controller",
            remedy=InputError.did_you_mean(file.symbol, _controller_names(module))
            or f"define step({', '.join(ARGUMENTS)}), see 'cranectl new controller NAME'",
        )
    return _callable(value, file), opened


def _load(file: ControllerFile) -> tuple[ModuleType, ControllerFile]:
    """Run the file and return its module; a worker on another machine runs a copy."""
    path = complete_copy_of(file)
    imports = FolderImports(path)
    module = ModuleType(f"{imports.package}.{path.stem}")
    module.__file__ = str(path)
    module.__package__ = ""  # as for any script
    module.__dict__["__builtins__"] = imports.names
    sys.modules[module.__name__] = module
    linecache.checkcache(str(path))  # or tracebacks would show the lines of an earlier version
    try:
        with ForeignCode.contained(f"{file.reference} has been loading"), imports.running():
            exec(compile(file.content, str(path), "exec"), module.__dict__)
        return module, file.with_companions(imports.folder, imports.files_read(path))
    except (InputError, KeyboardInterrupt):  # about a wrong declaration
        raise
    except BaseException as error:
        raise InputError(
            f"{_where(error, path)}: {InputError.describe(error)}".replace(f"{imports.package}.", ""),
            allowed="a file that Python can run",
            remedy="correct it",
        ) from error


def _where(error: BaseException, path: Path) -> str:
    if isinstance(error, SyntaxError):
        return f"{Path(error.filename or path).name}:{error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(path)]
    return f"{path.name}:{lines[-1]}" if lines else path.name


def _controller_names(module: ModuleType) -> list[str]:
    """Return the names in a module that look like controllers."""
    return [
        name
        for name, value in vars(module).items()
        if isinstance(value, Controller)
        or (getattr(value, "__module__", "") == module.__name__ and callable(getattr(value, "step", None)))
        or (inspect.isfunction(value) and len(inspect.signature(value).parameters) == len(ARGUMENTS))
    ]


def _checked(step: Any, file: ControllerFile) -> Any:
    taken = list(inspect.signature(step).parameters) if inspect.isfunction(step) else []
    if len(taken) != len(ARGUMENTS):
        raise InputError(
            f"the step of '{file.reference}' takes {', '.join(taken) or 'nothing'}",
            allowed=", ".join(ARGUMENTS),
            remedy="give it these five; a method of a class is a @staticmethod",
        )
    return step


def _declared(source: Any, step: Any, file: ControllerFile) -> Controller:
    """Return the controller of a class or function, whose attributes may have short forms."""
    name = getattr(source, "name", slug(file.symbol))
    parameters = getattr(source, "parameters", {})
    if isinstance(parameters, Mapping):
        parameters = tuple(
            Parameter(key, _number(name, key, value), "", "") for key, value in parameters.items()
        )
    logged = getattr(source, "logged", {})
    if isinstance(logged, Mapping):
        logged = tuple(Logged(index, Signal(key, key, "", "")) for key, index in logged.items())
    memory = _memory(name, getattr(source, "memory", MEMORY))

    def prepare(nominal: Nominal) -> tuple[Array, Array]:
        return np.array([*map(float, nominal.parameters.values())] or [0.0]), memory.copy()

    return Controller(
        name=name,
        title=(inspect.getdoc(source) or str(name)).partition("\n")[0].rstrip("."),
        step=_checked(step, file),
        prepare=getattr(source, "prepare", prepare),
        parameters=parameters,
        logged=logged,
        # Our own `prepare` reads nothing of the rig.
        **({} if hasattr(source, "prepare") else {"reads": ()})
        | {key: getattr(source, key) for key in DECLARED if hasattr(source, key)},
    )


def _number(owner: Any, key: Any, value: Any) -> float:
    """Return the default of a parameter; raise InputError if it is not a number."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            f"{owner}.parameters: {key} = {InputError.shown(value)}",
            allowed="a number",
            remedy="give the number that it has by default",
        ) from None


def _memory(owner: Any, start: Any) -> Array:
    """Return the memory at the start of a run; raise InputError if `start` does not describe one."""
    if isinstance(start, Slots):
        return start.array()
    if InputError.is_whole(start) and 0 <= int(start) <= Controller.MAX_MEMORY:
        return np.zeros(int(start))
    try:
        memory = real_numbers(start)
        if np.ndim(start) == 0:
            raise TypeError
    except (TypeError, ValueError, MemoryError):
        raise InputError(
            f"{owner}.memory = {InputError.shown(start)}",
            allowed=f"how many numbers it has, 0 to {Controller.MAX_MEMORY}, "
            "or a list of those that it starts with",
            remedy="give one of the two",
        ) from None
    return memory


def _callable(controller: Controller, file: ControllerFile) -> Controller:
    """Return the controller; if Numba cannot compile its step, warn and let Python run it."""
    try:
        with reported_when_slow(f"Numba has been compiling the step of {file.reference}"):
            CompiledStep.address_of(controller.step)
    except Exception as error:  # of many classes, some of no family
        said, where = CompiledStep.why_not(controller.step, error)
        if multiprocessing.parent_process() is None:  # workers would repeat the warning
            print(
                f"cranectl: {file.reference} is called back from the compiled loop, some microseconds a "
                f"sample: Numba cannot compile it: {where}: {said}",
                file=sys.stderr,
            )
        return replace(
            controller, entry=lambda sizes, _: callback_address(controller.step, file.reference, sizes)
        )
    return controller
