"""S/KS mixed-sensitivity H-infinity design (thesis 4.3.1).

Skogestad, Postlethwaite: Multivariable Feedback Control, 2nd ed., section 9.3.5.
"""

import control
import numpy as np

from cranectl.design.hinf_synthesis import hinf_controller
from cranectl.design.linear_systems import (
    HinfController,
    check_regulable,
    inner_loop,
    poles_text,
    unstable_poles,
)
from cranectl.scenario import HinfSettings
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError


def mixed_sensitivity(
    plant: control.StateSpace,
    sensitivity_weight: control.StateSpace,
    control_weight: control.StateSpace,
    back_off: float = 1.0,
    gamma: float | None = None,
) -> HinfController:
    """Bring the norm of [W_s S; W_ks K S] below `gamma`, by default the smallest times `back_off` >= 1.

    K is for negative feedback u = K (r - y); exactly at the optimum it has a pole that grows without bound.
    Raises InputError for weights of wrong dimension or with unstable poles, and where no controller exists.
    """
    _check_weight("sensitivity weight", sensitivity_weight, plant.noutputs)
    _check_weight("control weight", control_weight, plant.ninputs)
    if np.linalg.matrix_rank(control_weight.D) < plant.ninputs:
        raise InputError(
            "a control weight that vanishes at infinite frequency: the synthesis is singular",
            allowed="a weight with a feed-through of full rank",
            remedy="give the control weight a small constant part",
        )
    check_regulable(plant.A, plant.B, plant.C, "the plant")
    generalised = generalised_plant(plant, sensitivity_weight, control_weight)
    return hinf_controller(
        generalised, plant.ninputs, plant.noutputs, name="S/KS", back_off=back_off, gamma=gamma
    )


def hinf_robustifier(gain: Array, settings: HinfSettings) -> tuple[control.StateSpace, float, float]:
    """(robustifier from e to v-bar, gamma_opt, gamma) for the inner loop with `gain`, (5.1)."""
    omega = settings.bandwidth
    pole = omega * settings.offset
    # W_s = (s/M + omega) / (s + pole)
    direct = 1.0 / settings.peak
    weight = control.ss([[-pole]], [[1.0]], [[omega - pole * direct]], [[direct]])
    control_weight = control.ss([], [], [], [[settings.control_weight]])
    design = mixed_sensitivity(inner_loop(gain), weight, control_weight, settings.back_off, settings.gamma)
    return design.controller, design.gamma_min, design.gamma


def generalised_plant(
    plant: control.StateSpace, w_s: control.StateSpace, w_ks: control.StateSpace
) -> control.StateSpace:
    """From (r, u) to (W_s e, W_ks u, e) with e = r - G u, no state twice."""
    n, n_s, n_k = plant.nstates, w_s.nstates, w_ks.nstates
    p = plant.noutputs
    identity = np.eye(p)
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
    d = np.block([[w_s.D, -w_s.D @ plant.D], [np.zeros((w_ks.noutputs, p)), w_ks.D], [identity, -plant.D]])
    return control.ss(a, b, c, d)


def _check_weight(name: str, weight: control.StateSpace, size: int) -> None:
    if (weight.ninputs, weight.noutputs) != (size, size):
        raise InputError(
            f"a {name} of {weight.noutputs} x {weight.ninputs}",
            allowed=f"{size} x {size}, as the plant has it",
            remedy="give the weight the plant's dimension",
        )
    if len(unstable_poles(weight.A)):
        raise InputError(
            f"a {name} with poles {poles_text(weight.A)}",
            allowed="poles with negative real part: no controller can stabilise a weight",
            remedy="move an integrator a little to the left, for example to -1e-3",
        )
