"""Which cut a controller is judged at, and the scales of the signals there.

The nu-gap depends on both. At cut "v" the flat state is scaled so that b(G, K) is as large as it can be. The
logarithm of 1/b² is a maximum over frequency of convex functions of the logarithms of the scales (a geometric
program), so a descent from anywhere ends at the one optimum.
"""

import numpy as np
from scipy.optimize import minimize

from cranectl.analysis.certificate.loop import (
    Cut,
    CutName,
    design_inner_loop,
    robustifier_of,
    weight_of,
)
from cranectl.analysis.certificate.systems import Array, SampledSystem
from cranectl.design import Design
from cranectl.errors import InputError
from cranectl.scenario import DesignSettings

CUTS: tuple[CutName, ...] = ("v-bar", "v")
GRID = np.exp(1j * np.geomspace(1e-5, np.pi, 250))  # of the optimisation only; the margin is found anew


def choose_cut(design: Design, settings: DesignSettings, period: float, name: str | None) -> Cut:
    """The cut `name`, by default "v-bar" for loop shaping and "v" for the others."""
    shaping = design.name.endswith("+loop-shaping")
    robustifier = robustifier_of(design, period)
    if name is None:
        name = "v-bar" if shaping else "v"
    if name == "v-bar" and shaping:
        weight = weight_of(settings.loop_shaping.proportional, settings.loop_shaping.integral, period)
        return Cut("v-bar", design.gain, robustifier, weight, np.ones(4))
    if name == "v":
        scales = best_scales(design.gain, robustifier, period)
        return Cut("v", design.gain, robustifier, None, scales)
    raise InputError(
        f"cut '{name}' for {design.name}",
        allowed="v for every controller, v-bar for those with loop shaping",
        remedy="choose another cut with --cut, or leave it out",
    )


def best_scales(gain: Array, robustifier: SampledSystem, period: float) -> Array:
    """Scales (4,) of z, z', z'', z''' for which b(G, K) at cut "v" is largest."""
    flat = design_inner_loop(gain, period).response(GRID)[:, ::3, 0]  # one axis
    r = robustifier.response(GRID)[:, 0, 0]
    law = np.tile(gain.astype(complex), (len(GRID), 1))
    law[:, 0] += r
    plant, controller = np.abs(flat) ** 2, np.abs(law) ** 2
    v, loop = np.abs(1.0 - flat @ gain) ** 2, np.abs(1.0 + r * flat[:, 0]) ** 2

    def cost(logarithms: Array) -> float:
        squares = np.exp(2.0 * logarithms)
        return float(np.log((plant @ squares + v) * (1.0 + controller @ (1.0 / squares)) / loop).max())

    found = minimize(
        cost, np.log(gain), method="Nelder-Mead", options={"maxfev": 4000, "xatol": 1e-5, "fatol": 1e-8}
    )
    scales: Array = np.exp(found.x)
    return scales
