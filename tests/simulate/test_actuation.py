"""Set-points lead by the lag of the drives, and drives brake while the rope is slack."""

import numpy as np
import pytest

from cranectl.scenario import Scenario
from cranectl.scenario.load import default_scenario
from cranectl.simulate.actuation import (
    BRAKING,
    Actuation,
    UnloadedDrives,
    actuate,
    brake,
    follow_set_points,
    initial_integral,
    take_set_points,
)

START = np.array([1.0, 0.1, 0.7, 0.2, 0.6, 0.3, 0.0, 0.0, 0.0, 0.0])
PERIOD = 1e-3


def test_set_points_integrate_the_accelerations_and_lead_by_the_lag() -> None:
    scenario = default_scenario(overrides=["rig.trolley_time_constant=0.05"])
    actuation, integral = Actuation.of(scenario), initial_integral(START)
    assert actuation.lag.tolist() == [0.02, 0.05, 0.02]
    assert integral.tolist() == [0.1, 0.2, 0.3]
    command = np.array([1.0, -2.0, 3.0, 0.0, 0.0, 0.0])
    actuate(actuation, integral, command)
    assert command[:3].tolist() == [1.0, -2.0, 3.0]
    assert command[3:] == pytest.approx([0.1 + 0.02, 0.2 - 0.1, 0.3 + 0.06], rel=1e-14)
    assert integral == pytest.approx([0.101, 0.198, 0.303], rel=1e-14)
    assert START[1] == 0.1, "the start of the run is nobody's memory"


def test_without_compensation_there_is_no_lead() -> None:
    scenario = default_scenario(overrides=["control.lag_compensation=false"])
    assert not Actuation.of(scenario).lag.any()


def test_drives_brake_to_rest() -> None:
    actuation, integral, command = Actuation.of(default_scenario()), initial_integral(START), np.zeros(6)
    for _ in range(round(5.0 * BRAKING / PERIOD)):
        brake(integral, command)
        actuate(actuation, integral, command)
    expected = np.array([0.1, 0.2, 0.3]) * (1.0 - PERIOD / BRAKING) ** round(5.0 * BRAKING / PERIOD)
    assert integral == pytest.approx(expected, rel=1e-12)


def test_velocities_that_a_law_commands_are_the_set_points() -> None:
    """The recorded acceleration is that of the drives' lag, and braking begins at the set-points."""
    scenario = default_scenario(overrides=["rig.trolley_time_constant=0.05"])
    integral, command = initial_integral(START), np.array([0.3, -0.2, 0.1, 0.0, 0.0, 0.0])
    take_set_points(Actuation.of(scenario), integral, START, command)
    assert command[3:].tolist() == [0.3, -0.2, 0.1]
    assert command[:3] == pytest.approx([0.2 / 0.02, -0.4 / 0.05, -0.2 / 0.02], rel=1e-14)
    assert integral.tolist() == [0.3, -0.2, 0.1]


@pytest.mark.parametrize(("period", "lag"), [(1e-3, 0.02), (1e-3, 0.5), (1e-2, 0.4)])
def test_set_points_that_lead_for_an_acceleration_ask_for_it(period: float, lag: float) -> None:
    """It makes no difference whether a controller commands accelerations, or the set-points for them."""
    scenario = scenario_with(period, lag)
    actuation, integral = Actuation.of(scenario), initial_integral(START)
    drives, time = UnloadedDrives.of(scenario, "velocity", START), period * np.arange(round(2.0 / period))
    accelerations = np.column_stack([np.sin(3.0 * time), np.sign(np.cos(5.0 * time)), 0.2 * time])
    asked = []
    for acceleration in accelerations:
        command = np.array([*acceleration, 0.0, 0.0, 0.0])
        actuate(actuation, integral, command)
        command[:3] = np.nan
        follow_set_points(drives, True, command)
        asked.append(command[:3])
    assert np.array(asked) == pytest.approx(accelerations, abs=2.0 * period / lag)


@pytest.mark.parametrize("lag", [1e-3, 0.5])
def test_set_points_on_a_ramp_ask_for_its_slope(lag: float) -> None:
    """They do so at once with drives far faster than a period, and after the lag with others."""
    period, slope = 1e-2, np.array([0.3, -0.2, 1e-3])
    drives = UnloadedDrives.of(scenario_with(period, lag), "velocity", START)
    for k in range(1, 301):
        command = np.array([np.nan] * 3 + [*(START[1:6:2] + period * k * slope)])
        follow_set_points(drives, True, command)
        reached = 1.0 - np.exp(-period * k / lag)
        assert command[:3] == pytest.approx(reached * slope, rel=1e-9)
        assert drives.velocity == pytest.approx(command[3:] - lag * command[:3], abs=0.5 * period)


def test_commanded_accelerations_stay_as_they_are() -> None:
    drives = UnloadedDrives.of(scenario_with(1e-3, 0.02), "velocity", START)
    command = np.array([1.0, 2.0, 3.0, 9.0, 9.0, 9.0])
    follow_set_points(drives, False, command)
    assert command.tolist() == [1.0, 2.0, 3.0, 9.0, 9.0, 9.0]
    assert (drives.velocity > START[1:6:2]).all(), "a controller that takes over finds them where they are"
    assert START[1] == 0.1, "the start of the run is nobody's memory"


def scenario_with(period: float, lag: float) -> Scenario:
    """Return a scenario with this control period and lag of all drives [s]."""
    lags = [f"rig.{axis}_time_constant={lag}" for axis in ("bridge", "trolley", "winch")]
    return default_scenario(overrides=[f"control.period={period}", "control.physics_step=0.0005", *lags])
