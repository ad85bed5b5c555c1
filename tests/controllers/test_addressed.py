"""Controllers that the loop calls by address: the arguments of their steps, and what their commands cause."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from cranectl.model.dynamics import axis_masses, forced_accelerations
from cranectl.planning import load_scenario
from cranectl.reference import Trajectory
from cranectl.scenario import Scenario
from cranectl.simulate import Run, loops, simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from tests.conftest import PLANTS, closed_loop
from tests.controllers.own_controllers import FOLLOWING, PUSHING, giving_up, known, noting

SENSED = ("effects.sensing.angle_resolution=0.001", "effects.delay.seconds=0.004")


def path(*overrides: str) -> Scenario:
    """Three seconds along a diagonal, hoisting, and half a second at rest."""
    return load_scenario("fast-diagonal", overrides=["duration=3.5", *overrides])


def run_of(controller: object, scenario: Scenario, **how: object) -> Run:
    with known(controller) as name:  # type: ignore[arg-type]
        return simulate_run(scenario, controller=name, plant="analytic", **how)  # type: ignore[arg-type]


def test_a_controller_receives_state_reference_and_preview() -> None:
    run = run_of(noting(), path())
    seen, n = run.block("controller"), len(run.time_ns)
    assert np.array_equal(seen[:, :10], run.block("state"))
    assert not seen[:, 10:12].any(), "nothing estimates disturbances"
    for row in range(3):
        ahead = run.reference[np.minimum(np.arange(n) + row, n - 1)]
        assert np.array_equal(seen[:, 12 + 15 * row : 27 + 15 * row], ahead), (
            "after the end the last is repeated"
        )
    assert np.array_equal(seen[:, 57], np.arange(1, n + 1))


def test_load_and_error_are_recorded_of_any_law() -> None:
    run = run_of(noting(), path("initial.load_offset=[0.02,0.01,0.03]", "initial.alpha_offset=0.1"))
    assert run.block("flat_output") == pytest.approx(run.block("load")[:, :6], abs=1e-12)
    assert np.array_equal(run.block("error"), run.reference[:, :6] - run.block("flat_output"))
    assert np.abs(run.block("error")).max() > 0.1


def test_through_a_signal_path_it_is_given_what_is_measured() -> None:
    run = run_of(noting(), path(*SENSED))
    assert np.array_equal(run.block("controller")[:, :12], run.block("measurement"))
    assert run.block("controller")[-1, 10:12].any(), "estimates of disturbances"


def test_a_controller_that_measures_encoders_receives_five_readings() -> None:
    run = run_of(noting(measures="encoders"), path(*SENSED))
    readings = run.block("controller")[:, :12]
    assert readings[:, 3:5] / 0.001 == pytest.approx(np.round(readings[:, 3:5] / 0.001), abs=1e-9)
    assert readings[:, :5] == pytest.approx(run.block("state")[:, ::2], abs=1e-3)
    assert not readings[:, 5:].any()
    plain = run_of(noting(measures="encoders"), path())
    assert np.array_equal(plain.block("controller")[:, :5], plain.block("state")[:, ::2])


def test_a_controller_that_follows_set_points_receives_the_end_of_the_segment() -> None:
    scenario = path()
    run = run_of(noting(follows="set-point"), scenario)
    rows = run.block("controller")[:, 12:27]
    assert not rows[:, 3:].any()
    ends = np.unique(rows[:, :3], axis=0)
    moving = [segment for segment in scenario.reference.segments if segment.kind == "line"]
    assert np.array_equal(rows[0, :3], moving[0].to)
    assert len(ends) <= len(scenario.reference.segments) + 1
    last = Trajectory.of(scenario.reference).sample(np.array([scenario.duration]))[0, :3]
    assert np.array_equal(rows[-1, :3], last)


def test_a_slower_controller_steps_less_often_and_its_command_is_held() -> None:
    run = run_of(noting(every=5), path())
    steps = run.block("controller")[:, 57]
    assert np.array_equal(steps, np.arange(len(steps)) // 5 + 1)
    assert np.array_equal(
        run.block("controller")[:, 0], np.repeat(run.block("state")[::5, 0], 5)[: len(steps)]
    )


def test_velocities_become_what_the_drives_make_of_them() -> None:
    """w as set-point; an ideal drive gets the acceleration of a drive with the nominal lag, (w - x')/T.

    The servos feel nothing of a load so light, so they do what is recorded as commanded acceleration.
    """
    distances = []
    light = ["rig.load_mass=0.001", *(f"rig.{axis}_mass=1e6" for axis in ("bridge", "trolley", "winch"))]
    for period in (0.001, 0.0005):
        scenario = path(f"control.period={period}", f"control.physics_step={period}", *light)
        ideal, velocity = (run_of(FOLLOWING, scenario, drive=drive) for drive in ("ideal", "velocity"))
        for run in (ideal, velocity):
            assert run.block("input")[:, 3:] == pytest.approx(
                run.reference[:, 3:6] * (1.0, 1.0, -1.0), abs=1e-15
            )
        lags = ideal.block("input")[:, 3:] - ideal.block("state")[:, 1:6:2]
        accelerations = lags / scenario.rig.time_constants
        assert ideal.block("input")[:, :3] == pytest.approx(accelerations, rel=1e-12, abs=1e-12)
        accelerations = np.diff(velocity.block("state")[:, 1:6:2], axis=0) / period
        assert velocity.block("input")[:-1, :3] == pytest.approx(accelerations, rel=1e-5, abs=1e-6)
        distances.append(np.abs(ideal.load_position - velocity.load_position).max())
    assert distances[0] < 1e-3
    assert distances[1] == pytest.approx(0.5 * distances[0], rel=0.05), "held over a period, not continuous"


def test_forces_arrive_at_force_drives_and_other_drives_get_what_they_bring_about() -> None:
    """The load sinks, since only the inertia of the winch holds it."""
    distances = []
    for period in (0.001, 0.0005):
        scenario = path(f"control.period={period}", f"control.physics_step={period}")
        masses = axis_masses(scenario.rig)
        ideal, force = (run_of(PUSHING, scenario, drive=drive) for drive in ("ideal", "force"))
        forces = force.reference[:, 3:6] * (1.0, 1.0, -1.0)
        assert force.block("command")[:, :3] == pytest.approx(forces, rel=1e-12, abs=1e-12)
        for run in (ideal, force):
            rows = zip(run.block("state"), run.reference[:, 3:6] * (1.0, 1.0, -1.0), strict=True)
            expected = np.array([forced_accelerations(masses, state, *received) for state, received in rows])
            assert run.block("input")[:, :3] == pytest.approx(expected, rel=1e-12, abs=1e-12)
        n = min(len(ideal.time_ns), len(force.time_ns), round(0.3 / period))
        distances.append(np.abs(ideal.load_position[:n] - force.load_position[:n]).max())
    assert 0.0 < distances[0] < 1e-3
    assert distances[1] < 0.6 * distances[0], "held over a period, not continuous"


@pytest.mark.parametrize(
    ("controller", "status"),
    [
        (giving_up(3), RunStatus.ANGLE_SINGULAR),
        (giving_up(42), RunStatus.CONTROLLER_FAILED),
        (giving_up(-1), RunStatus.CONTROLLER_FAILED),
        (giving_up(0, np.nan), RunStatus.CONTROLLER_FAILED),
        (giving_up(0, np.inf), RunStatus.CONTROLLER_FAILED),
    ],
)
def test_a_controller_that_fails_ends_the_run(controller: object, status: RunStatus) -> None:
    run = run_of(controller, path())
    assert (run.status, len(run.time_ns)) == (status, 10)
    assert np.isfinite(run.table).all()


def slip(_parameters, measured, _reference, _memory, command):  # type: ignore[no-untyped-def]
    command[0] = stifness * measured[0]  # type: ignore[name-defined] # noqa: F821
    return 0


def mix(_parameters, measured, _reference, _memory, command):  # type: ignore[no-untyped-def]
    command[0] = np.dot(measured, "a")
    return 0


@pytest.mark.parametrize(
    ("step", "reason"),
    [(slip, r"cannot be compiled: .*'stifness' is not defined"), (mix, r"found for signature: dot\(float64")],
)
def test_a_step_that_cannot_be_compiled_is_refused_with_its_line(
    step: Callable[..., int], reason: str
) -> None:
    with pytest.raises(InputError, match=reason) as caught:
        run_of(replace(FOLLOWING, step=step), path())
    assert f"{Path(__file__).name}:{step.__code__.co_firstlineno + 1}" in caught.value.remedy


def test_one_loop_serves_every_controller_and_plant() -> None:
    """The loop is compiled once for all controllers and plants.

    A signal path does, and so do the forces that the loop makes for drives.
    """
    loop = loops.shared_loop()
    for controller in (noting(), noting(every=3, measures="encoders"), giving_up(1), FOLLOWING, PUSHING):
        run_of(controller, path())
    for name, plant in product(("lqr", "pole-placement+hinf", "pid"), PLANTS):
        simulate_run(path(), controller=name, plant=plant)
    parts = ("SignalPath(", "AxisMasses(")
    kinds = {tuple(str(signature).count(part) for part in parts) for signature in loop.signatures}  # type: ignore[attr-defined]
    assert len(loop.signatures) == len(kinds)  # type: ignore[attr-defined]


def test_while_the_rope_is_slack_the_controller_waits() -> None:
    recovering = "effects.rope.on_slack=recover"
    run = closed_loop("slack-rope", "lqr-integral", "mujoco", "velocity", recovering)
    slack = np.flatnonzero(run.tension[:-1] <= 0.0)[:-1] + 1
    assert len(slack), "it goes slack"
    states = run.block("controller")
    assert np.array_equal(states[slack], states[slack - 1])
    assert run.block("error")[slack] == pytest.approx(
        run.reference[slack, :6] - run.block("flat_output")[slack]
    )
