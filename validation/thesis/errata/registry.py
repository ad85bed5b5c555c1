"""Register checks of the errata in docs/thesis/errata.md by name, with functions that the checks share.

tests/tools/thesis/test_errata.py runs them. A check returns the errors of the printed and of the right form.
The errors are relative to a truth that uses no equation of the thesis: Newton's law for the load, `dynamics`,
which agrees with MuJoCo, SymPy, or plain differentiation.
"""

from collections.abc import Callable

import control
import numpy as np

from cranectl.design import design_controller
from cranectl.design.linear_systems import inner_loop
from cranectl.design.loop_shaping import error_weight
from cranectl.model import dynamics
from cranectl.scenario.design import DesignSettings
from cranectl.scenario.rig import RigParameters

Check = Callable[[], tuple[float, float]]

RIG = RigParameters(bridge_mass=5.0, trolley_mass=2.0, load_mass=1.7)
G = RIG.gravity
INPUT = np.array([0.4, -0.3, 0.2])  # accelerations of bridge, trolley, rope [m/s²]
ERRATA: dict[str, Check] = {}


def erratum(name: str) -> Callable[[Check], Check]:
    """Register a check under the name of its erratum in docs/thesis/errata.md."""

    def register(check: Check) -> Check:
        assert name not in ERRATA
        ERRATA[name] = check
        return check

    return register


def max_difference(a: object, b: object) -> float:
    """Return the largest difference between the elements of two arrays."""
    return float(np.abs(np.asarray(a, dtype=complex) - np.asarray(b, dtype=complex)).max())


def excess_over(value: float, tolerance: float) -> float:
    """Return the excess of a deviation over its tolerance, for numbers that the thesis prints rounded."""
    return max(0.0, float(value) - tolerance)


def random_states(count: int) -> np.ndarray:
    """Draw regular states (count, 10), in the order of the thesis's (3.21)."""
    states = np.random.default_rng(0).uniform(-0.8, 0.8, (count, 10))
    states[:, 4] = 0.5 + 0.4 * states[:, 4]  # the rope's length, never 1 m, which would hide units
    return states


def split(state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return q and q' (5,) in the order x_c, y_c, l, alpha, beta."""
    return state[0::2], state[1::2]


def check_states(check: Callable[[np.ndarray], tuple[float, float]]) -> tuple[float, float]:
    """Return the least error of the printed form and the largest of the right one, over random states."""
    errors = np.array([check(state) for state in random_states(50)])
    return float(errors[:, 0].min()), float(errors[:, 1].max())


def motion_terms(state: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return (q, q', q'', M, C q', G, F) of a motion with the input INPUT.

    F is the force on each coordinate: weight and inertia of the load by dr/dq, and the inertia of the drives.
    """
    q, qd = split(state)
    m, gravity = dynamics.mass_matrix(q, RIG), dynamics.gravity_vector(q, RIG)
    coriolis = dynamics.coriolis_matrix(q, qd, RIG) @ qd
    cardan = np.linalg.solve(m[3:, 3:], -(m[3:, :3] @ INPUT + coriolis[3:] + gravity[3:]))
    qdd = np.concatenate([INPUT, cardan])
    jacobian = dynamics.load_jacobian(q)
    acceleration = jacobian @ qdd + dynamics.load_jacobian_rate(q, qd) @ qd
    drives = [RIG.bridge_mass + RIG.trolley_mass, RIG.trolley_mass, RIG.winch_mass, 0.0, 0.0]
    force = drives * qdd + RIG.load_mass * jacobian.T @ (acceleration + np.array([0.0, 0.0, G]))
    return q, qd, qdd, m, coriolis, gravity, force


def shaped_plant(feedback: str) -> control.StateSpace:
    """Return G W_e of section 5.2.1 for one axis."""
    return inner_loop(design_controller(feedback).gain) * error_weight(DesignSettings())
