"""Find settings without effect on a plant, with its drives, under a controller or beside other settings.

A command prints a line for each such setting of its user, and a campaign refuses such parameters. A setting
that could act but does not in this run, such as a limit that is not reached, does not count.
"""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from cranectl.controllers import ALL_CONTROLLERS, prepared
from cranectl.design import ControllerDesign
from cranectl.plants import DRIVES, PLANTS, Drive
from cranectl.scenario import EFFECTS, RigParameters, Scenario
from cranectl.simulate.plan import AXES, PlannedReference
from cranectl.simulate.prepared import nominal_crane
from cranectl.support import InputError, Tree

LAG = "rig.*_time_constant"
OF_MODELS = ("rig.model", "rig.plant.names.*")
# A setting acts only if none of these groups has all its numbers zero.
FACTORS = {
    **{
        f"effects.{name}.{setting}": tuple(f"effects.{name}.{factor}" for factor in factors)
        for name, kind in EFFECTS.items()
        for setting, factors in kind.factors.items()
    },
    "disturbances.*.start": ("disturbances.*.magnitude", "disturbances.*.force.*"),
    "disturbances.*.end": ("disturbances.*.magnitude", "disturbances.*.force.*"),
}
# The settings of one axis, of bridge, trolley and winch; the trolley's mass is also that of a fixed trolley.
OF_AXIS = (
    "effects.limits.*.{0}",
    "effects.friction.*.{0}",
    "effects.installation.d*.{0}",
    "planning.jerk.{0}",
)
OF_DRIVES = (
    ("rig.bridge_mass", "rig.bridge_time_constant"),
    ("rig.trolley_motor_mass", "rig.trolley_time_constant"),
    ("rig.winch_mass", "rig.winch_time_constant"),
)
# The settings in [design] that a controller uses, by a part of its name.
DESIGNED = {
    "pole-placement": "design.poles.*",
    "lqr": "design.[is]*_weight*",
    "hinf": "design.hinf.*",
    "loop-shaping": "design.loop_shaping.*",
}
# What a controller of the package does not read, by the command of its drives: encoders, and the observer
# that tells rates and accelerations from them.
OBSERVER_SETTING, ANGLE_SENSORS = "effects.sensing.observer_bandwidth", "effects.sensing.angle_*"
UNREAD = {("pid", "acceleration"): (ANGLE_SENSORS,), ("pid", "velocity"): (ANGLE_SENSORS, OBSERVER_SETTING)}
# Parameters of the package's controllers that act unless another parameter has this value.
UNUSED = {
    "controller.pid.filter_time": ("derivative", 0.0),
    "controller.pid.rope_length": ("shaper", "none"),
}


class RunKind(NamedTuple):
    """Plant, drives and controller of a run."""

    plant: str  # its name
    drive: Drive  # kind of drive
    controller: str = ""  # its name

    @staticmethod
    def find_idle_settings(
        scenario: Scenario, requested: Scenario, names: Iterable[str], uses: Iterable["RunKind"]
    ) -> dict[str, list[str]]:
        """Return those of `names` that change nothing in any of `uses`, by the reason in the first use.

        Parameters
        ----------
        scenario
            The scenario that is run, with a planned reference.
        requested
            The same scenario as it was read, before its reference was planned.
        names
            Dotted names of the settings to check.
        uses
            The runs. A controller that cannot be designed raises its own error elsewhere, and is left out.
        """
        idle: dict[str, list[str]] = {}
        runs = []
        for use in uses:
            with suppress(InputError):
                runs.append((use, ALL_CONTROLLERS.design(use.controller, scenario)))
        numbers = (leaf for leaf in Tree(scenario.model_dump()).leaves() if isinstance(leaf[1], int | float))
        zero = {name: value == 0 for name, value in numbers}
        for name in names:
            reasons = [_why_idle(name, scenario, requested, run, zero) for run in runs]
            if reasons and None not in reasons:
                idle.setdefault(str(reasons[0]), []).append(name)
        return idle

    def why_idle_on_plant(self, name: str, rig: RigParameters, zero: Mapping[str, bool]) -> str | None:
        """Return why the setting `name` has no effect on the plant with `rig`, or None if it has one.

        `zero` says for each number, by name, whether it is 0 in all runs.
        """
        entry, drive = PLANTS.entry(self.plant), self.drive
        if fixed := _fixed_axis(name, rig):
            return f"the {fixed} does not move"
        group = "disturbances" if name.startswith("disturbances.") else ".".join(name.split(".")[1:3])
        for lack in (group, group.partition(".")[0]):
            if reason := entry.lack(lack):
                return f"the {entry.label} plant, {reason}"
        if any(fnmatchcase(name, pattern) for pattern in OF_MODELS) and not entry.is_model_file:
            return f"the {entry.label} plant is not from a model file"
        if name.removeprefix("rig.") in entry.fixed:
            return f"it is built into the {entry.label} plant"
        if fnmatchcase(name, LAG) and not DRIVES[drive].is_servo:
            return f"{drive} drives have no lag"
        for factor in (
            factor_name
            for pattern in FACTORS
            if fnmatchcase(name, pattern)
            for factor_name in FACTORS[pattern]
        ):
            if name.startswith("disturbances."):  # the factor must be of the same disturbance
                factor = factor.replace("*", name.split(".")[1], 1)
            names = [other for other in zero if fnmatchcase(other, factor)]
            if names and all(zero[other] for other in names):
                return f"{', '.join(names)} is 0 in all runs"
        return None


def _fixed_axis(name: str, rig: RigParameters) -> str:
    """Return the fixed axis to which alone the setting `name` belongs, or "" if there is none."""
    for axis, moves in enumerate(rig.moves):
        patterns = (*OF_DRIVES[axis], *(pattern.format(axis) for pattern in OF_AXIS))
        if not moves and any(fnmatchcase(name, pattern) for pattern in patterns):
            return AXES[axis]
    return ""


def _why_idle(
    name: str,
    scenario: Scenario,
    requested: Scenario,
    run: tuple[RunKind, ControllerDesign],
    zero: Mapping[str, bool],
) -> str | None:
    """Return why the setting `name` has no effect in a run, or None if it has one."""
    use, design = run
    table = name.partition(".")[0]
    if table == "design":
        return _why_idle_in_design(name, scenario, design)
    if table == "planning":
        return _why_idle_in_plan(name, requested)
    if table == "controller":
        return _why_idle_controller(name, use, design)
    if name.startswith("rig.effects."):
        if getattr(scenario.effects, name.split(".")[2], None) is None:
            return None  # `idle_effects` reports it
        name = name.removeprefix("rig.")
        rig_numbers, numbers = (
            dict(Tree(settings.model_dump()).leaves()) for settings in (scenario.rig, scenario)
        )
        if rig_numbers.get(name) != numbers.get(name):
            return f"{name} is given"
    if table == "limits":
        plant = name.split(".")[1]
        return f"no run is on the {plant} plant" if plant in PLANTS and plant != use.plant else None
    planned = not requested.reference.planned
    if name == "control.lag_compensation":
        return None if planned else _why_no_lead(use, design)
    unread = UNREAD.get((use.controller, DRIVES[use.drive].command), ())
    if any(fnmatchcase(name, pattern) for pattern in unread):
        source = "the observer" if name == OBSERVER_SETTING else "these encoders"
        return f"{use.controller} does not read {source}"
    zero = {key: is_zero for key, is_zero in zero.items() if not any(fnmatchcase(key, p) for p in unread)}
    why = use.why_idle_on_plant(name, scenario.rig, zero)
    if (
        why
        and fnmatchcase(name, LAG)
        and not _fixed_axis(name, scenario.rig)
        and (planned or _uses_lag(name, scenario, use, design))
    ):
        return None
    return why


def _why_idle_in_design(name: str, scenario: Scenario, design: ControllerDesign) -> str | None:
    if design.axis_design is None:
        return f"{design.name} has its own parameters, in [controller.{design.name}]"
    parts = design.name.split("+")
    if not any(fnmatchcase(name, DESIGNED[part]) for part in parts if part in DESIGNED):
        return f"{design.name} is designed without it"
    if name == "design.hinf.back_off" and scenario.design.hinf.gamma is not None:
        return "design.hinf.gamma is given"
    return None


def _why_idle_in_plan(name: str, requested: Scenario) -> str | None:
    if name == "planning.solver":
        return "one solver plans all motions"
    segments = requested.reference.segments
    if not any(segment.is_timed_by_limits for segment in segments):
        return "no segment of the reference is planned"
    is_solved = any(segment.is_in_minimum_time for segment in segments)
    if name == "planning.refinement" and not is_solved:
        return "it acts on motions in minimum time only, and the reference has none"
    if name == "planning.clearance" and requested.planning.load_box is not None:
        return "planning.load_box says where the load may be"
    return None


def _why_idle_controller(name: str, use: RunKind, design: ControllerDesign) -> str | None:
    controller_name = name.split(".")[1]
    if controller_name == "name":
        return None
    if controller_name != use.controller:
        return f"{controller_name} does not run"
    if name in UNUSED:
        factor, off = UNUSED[name]
        return f"controller.{controller_name}.{factor} is {off}" if design.parameters[factor] == off else None
    return None


def _why_no_lead(use: RunKind, design: ControllerDesign) -> str | None:
    if DRIVES[use.drive].command != "velocity":
        return f"{use.drive} drives take no set-points"
    if ALL_CONTROLLERS.of_design(design).command == "velocity":
        return f"{design.name} commands set-points itself"
    return None


def _uses_lag(name: str, scenario: Scenario, use: RunKind, design: ControllerDesign) -> bool:
    """Return True if the lag `name` of the rig's drives changes a controller's preparation or commands.

    Set-points of a controller depend on the lag with ideal drives too: these accelerate as nominal drives do.
    """
    if ALL_CONTROLLERS.of_design(design).command == "velocity":
        return True
    key = name.removeprefix("rig.")
    changed = scenario.rig.model_copy(update={key: 2.0 * getattr(scenario.rig, key)})
    controller, reference = ALL_CONTROLLERS.of_design(design), PlannedReference.of(scenario)
    try:
        one, other = (
            prepared(controller, nominal_crane(candidate, design, controller, use.drive, reference))
            for candidate in (scenario, scenario.model_copy(update={"rig": changed}))
        )
    except InputError:  # the preparation checks the number
        return True
    return not all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
