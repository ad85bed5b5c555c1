"""Open the controllers that are named on the command line: `law.py:NAME`, `law.so`, `law.fmu`.

Foreign code runs only because a user named it there, never because a log or a scenario names it. Worker
processes receive the content of the files, so that all run the same code.
"""

import contextlib
import hashlib
import os
import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import NamedTuple

from cranectl.controllers import ALL_CONTROLLERS, Controller, SharedControllers, register_controller
from cranectl.design import Origin
from cranectl.support import Arguments, File, InputError, Provenance

MAX_COMPANIONS = 64 * 2**20  # [bytes] of all files that a controller uses
OPEN, UDP = ALL_CONTROLLERS.opened, ALL_CONTROLLERS.UDP
# By file ending; each returns a controller, and its file with all files that it uses. Loaders of tools are
# named in text only, since a room of the core imports no tool.
LOADERS = {
    ".py": "cranectl.loaders.python_controller:open_python",
    ".so": "cranectl.loaders.c_controller:open_library",
    ".dylib": "cranectl.loaders.c_controller:open_library",
    ".dll": "cranectl.loaders.c_controller:open_library",
    ".fmu": "cranectl.tools.export.loaders.fmu:open_fmu",
    ".toml": "cranectl.tools.export.loaders.process_controller:open_process",
}


class ControllerFile(NamedTuple):
    """Hold the content of a controller's file and of the files it uses, to share with other processes."""

    reference: str  # as the user names it, FILE or FILE:SYMBOL
    path: Path  # of the file
    symbol: str  # name of the controller in the file; may be empty
    content: bytes  # of the file
    table: bytes = b""  # of an FMU: the TOML file beside it
    place: str = ""  # absolute path where it was read
    # What else it is made of, by path relative to its folder. An absolute path stays where it is, and its
    # content here is the digest of the file.
    companions: tuple[tuple[str, bytes], ...] = ()

    @property
    def digest(self) -> str:
        """SHA-256 of the content, of the table and of all files beside it, hexadecimal."""
        digest = hashlib.sha256(self.content + self.table)
        for name, content in self.companions:
            digest.update(f"\0{name}\0{len(content)}\0".encode() + content)
        return digest.hexdigest()

    @property
    def code_digest(self) -> str:
        """The same digest without comments and docstrings of Python source, hexadecimal."""
        companions = tuple((name, _code(name, content)) for name, content in self.companions)
        return self._replace(content=_code(self.path.name, self.content), companions=companions).digest

    @property
    def folder(self) -> Path:
        """The folder in which it was read."""
        return Path(self.place).parent

    def is_of(self, other: "ControllerFile") -> bool:
        """Return True if both name the same controller at the same place, whatever the content."""
        return (self.place, self.symbol) == (other.place, other.symbol)

    def with_companions(self, folder: Path, names: Iterable[str]) -> "ControllerFile":
        """Return the file together with the files `names`, relative to `folder`, that it also uses.

        Raises OSError, and InputError if these files are too large.
        """
        contents = {name: _part(folder, name) for name in names}
        size = sum(map(len, contents.values()))
        if size > MAX_COMPANIONS:
            raise InputError(
                f"{self.reference} takes {size / 2**20:.0f} MiB of files along",
                allowed=f"at most {MAX_COMPANIONS // 2**20} MiB of modules, programs and data",
                remedy="install large data as a package of its own, or read it from another folder",
            )
        return self._replace(companions=tuple(sorted(contents.items())))

    def read_again(self) -> "ControllerFile":
        """Return the file with the present content of all its parts; a missing part is empty."""
        contents = [(name, self._read(name)) for name, _ in self.companions]
        return self._replace(content=self._read(Path(self.place).name), companions=tuple(contents))

    def _read(self, name: str) -> bytes:
        with contextlib.suppress(OSError):
            return _part(self.folder, name)
        return b""


def _code(name: str, content: bytes) -> bytes:
    return Provenance.syntax_of(content) if name.endswith(".py") else content


def _part(folder: Path, name: str) -> bytes:
    """Return the content of a file, or the SHA-256 of a file with an absolute path; raise OSError."""
    if not Path(name).is_absolute():
        return (folder / name).read_bytes()
    with Path(name).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest().encode()


def directory_of(file: ControllerFile) -> Path:
    """Return the directory for copies of this controller's files."""
    path = OPEN.folder / file.digest[:16]
    path.mkdir(exist_ok=True)
    return path


def copy_of(file: ControllerFile) -> Path:
    """Return the path of a copy with the content as it was read, even if the file changes later."""
    path = directory_of(file) / file.path.name
    if not path.exists():
        _put(path, file.content)
    return path


def complete_copy_of(file: ControllerFile) -> Path:
    """Return the file's own path, or that of a complete copy if any of its files has changed."""
    if file.read_again() == file:
        return Path(file.place)
    # A name with .. needs as many folders above the copy, with the names that they have here.
    above = max((name.split("/").count("..") for name, _ in file.companions), default=0)
    folder = directory_of(file).joinpath("whole", *file.folder.parts[1:][-above:] if above else ())
    for name, content in (*file.companions, (Path(file.place).name, file.content)):
        path = Path(os.path.normpath(folder / name))
        if not Path(name).is_absolute() and not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            _put(path, content)
    return folder / Path(file.place).name


def _put(path: Path, content: bytes) -> None:
    """Write an executable file; other processes may write the same file at the same time."""
    with File(path).replacing() as part:
        part.write_bytes(content)
        part.chmod(0o700)


def slug(name: str) -> str:
    """Return a controller name made from a function, class or model name: `SlowServo` becomes slow-servo."""
    parted = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", name)
    return re.sub(r"[^a-z0-9]+", "-", parted.lower()).strip("-")


@Arguments.checked
def open_controller(reference: str) -> str:
    """Register the controller of a file, or of another process, with this process.

    Parameters
    ----------
    reference : str
        Such as `law.py:NAME`, `law.so`, `law.fmu`, `law.toml` or `udp://HOST:PORT`.

    Returns
    -------
    str
        The name of the controller.

    Raises
    ------
    InputError
        For a file that does not exist, or that holds no controller.
    """
    if reference.startswith(UDP):
        return _register(ControllerFile(reference, Path(), "", reference.encode(), place=reference))
    match = ALL_CONTROLLERS.FILE.fullmatch(reference)
    if match is None:
        raise InputError(
            f"'{reference}' names no controller in a file",
            allowed=f"PATH:NAME with a path that ends in {', '.join(LOADERS)}; {UDP}HOST:PORT",
            remedy="name the file, and for .py what of it: law.py:NAME",
        )
    path = Path(match["path"])
    if match["symbol"] is not None and path.suffix != ".py":
        raise InputError(
            f"'{reference}' names something in {path}",
            allowed=f"{path}, which holds one controller; a name only of what is in a .py",
            remedy=f"name it: {path}",
        )
    beside = path.with_suffix(".toml")
    try:
        with File(path).open() as stream:
            content = stream.read()
        table = beside.read_bytes() if path.suffix == ".fmu" and beside.is_file() else b""
    except OSError as error:
        raise InputError(
            f"{path}: {error.strerror or error}",
            allowed="a file with a controller",
            remedy="correct the path",
        ) from error
    absolute = str(path.parent.resolve() / path.name)
    return _register(ControllerFile(reference, path, match["symbol"] or "", content, table, absolute))


def file_from(name: str, folder: Path) -> str:
    """Return how to name the opened controller `name` from `folder`: its path, with its symbol if any."""
    file: ControllerFile = OPEN.files[name]
    if file.reference.startswith(UDP):
        return file.reference
    path = Path(os.path.relpath(file.place, folder.resolve())).as_posix()
    return f"{path}:{file.symbol}" if file.symbol else path


def open_again(shared: SharedControllers) -> None:
    """Register in a worker process the controllers that its parent shares.

    Raises InputError if a controller uses other files here than in the parent.
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


def _register(file: ControllerFile) -> str:
    """Register the controller that the user has named; return its name."""
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


def _opened(file: ControllerFile) -> tuple[Controller, ControllerFile]:
    """Return the controller of a file, and the file with all that it imports or reads."""
    ending = file.path.suffix or ".toml"
    # The file may register its controller itself, whose name an earlier version would have taken.
    earlier = {name: OPEN.registered.pop(name) for name, known in OPEN.files.items() if known.is_of(file)}
    controller: Controller
    opened: ControllerFile
    try:
        controller, opened = resolve_name(LOADERS[ending])(file)
        if OPEN.registered.get(controller.name) is controller:  # the file may say so itself
            del OPEN.registered[controller.name]
    finally:
        OPEN.registered.update(earlier)
    text = file.content if file.path.suffix in (".py", ".toml") else file.table
    origin = Origin(file.reference, opened.digest, text.decode("utf-8", "replace"))
    return replace(controller, origin=origin, code=opened.code_digest), opened


def _keep(controller: Controller, file: ControllerFile) -> None:
    """Register the controller and remove an earlier version of it."""
    earlier = [name for name, known in OPEN.files.items() if name == controller.name or known.is_of(file)]
    for name in earlier:
        del OPEN.files[name], OPEN.registered[name]
    register_controller(controller)
    OPEN.files[controller.name] = file
    assert controller.origin is not None
    OPEN.versions[controller.name, controller.origin.sha256] = controller


def close_controllers() -> None:
    """Forget all opened controllers; tests use this."""
    for name in OPEN.files:
        OPEN.registered.pop(name, None)
    OPEN.files.clear()
    OPEN.versions.clear()
