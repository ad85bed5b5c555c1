"""Set-points lead by the lag of the drives, and drives brake while the rope is slack."""

import numpy as np
import pytest

from cranectl.scenario.load import default_scenario
from cranectl.simulate.actuation import (
    BRAKING,
    actuate,
    brake,
    initial_integral,
    make_actuation,
    take_set_points,
)

START = np.array([1.0, 0.1, 0.7, 0.2, 0.6, 0.3, 0.0, 0.0, 0.0, 0.0])
PERIOD = 1e-3


def test_set_points_integrate_the_accelerations_and_lead_by_the_lag() -> None:
    scenario = default_scenario(overrides=["rig.trolley_time_constant=0.05"])
    actuation, integral = make_actuation(scenario), initial_integral(START)
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
    assert not make_actuation(scenario).lag.any()


def test_drives_brake_to_rest() -> None:
    actuation, integral, command = make_actuation(default_scenario()), initial_integral(START), np.zeros(6)
    for _ in range(round(5.0 * BRAKING / PERIOD)):
        brake(integral, command)
        actuate(actuation, integral, command)
    expected = np.array([0.1, 0.2, 0.3]) * (1.0 - PERIOD / BRAKING) ** round(5.0 * BRAKING / PERIOD)
    assert integral == pytest.approx(expected, rel=1e-12)


def test_velocities_that_a_law_commands_are_the_set_points() -> None:
    """The recorded acceleration is that of the drives' lag, and braking begins at the set-points."""
    scenario = default_scenario(overrides=["rig.trolley_time_constant=0.05"])
    integral, command = initial_integral(START), np.array([0.3, -0.2, 0.1, 0.0, 0.0, 0.0])
    take_set_points(make_actuation(scenario), integral, START, command)
    assert command[3:].tolist() == [0.3, -0.2, 0.1]
    assert command[:3] == pytest.approx([0.2 / 0.02, -0.4 / 0.05, -0.2 / 0.02], rel=1e-14)
    assert integral.tolist() == [0.3, -0.2, 0.1]
