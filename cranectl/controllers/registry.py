"""The controllers there are: the flat family by its designs, every other law by where it is defined."""

import functools
from collections.abc import Iterable
from typing import TYPE_CHECKING

from cranectl.design import CONTROLLERS as FLAT_FAMILY
from cranectl.design import TITLES, Design, design_controller
from cranectl.scenario import Scenario
from cranectl.scenario.similarity import size_of
from cranectl.support import extensions
from cranectl.support.errors import InputError, unknown_name
from cranectl.support.extensions import check_free, loaded, packages, with_extensions
from cranectl.support.provenance import DIGITS

if TYPE_CHECKING:
    from cranectl.controllers.controller import Controller, LawDesign

WHERE = {  # module and name of each law, imported only when asked for
    "pid": "cranectl.controllers.pid:PID",
    "lqr-integral": "cranectl.controllers.lqr_integral:LQR_INTEGRAL",
    "flat-velocity": "cranectl.controllers.flat_velocity:FLAT_VELOCITY",
    "lqr-offset-free": "cranectl.controllers.lqr_offset_free:LQR_OFFSET_FREE",
}
REGISTERED: dict[str, "Controller"] = {}  # in this process


def register_controller(controller: "Controller") -> None:
    """Make a controller known to this process; raises InputError for a name that another one has.

    An entry point of the group `cranectl.controllers` makes it known to all.
    """
    if REGISTERED.get(controller.name) is controller:  # as every test file of a package may say
        return
    check_free("controller", controller.name, controller_names())
    REGISTERED[controller.name] = controller


def controller_names() -> tuple[str, ...]:
    """The flat family, then all other laws; raises InputError as `with_extensions`."""
    return (*FLAT_FAMILY, *WHERE, *_added(), *REGISTERED)


@functools.cache
def _added() -> dict[str, "Controller"]:
    """Of other packages."""
    from cranectl.controllers.controller import Controller

    return with_extensions({}, Controller, extensions.CONTROLLERS, taken=(*FLAT_FAMILY, *WHERE))


def described_controllers() -> dict[str, tuple[str, str]]:
    """Where each controller is from, and what it is in a line, by name."""
    found = {name: ("cranectl", title) for name, title in TITLES.items()}
    origins = {**dict.fromkeys(WHERE, "cranectl"), **packages(extensions.CONTROLLERS)}
    for name in controller_names()[len(FLAT_FAMILY) :]:
        law = load_controller(name)
        found[name] = (law.origin.reference if law.origin else origins.get(name, "this process"), law.title)
    return found


def checked_controller(name: str) -> str:
    """`name` if it is a controller's; raises InputError that lists the known names otherwise."""
    if name in controller_names():
        return name
    from cranectl.controllers.doors.opening import is_reference

    if is_reference(name):
        raise InputError(
            f"the controller is the file '{name}', and neither scenario nor campaign runs code by itself",
            allowed=f"a file named on the command line, or {', '.join(controller_names())}",
            remedy="if you know what is in it, add --trust, or name it: --controller PATH",
        )
    by_file = "choose one of the controllers listed above, or name the file of a law, law.py:NAME"
    raise unknown_name("controller", name, controller_names(), remedy=by_file)


def chosen_controllers(names: Iterable[str]) -> tuple[str, ...]:
    """Controllers by name, by default the flat family, for `all` all; raises InputError as above."""
    wanted = dict.fromkeys(names)
    if "all" in wanted:
        return controller_names()
    return tuple(map(checked_controller, wanted)) or FLAT_FAMILY


def load_controller(name: str) -> "Controller":
    """The law `name`, which is not of the flat family."""
    if name not in WHERE:
        return {**_added(), **REGISTERED}[name]
    controller: Controller = loaded(WHERE[name])
    return controller


def law_digests(names: Iterable[str]) -> dict[str, str]:
    """Of those of `names` whose law is in a file, `law NAME`: the first digits of its SHA-256."""
    laws = {name: REGISTERED[name].origin for name in names if name in REGISTERED}
    return {f"law {name}": origin.sha256[:DIGITS] for name, origin in laws.items() if origin}


def runs_alone(names: Iterable[str]) -> bool:
    """Whether there is only one of one of these laws, for one run at a time."""
    return any(REGISTERED[name].alone for name in names if name in REGISTERED)


def controller_design(name: str, scenario: Scenario) -> "Design | LawDesign":
    """The controller `name` as `scenario` sets it: a design of the flat family, or a law's parameters.

    Raises InputError for a wrong name, also of a table of parameters, and for settings that it cannot meet.
    """
    checked_controller(name)
    laws = [law for law in controller_names() if law not in FLAT_FAMILY]
    for law in scenario.controller.parameters:
        if law not in laws:
            raise unknown_name("law", law, laws)
    if name in FLAT_FAMILY:
        return design_controller(name, scenario.design)
    given = scenario.controller.parameters.get(name, {})
    return load_controller(name).designed(given, size_of(scenario.rig))


def flat_design(name: str, scenario: Scenario) -> Design:
    """The design `name` of the flat family; raises InputError for any other controller."""
    return only_flat(controller_design(name, scenario))


def only_flat(design: "Design | LawDesign") -> Design:
    """`design` if it is one of the flat family; raises InputError otherwise."""
    if not isinstance(design, Design):
        raise InputError(
            f"'{design.name}' has no linear design of one axis of the load, on which this judgement rests",
            allowed=f"the flat family: {', '.join(FLAT_FAMILY)}",
            remedy="judge it by simulation: cranectl ladder, cranectl campaign",
        )
    return design


def design_from_json(data: "dict[str, object]") -> "Design | LawDesign":
    """What was written by `to_json`; raises KeyError, TypeError or ValueError for other data."""
    from cranectl.controllers.controller import LawDesign

    return Design.from_json(data) if "gain" in data else LawDesign.from_json(data)
