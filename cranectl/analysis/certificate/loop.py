"""The loop as the certificate opens it: graphs of plant and design model, and the controller.

State feedback v = v-bar - F (z, z', z'', z''') is closed on each axis. The loop is opened at
one of two signals, see docs/explanation/certificate.md:

    "v-bar"  plant: W then the inner loop, to z.                  controller: W^-1 times the robustifier
    "v"      plant: the chain from v to the scaled flat state.    controller: state feedback + robustifier

The nu-gap depends on the signal and on the scales of what is measured there. At "v" the flat state is scaled
so that b(G, K) is as large as it can be. The logarithm of 1/b² is a maximum over frequency of convex
functions of the logarithms of the scales (a geometric program), so a descent from anywhere ends at the one
optimum.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.optimize import minimize

from cranectl.analysis.certificate.linear_plant import ARRIVING, COMMAND, FLAT, LinearPlant, V
from cranectl.analysis.certificate.nu_gap import Graph
from cranectl.analysis.certificate.systems import (
    Array,
    Complex,
    SampledSystem,
    close_inputs,
    with_delay,
)
from cranectl.design import Design
from cranectl.design.discretisation import diagonal, sampled_blocks
from cranectl.scenario import DesignSettings
from cranectl.support.errors import InputError

AXES = 3
EYE: Array = np.eye(AXES)


@dataclass(frozen=True)
class InnerLoop:
    """From v-bar (3) to the flat state (12) with state feedback closed; delays kept out of the matrices."""

    undelayed: SampledSystem  # inputs: what delay adds to the commands (3), v-bar; outputs: commands, flat
    delay: int  # [samples]
    arriving: SampledSystem  # delay as states; inputs: added to what arrives, v-bar; outputs: arriving, flat

    @property
    def delayed(self) -> SampledSystem:
        """From v-bar to the flat state, with delay as states."""
        return SampledSystem(
            self.arriving.a, self.arriving.b[:, V], self.arriving.c[FLAT], self.arriving.d[FLAT, V]
        )

    def response(self, z: Complex) -> Complex:
        """(k, 12, 3) at points `z` (k,)."""
        response = self.undelayed.response(z)
        if self.delay == 0:
            return response[:, FLAT, V]
        late = (z**-self.delay - 1.0)[:, None, None]
        own, given = late * response[:, COMMAND, ARRIVING], late * response[:, COMMAND, V]
        added = np.linalg.solve(EYE - own, given)
        total: Complex = response[:, FLAT, V] + response[:, FLAT, ARRIVING] @ added
        return total


def inner_loop_of(plant: LinearPlant, gain: Array) -> InnerLoop:
    """The linearised plant under state feedback with `gain` (4,) on each axis."""
    closed = close_inputs(plant.system, FLAT, V, -np.kron(gain, EYE).astype(float))
    return InnerLoop(
        undelayed=close_inputs(closed, COMMAND, ARRIVING, EYE),
        delay=plant.delay,
        arriving=with_delay(closed, COMMAND, ARRIVING, plant.delay),
    )


def design_inner_loop(gain: Array, period: float) -> InnerLoop:
    """The design model: chains z'''' = v, v held over the period, under the same state feedback."""
    chain = np.zeros((5, 5))
    chain[:4, :4], chain[3, 4] = np.diag(np.ones(3), 1), 1.0
    exponential = expm(chain * period)
    a, b = np.kron(exponential[:4, :4], EYE), np.kron(exponential[:4, 4:], EYE)
    whole = SampledSystem(
        a - b @ np.kron(gain, EYE),
        np.hstack([np.zeros((12, AXES)), b]),
        np.vstack([np.zeros((AXES, 12)), np.eye(12)]),
        np.zeros((15, 2 * AXES)),
    )
    return InnerLoop(undelayed=whole, delay=0, arriving=whole)


def robustifier_of(design: Design, period: float) -> SampledSystem:
    """The sampled robustifier of one axis as the tracker runs it, from e to v-bar."""
    r = design.robustifier
    blocks = sampled_blocks(r.a, r.b, r.c, r.d, period)
    return SampledSystem(
        diagonal(blocks.state_matrix),
        blocks.input_matrix.reshape(-1, 1),
        blocks.output_matrix.reshape(1, -1),
        np.array([[blocks.feedthrough]]),
    )


def closed_loop_matrix(inner: InnerLoop, robustifier: SampledSystem) -> Array:
    """State matrix of the whole loop: linear plant, its delays, then the robustifier states axis by axis."""
    a, b, c = inner.delayed.a, inner.delayed.b, inner.delayed.c[:AXES]
    r = on_each_axis(robustifier)
    return np.block([[a - b @ r.d @ c, b @ r.c], [-r.b @ c, r.a]]).astype(float)


def closed_loop_radius(inner: InnerLoop, robustifier: SampledSystem) -> float:
    """Largest modulus of the closed loop's poles: below 1 the linear loop is stable."""
    return float(np.abs(np.linalg.eigvals(closed_loop_matrix(inner, robustifier))).max())


def on_each_axis(system: SampledSystem) -> SampledSystem:
    """The same single-input single-output system on each of the three axes."""
    a, b, c, d = (np.kron(EYE, matrix).astype(float) for matrix in system)
    return SampledSystem(a, b, c, d)


@dataclass(frozen=True)
class Weight:
    """The weight P + I T/(z - 1) before the inner loop, as a ratio of two factors without an integrator.

    With the common pole 1 - I T/P the numerator is the constant P, the denominator (z - 1)/(z - pole).
    """

    proportional: float  # P
    pole: float

    def denominator(self, z: Complex) -> Complex:
        """(z - 1)/(z - pole), shape (k, 1, 1)."""
        ratio: Complex = ((z - 1.0) / (z - self.pole))[:, None, None]
        return ratio


@dataclass(frozen=True)
class Opening:
    """Where the loop is opened and how the signals there are scaled."""

    name: str  # v-bar or v
    gain: Array  # (4,)
    robustifier: SampledSystem
    weight: Weight | None  # at "v-bar"
    scales: Array  # (4,) of z, z', z'', z''' at "v" [1/m⁠·s⁴ …]: y = scale times signal

    def graph(self, inner: InnerLoop) -> Graph:
        """The plant's graph. Its poles are those of the inner loop; nothing integrates in it."""
        poles, weight = inner.delayed.poles(), self.weight
        if weight is not None:
            poles = np.concatenate([poles, np.full(AXES, weight.pole)])

        def symbol(z: Complex) -> Complex:
            flat = inner.response(z)
            if weight is not None:
                output, given = weight.proportional * flat[:, :AXES], weight.denominator(z) * EYE
            else:
                output = np.repeat(self.scales, AXES)[:, None] * flat
                given = EYE - np.kron(self.gain, EYE) @ flat
            return np.concatenate([output, given], axis=1)

        return Graph(symbol, poles)

    def controller(self, z: Complex) -> Complex:
        """K with u = K y at points `z`: (k, 3, outputs)."""
        r = self.robustifier.response(z)
        if self.weight is not None:
            shaped: Complex = -r * self.weight.denominator(z) / self.weight.proportional * EYE
            return shaped
        rows = np.broadcast_to(self.gain, (len(z), 4)).astype(complex)
        rows[:, 0] += r[:, 0, 0]
        return np.kron(-rows / self.scales, EYE).reshape(len(z), AXES, 4 * AXES).astype(complex)


GRID = np.exp(1j * np.geomspace(1e-5, np.pi, 250))  # of the optimisation only; the margin is found anew


def choose_opening(design: Design, settings: DesignSettings, period: float, name: str | None) -> Opening:
    """The loop opened at the signal `name`: by default "v-bar" for loop shaping and "v" for the others.

    Raises InputError for a signal at which it cannot be.
    """
    shaping = design.name.endswith("+loop-shaping")
    robustifier = robustifier_of(design, period)
    name = name or ("v-bar" if shaping else "v")
    if name == "v-bar" and shaping:
        p, i = settings.loop_shaping.proportional, settings.loop_shaping.integral
        return Opening(name, design.gain, robustifier, Weight(p, 1.0 - i * period / p), np.ones(4))
    if name == "v":
        return Opening(name, design.gain, robustifier, None, best_scales(design.gain, robustifier, period))
    raise InputError(
        f"the loop of {design.name} opened at '{name}'",
        allowed="v for every controller, v-bar for those with loop shaping",
        remedy="choose another signal with --open-at, or leave it out",
    )


def best_scales(gain: Array, robustifier: SampledSystem, period: float) -> Array:
    """Scales (4,) of z, z', z'', z''' for which b(G, K) at "v" is largest."""
    flat = design_inner_loop(gain, period).response(GRID)[:, ::3, 0]  # one axis
    r = robustifier.response(GRID)[:, 0, 0]
    law = np.tile(gain.astype(complex), (len(GRID), 1))
    law[:, 0] += r
    plant, controller = np.abs(flat) ** 2, np.abs(law) ** 2
    v, loop = np.abs(1.0 - flat @ gain) ** 2, np.abs(1.0 + r * flat[:, 0]) ** 2

    def cost(logarithms: Array) -> float:
        squares = np.exp(2.0 * logarithms)
        return float(np.log((plant @ squares + v) * (1.0 + controller @ (1.0 / squares)) / loop).max())

    optimum = minimize(
        cost, np.log(gain), method="Nelder-Mead", options={"maxfev": 4000, "xatol": 1e-5, "fatol": 1e-8}
    )
    scales: Array = np.exp(optimum.x)
    return scales
