"""The controllers there are: the flat family by its designs, every other law by where it is defined."""

import functools
import importlib
import re
from collections.abc import Iterable
from importlib.metadata import entry_points
from typing import TYPE_CHECKING

from cranectl.design import CONTROLLERS as FLAT_FAMILY
from cranectl.design import Design, design_controller
from cranectl.scenario import Scenario
from cranectl.support.errors import InputError, unknown_name

if TYPE_CHECKING:
    from cranectl.controllers.controller import Controller, LawDesign

GROUP = "cranectl.controllers"  # of entry points, with which other packages add controllers

LAWS: dict[str, "str | Controller"] = {  # where a Controller is, as module:name, or itself
    "pid": "cranectl.controllers.pid:PID",
    "lqr-integral": "cranectl.controllers.lqr_integral:LQR_INTEGRAL",
}


def register_controller(controller: "Controller") -> None:
    """Make a controller known in this process; raises InputError for a name that is taken or is none.

    An entry point of the group `cranectl.controllers`, NAME = "module:controller", does so in all.
    """
    if controller.name in controller_names() or not re.fullmatch(r"[a-z][a-z0-9-]*", controller.name):
        raise InputError(
            f"a controller named '{controller.name}'",
            allowed=f"lower case letters, digits, hyphens; not {', '.join(controller_names())}",
            remedy="take another name",
        )
    LAWS[controller.name] = controller


def controller_names() -> tuple[str, ...]:
    """The flat family, then all other laws."""
    return (*FLAT_FAMILY, *{**LAWS, **_from_other_packages()})


@functools.cache
def _from_other_packages() -> dict[str, str]:
    return {entry.name: entry.value for entry in entry_points(group=GROUP)}


def checked_controller(name: str) -> str:
    """`name` if it is a controller's; raises InputError that lists the known names otherwise."""
    if name not in controller_names():
        raise unknown_name("controller", name, controller_names())
    return name


def chosen_controllers(names: Iterable[str]) -> tuple[str, ...]:
    """Controllers by name, by default the flat family, for `all` all; raises InputError as above."""
    wanted = dict.fromkeys(names)
    if "all" in wanted:
        return controller_names()
    return tuple(map(checked_controller, wanted)) or FLAT_FAMILY


def load_controller(name: str) -> "Controller":
    """The law `name`, which is not of the flat family; raises InputError where it cannot be loaded."""
    from cranectl.controllers.controller import Controller

    where = {**_from_other_packages(), **LAWS}[name]
    if isinstance(where, Controller):
        return where
    module, _, attribute = where.partition(":")
    try:
        controller = getattr(importlib.import_module(module), attribute)
        if not isinstance(controller, Controller):
            raise TypeError(f"{type(controller).__name__} is no Controller")
    except (ImportError, AttributeError, TypeError) as error:
        raise InputError(
            f"the controller {name} at {where}: {error}",
            allowed="a cranectl.Controller",
            remedy="correct or remove the package that brings it",
        ) from error
    return controller


def controller_design(name: str, scenario: Scenario) -> "Design | LawDesign":
    """The controller `name` as `scenario` sets it: a design of the flat family, or a law's parameters.

    Raises InputError for a wrong name, also of a table of parameters, and for settings that it cannot meet.
    """
    laws = [law for law in controller_names() if law not in FLAT_FAMILY]
    for law in scenario.controller.parameters:
        if law not in laws:
            raise unknown_name("law with parameters", law, laws)
    if checked_controller(name) in FLAT_FAMILY:
        return design_controller(name, scenario.design)
    return load_controller(name).designed(scenario.controller.parameters.get(name, {}))


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
