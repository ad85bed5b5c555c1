"""Test `partial-linearisation`: drives are linear for any swing if masses are right; poles; disturbance."""

from math import sqrt

import numpy as np
import pytest

from cranectl.simulate import Run
from cranectl.support.errors import InputError
from tests.benchmark.linear_loop import GRAVITY, PERIOD, nominal_at
from tests.benchmark.runs import at_rest, simulate
from validation.benchmark.partial_linearisation import LINEARISATION, polynomial, prepare

CONTROLLER = "partial_linearisation.py:LINEARISATION"
POSITION, SWING, SHARE = 0.45, 1.8, 0.3  # its defaults
UNDISTURBED = ["duration=4.0", "disturbances=[]"]


def acceleration_error(run: Run) -> float:
    """Return the largest relative difference between the drives' accelerations and the requested ones."""
    rates, requested = run.block("state")[:, [1, 3, 5]], run.block("controller")[:, :3]
    middle = 0.5 * (requested[1:] + requested[:-1])
    return float(np.abs(np.diff(rates, axis=0) / PERIOD - middle).max() / np.abs(requested).max())


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_drives_are_linear_for_any_swing_with_right_masses(plant: str) -> None:
    initial_swing = ["initial.alpha_offset=0.5", "initial.beta_offset=-0.6"]
    for assumed, is_linear in (([], True), (["rig.load_mass=1.5"], False)):
        run = simulate(CONTROLLER, *UNDISTURBED, *initial_swing, plant=plant, drive="force", assumed=assumed)
        assert acceleration_error(run) < 0.01 if is_linear else acceleration_error(run) > 0.1


@pytest.mark.parametrize("length", [0.2, 0.7, 1.4])
def test_loop_has_documented_polynomial(length: float) -> None:
    """The determinant of l b'' = -g b - v and e'' = v follows from the three numbers."""
    pole = sqrt(GRAVITY / length)
    drive = [1.0, 2.0 * POSITION * pole, (POSITION * pole) ** 2]
    swing = SHARE * length * np.array([2.0 * SWING * pole, (SWING * pole) ** 2 - pole**2])
    determinant = np.polymul([length, 0.0, GRAVITY], drive) + np.append(np.append(0.0, swing), [0.0, 0.0])
    scale = pole ** np.arange(5)
    np.testing.assert_allclose(determinant / length, polynomial(POSITION, SWING, SHARE) * scale, rtol=1e-12)


def test_exactly_unstable_settings_are_refused() -> None:
    refused = 0
    for position in (0.2, 0.5, 1.0, 2.0):
        for swing in (0.5, 1.0, 2.0):
            for share in (0.1, 0.5, 1.5):
                stable = np.roots(polynomial(position, swing, share)).real.max() < 0.0
                nominal = nominal_at(LINEARISATION, 0.7, position=position, swing=swing, share=share)
                if stable:
                    prepare(nominal)
                    continue
                refused += 1
                with pytest.raises(InputError, match="of partial-linearisation"):
                    prepare(nominal)
    assert 5 < refused < 30


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_motion_near_rest_agrees_with_polynomial(plant: str) -> None:
    offset, length = 1e-3, 0.7
    run = simulate(CONTROLLER, *at_rest(length, offset, 4.0), plant=plant, drive="force")
    pole = sqrt(GRAVITY / length)
    roots = np.roots(polynomial(POSITION, SWING, SHARE))
    # e and its first three derivatives at the start, with times in sqrt(l/g): e'' = -a² e, b'' = a² e/l.
    square = POSITION**2
    jerk = 2.0 * POSITION * square + 2.0 * SHARE * SWING * square
    weights = np.linalg.solve(np.vander(roots, 4, increasing=True).T, [1.0, 0.0, -square, jerk])
    expected = (np.exp(np.outer(pole * run.time, roots)) @ weights).real
    np.testing.assert_allclose(run.block("state")[:, 0] - 1.0, offset * expected, atol=0.01 * offset)
