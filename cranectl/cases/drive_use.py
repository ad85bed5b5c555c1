"""Compare the commands of a run with the limits of its drives."""

import shlex
from typing import NamedTuple

import numpy as np

from cranectl.plants import DRIVES, PLANTS
from cranectl.reference import Trajectory
from cranectl.scenario import NANOSECONDS
from cranectl.simulate import Run
from cranectl.support import Array

AXES = ("bridge", "trolley", "winch")
UNITS = {"acceleration": "m/s²", "velocity": "m/s", "force": "N"}


class DriveUse(NamedTuple):
    """The largest command to a drive, and the drive's limit."""

    axis: str  # bridge, trolley or winch
    unit: str  # m/s² of an acceleration, m/s of a velocity, N of a force
    commanded: float
    limit: float
    is_assumed: bool = False  # True if the limit is scaled from the laboratory rig
    time: float = 0.0  # when it is commanded [s]

    @property
    def share(self) -> float:
        """Command as a share of the limit; above 1 the drive cannot follow."""
        return self.commanded / self.limit


def drive_uses(run: Run) -> list[DriveUse]:
    """Return the largest commands of a run with samples, in descending order of their share of the limit."""
    limits, scenario = run.scenario.drive_limits, run.scenario
    assumed = scenario.assumed_settings
    uses = []
    for kind, commands in commands_of(run).items():
        largest, is_assumed = (
            np.abs(commands).argmax(axis=0),
            f"{scenario.drive_limits_key}.{kind}" in assumed,
        )
        for k, (axis, limit) in enumerate(zip(AXES, getattr(limits, kind), strict=True)):
            commanded, time = (
                float(abs(commands[largest[k], k])),
                float(run.time_ns[largest[k]]) / NANOSECONDS,
            )
            uses.append(DriveUse(axis, UNITS[kind], commanded, limit, is_assumed, time))
    return sorted(uses, key=lambda use: -use.share)


def commands_of(run: Run) -> dict[str, Array]:
    """Return what a run asks of its drives (N, 3), by the kind of limit with which it is compared.

    The accelerations are the commanded ones. Where a controller commands velocities to drives that feel the
    load, they are the slopes of the set-points (`simulate.actuation.follow_set_points`). The velocities are
    the set-points of velocity drives, and else those of the axes. Force drives also have forces.
    """
    inputs, kind = run.block("input"), DRIVES[run.drive].command
    velocities = inputs[:, 3:6] if kind == "velocity" else run.state.axis_rates
    commands = {"acceleration": inputs[:, :3], "velocity": velocities}
    return commands | ({"force": run.commands} if kind == "force" else {})


def beyond_drives(run: Run) -> str:
    """Return the largest command beyond the drives' limits, if the run does not limit it; else ""."""
    unlimited = run.scenario.effects.limits is None
    if not (unlimited and run.has("input", "state") and len(run.time_ns)) or run.status.stopped:
        return ""
    uses = drive_uses(run)
    axis, unit, commanded, limit, is_assumed, time = worst = uses[0]
    if worst.share <= 1.0:
        return ""
    is_force = unit == UNITS["force"]
    moves_until, _ = Trajectory.of(run.scenario.reference).last_motion
    remedies = ["give the move more time" if time < moves_until else "choose a gentler controller"]
    remedies += ["lift less"] * (is_force and axis == AXES[-1])
    text = (
        f"asks {commanded:.3g} {unit} of the {axis}, {worst.share:.3g} times what its drive can do"
        f"{f' (assumed: {limit:.3g} {unit})' if is_assumed else ''}: {', or '.join(remedies)}"
    )
    if _may_be_refused(run, uses, drive := "force" if is_force else "velocity"):
        return text
    none = [run.scenario.drive_limits.NO_LIMIT] * 3
    if is_force:  # such drives have no set-points, whose limits would be refused
        force = list(run.scenario.drive_limits.force)
        table = f"{{velocity={none}, acceleration={none}, force={force}}}"
    else:
        table = f"{{force={none}}}" if PLANTS.entry(run.plant).why_lacking("limits.force") else "{}"
    plant, limits = shlex.quote(PLANTS.entry(run.plant).argument), shlex.quote(f"effects.limits={table}")
    return f"{text}, or see what comes of it with --drive {drive} --plants {plant} --set {limits}"


def _may_be_refused(run: Run, uses: list[DriveUse], drive: str) -> bool:
    """Return True if this run might be refused with limits on drives of the kind `drive`.

    Motions beyond the limits of speed are refused, and winches that cannot hold the load.
    """
    entry, beyond = PLANTS.entry(run.plant), [use for use in uses if use.share > 1.0]
    if drive == "force" and entry.why_lacking("limits.force"):
        return True
    return drive not in entry.drives or any(
        use.unit == UNITS["velocity"] or (use.unit == UNITS["force"] and use.axis == AXES[-1])
        for use in beyond
    )
