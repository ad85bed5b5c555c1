"""H-infinity synthesis for a generalised plant, on SLICOT's SB10AD.

SLICOT comes through ctrlsys (BSD-3); the closed loop is rebuilt here from plant and controller and checked.
"""

import math

import control
import ctrlsys
import numpy as np

from cranectl.design.linear_systems import HinfController, closed_loop_norm, ill_conditioned
from cranectl.support.errors import InputError

GAMMA_ROUNDING = 1e-5  # relative error that SB10AD's bisection may leave in gamma; five digits are printed


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
    wanted = wanted_gamma(gamma_opt, back_off, gamma, name)
    controller, wanted = _synthesise(generalised, controls, measurements, name, job=4, gamma=wanted)
    return checked_controller(controller, gamma_opt, closed_loop_norm(generalised, controller), wanted, name)


def wanted_gamma(smallest: float, back_off: float, gamma: float | None, name: str) -> float:
    """Return the gamma to design for; raises InputError for a `gamma` below the smallest."""
    if gamma is not None and gamma < smallest:
        raise InputError(
            f"{name} with gamma = {gamma:g}",
            allowed=f"gamma of at least {smallest:.6g}, the smallest that these weights allow",
            remedy="raise gamma, or leave it out and set back_off",
        )
    return rounded_up(back_off * smallest) if gamma is None else gamma


def rounded_up(gamma: float) -> float:
    """Round up to five digits, which are certain: what is designed for it is the same on every processor."""
    unit = 10.0 ** (math.floor(math.log10(gamma)) - 4)
    return math.ceil(gamma / unit) * unit


def checked_controller(
    controller: control.StateSpace, smallest: float, achieved: float, wanted: float, name: str
) -> HinfController:
    """Return the design; raises InputError unless its norm lies between the smallest and the wanted one.

    A norm that is smaller by rounding is the better value of the smallest.
    """
    if not smallest * (1.0 - GAMMA_ROUNDING) <= achieved <= wanted * (1.0 + 1e-4):
        raise ill_conditioned(name)
    return HinfController(controller, min(smallest, achieved), achieved)


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
