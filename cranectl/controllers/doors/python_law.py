"""The door for Python: a function, a class or a `Controller` of a file.

What Numba compiles costs as much as a law of ours. What it does not is called back from the compiled loop,
which holds the interpreter's lock and takes microseconds: it is told once, and why.
"""

import inspect
import linecache
import multiprocessing
import sys
import traceback
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from cranectl.controllers.controller import Controller, Logged, Nominal, Parameter
from cranectl.controllers.doors.called_back import called_back
from cranectl.controllers.doors.law_file import LawFile, copy_of, slug
from cranectl.signals import Signal
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from cranectl.support.jit import address_of, why_not_compiled

ARGUMENTS = ("parameters", "measured", "reference", "memory", "command")
MEMORY = 64  # numbers that a plain function may remember
DECLARED = ("command", "follows", "measures", "every", "preview")


def open_python(file: LawFile) -> Controller:
    """The law `file.symbol` of a file; raises InputError where there is none, or it is no law."""
    module = _load(file)
    if not file.symbol:
        raise InputError(
            f"'{file.reference}' does not say which law",
            allowed=", ".join(f"{file.path}:{name}" for name in _laws(module)) or "a file with a law",
            remedy=f"name it: {file.path}:NAME",
        )
    found = getattr(module, file.symbol, None)
    if isinstance(found, Controller):
        return _callable(found, file)
    if inspect.isclass(found) and callable(getattr(found, "step", None)):
        return _callable(_of_class(found, file), file)
    if inspect.isfunction(found):
        name = slug(file.symbol)
        law = Controller(name, _title(found, name), _checked(found, file), _nothing)
        return _callable(law, file)
    raise InputError(
        f"'{file.reference}': {file.path} has no law '{file.symbol}'",
        allowed=", ".join(_laws(module)) or "a function, a class with a step, a cranectl.Controller",
        remedy=f"define step({', '.join(ARGUMENTS)}), see 'cranectl new controller'",
    )


def _load(file: LawFile) -> ModuleType:
    """The module, run; of a worker on another machine from a copy."""
    path = file.path.absolute()
    if not path.is_file() or path.read_bytes() != file.content:
        path = copy_of(file)
    module = ModuleType(f"_law_{file.digest[:16]}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module
    linecache.checkcache(str(path))
    sys.path.insert(0, str(path.parent))  # as of any script
    try:
        exec(compile(file.content, str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[module.__name__]
        raise InputError(
            f"{_where(error, path)}: {type(error).__name__}: {error}",
            allowed="a file that Python can run",
            remedy="correct it",
        ) from error
    finally:
        sys.path.remove(str(path.parent))
    return module


def _where(error: BaseException, path: Path) -> str:
    if isinstance(error, SyntaxError):
        return f"{path.name}:{error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(path)]
    return f"{path.name}:{lines[-1]}" if lines else path.name


def _laws(module: ModuleType) -> list[str]:
    """What of a file looks like a law."""
    return [
        name
        for name, value in vars(module).items()
        if isinstance(value, Controller)
        or (getattr(value, "__module__", "") == module.__name__ and callable(getattr(value, "step", None)))
        or (inspect.isfunction(value) and len(inspect.signature(value).parameters) == len(ARGUMENTS))
    ]


def _title(found: Any, name: str) -> str:
    return (inspect.getdoc(found) or name).splitlines()[0].rstrip(".")


def _checked(step: Any, file: LawFile) -> Callable[..., int]:
    taken = list(inspect.signature(step).parameters)
    if not inspect.isfunction(step) or len(taken) != len(ARGUMENTS):
        raise InputError(
            f"the step of '{file.reference}' takes {', '.join(taken) or 'nothing'}",
            allowed=", ".join(ARGUMENTS),
            remedy="give it these five; a method of a class is a @staticmethod",
        )
    return step


def _nothing(_: Nominal) -> tuple[Array, Array]:
    return np.zeros(1), np.zeros(MEMORY)


def _of_class(found: Any, file: LawFile) -> Controller:
    """From its attributes, called as those of a `Controller`, with their defaults.

    Besides, `parameters` may be {name: number} and `logged` {name: place of the memory}; `memory` is where it
    starts, or how many zeros. Without a `prepare` the step gets the parameters' numbers in their order.
    """
    name = getattr(found, "name", slug(file.symbol))
    start = getattr(found, "memory", MEMORY)
    parameters = getattr(found, "parameters", {})
    if isinstance(parameters, Mapping):
        parameters = tuple(Parameter(key, float(value), "", "") for key, value in parameters.items())
    logged = getattr(found, "logged", {})
    if isinstance(logged, Mapping):
        logged = tuple(Logged(int(place), Signal(key, key, "", "")) for key, place in logged.items())
    memory = np.zeros(start) if isinstance(start, int) else np.array(start, dtype=float)

    def prepare(nominal: Nominal) -> tuple[Array, Array]:
        return np.array([float(value) for value in nominal.parameters.values()]), memory.copy()

    return Controller(
        name=name,
        title=_title(found, name),
        step=_checked(found.step, file),
        prepare=getattr(found, "prepare", prepare),
        parameters=tuple(parameters),
        logged=tuple(logged),
        **{key: getattr(found, key) for key in DECLARED if hasattr(found, key)},
    )


def _callable(law: Controller, file: LawFile) -> Controller:
    """`law` if Numba compiles it, else called back, which is told."""
    try:
        address_of(law.step)
    except Exception as error:  # of many classes, some of no family
        said, where = why_not_compiled(law.step, error)
        if multiprocessing.parent_process() is None:  # workers would say it once more
            print(
                f"cranectl: {file.reference} is called back from the compiled loop, some microseconds a "
                f"sample: Numba cannot compile it: {where}: {said}",
                file=sys.stderr,
            )
        return replace(law, entry=lambda sizes, _: called_back(law.step, file.reference, sizes))
    return law
