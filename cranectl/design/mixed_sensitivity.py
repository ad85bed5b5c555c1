"""S/KS mixed-sensitivity H-infinity design (thesis 4.3.1).

Skogestad, Postlethwaite: Multivariable Feedback Control, 2nd ed., section 9.3.5.
"""

from dataclasses import replace

import control
import numpy as np
from scipy.linalg import LinAlgError

from cranectl.design.hinf_synthesis import (
    GAMMA_ROUNDING,
    FullInformation,
    central_controller,
    checked_controller,
    design_gamma,
    full_information,
    hinf_controller,
    in_own_units,
    smallest_gamma,
)
from cranectl.design.linear_systems import (
    HinfController,
    Synthesised,
    check_regulable,
    check_swept,
    closed_loop_norm,
    frequency_response,
    hinf_norm,
    ill_conditioned,
    inner_loop,
    open_loop,
    real_modal_form,
    unstable_poles,
)
from cranectl.scenario import DesignSettings
from cranectl.support import Array, InputError

NAME = "S/KS"
NEAR_ENOUGH = 1e-4  # largest relative error of SLICOT's smallest gamma with which its controller is used
CLOSEST = 2e-5  # least relative distance to the smallest gamma; nearer, a fast pole loses all digits


def mixed_sensitivity(
    plant: control.StateSpace,
    sensitivity_weight: control.StateSpace,
    control_weight: control.StateSpace,
    back_off: float = 1.0,
    gamma: float | None = None,
) -> HinfController:
    """Design K with a norm of [W_s S; W_ks K S] below `gamma`, by default `back_off` >= 1 times the smallest.

    K is for negative feedback u = K (r - y). Exactly at the optimum one of its poles grows without bound. For
    a stable plant a Riccati equation checks the smallest gamma that SLICOT finds. If the two differ, that of
    the Riccati equation counts. If they differ by much, it also gives the controller. `plant` has no
    feed-through, and the control weight does not vanish at infinite frequency.
    """
    check_regulable(plant.A, plant.B, plant.C, "the plant")
    generalised = generalised_plant(plant, sensitivity_weight, control_weight)
    sizes = (plant.ninputs, plant.noutputs)
    if len(unstable_poles(plant.A)):
        return hinf_controller(generalised, *sizes, name=NAME, back_off=back_off, gamma=gamma)
    problem = full_information(generalised, *sizes)
    # Without control the norm is that of the weight, so it is an upper bound.
    smallest = smallest_gamma(problem, hinf_norm(sensitivity_weight))
    try:
        design = hinf_controller(generalised, *sizes, name=NAME, back_off=back_off, gamma=gamma)
    except InputError:
        design = None
    difference = np.inf if design is None else abs(design.gamma_min - smallest) / smallest
    if design is not None and difference <= NEAR_ENOUGH:
        return (
            design if difference <= GAMMA_ROUNDING else replace(design, gamma_min=min(smallest, design.gamma))
        )
    return _by_full_information(problem, smallest, back_off, gamma)


def _by_full_information(
    problem: FullInformation, smallest: float, back_off: float, gamma: float | None
) -> HinfController:
    """Design by the Riccati equation, for weights with which SB10AD is inaccurate or fails."""
    target = design_gamma(smallest, back_off, gamma, NAME)
    target = max(target, smallest * (1.0 + CLOSEST))
    try:
        controller = central_controller(problem, target)
    except LinAlgError:
        raise ill_conditioned(NAME) from None
    achieved = closed_loop_norm(problem.system(), controller)
    return checked_controller(in_own_units(problem, controller), smallest, achieved, target, NAME)


def hinf_robustifier(gain: Array, settings: DesignSettings) -> Synthesised:
    """Design a robustifier for the inner loop with `gain` (5.1)."""
    try:
        return _robustifier(gain, settings)
    except InputError as error:
        raise InputError(
            error.found, allowed=error.allowed, remedy=f"in [design] or [design.hinf]: {error.remedy}"
        ) from error


def _robustifier(gain: Array, design_settings: DesignSettings) -> Synthesised:
    settings = design_settings.hinf
    omega = settings.bandwidth
    pole = omega * settings.offset
    # W_s = (s/M + omega) / (s + pole)
    direct = 1.0 / settings.peak
    weight = control.ss([[-pole]], [[1.0]], [[omega - pole * direct]], [[direct]])
    control_weight = control.ss([], [], [], [[settings.control_weight]])
    plant = inner_loop(gain)
    design = mixed_sensitivity(plant, weight, control_weight, settings.back_off, settings.gamma)
    modal = real_modal_form(design.controller)

    def norm(omega: Array) -> Array:
        response = frequency_response(modal, omega)
        error, effort = np.abs(frequency_response(weight, omega)), settings.control_weight * np.abs(response)
        stacked: Array = np.hypot(error, effort) / np.abs(1.0 + frequency_response(plant, omega) * response)
        return stacked

    check_swept(NAME, design.gamma, norm, open_loop(gain, modal), direct)
    return Synthesised(design.controller, modal, design.gamma_min, design.gamma)


def generalised_plant(
    plant: control.StateSpace, w_s: control.StateSpace, w_ks: control.StateSpace
) -> control.StateSpace:
    """Return the plant from (r, u) to (W_s e, W_ks u, e) with e = r - G u, without redundant states."""
    n, n_s, n_k = plant.nstates, w_s.nstates, w_ks.nstates
    p = plant.noutputs
    a = np.block(
        [
            [plant.A, np.zeros((n, n_s + n_k))],
            [-w_s.B @ plant.C, w_s.A, np.zeros((n_s, n_k))],
            [np.zeros((n_k, n + n_s)), w_ks.A],
        ]
    )
    b = np.block([[np.zeros((n, p)), plant.B], [w_s.B, -w_s.B @ plant.D], [np.zeros((n_k, p)), w_ks.B]])
    c = np.block(
        [
            [-w_s.D @ plant.C, w_s.C, np.zeros((w_s.noutputs, n_k))],
            [np.zeros((w_ks.noutputs, n + n_s)), w_ks.C],
            [-plant.C, np.zeros((p, n_s + n_k))],
        ]
    )
    d = np.block([[w_s.D, -w_s.D @ plant.D], [np.zeros((w_ks.noutputs, p)), w_ks.D], [np.eye(p), -plant.D]])
    return control.ss(a, b, c, d)
