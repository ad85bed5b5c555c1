"""What a motion asks of the drives' set-points, against what the rig's drives can do."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import BSpline

from cranectl.model.flatness import states_and_inputs
from cranectl.reference.time_laws import derivatives
from cranectl.scenario import Scenario
from cranectl.signals import ACCELERATION, Z
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

DRIVES = ("bridge", "trolley", "rope")
UPPER = 0.975  # quantile of what motions ask that the samples could as well mean
UNITS = {"velocity": "m/s", "acceleration": "m/s²"}


def check_demand(
    curves: Sequence[BSpline],
    scenario: Scenario,
    where: str,
    time: Array | None = None,
    begins: float = 0.0,
) -> None:
    """Raise InputError where velocity or acceleration of a set-point is beyond `effects.limits`.

    Without such an effect the rig's numbers of it count. `curves`: one motion, or many that it could as well
    be, of which the upper end of their peaks counts. `time` (N,) [s]: where it is looked at, by default at
    each control sample; `begins` [s]: when the motion begins in its segment. A motion with a slack rope has
    no set-points: it is refused where it is run.
    """
    if time is None:
        time = np.arange(0.0, curves[0].t[-1], scenario.control.period)
    asked = [demand for curve in curves if (demand := _demand(curve, scenario, time)) is not None]
    if not asked:
        return
    limits = scenario.drive_limits
    allowed = np.array([limits.velocity, limits.acceleration])
    peaks = np.quantile(np.abs(asked).max(axis=2), UPPER if len(asked) > 1 else 1.0, axis=0)
    beyond = np.argwhere(peaks > allowed)
    if not len(beyond):
        return
    kind, drive = beyond[0]
    quantity, unit = list(UNITS.items())[kind]
    when = begins + time[int(np.argmax(np.abs(asked[0][kind, :, drive])))]
    key = f"{scenario.drive_limits_key}.{quantity}"
    likely = ", the upper end of what its noise leaves open," if len(asked) > 1 else ""
    raise InputError(
        f"{where} asks the set-point of the {DRIVES[drive]} for {peaks[kind, drive]:.3g} {unit}{likely} "
        f"near {when:.3g} s",
        allowed=f"{quantity} up to {allowed[kind, drive]:g} {unit}, as {key} says",
        remedy="give the motion more time, or fewer knots by spans"
        if len(asked) > 1
        else f"give the motion more time, or raise {key} if the drive can do more",
    )


def _demand(curve: BSpline, scenario: Scenario, time: Array) -> Array | None:
    """Velocity and acceleration of the set-points w = v + tau u (2, N, 3); none with a slack rope."""
    rows = np.hstack([each(time) for each in derivatives(curve)])
    gravity = scenario.rig.gravity
    if (rows[:, ACCELERATION + Z] <= -gravity).any() or (rows[:, Z] >= 0.0).any():
        return None
    states, inputs = states_and_inputs(rows, gravity)
    lag = scenario.rig.time_constants if scenario.control.lag_compensation else 0.0
    set_point = states[:, 1:6:2] + lag * inputs
    return np.array([set_point, np.gradient(set_point, time, axis=0)])
