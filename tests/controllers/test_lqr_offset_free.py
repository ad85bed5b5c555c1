"""LQR about the path of a crane that leans: its poles, its ellipsoids, no offset, no wind-up."""

import itertools

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.controllers.lqr_offset_free import (
    LEVEL,
    LEVELS,
    LQR_OFFSET_FREE,
    MEMORY,
    PARAMETERS,
    STATES,
    A,
    B,
    feedback,
    frequencies,
    levels,
    prepare,
    regulator,
)
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.planning import load_scenario
from cranectl.signals import BRIDGE_RATE
from cranectl.simulate import PreparedController
from cranectl.support.arrays import Array
from cranectl.support.documents import TOML
from cranectl.support.errors import InputError
from tests.benchmark.linear_loop import GRAVITY, PERIOD, loop_matrix, nominal_at
from tests.conftest import ROOT, closed_loop

LAW = LQR_OFFSET_FREE.name
SENSED = ["effects.sensing={}", "effects.delay.seconds=0.004"]
FAR_OFF = ["effects.limits={}", "initial.load_offset=[0.3, 0.0, 0.0]", "disturbances=[]"]


def polynomial_error(roots: Array, wanted: Array) -> float:
    """Return the largest relative error of the characteristic polynomial; equal poles are ill-conditioned."""
    wanted_polynomial, polynomial = np.poly(wanted).real, np.poly(roots).real
    return float(np.abs(polynomial / wanted_polynomial - 1.0).max())


@pytest.mark.parametrize("length", [0.2, 0.8, 1.4])
def test_the_poles_of_the_loop_are_those_of_regulator_observer_and_rope(length: float) -> None:
    nominal = nominal_at(LQR_OFFSET_FREE, length)
    observer_pole, rope_pole = frequencies(nominal)
    regulated = np.linalg.eigvals(A - B @ levels(nominal)[-1:, :STATES]) * np.sqrt(GRAVITY / length)
    poles = (
        np.log(np.linalg.eigvals(loop_matrix(LQR_OFFSET_FREE, length, MEMORY.begun, MEMORY.leaning))) / PERIOD
    )
    wanted = np.array([*regulated, *regulated, *[-observer_pole] * 6, *[-rope_pole] * 2])
    assert polynomial_error(poles, wanted) < 0.04  # of what the period does to them
    assert poles.real.max() < -1.0


@pytest.mark.parametrize("error_weight", [1e-12, 1e-6, 5.0, 1e6])
@pytest.mark.parametrize("rate_weight", [1e-12, 1e-6, 1.0, 1e6])
def test_its_regulator_solves_the_riccati_equation(error_weight: float, rate_weight: float) -> None:
    """The stabilising solution is the only one that is positive definite."""
    gain, cost = regulator(error_weight, rate_weight)
    weights = np.diag([0.0, 0.0, error_weight, rate_weight])
    residual = A.T @ cost + cost @ A - np.outer(gain, gain) + weights
    assert np.abs(residual).max() < 1e-14 * np.abs(cost).max()
    assert (gain == cost[1]).all()
    assert (cost == cost.T).all()
    assert np.linalg.eigvalsh(cost).min() > 0.0
    assert np.linalg.eigvals(A - B @ gain[np.newaxis]).real.max() < 0.0


def test_its_linearisation_has_the_same_poles() -> None:
    scenario = load_scenario("fixed-position")
    for linear in PreparedController.near_rest(scenario, ALL_CONTROLLERS.design(LAW, scenario)):
        nominal = nominal_at(LQR_OFFSET_FREE, linear.rope_length)
        scale = np.sqrt(GRAVITY / linear.rope_length)
        regulated = np.linalg.eigvals(A - B @ levels(nominal)[-1:, :STATES]) * scale
        wanted = np.array([*regulated, *[-frequencies(nominal)[0]] * 3])
        poles = np.linalg.eigvals(linear.a - linear.b @ linear.gain[np.newaxis])
        assert polynomial_error(poles, wanted) < 0.02


def test_its_command_stays_within_the_limit_on_the_whole_ellipsoid() -> None:
    """Levels are nested; u_max is met on the boundary; K x changes without steps; P never grows."""
    nominal = nominal_at(LQR_OFFSET_FREE, 0.8)
    parameters, table = prepare(nominal)[0], levels(nominal)
    ellipsoids = table[:, LEVEL.ellipsoid :].reshape(LEVELS, STATES, STATES)
    for small, large in itertools.pairwise(ellipsoids):
        assert np.linalg.eigvalsh(large - small).min() > 0.0
    random = np.random.default_rng(1)
    for row, ellipsoid in zip(table, ellipsoids, strict=True):
        gain, loop = row[:STATES], A - B @ row[np.newaxis, :STATES]
        assert np.linalg.eigvalsh(ellipsoid @ loop + loop.T @ ellipsoid).max() < 1e-12
        assert gain @ np.linalg.solve(ellipsoid, gain) == pytest.approx(1.0, rel=1e-6)
    for state in random.standard_normal((300, STATES)) * 10.0 ** random.uniform(-4, 1, (300, 1)):
        for limit in (0.02, 0.4):
            if np.sqrt(state @ ellipsoids[0] @ state) <= limit:
                assert abs(feedback(parameters, state, limit)) <= limit * (1.0 + 1e-12)
            if np.sqrt(state @ ellipsoids[-1] @ state) <= limit:
                assert feedback(parameters, state, limit) == pytest.approx(table[-1, :STATES] @ state)
    direction = np.array([0.3, -0.2, 0.5, 0.1])
    values = np.array([feedback(parameters, k * direction, 0.1) for k in np.geomspace(1e-3, 3.0, 4000)])
    assert np.abs(np.diff(values)).max() < 2e-3
    assert len(parameters) == PARAMETERS.levels + LEVELS * LEVEL.size


@pytest.mark.parametrize(
    ("plant", "drive", "effects"),
    [
        ("analytic", "ideal", []),
        ("mujoco", "velocity", []),
        ("mujoco", "velocity", ["effects.installation={tilt=[0.01, -0.005]}", *SENSED]),
    ],
)
def test_standing_pushes_and_tilted_rails_leave_no_error(plant: str, drive: str, effects: list[str]) -> None:
    run = closed_loop("fixed-position", LAW, plant, drive, *effects)
    late = run.time > 22.0
    assert np.abs(run.block("disturbance")[-1]).min() > 0.1
    error, push = run.block("error")[late, :3].mean(axis=0), run.block("controller")[late].mean(axis=0)
    assert np.linalg.norm(error) < (2e-4 if effects else 1e-5)
    assert np.abs(push).min() > 0.1


@pytest.mark.parametrize("numbers", ["defaults", "tuned"])
def test_it_is_certified_with_delay_observer_and_structure(
    numbers: str, capsys: pytest.CaptureFixture[str]
) -> None:
    lengths = (0.3, 0.5, 0.7, 1.0, 1.3)
    effects = [f"effects.{name}={{}}" for name in ("sensing", "rope", "body", "frame")]
    if numbers == "tuned":
        tuned = TOML.read(ROOT / "validation" / "benchmark" / "tuned" / f"{LAW}.toml")["parameters"]
        effects += [f"{key}={value}" for key, value in tuned.items()]
    options = [f"--rope-length={length}" for length in lengths] + [f"--set={effect}" for effect in effects]
    assert main(["certify", LAW, "--delay", "0.008", *options]) == 0
    output = capsys.readouterr().out
    assert f"of {len(lengths)} points certified" in output
    assert "truly unstable (u): 0" in output


@pytest.mark.parametrize("effects", [[], SENSED])
def test_within_the_limits_of_weak_drives_nothing_winds_up(effects: list[str]) -> None:
    """Limits are a thirteenth of the usual acceleration, and the load starts half a rope length off."""
    weak = "rig.effects.limits.acceleration=[0.3, 0.3, 6.0]"
    run = closed_loop("fixed-position", LAW, "mujoco", "velocity", weak, *FAR_OFF, "duration=6.0", *effects)
    acceleration = np.abs(run.block("input")[:, 0])
    assert 0.1 < acceleration.max() < 0.3
    assert np.abs(run.block("controller")).max() < 0.05  # nothing pushes, nor does it seem so
    assert np.linalg.norm(run.block("error")[-1, :3]) < 1e-3


@pytest.mark.parametrize(("law", "least", "most"), [(LAW, 0.0, 1e-3), ("lqr-integral", 0.1, 0.3)])
def test_it_takes_no_saturation_of_a_drive_for_a_disturbance(law: str, least: float, most: float) -> None:
    """At a tenth of the usual speed, with the load 0.3 m off, drives saturate and integrals wind up."""
    slow = "rig.effects.limits.velocity=[0.1, 0.1, 0.6]"
    run = closed_loop("fixed-position", law, "mujoco", "velocity", slow, *FAR_OFF, "duration=5.0", *SENSED)
    assert np.abs(run.block("state")[:, BRIDGE_RATE]).max() == pytest.approx(0.1, rel=0.02)
    assert least <= np.linalg.norm(run.block("error")[-1, :3]) < most
    if law == LAW:
        assert np.abs(run.block("controller")).max() < 2e-3  # nothing pushes, nor does it seem so


def test_sampling_that_it_cannot_stand_is_refused() -> None:
    with pytest.raises(InputError, match="'lqr-offset-free' is unstable when sampled"):
        prepare(nominal_at(LQR_OFFSET_FREE, 0.8, error_weight=1e6, rate_weight=1e6)._replace(period=0.05))


def test_an_estimate_begins_with_the_load_as_it_is_measured() -> None:
    offset = ["initial.load_offset=[0.05, -0.02, 0.0]", "disturbances=[]", "duration=0.01"]
    run = closed_loop("fixed-position", LAW, "analytic", "ideal", *offset)
    assert np.abs(run.block("controller")).max() < 1e-6
    assert MEMORY.estimate == 0
