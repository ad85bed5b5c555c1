"""A rope that goes slack ends the run, or the run recovers, as the scenario says."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from cranectl.controllers.flat import MIN_TENSION
from cranectl.log.events import events
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from cranectl.simulate.actuation import BRAKING
from cranectl.status import RunStatus

UPDRAUGHT = ["effects.wind.mean=[0.0,0.0,80.0]", "effects.wind.gust=0.0"]  # 14 N on a load of 9.8 N


def run(scenario: str, mode: str, *overrides: str, drive: str = "velocity", compiled: bool = True) -> Run:
    chosen = load_scenario(
        scenario, overrides=[f"effects.rope.on_slack='{mode}'", "expected='completed'", *overrides]
    )
    return simulate_run(chosen, plant="mujoco", drive=drive, compiled=compiled)


def test_a_tracker_that_is_to_recover_keeps_the_rope_taut() -> None:
    """The reference falls almost freely and the load starts 0.34 m too high."""
    assert run("slack-rope", "stop").status == RunStatus.SLACK_ROPE
    recovered = run("slack-rope", "recover", "duration=12.0")
    assert recovered.status == RunStatus.COMPLETED
    assert recovered.signal("load.rope_tension").min() > 0.0
    least = (MIN_TENSION - 1.0) * 9.81
    assert recovered.signal("controller.zeta").min() >= least * (1.0 + 1e-9)
    final = recovered.reference[-1, :3] - recovered.load_position[-1]
    assert np.linalg.norm(final) < 1e-3


@pytest.mark.parametrize("compiled", [True, False])
def test_a_load_that_is_lifted_off_its_rope(compiled: bool) -> None:
    stopped = run("fixed-position", "stop", *UPDRAUGHT, compiled=compiled)
    assert stopped.status == RunStatus.SLACK_ROPE
    assert stopped.end_ns < 20_000_000
    short = ["duration=0.4", "disturbances=[]", "effects.rope.mass=0.0"]
    flown = run("fixed-position", "recover", *UPDRAUGHT, *short, compiled=compiled)
    assert flown.status == RunStatus.COMPLETED
    slack = flown.signal("load.rope_tension") <= 0.0
    assert_array_equal(slack[20:], np.ones(len(slack) - 20, dtype=bool))
    speed = flown.signal("load.load_z_dot")[100:]
    drag = 0.5 * 1.2 * 0.0037 * (80.0 - speed) ** 2
    # The sensors tell the speed one step late, so the drag of the step before counts.
    assert_allclose(np.diff(speed)[1:] * 1e3, (drag - 9.81)[1:-1], rtol=2e-3)


def test_the_drives_brake_while_the_rope_is_slack() -> None:
    moving = run("slack-rope", "recover", *UPDRAUGHT, "duration=1.0")
    slack = moving.signal("load.rope_tension") <= 0.0
    first = int(np.argmax(slack)) + 1
    setpoints = moving.block("input")[first:, 3:]
    accelerations = moving.block("input")[first:, :3]
    assert slack[first:].all()
    assert_allclose(accelerations[1:], accelerations[:-1] * (1.0 - 1e-3 / BRAKING), rtol=1e-9, atol=1e-15)
    assert np.abs(setpoints[-1]).max() < 1e-3


def test_while_the_rope_is_slack_forces_brake_the_drives_alone() -> None:
    """So heavy a winch does not follow the load."""
    heavy = "effects.rope.mass=0.0", "rig.winch_mass=20.0", "duration=1.0"
    pushed = run("slack-rope", "recover", *UPDRAUGHT, *heavy, drive="force")
    slack = pushed.tension <= 0.0
    first = int(np.argmax(slack)) + 2
    assert slack[first:].all()
    rates = pushed.block("state")[first:, 1:6:2]
    assert np.abs(rates[0]).max() > 1e-3
    assert_allclose(np.diff(rates, axis=0), rates[:-1] * -1e-3 / BRAKING, rtol=1e-6, atol=1e-12)


def test_slackness_is_a_line_in_the_log() -> None:
    lines = [event.message for event in events(run("fixed-position", "recover", *UPDRAUGHT))]
    assert lines.count("the rope goes slack") == 1
