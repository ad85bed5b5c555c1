"""Open the loop for the certificate: return the graphs of plant and design model, and the controller.

State feedback v = v-bar - F (z, z', z'', z''') is closed on each axis. The loop is opened at
one of these signals, see docs/explanation/certificate.md:

    "v-bar"  plant: W then the inner loop, to z.                  controller: W^-1 times the robustifier
    "v"      plant: the chain from v to the scaled flat state.    controller: state feedback + robustifier
    "u"      plant: the crane from accelerations of its drives to their positions, the angles, and the rates
             of both, scaled; without the rope.                   controller: a controller's linearisation

The nu-gap depends on this signal and on the scales of the plant's outputs. At "v" and "u" the scales are
those for which b(G, K) is largest. The logarithm of 1/b² is a maximum over frequency of convex functions of
the logarithms of the scales (a geometric program), so descent from any start finds the only optimum.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_continuous_are
from scipy.optimize import minimize

from cranectl.controllers import CRANE_STATES, LinearController
from cranectl.design import Design, zero_order_hold
from cranectl.scenario import DesignSettings
from cranectl.support import Array, InputError
from cranectl.tools.robustness.certificate.linear_plant import LinearPlant
from cranectl.tools.robustness.certificate.nu_gap import Graph
from cranectl.tools.robustness.certificate.systems import Complex, SampledSystem

MARGINAL = 1e-9  # poles this near to the unit circle count as on it
CANCELLATION_TOLERANCE = 1e-9  # a smaller share of a gain is the rounding error of two that cancel
SIGNALS = CRANE_STATES  # four measured on each axis: a flat output and three derivatives, or crane states


@dataclass(frozen=True)
class InnerLoop:
    """The system from v-bar (m) to the measured signals (4 m), with state feedback closed.

    It has m axes: three with flat states, or the two horizontal axes outside the flat family, with u as v.
    The delay is not in the matrices.
    """

    opened: SampledSystem  # at the drives; inputs: arriving commands, v-bar; outputs: commands, measured
    delay: int  # [samples]

    @cached_property
    def arriving(self) -> SampledSystem:
        """The system with delay as states; inputs: added to arriving, v-bar; outputs: arriving, measured."""
        drives, _ = drive_slices(self.opened)
        return self.opened.with_delay(drives, drives, self.delay)

    def response(self, z: Complex) -> Complex:
        """Return the response (k, 4 m, m) at points `z` (k,)."""
        drives, rest = drive_slices(self.opened)
        response = self.opened.close_inputs(drives, drives, np.eye(drives.stop)).response(z)
        if self.delay == 0:
            return response[:, rest, rest]
        late = (z**-self.delay - 1.0)[:, None, None]
        own, external = late * response[:, drives, drives], late * response[:, drives, rest]
        added = np.linalg.solve(np.eye(own.shape[1]) - own, external)
        total: Complex = response[:, rest, rest] + response[:, rest, drives] @ added
        return total

    @staticmethod
    def of(plant: LinearPlant, gain: Array) -> "InnerLoop":
        """Return the linearised plant under state feedback with `gain` (4,) on each axis."""
        drives, rest = drive_slices(plant.system)
        feedback = -np.kron(gain, np.eye(drives.stop)).astype(float)
        return InnerLoop(plant.system.close_inputs(rest, rest, feedback), plant.delay)

    def closed_loop(self, robustifier: SampledSystem) -> SampledSystem:
        """Return the closed loop from a disturbance of the arriving commands (m) to these commands (m).

        Its states are the linear plant, its delays, and then the robustifier states axis by axis.
        """
        a, b, c, d = self.arriving
        drives, rest = drive_slices(self.arriving)
        r = on_each_axis(robustifier, drives.stop)
        b_v, d_v, measured = b[:, rest], d[drives, rest], c[rest]
        return SampledSystem(
            np.block([[a - b_v @ r.d @ measured, b_v @ r.c], [-r.b @ measured, r.a]]).astype(float),
            np.vstack([b[:, drives], np.zeros((len(r.a), drives.stop))]),
            np.hstack([c[drives] - d_v @ r.d @ measured, d_v @ r.c]),
            d[drives, drives],
        )

    def closed_loop_radius(self, robustifier: SampledSystem) -> float:
        """Return the largest modulus of the closed loop's poles: below 1 the linear loop is stable."""
        return float(np.abs(self.closed_loop(robustifier).poles()).max())


def drive_slices(system: SampledSystem) -> tuple[slice, slice]:
    """Return the slice of inputs and outputs at the drives of a plant or inner loop, and that of the rest."""
    axes = system.b.shape[1] // 2
    return slice(0, axes), slice(axes, None)


@dataclass(frozen=True)
class AxisDesign:
    """The design model of one axis of the loop: x' = A x + B v, v = -(F + R) x; all axes are alike."""

    a: Array  # (4, 4)
    b: Array  # (4, 1)
    gain: Array  # F (4,)
    robustifier: SampledSystem  # R, from -x (4) to what it adds to v
    axes: int
    period: float  # [s], over which v is held

    def inner_loop(self) -> InnerLoop:
        """Return the design model, with all its axes, under state feedback."""
        phi, hold = zero_order_hold(self.a, self.b, self.period)
        eye, n = np.eye(self.axes), SIGNALS * self.axes
        a, b = np.kron(phi, eye), np.kron(hold, eye)
        whole = SampledSystem(
            (a - b @ np.kron(self.gain, eye)).astype(float),
            np.hstack([np.zeros((n, self.axes)), b]),
            np.vstack([np.zeros((self.axes, n)), np.eye(n)]),
            np.zeros((n + self.axes, 2 * self.axes)),
        )
        return InnerLoop(whole, delay=0)

    @staticmethod
    def of_flat(design: Design, period: float) -> "AxisDesign":
        """Return the chain z'''' = v, its state feedback, and the sampled robustifier from e to v-bar."""
        blocks = design.robustifier.sampled(period)
        first = np.eye(1, SIGNALS)
        robustifier = SampledSystem(
            blocks.matrix,
            blocks.input_matrix.reshape(-1, 1) @ first,
            blocks.output_matrix.reshape(1, -1),
            blocks.feedthrough * first,
        )
        return AxisDesign(np.diag(np.ones(3), 1), np.eye(4)[:, 3:], design.gain, robustifier, 3, period)

    @staticmethod
    def of_controller(controller: LinearController, period: float) -> "AxisDesign":
        """Return a linearised controller as axis design: its own states become the robustifier R.

        Coprime factors need an F that makes the crane stable. If the controller's own gain does not, F is an
        LQR gain, and R gets the difference of both. That changes neither the loop nor the margin.
        """
        crane, own = slice(SIGNALS), slice(SIGNALS, None)
        a, b, gain = controller.a[crane, crane], controller.b[crane], controller.gain[crane]
        phi, hold = zero_order_hold(a, b, period)
        if np.abs(np.linalg.eigvals(phi - hold @ gain[None])).max() >= 1.0 - MARGINAL:
            gain = (b.T @ solve_continuous_are(a, b, np.eye(SIGNALS), [[1.0]]))[0]
        phi, hold = zero_order_hold(controller.a[own, own], controller.a[own, crane], period)
        robustifier = SampledSystem(
            phi, hold, controller.gain[None, own], (controller.gain[crane] - gain)[None]
        )
        return AxisDesign(a, b, gain, robustifier, 2, period)


def on_each_axis(system: SampledSystem, axes: int) -> SampledSystem:
    """Repeat a system on each axis: states are ordered by axis, inputs and outputs by signal."""
    eye: Array = np.eye(axes)
    b = np.einsum("xy,si->xsiy", eye, system.b).reshape(axes * len(system.a), axes * SIGNALS)
    a, c, d = np.kron(eye, system.a), np.kron(eye, system.c), np.kron(system.d, eye)
    return SampledSystem(a.astype(float), b, c.astype(float), d.astype(float))


@dataclass(frozen=True)
class Weight:
    """The weight P + I T/(z - 1) before the inner loop, as a ratio of two factors without an integrator.

    Both have the pole 1 - I T/P. The numerator is the constant P, the denominator (z - 1)/(z - pole).
    """

    proportional: float  # P
    pole: float

    def denominator(self, z: Complex) -> Complex:
        """Return (z - 1)/(z - pole), shape (k, 1, 1)."""
        ratio: Complex = ((z - 1.0) / (z - self.pole))[:, None, None]
        return ratio


@dataclass(frozen=True)
class Opening:
    """Where the loop is opened and how the signals there are scaled."""

    name: str  # v-bar, v or u
    axis: AxisDesign
    weight: Weight | None  # at "v-bar"
    scales: Array  # (4,) of z, z', z'', z''' at "v" [1/m⁠·s⁴ …], of an axis at "u": y = scale times signal

    def graph(self, inner: InnerLoop) -> Graph:
        """Return the graph of the plant; its poles are those of the inner loop, without integrators."""
        poles, weight, axes = inner.arriving.poles(), self.weight, self.axis.axes
        eye = np.eye(axes)
        if weight is not None:
            poles = np.concatenate([poles, np.full(axes, weight.pole)])

        def symbol(z: Complex) -> Complex:
            measured = inner.response(z)
            if weight is not None:
                output, injected = weight.proportional * measured[:, :axes], weight.denominator(z) * eye
            else:
                output = np.repeat(self.scales, axes)[:, None] * measured
                injected = eye - np.kron(self.axis.gain, eye) @ measured
            return np.concatenate([output, injected], axis=1)

        return Graph(symbol, poles)

    def controller(self, z: Complex) -> Complex:
        """Return K with u = K y at points `z`: (k, m, outputs)."""
        r, eye = self.axis.robustifier.response(z), np.eye(self.axis.axes)
        if self.weight is not None:
            shaped: Complex = -r[:, :, :1] * self.weight.denominator(z) / self.weight.proportional * eye
            return shaped
        used = self.scales > 0.0
        rows = np.where(used, -(self.axis.gain + r[:, 0]) / np.where(used, self.scales, 1.0), 0.0)
        return np.kron(rows, eye).reshape(len(z), len(eye), -1).astype(complex)

    @staticmethod
    def choose(controller: str, axis: AxisDesign, settings: DesignSettings, name: str | None) -> "Opening":
        """Choose where the loop is opened: "v-bar" for loop shaping, "v" for the rest of the flat family.

        The loop of every other controller is opened at "u". Raises InputError for a `name` that it does not
        have.
        """
        shaping, plain = controller.endswith("+loop-shaping"), "v" if axis.axes == 3 else "u"
        name = name or ("v-bar" if shaping else plain)
        if name == "v-bar" and shaping:
            p, i = settings.loop_shaping.proportional, settings.loop_shaping.integral
            return Opening(name, axis, Weight(p, 1.0 - i * axis.period / p), np.ones(SIGNALS))
        if name == plain:
            return Opening(name, axis, None, best_scales(axis))
        raise InputError(
            f"the loop of {controller} opened at '{name}'",
            allowed="v for the flat family, v-bar for those of it with loop shaping, u for other controllers",
            remedy="choose another signal with --open-at, or leave it out",
        )


GRID = np.exp(1j * np.geomspace(1e-5, np.pi, 250))  # for the optimisation only, not for the margin


def best_scales(axis: AxisDesign) -> Array:
    """Find the scales (4,) with the largest b(G, K) at "v" or "u"; 0 for signals that are not used."""
    measured = axis.inner_loop().response(GRID)[:, :: axis.axes, 0]
    r = axis.robustifier.response(GRID)[:, 0]
    plant, controller = np.abs(measured) ** 2, np.abs(axis.gain + r) ** 2
    used = np.sqrt(controller.max(axis=0)) > CANCELLATION_TOLERANCE * np.abs(axis.gain)
    plant, controller = plant[:, used], controller[:, used]
    v, loop = np.abs(1.0 - measured @ axis.gain) ** 2, np.abs(1.0 + (r * measured).sum(axis=1)) ** 2

    def cost(logarithms: Array) -> float:
        squares = np.exp(2.0 * logarithms)
        return float(np.log((plant @ squares + v) * (1.0 + controller @ (1.0 / squares)) / loop).max())

    start = 0.5 * np.log(controller).mean(axis=0)
    optimum = minimize(
        cost, start, method="Nelder-Mead", options={"maxfev": 4000, "xatol": 1e-5, "fatol": 1e-8}
    )
    scales = np.zeros(SIGNALS)
    scales[used] = np.exp(optimum.x)
    return scales
