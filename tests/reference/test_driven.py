"""The filter of velocity commands: its response, stopping point, box and limits."""

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import gammainc

from cranectl.model.flatness import states_and_inputs
from cranectl.planning import load_scenario
from cranectl.planning.limits import limits_of
from cranectl.reference import Trajectory
from cranectl.reference.driven import DrivenPath, HandLimits
from cranectl.scenario import ReferenceSettings
from cranectl.tools.live.hand_limits import DrivingBounds, _kernel_norm, hand_limits
from validation.proofs import random_joystick

PERIOD, COARSE = 1e-3, 1e-2
UNBOUNDED = np.full(3, 1e3)
CRANES = {"laboratory": None, "workshop": "bridge-crane", "quay": "harbour-crane"}
UNLIMITED = HandLimits(3.7, np.array([0.45, 0.45, 0.27]), -UNBOUNDED, UNBOUNDED)  # the box is far away


def hold_commands(*commands: tuple[float, ...], samples: int) -> np.ndarray:
    """Return velocity commands, each held for `samples`, as `drive` takes them."""
    return np.repeat([(0.0, *command) for command in commands], samples, axis=0)


def respond(commands: np.ndarray) -> np.ndarray:
    """Return the motion of an unlimited load from rest at the origin, (N, 5, 3)."""
    return UNLIMITED.derivatives(UNLIMITED.drive(PERIOD, HandLimits.rest_state(np.zeros(3)), commands))


def bang_bang(kernel: np.ndarray) -> np.ndarray:
    """Return the command of size 1 that drives the kernel's convolution to its L1 norm."""
    return np.where(kernel[::-1] >= 0.0, 1.0, -1.0)


def test_the_step_response_is_the_closed_form() -> None:
    """Four equal lags are Erlang's distribution: z' = v P(4, omega t), P the regularised gamma function."""
    v, omega, t = 0.4, UNLIMITED.bandwidth, PERIOD * np.arange(4000)
    motion = respond(hold_commands((v, 0.0, -0.2), samples=4000))
    rows = motion[:, :, 0]
    a = omega * t
    k = omega * np.exp(-a) * a**3 / 6.0
    k1 = omega**2 * np.exp(-a) * (a**2 / 2.0 - a**3 / 6.0)
    k2 = omega**3 * np.exp(-a) * (a - a**2 + a**3 / 6.0)
    assert rows[:, 0] == pytest.approx(v * (t * gammainc(4, a) - 4.0 / omega * gammainc(5, a)), abs=1e-12)
    assert rows[:, 1] == pytest.approx(v * gammainc(4, a), abs=1e-12)
    for order, expected in ((2, k), (3, k1), (4, k2)):
        assert rows[:, order] == pytest.approx(v * expected, abs=1e-11)
    assert not motion[:, :, 1].any()


def test_a_released_load_comes_to_rest_at_its_stopping_point() -> None:
    random, period = np.random.default_rng(1), 0.03
    for _ in range(20):
        state = HandLimits.rest_state(random.uniform(-1.0, 1.0, 3))
        UNLIMITED.drive(period, state, hold_commands(*random.uniform(-0.4, 0.4, (5, 3)), samples=10))
        predicted = UNLIMITED.stopping_points(state[np.newaxis])[0]
        UNLIMITED.drive(period, state, hold_commands((0.0, 0.0, 0.0), samples=400))
        assert state[:, 0] == pytest.approx(predicted, abs=1e-12)
        assert np.abs(state[:, 1:]).max() < 1e-12


@pytest.mark.parametrize(
    ("order", "mu"), [*itertools.product((0, 1, 2), (0.0, 0.7, 2.0)), (3, 0.0), (4, 0.0)]
)
def test_the_norms_are_those_of_the_kernel(order: int, mu: float) -> None:
    """Compare with quadrature of k + mu k'', plus its jump at 0; the kernel is not negative up to mu = 2."""
    t = np.linspace(0.0, 60.0, 600_001)
    k = [
        np.polynomial.Polynomial(c)(t) * np.exp(-t)
        for c in ([0, 0, 0, 1 / 6], [0, 0, 1 / 2, -1 / 6], [0, 1, -1, 1 / 6], [1, -3, 3 / 2, -1 / 6])
    ] + [np.polynomial.Polynomial([-4, 6, -2, 1 / 6])(t) * np.exp(-t)]
    kernel = k[order] + (mu * k[order + 2] if mu else 0.0)
    jump = {2: mu, 4: 1.0}.get(order, 0.0)
    assert _kernel_norm(order, mu) == pytest.approx(np.trapezoid(np.abs(kernel), t) + jump, abs=1e-6)
    if order == 0:
        assert kernel.min() >= -1e-15
        assert (k[0] + 2.01 * k[2]).min() < 0.0


HARD_CRANES = {  # bandwidth, speed, drop: cranes whose rope motion contributes most
    "hoisted fast": (2.0, (0.2, 0.2, 4.0), 1.0),
    "swung far": (1.5, (3.0, 3.0, 0.01), 8.0),
}


@pytest.mark.parametrize("crane", [*CRANES, *HARD_CRANES])
def test_bounds_hold_under_the_worst_reversals(crane: str) -> None:
    """The worst commands for bridge and trolley, while the rope is hoisted or paid out at full speed."""
    gravity = 9.81
    if crane in HARD_CRANES:
        bandwidth, speed, drop = HARD_CRANES[crane]
        free = HandLimits(bandwidth, np.array(speed), -UNBOUNDED, UNBOUNDED)
    else:
        limits = hand_limits(load_scenario("fixed-position", rig=CRANES[crane]))
        free, drop = HandLimits(limits.bandwidth, limits.speed, -UNBOUNDED, UNBOUNDED), -limits.low[2]
    limits, period = free, 0.02 / free.bandwidth
    bound = DrivingBounds(free.bandwidth, free.speed, drop, gravity)
    samples = 1000
    impulse = np.zeros((samples, 4))
    impulse[0, 1:] = 1.0
    kernels = free.derivatives(free.drive(period, HandLimits.rest_state(np.zeros(3)), impulse))[1:, :, 0]
    peaks = np.zeros((3, 2))
    for lead, order, hoist, sign in itertools.product(
        (0.0, bound.overshoot), (1, 2), (-1.0, 0.0, 1.0), (1, -1)
    ):
        paid_out = -hoist * limits.speed[2] / gravity  # lambda'
        kernel = kernels[:, order] + lead / limits.bandwidth**2 * kernels[:, order + 2]
        kernel += order * paid_out * kernels[:, order + 1]
        requests = np.zeros((samples, 4))
        requests[:-1, 1:] = np.outer(sign * bang_bang(kernel), limits.speed)
        requests[:, 3] = hoist * limits.speed[2]
        travel = hoist * limits.speed[2] * ((samples - 1) * period - 4.0 / limits.bandwidth)
        start = np.array([0.0, 0.0, -drop - travel])  # at the end the rope is as long as it may be
        rows = free.derivatives(free.drive(period, HandLimits.rest_state(start), requests))
        rows = rows[-drop - 1e-9 <= rows[:, 0, 2]]
        rows = rows[rows[:, 0, 2] < 0.0]
        states, inputs = states_and_inputs(rows.reshape(-1, 15), gravity)
        peaks[:, 0] = np.maximum(peaks[:, 0], np.abs(states[:, 1:6:2]).max(axis=0))
        peaks[:, 1] = np.maximum(peaks[:, 1], np.abs(inputs).max(axis=0))
    allowed = np.array(bound.joints)[:, :2]
    assert (peaks <= allowed * (1.0 + 1e-12)).all()
    if crane in CRANES:
        assert (peaks[:2] > 0.7 * allowed[:2]).all(), "the bounds are not conservative by more than 30 %"


@pytest.mark.parametrize(
    ("override", "share"),
    [
        (
            "rig.trolley_time_constant=0.5 rig.effects.limits.acceleration=[1e9,1e9,1e9]",
            lambda bound, kept: (bound.joints[1][0] + 0.5 * bound.joints[1][1]) / kept.velocity[1],
        ),
        ("planning.lean=0.05", lambda bound, kept: bound.slope / kept.lean),
        ("planning.jerk=[9.0,1e9,1e9]", lambda bound, kept: bound.joints[0][2] / kept.jerk[0]),
        ("planning.jerk=[1e9,1e9,2.0]", lambda bound, kept: bound.joints[2][2] / kept.jerk[2]),
        (
            "planning.tension=[0.97,2.0]",
            lambda bound, kept: (9.81 - bound.min_gravity) / (9.81 - kept.tension[0]),
        ),
        (
            "planning.tension=[0.2,1.03]",
            lambda bound, kept: bound.rope_factor[0] * (2.0 * 9.81 - bound.min_gravity) / kept.tension[1],
        ),
        (
            "rig.effects.limits.acceleration=[4.0,0.6,6.0]",
            lambda bound, kept: (bound.joints[1][1] + 0.02 * bound.joints[1][2]) / kept.acceleration[1],
        ),
    ],
)
def test_each_limit_can_be_the_active_one(override: str, share: Callable) -> None:
    scenario = load_scenario("fixed-position", overrides=override.split())
    limits = hand_limits(scenario)
    assert limits.bandwidth < hand_limits(load_scenario("fixed-position")).bandwidth
    bound = DrivingBounds(limits.bandwidth, limits.speed, scenario.rig.rope_range[1] - 0.05, 9.81)
    assert share(bound, limits_of(scenario)) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("speed_up", "overshoots"), [(1.0, False), (1.15, True)])
def test_the_bridge_overshoots_the_end_of_the_rig_only_with_a_faster_filter(
    speed_up: float, overshoots: bool
) -> None:
    """Drive away from the end of the rig and back to it, on the longest rope."""
    scenario = load_scenario("fixed-position")
    limits = hand_limits(scenario)
    filtered = HandLimits(speed_up * limits.bandwidth, limits.speed, limits.low, limits.high)
    over = []
    for samples in (100, 200, 400, 800):
        state = HandLimits.rest_state(np.array([limits.high[0], 0.7, limits.low[2]]))
        commands = [(-limits.speed[0], 0.0, 0.0), *[(limits.speed[0], 0.0, 0.0)] * 4]
        rows = filtered.derivatives(filtered.drive(PERIOD, state, hold_commands(*commands, samples=samples)))
        states, _ = states_and_inputs(rows.reshape(-1, 15), scenario.rig.gravity)
        over.append((states[:, 0] - limits.high[0]).max())
    assert max(over) > 1e-4 if overshoots else max(over) <= 1e-12


@pytest.mark.slow
def test_random_commands_stay_inside_the_limits() -> None:
    """50 minutes at a joystick with a new seed for every commit; the message contains it."""
    seed = random_joystick.commit()
    for scenario in itertools.islice(random_joystick.random_drives(seed), 50):
        usage = random_joystick.limit_usage(scenario)
        assert max(usage.values()) <= 1.0 + random_joystick.ALLOWED_EXCESS, (seed, scenario.name, usage)


@pytest.mark.parametrize("k", range(4))
def test_plants_agree_under_random_commands(k: int) -> None:
    seed = random_joystick.commit()
    scenario = next(itertools.islice(random_joystick.random_drives(seed, "fixed-position"), k, None))
    (pair,) = random_joystick.case_of(scenario).run().pairs
    assert pair.agreement.passed, (seed, k, pair.agreement)
    assert pair.agreement.limit_m == 1e-7


RELEASED = [9.0, 0.0, 0.0, 0.0]


def driven(**changes: object) -> dict:
    return {
        "kind": "driven",
        "duration": 20.0,
        "period": COARSE,
        "bandwidth": 3.7,
        "speed": [0.45, 0.45, 0.27],
        "low": [0.1, 0.1, -1.3],
        "high": [1.9, 1.4, -0.1],
        "wishes": [[0.0, 0.4, 0.1, 0.0], [1.5, -0.4, 0.0, 0.2], [4.0, 0.0, 0.0, 0.0]],
        **changes,
    }


def path(**changes: object) -> DrivenPath:
    reference = {"start": [1.0, 0.7, -0.7], "segments": [driven(**changes)]}
    return Trajectory.of(ReferenceSettings.model_validate(reference)).paths[0]


def test_the_path_is_as_exact_between_samples() -> None:
    time = np.array([0.0, 0.04, 0.53, 1.49, 1.57, 3.21, 7.13, 20.0])
    fine = path().sample(time)
    assert path(period=0.5).sample(time).reshape(-1, 15) == pytest.approx(fine.reshape(-1, 15), abs=1e-10)


def test_the_load_moves_straight_to_a_goal_without_overshoot() -> None:
    start, goal = np.array([1.0, 0.7, -0.7]), np.array([0.3, 1.2, -1.1])
    rows = path(wishes=[RELEASED], goals=[[0.0, *goal.tolist()]]).sample(COARSE * np.arange(2000))
    assert rows[-1, 0] == pytest.approx(goal, abs=1e-6)
    share = (rows[:, 0] - start) / (goal - start)
    assert np.ptp(share, axis=1).max() < 1e-9, "on a straight line"
    assert (np.diff(share[:, 0]) >= -1e-12).all(), "never back, so never beyond"


def test_the_stopping_point_stays_in_the_box_and_the_load_with_it() -> None:
    into = path(wishes=[[0.0, 0.45, -0.45, 0.27], [4.5, -0.45, 0.45, -0.27], RELEASED])
    stop = into.limits.stopping_points(into._states)
    low, high = into.limits.low, into.limits.high
    assert stop.min(axis=0) == pytest.approx(low, abs=1e-12)
    assert stop.max(axis=0) == pytest.approx(high, abs=1e-12)
    load = into.sample(COARSE * np.arange(2001))[:, 0]
    assert (load >= low - 1e-12).all()
    assert (load <= high + 1e-12).all()


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"wishes": [[20.0, 0.0, 0.0, 0.0]]}, "before the end"),
        ({"wishes": [[0.0, float("nan"), 0.0, 0.0]]}, "finite number"),
        ({"duration": 14.8}, "by a wish of zeros, 10.81 s before the end"),
    ],
)
def test_commands_that_no_session_could_record_are_refused(changes: dict, found: str) -> None:
    with pytest.raises(ValueError, match=found):
        path(**changes)
