"""Both ends of every setting of the package's controllers: a stable loop and finite numbers, or a remedy.

The oracles are independent of what they judge:

- gains of `lqr-integral` and `lqr-offset-free`: Kalman's return difference, at 400 frequencies;
- poles of `flat-velocity`: the polynomial with these roots;
- margins that `cranectl design` prints: a sweep over frequency;
- stability: eigenvalues of the linearised closed loop; a short run on the nonlinear crane.
"""

import control
import numpy as np
import pytest

from cranectl.controllers.flat_velocity import FLAT_VELOCITY, POLES, tracker_of
from cranectl.controllers.lqr_integral import LQR_INTEGRAL, gain_at, matrices
from cranectl.controllers.lqr_offset_free import LQR_OFFSET_FREE, A, B, levels
from cranectl.controllers.registry import ALL_CONTROLLERS, WHERE
from cranectl.design.linear_systems import loop_margins
from cranectl.support.errors import InputError
from tests.benchmark.linear_loop import nominal_at
from tests.controller_ranges import Case, cases, check
from tests.loops import check_margins, return_difference_error, state_loop
from tests.ranges import has_found_allowed_and_remedy, result_or_refusal, share_of

SHARE = 10
CASES = cases(ALL_CONTROLLERS[name] for name in WHERE)
LENGTH = 0.7  # [m], of the rope
# Of the return difference. Poles of 1e-9 1/s, which such weights ask for, keep three digits of it.
OPTIMAL = 1e-3


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", share_of(CASES, SHARE), ids=lambda case: case[0])
def test_a_setting_gives_finite_numbers_or_says_what_to_do(case: Case) -> None:
    check(case)


def of(law: str) -> list[Case]:
    return [case for case in CASES if case[1] == law]


@pytest.mark.parametrize("case", of("lqr-integral"), ids=lambda case: case[0])
def test_gains_of_lqr_integral_are_optimal(case: Case) -> None:
    nominal = nominal_at(LQR_INTEGRAL, LENGTH, **{case[2]: float(case[3])})
    gain = result_or_refusal(lambda: gain_at(LENGTH, nominal))
    if isinstance(gain, InputError):
        assert has_found_allowed_and_remedy(str(gain))
        return
    a, b, outputs = matrices(LENGTH, nominal.rig.gravity)
    weights = [nominal.parameters[f"{name}_weight"] for name in ("error", "rate", "integral")]
    relative = np.array(weights) / nominal.parameters["input_weight"]
    assert return_difference_error(a, b, outputs, relative, gain) < OPTIMAL


@pytest.mark.parametrize("case", of("lqr-offset-free"), ids=lambda case: case[0])
def test_gains_of_lqr_offset_free_are_optimal_at_every_level(case: Case) -> None:
    nominal = nominal_at(LQR_OFFSET_FREE, LENGTH, **{case[2]: float(case[3])})
    weights = np.array([nominal.parameters[f"{name}_weight"] for name in ("error", "rate")])
    table = levels(nominal)
    for share, row in zip(np.geomspace(1e-6, 1.0, len(table)), table, strict=True):
        assert return_difference_error(A, B, np.eye(4)[2:], share * weights, row[:4]) < OPTIMAL


@pytest.mark.parametrize("case", of("flat-velocity"), ids=lambda case: case[0])
def test_poles_of_flat_velocity_are_the_requested_ones(case: Case) -> None:
    nominal = nominal_at(FLAT_VELOCITY, LENGTH, **{case[2]: float(case[3])})
    wanted = np.poly([nominal.parameters[name] for name in POLES])
    assert tracker_of(nominal).gain == pytest.approx(wanted[:0:-1], rel=1e-9, abs=0.0)


@pytest.mark.parametrize(
    "case",
    share_of([case for case in CASES if ALL_CONTROLLERS[case[1]].linearise], SHARE),
    ids=lambda case: case[0],
)
def test_margins_of_linearised_controllers(case: Case) -> None:
    controller = ALL_CONTROLLERS[case[1]]
    linearise = controller.linearise
    assert linearise is not None
    nominal = nominal_at(controller, LENGTH, **{case[2]: float(case[3])})
    law = result_or_refusal(lambda: linearise(nominal, LENGTH))
    if isinstance(law, InputError):
        assert has_found_allowed_and_remedy(str(law))
        return
    margins = loop_margins(control.ss(law.a, law.b, law.gain.reshape(1, -1), 0.0))
    check_margins(margins, state_loop(law.a, law.b, law.gain), np.logspace(-11.0, 6.0, 6801))


def test_every_setting_is_tried() -> None:
    assert {case[1] for case in CASES} == set(WHERE)
    assert len(CASES) > 40
