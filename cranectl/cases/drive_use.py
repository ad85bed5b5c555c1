"""Compare the commands of a run with the limits of its drives."""

import shlex
from itertools import product
from typing import NamedTuple

import numpy as np

from cranectl.plants.capabilities import lacking
from cranectl.plants.model_files import plant_argument
from cranectl.plants.registry import plant_entry
from cranectl.scenario.effects import NO_LIMIT
from cranectl.scenario.similarity import assumed_settings
from cranectl.simulate import Run

UNITS = {"acceleration": "m/s²", "velocity": "m/s"}


class DriveUse(NamedTuple):
    """The largest command to a drive, and the drive's limit."""

    axis: str  # bridge, trolley or winch
    unit: str  # m/s² of an acceleration, m/s of a velocity
    commanded: float
    limit: float
    is_assumed: bool = False  # True if the limit is scaled from the laboratory rig

    @property
    def share(self) -> float:
        """Command as a share of the limit; above 1 the drive cannot follow."""
        return self.commanded / self.limit


def drive_uses(run: Run) -> list[DriveUse]:
    """Return the largest commands of a run with samples, in descending order of their share of the limit."""
    limits, scenario = run.scenario.drive_limits, run.scenario
    assumed = assumed_settings(scenario.rig, scenario.effects)
    commanded = np.abs(np.hstack([run.block("input")[:, :3], run.block("state")[:, 1:6:2]])).max(axis=0)
    kinds = product(("acceleration", "velocity"), ("bridge", "trolley", "winch"))
    pairs = zip(commanded.tolist(), (*limits.acceleration, *limits.velocity), strict=True)
    uses = [
        DriveUse(axis, UNITS[kind], *pair, f"{scenario.drive_limits_key}.{kind}" in assumed)
        for (kind, axis), pair in zip(kinds, pairs, strict=True)
    ]
    return sorted(uses, key=lambda use: -use.share)


def beyond_drives(run: Run) -> str:
    """Return the largest command beyond the drives' limits, if the run does not limit it; else ""."""
    unlimited = run.scenario.effects.limits is None
    if not (unlimited and run.has("input", "state") and len(run.time_ns)) or run.status.stopped:
        return ""
    uses = drive_uses(run)
    axis, unit, commanded, limit, is_assumed = worst = uses[0]
    if worst.share <= 1.0:
        return ""
    text = (
        f"asks {commanded:.3g} {unit} of the {axis}, {worst.share:.3g} times what its drive can do"
        f"{f' (assumed: {limit:.3g} {unit})' if is_assumed else ''}: give the move more time"
    )
    entry = plant_entry(run.plant)
    is_too_fast = any(use.share > 1.0 for use in uses if use.unit == "m/s")  # might be refused with limits
    if is_too_fast or "velocity" not in entry.drives:
        return text
    table = f"{{force={[NO_LIMIT] * 3}}}" if lacking(entry, "limits.force") else "{}"
    plant, limits = shlex.quote(plant_argument(run.plant)), shlex.quote(f"effects.limits={table}")
    return f"{text}, or see what comes of it with --drive velocity --plants {plant} --set {limits}"
