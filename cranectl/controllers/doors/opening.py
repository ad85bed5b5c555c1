"""What is named on the command line becomes a controller of this process: `law.py:NAME`, `law.so`, `law.fmu`.

Code runs only because somebody named it there; never because a log or a scenario does. Worker processes get
the files by content, so that all run the same.
"""

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from cranectl.controllers.controller import Controller, Origin
from cranectl.controllers.doors.law_file import UDP, LawFile
from cranectl.controllers.registry import REGISTERED, register_controller
from cranectl.support.errors import InputError
from cranectl.support.extensions import loaded

DOORS = {  # by ending; imported only when asked for
    ".py": "cranectl.controllers.doors.python_law:open_python",
    ".so": "cranectl.controllers.doors.c_law:open_library",
    ".dylib": "cranectl.controllers.doors.c_law:open_library",
    ".dll": "cranectl.controllers.doors.c_law:open_library",
    ".fmu": "cranectl.controllers.doors.fmu:open_fmu",
    ".toml": "cranectl.controllers.doors.process_law:open_process",
}
_REFERENCE = re.compile(rf"(?P<path>.*({'|'.join(map(re.escape, DOORS))}))(:(?P<symbol>\w*))?")


OPENED: dict[str, LawFile] = {}  # by the name of the controller


def is_reference(text: str) -> bool:
    """Whether `text` names a law in a file, rather than a controller."""
    return text.startswith(UDP) or _REFERENCE.fullmatch(text) is not None


def open_law(reference: str) -> str:
    """Register the law at `reference` with this process; returns the controller's name.

    Raises InputError for a file that is not there, or not a law.
    """
    if reference.startswith(UDP):
        return _register(LawFile(reference, Path(), "", reference.encode()))
    match = _REFERENCE.fullmatch(reference)
    if match is None:
        raise InputError(
            f"'{reference}' names no law in a file",
            allowed=f"PATH:NAME with a path that ends in {', '.join(DOORS)}; {UDP}HOST:PORT",
            remedy="name the file, and for .py what of it: law.py:NAME",
        )
    path = Path(match["path"])
    if match["symbol"] is not None and path.suffix != ".py":
        raise InputError(
            f"'{reference}' names something in {path}",
            allowed=f"{path}, which holds one law; a name only of what is in a .py",
            remedy=f"name it: {path}",
        )
    beside = path.with_suffix(".toml")
    try:
        content = path.read_bytes()
        table = beside.read_bytes() if path.suffix == ".fmu" and beside.exists() else b""
    except OSError as error:
        raise InputError(
            f"{path}: {error.strerror or error}", allowed="a file with a law", remedy="correct the path"
        ) from error
    return _register(LawFile(reference, path, match["symbol"] or "", content, table))


def open_again(files: Iterable[LawFile]) -> None:
    """In a worker process: register what its parent has opened."""
    for file in files:
        _register(file)


def _register(file: LawFile) -> str:
    for name, known in OPENED.items():
        if (known.symbol, known.content, known.table) == (file.symbol, file.content, file.table):
            return name
    controller: Controller = loaded(DOORS[file.path.suffix or ".toml"])(file)
    text = file.content if file.path.suffix in (".py", ".toml") else file.table
    if REGISTERED.get(controller.name) is controller:  # the file may say so itself
        del REGISTERED[controller.name]
    register_controller(
        replace(controller, origin=Origin(file.reference, file.digest, text.decode("utf-8", "replace")))
    )
    OPENED[controller.name] = file
    return controller.name


def close_laws() -> None:
    """Forget all, for tests."""
    for name in OPENED:
        REGISTERED.pop(name, None)
    OPENED.clear()
