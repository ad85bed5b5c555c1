"""H-infinity loop shaping after Glover and McFarlane (thesis 4.3.2), on SciPy's Riccati solver.

McFarlane, Glover: A Loop Shaping Design Procedure Using H-infinity Synthesis, IEEE TAC 37 (1992) 759; with
feed-through as in Skogestad, Postlethwaite: Multivariable Feedback Control, 2nd ed., section 9.4.
"""

import control
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_are

from cranectl.design.linear_systems import (
    HinfController,
    Synthesised,
    balanced,
    check_regulable,
    check_swept,
    closed_loop_norm,
    frequency_response,
    inner_loop,
    open_loop,
    poles_text,
    real_modal_form,
)
from cranectl.scenario import DesignSettings
from cranectl.support import Array, InputError

SLOWER = "move design.poles towards 0, or raise design.input_weight or design.loop_shaping.integral"


def glover_mcfarlane(plant: control.StateSpace, back_off: float = 1.01) -> HinfController:
    """Design u = K y, in positive feedback, that robustly stabilises normalised coprime factors of `plant`.

    `plant` is the shaped plant, with any number of inputs and outputs, stable or not, with or without
    feed-through. gamma_min is 1 / the largest stability margin. The controller is designed for
    gamma = back_off * gamma_min with `back_off` > 1. Raises InputError if there is no controller.
    """
    if not back_off > 1.0:
        raise InputError(
            f"loop shaping with gamma = {back_off:g} gamma_min",
            allowed="a factor above 1: at gamma_min itself the controller is improper",
            remedy="set back_off a little above 1, for example 1.01",
        )
    try:
        return _synthesise(plant, back_off)
    except InputError:  # with large gains, rounding in these coordinates can hide the slow modes
        return _synthesise(control.ss(*balanced(plant.A, plant.B, plant.C), plant.D), back_off)


def _synthesise(plant: control.StateSpace, back_off: float) -> HinfController:
    """Return the central controller, computed in the coordinates of `plant`."""
    a, b, c, d = plant.A, plant.B, plant.C, plant.D
    check_regulable(a, b, c, "the shaped plant")
    s, r = np.eye(b.shape[1]) + d.T @ d, np.eye(c.shape[0]) + d @ d.T
    a_1 = a - b @ np.linalg.solve(s, d.T @ c)
    x = _riccati(a_1, b, c.T @ np.linalg.solve(r, c), s)
    z = _riccati(a_1.T, c.T, b @ np.linalg.solve(s, b.T), r)
    gamma_min = float(np.sqrt(1.0 + np.linalg.eigvals(x @ z).real.max()))
    gamma = back_off * gamma_min
    coupling = (1.0 - gamma**2) * np.eye(len(a)) + x @ z
    feedback = -np.linalg.solve(s, d.T @ c + b.T @ x)
    injection = gamma**2 * np.linalg.solve(coupling.T, z @ c.T)
    k = control.ss(a + b @ feedback + injection @ (c + d @ feedback), injection, b.T @ x, -d.T)
    achieved = closed_loop_norm(_coprime_problem(plant), k)
    if not achieved <= gamma * (1.0 + 1e-6):
        raise InputError(
            f"the loop-shaping controller reaches gamma {achieved:.6g} instead of {gamma:.6g}",
            allowed="shaped plants whose Riccati equations are well conditioned",
            remedy="scale the plant, or choose a smoother weight",
        )
    return HinfController(k, gamma_min, achieved)


def loop_shaping_robustifier(gain: Array, settings: DesignSettings) -> Synthesised:
    """Design a robustifier for the inner loop with `gain`.

    The weight W_e = P + I/s shapes the inner loop from v-bar to z. Since K is in positive feedback and
    e = z_d - z, v-bar = -W_e K e.
    """
    weight, inner = error_weight(settings), inner_loop(gain)
    try:
        design = glover_mcfarlane(inner * weight, settings.loop_shaping.back_off)
    except InputError as error:
        raise InputError(error.found, allowed=error.allowed, remedy=SLOWER) from error
    robustifier = -weight * design.controller
    modal = real_modal_form(robustifier)

    def norm(omega: Array) -> Array:
        by_weight = frequency_response(weight, omega)
        plant, response = frequency_response(inner, omega), frequency_response(modal, omega)
        both = np.hypot(1.0, np.abs(response / by_weight)) * np.hypot(1.0, np.abs(plant * by_weight))
        stacked: Array = both / np.abs(1.0 + plant * response)
        return stacked

    high = np.hypot(1.0, np.abs(design.controller.D[0, 0]))  # at high frequencies the shaped plant vanishes
    check_swept("loop-shaping", design.gamma, norm, open_loop(gain, modal), float(high))
    return Synthesised(robustifier, modal, design.gamma_min, design.gamma)


def error_weight(settings: DesignSettings) -> control.StateSpace:
    """Return W_e = P + I/s."""
    weight = settings.loop_shaping
    return control.ss([[0.0]], [[1.0]], [[weight.integral]], [[weight.proportional]])


def _coprime_problem(plant: control.StateSpace) -> control.StateSpace:
    """Return the plant from (disturbances at y and u; u) to (y, u; y): [I; K] (I - G K)^-1 [I G], u = K y."""
    a, b, c, d = plant.A, plant.B, plant.C, plant.D
    m, p = plant.ninputs, plant.noutputs
    measured = np.hstack([np.eye(p), d, d])
    return control.ss(
        a,
        np.hstack([np.zeros((len(a), p)), b, b]),
        np.vstack([c, np.zeros((m, len(a))), c]),
        np.vstack([measured, np.hstack([np.zeros((m, p + m)), np.eye(m)]), measured]),
    )


def _riccati(a: Array, b: Array, q: Array, r: Array) -> NDArray[np.float64]:
    try:
        solution: Array = solve_continuous_are(a, b, q, r)
    except ValueError as error:
        raise InputError(
            f"a Riccati equation of the shaped plant is ill-conditioned: {error}; its poles: {poles_text(a)}",
            allowed="plants without hidden modes on or near the imaginary axis",
            remedy="remove such modes, or scale the plant",
        ) from None
    return solution
