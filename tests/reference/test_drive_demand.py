"""Motions beyond the drives are refused, measured by pure hoisting, where the rope's length is -z."""

from pathlib import Path

import numpy as np
import pytest

from cranectl.reference.fitting import interpolate_points
from cranectl.support.errors import InputError
from tests.reference.recordings import scenario_of

HEIGHTS, TIMES = [-1.1, -0.8, -0.4], [0.0, 2.6, 3.4]  # uneven, so that the sign of the lag shows
HOISTING = f"kind = 'waypoints'\npoints = {[[0.4, 0.5, z] for z in HEIGHTS]}\ntimes = {TIMES}\n"
LAG = 0.2  # [s]; large, to be seen


def peaks(lag: float) -> tuple[float, float]:
    """Return peak velocity and acceleration of the winch's set-point w = v + tau u."""
    z, _ = interpolate_points(np.array(TIMES), np.array([[0.0, 0.0, z] for z in HEIGHTS]))
    _, velocity, acceleration, jerk = (
        z.derivative(order)(np.linspace(0.0, TIMES[-1], 3401))[:, 2] for order in range(4)
    )
    return np.abs(velocity + lag * acceleration).max(), np.abs(acceleration + lag * jerk).max()


@pytest.mark.parametrize("compensated", [True, False])
@pytest.mark.parametrize("quantity", ["velocity", "acceleration"])
def test_set_points_up_to_the_drives_limits_are_accepted_and_beyond_refused(
    tmp_path: Path, quantity: str, compensated: bool
) -> None:
    index = ["velocity", "acceleration"].index(quantity)
    assert peaks(-LAG)[index] != pytest.approx(peaks(LAG)[index], rel=0.003)
    free, peak = [100.0, 100.0], float(peaks(LAG if compensated else 0.0)[index])
    common = {
        "start": [0.4, 0.5, HEIGHTS[0]],
        "rig.winch_time_constant": LAG,
        "control.lag_compensation": str(compensated).lower(),
        "effects.limits.velocity": [100.0, 100.0, 100.0],
        "effects.limits.acceleration": [100.0, 100.0, 100.0],
    }
    limit = f"effects.limits.{quantity}"
    # Peaks are searched at control samples; between those they differ by far less than 0.1 %.
    assert scenario_of(tmp_path, HOISTING, **{**common, limit: [*free, 1.001 * peak]}).reference.planned
    with pytest.raises(InputError) as error:
        scenario_of(tmp_path, HOISTING, **{**common, limit: [*free, 0.999 * peak]})
    assert f"the set-point of the rope for {peak:.3g} m/s" in error.value.found
    assert error.value.allowed.startswith(quantity)


def test_without_the_effect_the_limits_of_the_rig_count(tmp_path: Path) -> None:
    changes = {
        "start": [0.4, 0.5, HEIGHTS[0]],
        "rig.effects.limits.velocity": [9.0, 9.0, 9.0],
        "rig.effects.limits.acceleration": [9.0, 9.0, 0.1],
    }
    with pytest.raises(InputError) as error:
        scenario_of(tmp_path, HOISTING, **changes)
    assert error.value.allowed.startswith("acceleration up to 0.1 m/s²")
