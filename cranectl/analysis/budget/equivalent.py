"""Compute equivalent disturbances of effects along a nominal run: their errors at the ports of the loop.

Each follows from the equations of the effect and the nominal run alone, sampled with the period T:

    hold         held minus continuous command: -(T/2) u' on average over a sample, and the same for v_z and
                 for the error that the robustifier gets
    integrator   a step of the classical Runge-Kutta scheme (RK4) minus the exact step
    limits       limited minus free set-points and forces; a force on a servo is a shift of its set-point
    delay        u(t - T_d) - u(t)
    friction     its force on the axes, its torque on the joint

The structural effects of the real crane are in `plants.elastic`.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from cranectl.analysis.budget.propagation import Deviation, FrictionPort, Ports, no_errors
from cranectl.analysis.budget.trajectory_loop import EXTENSION, ROBUSTIFIER, TrajectoryLoop, analytic_plant
from cranectl.plants import ideal_inertia
from cranectl.reference import build_trajectory
from cranectl.scenario import NANOSECONDS, DriveLimits, Friction
from cranectl.signals import ALPHA, BETA, ROPE
from cranectl.simulate import Run, SetpointLimits, limited
from cranectl.support import Array, jit_called


def hold_error(run: Run, loop: TrajectoryLoop, predicted: Deviation | None = None) -> Ports:
    """Return the errors that the hold of a sampled controller adds to the continuous-time ideal.

    They depend on the signals of the continuous controller. Those are the signals of the sampled run or, more
    exactly, these minus a `predicted` deviation.
    """
    ports, period = no_errors(loop), loop.period
    extension, robustifier = len(loop.moving) + EXTENSION, len(loop.moving) + ROBUSTIFIER
    u, v, error = (run.block(n)[:, :3].copy() for n in ("input", "virtual_input", "error"))
    if predicted is not None:
        u[:-1] -= predicted.commanded
        v -= np.einsum("kij,kj->ki", loop.outputs[:, :3], predicted.state)
        error += predicted.load
    jumps = _segment_starts(run)
    ports.drive[:] = -_rise(u, period, jumps)
    v_z = -_rise(v[:, 2:], period, jumps)[:, 0]
    ports.local[:, extension] = 0.5 * period**2 * v_z
    ports.local[:, extension + 1] = period * v_z
    ramp = _ramp_response(run, period)
    error_rate = _rate(error, period, jumps)
    m = len(ramp)
    for axis in range(3):
        first = robustifier + axis * m
        ports.local[:, first : first + m] = -error_rate[:, axis : axis + 1] * ramp
    return ports


def _ramp_response(run: Run, period: float) -> Array:
    """Return the robustifier's states (m,) of one axis after one period of an error that grows by 1 m/s."""
    r = run.design.flat.robustifier
    augmented = np.zeros((r.order + 2, r.order + 2))
    augmented[:-2, :-2], augmented[:-2, -2], augmented[-2, -1] = r.a, r.b, 1.0
    states = np.zeros(r.sampled_order)
    states[: r.order] = expm(augmented * period)[:-2, -1]
    return states


def _rate(signal: Array, period: float, jumps: NDArray[np.intp]) -> Array:
    """Return the slope over each sample, (N - 1, m); before a jump, the slope of the sample before."""
    slope: Array = np.diff(signal, axis=0) / period
    for k in jumps:
        if 2 <= k <= len(slope):
            slope[k - 1] = slope[k - 2]
    return slope


def _rise(signal: Array, period: float, jumps: NDArray[np.intp]) -> Array:
    """Return the mean over each sample minus its start, (N - 1, m), by parabolas through three samples."""
    slope = _rate(signal, period, jumps)
    curvature = np.zeros_like(slope)
    curvature[:-1] = np.diff(slope, axis=0)
    for k in jumps:
        if 1 <= k <= len(curvature):
            curvature[k - 1] = 0.0
    rise: Array = 0.5 * period * slope - period / 12.0 * curvature
    return rise


def _segment_starts(run: Run) -> NDArray[np.intp]:
    """Return the samples at which the reference's segments begin."""
    joints = build_trajectory(run.scenario.reference).joints[1:]
    return np.ceil(joints * NANOSECONDS / run.scenario.period_ns - 1e-6).astype(np.intp)


def integrator_error(run: Run, loop: TrajectoryLoop) -> Ports:
    """Return the error of RK4 in the nominal run, and the effect of the rope's force on ideal drives."""
    ports = no_errors(loop)
    states, inputs, disturbances = (
        np.ascontiguousarray(run.block(name)) for name in ("state", "input", "disturbance")
    )
    analytic_plant(run).write_runge_kutta_defect(
        states, inputs[:, :3], disturbances, winds=loop.winds, defect=ports.local
    )
    load, joints = run.block("load")[:-1, 6:7], states[:-1]
    alpha, beta = joints[:, ALPHA], joints[:, BETA]
    direction = np.column_stack([np.sin(beta), np.cos(beta) * np.sin(alpha), np.ones(len(joints))])
    ports.drive[:] = load * direction / ideal_inertia(run.scenario.rig)
    return ports


def delay_error(loop: TrajectoryLoop, commands: Array) -> Ports:
    """Return delayed minus undelayed `commands` (N - 1, 3); before the first the drives rest."""
    ports = no_errors(loop)
    arriving = np.vstack([np.zeros((min(loop.delay, len(commands)), 3)), commands])
    ports.arriving[:] = arriving[: len(commands)] - commands
    return ports


def limit_error(run: Run, loop: TrajectoryLoop, limits: DriveLimits, predicted: Deviation) -> Ports:
    """Return limited minus free set-points and forces along a predicted trajectory."""
    rig, ports, period = run.scenario.rig, no_errors(loop), loop.period
    u = run.block("input")[:-1, :3]
    start = run.block("state")[0, 1:6:2]
    commanded = u + predicted.commanded
    ideal = start + period * (np.cumsum(commanded, axis=0) - commanded)
    correction = np.zeros_like(commanded)
    limit_set_points(SetpointLimits.of(limits, period), ideal + loop.lead * commanded, start, correction)
    true_velocity = run.block("state")[:-1, 1:6:2] + predicted.state[:-1, 1:6:2]
    set_points = ideal + loop.lead * commanded + correction
    force = rig.velocity_gains * (set_points - true_velocity) - [0.0, 0.0, rig.weight]
    force_correction = np.clip(force, -np.array(limits.force), np.array(limits.force)) - force
    ports.drive[:] = correction + force_correction / rig.velocity_gains
    return ports


@jit_called
def limit_set_points(limits, requested, start, correction):
    """Write limited minus requested set-points `requested` (N, 3) into `correction`.

    The set-point integral of the tracker continues from the limited values.
    """
    previous, shift = start.copy(), np.zeros(3)
    for k in range(len(requested)):
        for axis in range(3):
            shifted = requested[k, axis] + shift[axis]
            previous[axis] = limited(limits, axis, shifted, previous[axis])
            shift[axis] += previous[axis] - shifted
            correction[k, axis] = shift[axis]


def friction_port(run: Run, friction: Friction) -> FrictionPort:
    """Convert friction to shifts of the servos' set-points and angular accelerations of the joint."""
    rig, states = run.scenario.rig, run.block("state")
    inertia = rig.load_mass * states[:-1, ROPE] ** 2
    gains = np.empty((len(inertia), 5))
    gains[:, :3] = rig.velocity_gains
    gains[:, 3], gains[:, 4] = inertia * np.cos(states[:-1, BETA]) ** 2, inertia
    viscous = np.array([*friction.viscous, *(friction.pivot_viscous,) * 2])
    coulomb = np.array([*friction.coulomb, *(friction.pivot_coulomb,) * 2])
    return FrictionPort(np.ascontiguousarray(states[:, 1::2]), viscous / gains, coulomb / gains)
