"""The list of all controllers: the flat family by its designs, the others by their modules.

Names and titles are known without importing what computes, so that `cranectl list` answers at once.
"""

import ast
import functools
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, NamedTuple

from cranectl import support
from cranectl.design import CONTROLLERS as FLAT_FAMILY
from cranectl.design import TITLES as FLAT_TITLES
from cranectl.support import Extensions, InputError

if TYPE_CHECKING:
    from cranectl.controllers.controller import Controller, Sizes
    from cranectl.design import ControllerDesign
    from cranectl.scenario import Scenario
    from cranectl.support import Array

WHERE = {  # module and name of each controller, imported at first use
    "pid": "cranectl.controllers.pid:PID",
    "lqr-integral": "cranectl.controllers.lqr_integral:LQR_INTEGRAL",
    "flat-velocity": "cranectl.controllers.flat_velocity:FLAT_VELOCITY",
    "lqr-offset-free": "cranectl.controllers.lqr_offset_free:LQR_OFFSET_FREE",
}
ENDINGS = (".py", ".so", ".dylib", ".dll", ".fmu", ".toml")  # of files with controllers


class SharedControllers(NamedTuple):
    """Data with which another process can open the same controllers."""

    files: tuple[Any, ...]  # of `loaders.opening.ControllerFile`
    folder: Path | None = None  # of copies of the files; None for a process on another machine


class OpenControllers:
    """The controllers that modules have registered in this process, or that it has opened from files.

    The command line and the API add to them; children get a share.
    """

    def __init__(self) -> None:
        self.registered: dict[str, Controller] = {}  # by name, including controllers from files
        self.files: dict[str, Any] = {}  # `loaders.opening.ControllerFile` by name of the controller
        self.versions: dict[tuple[str, str], Controller] = {}  # those from files, by name and SHA-256
        # Functions that give an address to a step that Numba does not compile: `CompiledController.entry`.
        self.entries: list[tuple[Callable[[Sizes, Array], int], Sizes]] = []
        self._folder: Path | None = None

    @property
    def folder(self) -> Path:
        """Folder with copies of files. It exists while this process runs, or the parent that shares it."""
        if self._folder is None or not self._folder.is_dir():
            self._folder = support.temporary_directory("controllers")
        return self._folder

    def share(self, names: Iterable[str] | None = None) -> SharedControllers:
        """Return the data for a child process to open the controllers `names`, by default all from files."""
        selected = self.files if names is None else names
        files = tuple(self.files[name] for name in selected if name in self.files)
        return SharedControllers(files, self.folder if files else None)

    def take_folder(self, folder: Path | None) -> None:
        """Keep copies in the folder of the parent process."""
        self._folder = folder or self._folder


OPEN = OpenControllers()


@functools.cache
def _added() -> dict[str, "Controller"]:
    """Return the controllers of other packages."""
    if not Extensions.CONTROLLERS.entries:
        return {}
    from cranectl.controllers.controller import Controller

    return Extensions.CONTROLLERS.join({}, Controller, taken=(*FLAT_FAMILY, *WHERE))


def _stated_title(where: str) -> str:
    """Return the title that the module of a controller states; to import the module would take a second."""
    module, _, name = where.partition(":")
    file = Path(__file__).with_name(f"{module.rpartition('.')[2]}.py")
    calls = [
        node.value
        for node in ast.parse(file.read_bytes()).body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call)
        if ast.unparse(node.targets[0]) == name
    ]
    (title,) = (keyword.value for call in calls for keyword in call.keywords if keyword.arg == "title")
    return str(ast.literal_eval(title))


def _registered(names: Iterable[str]) -> list["Controller"]:
    return [OPEN.registered[name] for name in names if name in OPEN.registered]


class Controllers(Mapping[str, "Controller"]):
    """All controllers by name: the flat family, then the others. Each is loaded when it is looked up."""

    UDP = "udp://"  # prefix of the address of a controller in another process
    FILE = re.compile(rf"(?P<path>.*({'|'.join(map(re.escape, ENDINGS))}))(:(?P<symbol>\w*))?")
    opened = OPEN  # those that this process has registered or opened from files

    def __iter__(self) -> Iterator[str]:
        return iter((*FLAT_FAMILY, *WHERE, *_added(), *OPEN.registered))

    def __len__(self) -> int:
        return len(tuple(iter(self)))

    def __contains__(self, name: object) -> bool:
        return name in tuple(iter(self))

    def __getitem__(self, name: str) -> "Controller":
        if name in FLAT_FAMILY:
            from cranectl.controllers.flat import FLAT_CONTROLLERS

            return FLAT_CONTROLLERS[name]
        if name not in WHERE:
            return {**_added(), **OPEN.registered}[name]
        controller: Controller = resolve_name(WHERE[name])
        return controller

    def is_reference(self, text: str) -> bool:
        """Return True if `text` names a controller in a file, rather than one by its name."""
        return text.startswith(self.UDP) or self.FILE.fullmatch(text) is not None

    def checked(self, name: str) -> str:
        """Return `name` if it names a controller; else raise an InputError that lists the known names."""
        if name in self:
            return name
        if self.is_reference(name):
            raise InputError(
                f"the controller is the file '{name}', and neither scenario nor campaign runs code by itself",
                allowed=f"a file named on the command line, or {', '.join(self)}",
                remedy="if you know what is in it, add --trust, or name it: --controller PATH",
            )
        raise InputError.unknown(
            "controller",
            name,
            self,
            remedy="choose one of the controllers listed above, or name the file of a controller, "
            "law.py:NAME",
        )

    def chosen(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return the chosen names of controllers; no names mean the flat family, `all` means all."""
        selected = dict.fromkeys(names)
        if "all" in selected:
            return tuple(self)
        return tuple(map(self.checked, selected)) or FLAT_FAMILY

    def design(self, name: str, scenario: "Scenario") -> "ControllerDesign":
        """Return `name` with the settings of `scenario`; raise InputError for bad names and settings."""
        self.checked(name)
        names = [other for other in self if other not in FLAT_FAMILY]
        InputError.check_known("controller", scenario.controller.parameters, names)
        controller = self[name]
        if controller.axis_design is not None:
            return controller.axis_design(scenario.design)
        stated = scenario.controller.parameters.get(name, {})
        return controller.designed(stated, scenario.rig.design_scale)

    def of_design(self, design: "ControllerDesign") -> "Controller":
        """Return the controller that runs `design`; from a file, the version with the same content.

        All designs of the flat family run the same code, also one whose gains were set by hand.
        """
        if design.axis_design is not None:
            return self[FLAT_FAMILY[0]]
        origin = design.origin
        version = OPEN.versions.get((design.name, origin.sha256)) if origin else None
        return version or self[design.name]

    def described(self) -> dict[str, tuple[str, str]]:
        """Return the origin and a one-line description of each controller, by name."""
        own = {**FLAT_TITLES, **{name: _stated_title(where) for name, where in WHERE.items()}}
        described = {name: ("cranectl", title) for name, title in own.items()}
        origins = Extensions.CONTROLLERS.packages()
        for name, controller in {**_added(), **OPEN.registered}.items():
            described[name] = (
                controller.origin.reference if controller.origin else origins.get(name, "this process"),
                controller.title,
            )
        return described

    def argument(self, name: str) -> str:
        """Return the argument of `--controller` for a controller: its file as it was named, or its name."""
        origin = OPEN.registered[name].origin if name in OPEN.registered else None
        return origin.reference if origin else name

    def digests(self, names: Iterable[str]) -> dict[str, str]:
        """Return the short digest of each controller that comes from a file, by the key `law NAME`."""
        return {
            f"law {controller.name}": controller.code[: support.Provenance.DIGITS]
            for controller in _registered(names)
            if controller.code
        }

    def sources(self, names: Iterable[str]) -> dict[str, str]:
        """Return source digests of those of `names` that a module has registered in this process."""
        own = [controller for controller in _registered(names) if not controller.origin]
        functions = [function for controller in own for function in (controller.step, controller.prepare)]
        return support.Provenance.sources_of(
            getattr(function, "__module__", "cranectl") for function in functions
        )

    def run_alone(self, names: Iterable[str]) -> bool:
        """Return True if any of these controllers can serve only one run at a time."""
        return any(controller.alone for controller in _registered(names))


ALL_CONTROLLERS = Controllers()  # by name


def register_controller(controller: "Controller") -> None:
    """Make a controller known to this process.

    An entry point of the group `cranectl.controllers` makes it known to all processes.

    Parameters
    ----------
    controller : Controller
        The controller.

    Raises
    ------
    InputError
        If another controller has its name, or it is no Controller.
    """
    from cranectl.controllers.controller import Controller

    support.Arguments.check("controller", controller, Controller)
    if OPEN.registered.get(controller.name) is controller:  # several test files may register the same one
        return
    InputError.check_name("controller", controller.name, taken=ALL_CONTROLLERS)
    OPEN.registered[controller.name] = controller


def controller_names() -> tuple[str, ...]:
    """Return the names of the flat family, then of all other controllers.

    Returns
    -------
    tuple of str
        The names.

    Raises
    ------
    InputError
        If a controller of an installed package cannot be loaded.
    """
    return tuple(ALL_CONTROLLERS)
