"""The numbers of a crane that are fitted to measured runs: first values, scales and ranges."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import inf, sqrt
from typing import Any

import numpy as np

from cranectl.scenario import RigParameters
from cranectl.simulate import Run
from cranectl.support import Table
from cranectl.tools.measured.replay import Replay

AXES = ("bridge", "trolley", "winch")
ANGLE_SCALE, ANGLE_DELAY = "angles.scale", "angles.delay"  # of their sensor: no settings of a rig
ROPE_ZERO = "effects.installation.rope_offset"
HOLDING_SHARE = 0.5  # of a drive's force at the recorded commands, from which friction holds its axis
MOVABLE_SHARE = 0.1  # of the same force, from which the fit of such friction starts at least
MOVING_SHARE = 0.2  # of its largest speed, above which an axis moves


@dataclass(frozen=True)
class Unknown:
    """A number of the crane that is fitted."""

    name: str  # of the setting in a rig file
    unit: str
    start: float
    scale: float  # typical size of a change
    low: float = -inf
    high: float = inf


def unknowns_of(rig: RigParameters, replay: Replay) -> tuple[Unknown, ...]:
    """Return the numbers that can be fitted, with their first values from `rig`, in the ranges of a rig."""
    friction, size = rig.effects.friction, rig.length_scale
    fitted, driven = [], np.flatnonzero(rig.moves).tolist()  # a fixed axis has no drive
    if replay != "motion":
        for k in driven:
            tau = float(rig.time_constants[k])
            fitted.append(_ranged(f"{AXES[k]}_time_constant", "s", tau, tau, low=0.05 * tau))
        gains = rig.effects.installation.drive_gain
        fitted += [
            _ranged(f"effects.installation.drive_gain.{k}", "1", gains[k], 0.1, low=0.1) for k in driven
        ]
        for k in driven:
            force = friction.coulomb[k] or 0.02 * rig.load_mass * rig.gravity
            fitted.append(_ranged(f"effects.friction.coulomb.{k}", "N", force, force, low=0.0))
        late = rig.effects.delay.seconds or 0.1 * rig.trolley_time_constant
        fitted.append(_ranged("effects.delay.seconds", "s", late, late, low=0.0))
        mass = rig.load_mass
        fitted.append(_ranged("load_mass", "kg", mass, mass, low=0.05 * mass, high=rig.heaviest_load))
    else:
        late = 0.1 / sqrt(rig.gravity / rig.rope_range[1])
        fitted += [Unknown(ANGLE_SCALE, "1", 1.0, 0.1, 0.1), Unknown(ANGLE_DELAY, "s", 0.0, late)]
    fitted.append(_ranged(ROPE_ZERO, "m", 0.0, 0.02 * rig.rope_range[1]))
    for name, unit in (("pivot_coulomb", "N m"), ("pivot_viscous", "N m s/rad")):
        value = float(getattr(friction, name)) or 1e-4 * rig.load_mass * rig.gravity * size
        fitted.append(_ranged(f"effects.friction.{name}", unit, value, value, low=0.0))
    return tuple(fitted)


def _ranged(
    name: str, unit: str, start: float, scale: float, *, low: float = -inf, high: float = inf
) -> Unknown:
    """Return a number that stays between `low` and `high`, and in the range that a rig file allows."""
    least, most = _allowed_range(name)
    return Unknown(name, unit, start, scale, max(low, least), min(high, most))


@cache
def _allowed_range(name: str) -> tuple[float, float]:
    """Return the range of a setting of a rig, by its dotted name."""
    schema = RigParameters.model_json_schema()
    setting: Table = schema
    for key in name.split("."):
        setting = setting["prefixItems"][int(key)] if key.isdigit() else setting["properties"][key]
        if "$ref" in setting:
            setting = schema["$defs"][setting["$ref"].rpartition("/")[2]]
    low, high = setting.get("minimum"), setting.get("maximum")
    return -inf if low is None else float(low), inf if high is None else float(high)


def movable_friction(
    rig: RigParameters, runs: Sequence[Run], progress: Callable[[str], None]
) -> dict[str, float]:
    """Return less friction for the axes that the rig's friction holds though they moved, by name.

    An axis that its model cannot move shows nothing of its drive, so no step leads to a better number.
    Friction is what a drive gives for the speed by which an axis stays behind its command. `progress` is
    called with a sentence for each such axis.
    """
    lowered: dict[str, float] = {}
    if not all(run.has("command") and run.drive == "velocity" for run in runs):
        return lowered
    commands = np.vstack([run.commands for run in runs])
    moved = np.vstack([run.state.joint_rates[:, :3] for run in runs])
    forces = rig.velocity_gains * rig.effects.installation.drive_gain * np.abs(commands).max(axis=0)
    for k in np.flatnonzero(rig.moves).tolist():
        assumed, force = rig.effects.friction.coulomb[k], float(forces[k])
        moves = np.abs(moved[:, k]) > MOVING_SHARE * np.abs(moved[:, k]).max()
        if not assumed > HOLDING_SHARE * force > 0.0 or not moves.any():
            continue
        behind = float(np.median((np.sign(moved[:, k]) * (commands[:, k] - moved[:, k]))[moves]))
        start = float(f"{max(rig.velocity_gains[k] * behind, MOVABLE_SHARE * force):.3g}")
        if start < HOLDING_SHARE * assumed:
            lowered[f"effects.friction.coulomb.{k}"] = start
            progress(
                f"friction of the {AXES[k]} starts from {start:g} N: the rig's {assumed:g} N would hold it, "
                f"or nearly so, since its drive gives {force:.0f} N at the largest recorded command"
            )
    return lowered


def rig_with(rig: RigParameters, values: Mapping[str, float]) -> RigParameters:
    """Return the rig with other `values`, by the names of its settings."""
    for name, value in values.items():
        if name not in (ANGLE_SCALE, ANGLE_DELAY):
            rig = _replace(rig, name.split("."), value)
    return rig


def assumed_value(rig: RigParameters, name: str) -> float:
    """Return the value of a number that is not fitted."""
    if name in (ANGLE_SCALE, ANGLE_DELAY):
        return float(name == ANGLE_SCALE)
    setting: Any = rig
    for key in name.split("."):
        setting = setting[int(key)] if key.isdigit() else getattr(setting, key)
    return float(setting)


def _replace(settings: Any, path: Sequence[str], value: float) -> Any:
    """Return settings, or a list of numbers, with another value at the end of `path`."""
    if not path:
        return value
    key, *below = path
    if isinstance(settings, tuple):
        index = int(key)
        return (*settings[:index], _replace(settings[index], below, value), *settings[index + 1 :])
    return settings.model_copy(update={key: _replace(getattr(settings, key), below, value)})
