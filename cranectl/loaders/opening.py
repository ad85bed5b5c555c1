"""What is named on the command line becomes a controller of this process: `law.py:NAME`, `law.so`, `law.fmu`.

Code runs only because somebody named it there; never because a log or a scenario does. Worker processes get
the files by content, so that all run the same.
"""

import os
from dataclasses import replace
from pathlib import Path

from cranectl.controllers.controller import Controller
from cranectl.controllers.open_controllers import OPEN, SharedControllers
from cranectl.controllers.registry import FILE, UDP, register_controller
from cranectl.design.records import Origin
from cranectl.loaders.law_file import LawFile
from cranectl.support.errors import InputError
from cranectl.support.extensions import loaded
from cranectl.support.inputs import open_input

LOADERS = {  # by ending; imported only when asked for
    ".py": "cranectl.loaders.python_law:open_python",
    ".so": "cranectl.loaders.c_law:open_library",
    ".dylib": "cranectl.loaders.c_law:open_library",
    ".dll": "cranectl.loaders.c_law:open_library",
    ".fmu": "cranectl.loaders.fmu:open_fmu",
    ".toml": "cranectl.loaders.process_law:open_process",
}
BESIDE = {  # by ending; what the file takes along, once it is open
    ".py": "cranectl.loaders.python_law:taken_along",
    ".toml": "cranectl.loaders.process_law:taken_along",
}


def open_law(reference: str) -> str:
    """Register the law at `reference` with this process; returns the controller's name.

    Raises InputError for a file that is not there, or not a law.
    """
    if reference.startswith(UDP):
        return _register(LawFile(reference, Path(), "", reference.encode(), place=reference))
    match = FILE.fullmatch(reference)
    if match is None:
        raise InputError(
            f"'{reference}' names no law in a file",
            allowed=f"PATH:NAME with a path that ends in {', '.join(LOADERS)}; {UDP}HOST:PORT",
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
        with open_input(path) as stream:
            content = stream.read()
        table = beside.read_bytes() if path.suffix == ".fmu" and beside.is_file() else b""
    except OSError as error:
        raise InputError(
            f"{path}: {error.strerror or error}", allowed="a file with a law", remedy="correct the path"
        ) from error
    place = str(path.parent.resolve() / path.name)
    return _register(LawFile(reference, path, match["symbol"] or "", content, table, place))


def file_from(name: str, folder: Path) -> str:
    """Return the file of the opened controller `name` as seen from `folder`, with what of it."""
    file: LawFile = OPEN.files[name]
    if file.reference.startswith(UDP):
        return file.reference
    path = Path(os.path.relpath(file.place, folder.resolve())).as_posix()
    return f"{path}:{file.symbol}" if file.symbol else path


def open_again(shared: SharedControllers) -> None:
    """In a worker process: register what its parent shares, in place of others of the same names.

    Raises InputError where a file here is made of other parts than there.
    """
    OPEN.take_folder(shared.folder)
    for file in shared.files:
        if file in OPEN.files.values():
            continue
        controller, opened = _opened(file)
        if opened != file:
            raise InputError(
                f"{file.reference} imports or reads something else in this process than where it was opened",
                allowed="a controller that takes the same modules and data from its folder wherever it runs",
                remedy="import and read the same files on every machine",
            )
        _keep(controller, opened)


def _register(file: LawFile) -> str:
    """Register what somebody has named; returns the name of the controller."""
    for name, known in OPEN.files.items():
        if known.is_of(file):
            now = known.read_again()._replace(content=file.content, table=file.table)
            if now == known:
                return name
    controller, opened = _opened(file)
    other = OPEN.files.get(controller.name)
    if other is not None and not other.is_of(file):
        raise InputError(
            f"{file.reference} and {other.reference} are two controllers named '{controller.name}'",
            allowed="a name of its own for each of them",
            remedy="give one of them another name in its file, or take one at a time",
        )
    _keep(controller, opened)
    return controller.name


def _opened(file: LawFile) -> tuple[Controller, LawFile]:
    """The controller of a file, and the file with all that it takes along."""
    ending = file.path.suffix or ".toml"
    earlier = {name: OPEN.registered.pop(name) for name, known in OPEN.files.items() if known.is_of(file)}
    try:
        controller: Controller = loaded(LOADERS[ending])(file)
        if OPEN.registered.get(controller.name) is controller:  # the file may say so itself
            del OPEN.registered[controller.name]
    finally:
        OPEN.registered.update(earlier)
    taken = loaded(BESIDE[ending])(file) if ending in BESIDE else {}
    opened = file.with_beside(taken)
    text = file.content if file.path.suffix in (".py", ".toml") else file.table
    origin = Origin(file.reference, opened.digest, text.decode("utf-8", "replace"))
    return replace(controller, origin=origin, code=opened.code_digest), opened


def _keep(controller: Controller, file: LawFile) -> None:
    """Make the controller known, in place of an earlier version of it."""
    earlier = [name for name, known in OPEN.files.items() if name == controller.name or known.is_of(file)]
    for name in earlier:
        del OPEN.files[name], OPEN.registered[name]
    register_controller(controller)
    OPEN.files[controller.name] = file
    assert controller.origin is not None
    OPEN.versions[controller.name, controller.origin.sha256] = controller


def close_laws() -> None:
    """Forget all, for tests."""
    for name in OPEN.files:
        OPEN.registered.pop(name, None)
    OPEN.files.clear()
    OPEN.versions.clear()
