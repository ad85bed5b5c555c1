"""Lower bounds of durations: shortest motions by direct transcription in joint coordinates.

The bounds are independent of the package, with their own equations of motion and of the joints along a path.
For free motions the controls are piecewise constant accelerations of the drives or, with a lag, of their
set-points w = v + lag u, so v' = (w - v) / lag. Along a path z = z(s), the highest derivative of s(t) is
piecewise constant.

Limits hold at the nodes. Between them the lean exceeds its limit by at most 2 mrad. Along a path, one limit
is exceeded by 5 % at worst; limits at midpoints too would cost 0.01 % of the duration. Durations converge
from above: those of `bound` are at most 0.42 % longer than those with 120 controls. Other first guesses give
the same four digits.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import cos, pi
from typing import NamedTuple

import casadi as ca
import numpy as np

# Only Solve_Succeeded counts as success, so acceptable solutions are switched off.
IPOPT = {"print_level": 0, "sb": "yes", "tol": 1e-7, "max_iter": 1000, "acceptable_iter": 0}


@dataclass(frozen=True)
class Limits:
    """Limits of bridge, trolley, winch and load, by default of the laboratory's rig with a load of 1 kg."""

    velocity: tuple[float, ...] = (1.0, 1.0, 0.6)  # [m/s], of the set-points
    acceleration: tuple[float, ...] = (4.0, 4.0, 6.0)  # [m/s²], of the set-points
    lag: float = 0.0  # [s]
    lean: float = 0.35  # [rad]
    tension: tuple[float, float] = (0.2, 2.0)  # in weights of the load
    load_low: tuple[float, ...] = (0.05, 0.05, -1.35)  # [m]
    load_high: tuple[float, ...] = (1.95, 1.49, -0.05)
    joints_low: tuple[float, ...] = (0.0, 0.0, 0.05)
    joints_high: tuple[float, ...] = (2.0, 1.54, 1.4)
    gravity: float = 9.81


@dataclass(frozen=True)
class Wall:
    """A wall across x, as wide as the rig, that a load of `radius` and its rope must not touch."""

    low: float  # [m], x
    high: float
    top: float  # z
    radius: float = 0.0


@dataclass(frozen=True)
class Move:
    """A motion from rest to rest on any path; before, over and behind a wall if there is one."""

    start: tuple[float, float, float]  # [m]
    end: tuple[float, float, float]
    wall: Wall | None = None


@dataclass(frozen=True)
class Along:
    """A motion from rest to rest along the path z(s), s from 0 to 1."""

    position: Callable[[ca.SX], ca.SX]  # (3,) [m]


def _line(s: ca.SX) -> ca.SX:
    return ca.vertcat(0.1 + 1.55 * s, 0.1 + 0.67 * s, -0.15 - 0.55 * s)


def _turn(s: ca.SX) -> ca.SX:
    return ca.vertcat(1.0 + 0.65 * ca.cos(2 * pi * s), 0.77 - 0.65 * ca.sin(2 * pi * s), -0.7)


WALL = Wall(0.8, 1.2, -0.6)
CASES: dict[str, Move | Along] = {
    "a": Move((0.5, 0.77, -0.7), (1.5, 0.77, -0.7)),
    "b": Move((0.4, 0.4, -0.9), (1.6, 1.0, -0.6)),
    "c, load of 0.05 m": Move((0.4, 0.77, -1.1), (1.6, 0.77, -1.1), replace(WALL, radius=0.05)),
    "d, line": Along(_line),  # the thesis's
    "d, turn": Along(_turn),
}


class Model(NamedTuple):
    """Symbols of CasADi for the transcription."""

    state: ca.SX  # at rest zero, except for the joints or s
    control: ca.SX
    rate: ca.SX  # of the state [1/s]
    joints: ca.SX  # (x_c, y_c, l) [m]
    load: ca.SX  # [m]
    acceleration: ca.SX  # of the joints [m/s²]
    rows: tuple[ca.SX, np.ndarray, np.ndarray]  # constraints with lower and upper bounds


def model_of(case: Move | Along, limits: Limits) -> Model:
    """Return the model of the crane, or of its motion along a path."""
    return _free(limits) if isinstance(case, Move) else _along(case, limits)


def _free(limits: Limits) -> Model:
    """Return the model with the state (joints, alpha, beta; their rates; with a lag the set-points)."""
    joints, angles, velocity, rates, setpoint, control = (ca.SX.sym("q", n) for n in (3, 2, 3, 2, 3, 3))
    u = (setpoint - velocity) / limits.lag if limits.lag else control
    (a, b), (a_rate, b_rate) = ca.vertsplit(angles), ca.vertsplit(rates)
    length, rope_rate, g = joints[2], velocity[2], limits.gravity
    sin_a, cos_a, sin_b, cos_b = ca.sin(a), ca.cos(a), ca.sin(b), ca.cos(b)
    a_forcing = (
        2 * length * a_rate * b_rate * sin_b - g * sin_a - 2 * rope_rate * a_rate * cos_b - cos_a * u[1]
    )
    b_forcing = sin_a * sin_b * u[1] - cos_b * u[0] - g * cos_a * sin_b - 2 * rope_rate * b_rate
    b_forcing -= length * a_rate**2 * sin_b * cos_b
    n = ca.vertcat(sin_b, cos_b * sin_a, -cos_a * cos_b)
    load = ca.vertcat(joints[:2], 0) + length * n
    pull = length * ((a_rate * cos_b) ** 2 + b_rate**2) - g * n[2] - u[0] * n[0] - u[1] * n[1] - u[2]
    state = ca.vertcat(joints, angles, velocity, rates)
    rate = ca.vertcat(velocity, rates, u, a_forcing / (length * cos_b), b_forcing / length)
    if not limits.lag:
        rows = _rows(limits, joints, load, velocity, u, n, pull)
        return Model(state, control, rate, joints, load, u, rows)
    rows = _rows(limits, joints, load, setpoint, control, n, pull)
    return Model(ca.vertcat(state, setpoint), control, ca.vertcat(rate, control), joints, load, u, rows)


def _along(path: Along, limits: Limits) -> Model:
    """Return the model with the state s, s', s'', s''' (with a lag also s'''') and the next as control."""
    state, control = ca.SX.sym("s", 5 if limits.lag else 4), ca.SX.sym("control")
    rate = ca.vertcat(state[1:], control)

    def dot(expression: ca.SX) -> ca.SX:
        return ca.jtimes(expression, state, rate)

    load = path.position(state[0])
    force = dot(dot(load)) + np.array([0.0, 0.0, limits.gravity])  # of the rope, per mass
    slope = force[:2] / force[2]
    joints = ca.vertcat(load[:2] - load[2] * slope, -load[2] * ca.sqrt(1 + ca.sumsqr(slope)))
    velocity = dot(joints)
    u, pull = dot(velocity), ca.norm_2(force)
    w = velocity + limits.lag * u
    rows = _rows(limits, joints, load, w, dot(w) if limits.lag else u, -force / pull, pull)
    return Model(state, control, rate, joints, load, u, rows)


def _rows(
    limits: Limits, joints: ca.SX, load: ca.SX, w: ca.SX, w_dot: ca.SX, n: ca.SX, pull: ca.SX
) -> tuple[ca.SX, np.ndarray, np.ndarray]:
    """Return constraints and bounds; `pull` is the tension per mass of the load [m/s²]."""
    rows = [
        (joints, limits.joints_low, limits.joints_high),
        (load, limits.load_low, limits.load_high),
        (w, -np.array(limits.velocity), limits.velocity),
        (w_dot, -np.array(limits.acceleration), limits.acceleration),
        (-n[2], [cos(limits.lean)], [2.0]),
        (pull / limits.gravity, limits.tension[:1], limits.tension[1:]),
    ]
    expressions, low, high = zip(*rows, strict=True)
    return ca.vertcat(*expressions), np.concatenate(low), np.concatenate(high)


def sides_of(wall: Wall, model: Model) -> list[ca.SX]:
    """Return expressions that must not be negative before, over and behind the wall, for load and rope."""
    x, (load_x, _, load_z) = model.joints[0], ca.vertsplit(model.load)
    # Position of the rope at the wall's top, times -load_z.
    rope = x * (wall.top - load_z) - load_x * wall.top
    before = ca.vertcat(wall.low - wall.radius - load_x, -wall.low * load_z - rope)
    behind = ca.vertcat(load_x - wall.high - wall.radius, rope + wall.high * load_z)
    return [before, load_z - wall.top - wall.radius, behind]


def _guess(case: Move | Along, states: int, nodes: int, seconds: float) -> np.ndarray:
    """Return a smooth initial guess (states, nodes), at rest at both ends."""
    law = np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])
    share = np.linspace(0.0, 1.0, nodes)
    s = np.array([law.deriv(k)(share) / seconds**k for k in range(5)])
    s[:, -1] = [1.0, 0.0, 0.0, 0.0, 0.0]
    if isinstance(case, Along):
        return s[:states]
    guess, bump = np.zeros((states, nodes)), np.sin(pi * share) ** 2
    start, end = (np.array(point) * (1.0, 1.0, -1.0) for point in (case.start, case.end))
    guess[:3] = start[:, None] + np.outer(end - start, s[0])
    guess[5:8] = np.outer(end - start, s[1])
    guess[1, 1:-1] += 0.05 * bump[1:-1]  # sideways swing is faster, and the motion in the plane is a saddle
    if case.wall:
        guess[2, 1:-1] -= (case.wall.top + case.wall.radius - case.start[2]) * bump[1:-1]
    return guess


@dataclass(frozen=True)
class Optimum:
    """Solution of IPOPT."""

    duration: float  # [s]
    times: np.ndarray  # of the nodes [s]
    states: np.ndarray  # (states, nodes)
    controls: np.ndarray  # (controls, nodes - 1), each held to the next node


def _runge_kutta(rate: ca.Function, state: ca.SX, control: ca.SX, step: ca.SX) -> ca.SX:
    """Return the state after a step, by two half steps of the classical method of order four."""
    h = step / 2
    for _ in range(2):
        k1 = rate(state, control)
        k2 = rate(state + h / 2 * k1, control)
        k3 = rate(state + h / 2 * k2, control)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(state + h * k3, control))
    return state


def _shares(passages: int, steps: int) -> np.ndarray:
    """Return each step's share of its passage (passages x steps,), finer towards the ends."""
    middle = (np.arange(passages * steps) + 0.5) / (passages * steps)
    weights = (0.5 + np.sin(pi * middle)).reshape(passages, steps)
    return (weights / weights.sum(axis=1, keepdims=True)).ravel()


def optimum(case: Move | Along, limits: Limits, intervals: int) -> Optimum:
    """Return the shortest motion with `intervals` controls.

    Raises RuntimeError with IPOPT's status unless it is Solve_Succeeded.
    """
    model = model_of(case, limits)
    sides = sides_of(case.wall, model) if isinstance(case, Move) and case.wall else [ca.SX(0, 1)]
    seconds, steps_per_side = (2.0 if isinstance(case, Move) else 5.0), intervals // len(sides)
    steps = steps_per_side * len(sides)
    x_, u_, h = model.state, model.control, ca.SX.sym("h")
    rate = ca.Function("rate", [x_, u_], [model.rate])
    step = ca.Function("step", [x_, u_, h], [_runge_kutta(rate, x_, u_, h)])

    opti = ca.Opti()
    x, u = opti.variable(x_.numel(), steps + 1), opti.variable(u_.numel(), steps)
    passages = opti.variable(1, len(sides))  # durations on each side of a wall [s]
    shares = _shares(len(sides), steps_per_side)
    opti.minimize(ca.sum2(passages))
    opti.subject_to(opti.bounded(0.02, passages, 60.0))
    lengths = ca.kron(passages, ca.DM.ones(1, steps_per_side)) * shares[None]
    opti.subject_to(x[:, 1:] == step.map(steps)(x[:, :-1], u, lengths))
    _limit(opti, model, x, u)
    for k, side in enumerate(sides):
        clear = ca.Function("clear", [x_], [side]).map(steps_per_side + 1)
        if side.numel():
            nodes = x[:, k * steps_per_side : (k + 1) * steps_per_side + 1]
            opti.subject_to(ca.vec(clear(nodes)) >= 0)
    guess = _guess(case, x_.numel(), steps + 1, seconds)
    opti.subject_to(x[:, 0] == guess[:, 0])
    opti.subject_to(x[:, -1] == guess[:, -1])
    opti.set_initial(x, guess)
    opti.set_initial(passages, seconds / len(sides))
    opti.solver("ipopt", {"expand": True, "print_time": False}, IPOPT)
    solution = opti.solve()
    durations = np.atleast_1d(solution.value(passages))
    times = np.append(0.0, np.cumsum(np.repeat(durations, steps_per_side) * shares))
    return Optimum(float(durations.sum()), times, solution.value(x), np.atleast_2d(solution.value(u)))


def _limit(opti: ca.Opti, model: Model, x: ca.MX, u: ca.MX) -> None:
    """Add the limits at the nodes, on both sides of a node for expressions that jump with the control."""
    rows, low, high = model.rows
    jumps = np.array(ca.which_depends(rows, model.control, 1, True))
    still = ca.Function("still", [model.state], [rows[np.flatnonzero(~jumps).tolist()]])
    opti.subject_to(opti.bounded(low[~jumps], still(x), high[~jumps]))
    jumping = ca.Function("jumping", [model.state, model.control], [rows[np.flatnonzero(jumps).tolist()]])
    for side in (x[:, :-1], x[:, 1:]):
        opti.subject_to(opti.bounded(low[jumps], jumping(side, u), high[jumps]))


def bound(case: Move | Along, limits: Limits) -> float:
    """Return the duration of the shortest motion [s]; this takes 1 to 5 s."""
    return optimum(case, limits, 60 if isinstance(case, Move) else 80).duration
