"""H-infinity synthesis for a generalised plant, on SLICOT's SB10AD.

SLICOT comes through ctrlsys (BSD-3); the closed loop is rebuilt here from plant and controller and checked.
"""

import control
import ctrlsys
import numpy as np

from cranectl.design.linear_systems import HinfController, closed_loop_norm
from cranectl.support.errors import InputError


def hinf_controller(
    generalised: control.StateSpace,
    controls: int,
    measurements: int,
    *,
    name: str,
    back_off: float = 1.0,
    gamma: float | None = None,
) -> HinfController:
    """Bring the norm from w to z below `gamma`, by default the smallest times `back_off` >= 1, by u = K y.

    `generalised` maps (w, u) to (z, y), with so many `controls` u and `measurements` y; `name` is what errors
    call the problem. Raises InputError where no controller exists.
    """
    gamma_opt = _smallest_gamma(generalised, controls, measurements, name)
    if gamma is not None and gamma < gamma_opt:
        raise InputError(
            f"{name} with gamma = {gamma:g}",
            allowed=f"gamma of at least {gamma_opt:.6g}, the smallest that these weights allow",
            remedy="raise gamma, or leave it out and set back_off",
        )
    wanted = back_off * gamma_opt if gamma is None else gamma
    controller, gamma = _synthesise(generalised, controls, measurements, name, job=4, gamma=wanted)
    achieved = closed_loop_norm(generalised, controller)
    if not achieved <= gamma * (1.0 + 1e-4):
        raise InputError(
            f"the {name} controller reaches gamma {achieved:.6g} instead of {gamma:.6g}",
            allowed="weights for which the synthesis is well conditioned",
            remedy="increase back_off, or choose less extreme weights",
        )
    return HinfController(controller, gamma_opt, achieved)


_INFEASIBLE = {
    1: "the input cannot be regularised: the control weight vanishes at infinite frequency",
    2: "the measurement cannot be regularised: the error does not see the reference",
    3: "singular value decomposition failed",
    4: "singular value decomposition failed",
    5: "the singular value of the feed-through exceeds gamma",
    6: "the first Riccati equation has no stabilising solution at this gamma",
    7: "the second Riccati equation has no stabilising solution at this gamma",
    8: "the spectral radius condition fails at this gamma",
    9: "the estimator gain is singular",
    10: "a matrix of the controller is singular",
    11: "a matrix of the controller is singular",
    12: "no gamma gives a stabilising controller",
}


def _smallest_gamma(generalised: control.StateSpace, controls: int, measurements: int, name: str) -> float:
    """The bisection needs to start where there is a controller; how large that is depends on the weights."""
    errors = []
    for start in (1.0, 1e2, 1e4, 1e6):
        try:
            return _synthesise(generalised, controls, measurements, name, job=1, gamma=start)[1]
        except InputError as error:
            errors.append(error)
    raise errors[0]


def _synthesise(
    generalised: control.StateSpace, controls: int, measurements: int, name: str, *, job: int, gamma: float
) -> tuple[control.StateSpace, float]:
    """SB10AD: `job` 1 bisects for the smallest gamma from above, 4 takes the given one."""
    matrices = (np.asfortranarray(x) for x in (generalised.A, generalised.B, generalised.C, generalised.D))
    sizes = (generalised.nstates, generalised.ninputs, generalised.noutputs, controls, measurements)
    *_, info = solution = ctrlsys.sb10ad(job, *sizes, *matrices, gamma, 1e-8, 0.0)
    if info != 0:
        raise InputError(
            f"no {name} controller for gamma = {gamma:.6g}: {_INFEASIBLE.get(info, f'SB10AD info {info}')}",
            allowed="weights that some stabilising controller meets",
            remedy="lower the demanded bandwidth or the control weight, or increase back_off",
        )
    return control.ss(*solution[:4]), float(solution[8])
