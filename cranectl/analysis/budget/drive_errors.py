"""What real drives make of a command, as equivalent disturbances along a nominal run.

servos       first-order lag tau under held set-points w = w_u + lead u, pulled by the rope with F:
x'' = (w - x')/tau + F/m; with the lead tau it is -(T/2) u' and the high-pass of F tau/m
limits       set-points and forces cut off, through the servo
delay        u(t - T_d) - u(t)
friction     its force like F
"""

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.equivalent import Equivalent
from cranectl.analysis.budget.propagation import Deviation, DriveOperator, no_errors
from cranectl.analysis.budget.trajectory_loop import TrajectoryLoop
from cranectl.effects.friction import STICTION_RATE
from cranectl.effects.limits import limited, make_limits
from cranectl.effects.settings import DriveLimits, Friction
from cranectl.jit import jit
from cranectl.parameters import RigParameters
from cranectl.simulate import Run

Array = NDArray[np.float64]

STICTION_SPEED = 1e-3  # [m/s], below which Coulomb's friction of an axis is smoothed


def servo_error(run: Run, loop: TrajectoryLoop, *, yielding: bool = True) -> Equivalent:
    """Velocity servos, that yield to the rope or, `yielding` false, do not, less ideal drives."""
    rig, period, ports = run.scenario.rig, loop.period, no_errors(loop)
    lag = rig.time_constants
    lead = lag * run.scenario.control.lag_compensation
    gain = -np.expm1(-period / lag) / period  # of the set-point's distance, mean over a sample [1/s]
    u, states = run.block("input")[:-1, :3], run.block("state")[:-1]
    disturbances = run.block("disturbance")[:-1]
    pull, by_state, by_command = _linear_pull(rig, states, u, disturbances)
    pull = 0.5 * (pull + rope_pull(rig, run.block("state")[1:], u, disturbances))  # mean over the sample
    if not yielding:
        pull, by_state, by_command = np.zeros_like(pull), np.zeros_like(by_state), np.zeros_like(by_command)
    implicit = np.linalg.inv(np.eye(3) - (gain * lag)[:, None] * by_command)
    operator = DriveOperator(
        0,
        implicit * (gain * lead),
        np.matmul(implicit, (gain * lag)[:, None] * by_state),
        implicit * gain,
    )
    ports.drive[:] = np.einsum("kij,kj->ki", implicit, gain * (lead * u + lag * pull) - u)
    return Equivalent(ports, operator)


def rope_pull(rig: RigParameters, states: Array, accelerations: Array, disturbances: Array) -> Array:
    """What the rope adds to the acceleration of each servo's driven mass [m/s²], (N, 3).

    Bridge and trolley feel the tension along n. The winch's driven mass includes the load and its drive holds
    the weight: it feels what the tension at constant speed of the winch has beyond the weight. The torques
    that disturb the angles act between trolley and rope, so the trolley feels their reaction.
    """
    length, alpha, alpha_rate, beta, beta_rate = (states[:, i] for i in (4, 6, 7, 8, 9))
    u_x, u_y, u_l = accelerations.T
    sa, ca, sb, cb = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    centripetal = length * (alpha_rate**2 * cb**2 + beta_rate**2)
    steady = rig.load_mass * (rig.gravity * ca * cb + centripetal - u_x * sb - u_y * sa * cb)
    tension = steady - rig.load_mass * u_l
    masses, (d_alpha, d_beta) = rig.driven_masses, rig.load_mass * length * disturbances.T
    force_x = tension * sb - d_beta * cb
    force_y = tension * cb * sa - d_alpha * cb * ca + d_beta * sb * sa
    return np.column_stack([force_x / masses[0], force_y / masses[1], (steady - rig.weight) / masses[2]])


def _linear_pull(rig: RigParameters, states: Array, u: Array, d: Array) -> tuple[Array, Array, Array]:
    """`rope_pull` and its derivatives by the state (N, 3, 10) and by the accelerations (N, 3, 3)."""
    half = 1e-5
    by_state, by_command = np.zeros((len(u), 3, 10)), np.zeros((len(u), 3, 3))
    for column in (4, 6, 7, 8, 9):
        shift = half * np.eye(10)[column]
        apart = rope_pull(rig, states + shift, u, d) - rope_pull(rig, states - shift, u, d)
        by_state[:, :, column] = apart / (2.0 * half)
    for column in range(3):
        shift = half * np.eye(3)[column]
        apart = rope_pull(rig, states, u + shift, d) - rope_pull(rig, states, u - shift, d)
        by_command[:, :, column] = apart / (2.0 * half)
    return rope_pull(rig, states, u, d), by_state, by_command


def delayed(loop: TrajectoryLoop, commands: Array, seconds: float, operator: DriveOperator) -> Equivalent:
    """`commands` (N - 1, 3) that arrive late, less punctual ones; before the first the drives rest."""
    ports, late = no_errors(loop), round(seconds / loop.period)
    arriving = np.vstack([np.zeros((min(late, len(commands)), 3)), commands])
    ports.arriving[:] = arriving[: len(commands)] - commands
    return Equivalent(ports, operator._replace(delay=late))


def limited_commands(
    run: Run, loop: TrajectoryLoop, limits: DriveLimits, predicted: Deviation, operator: DriveOperator
) -> Equivalent:
    """Set-points and forces cut off along a predicted trajectory, less free ones."""
    rig, ports, period = run.scenario.rig, no_errors(loop), loop.period
    lag = rig.time_constants
    lead = lag * run.scenario.control.lag_compensation
    u = run.block("input")[:-1, :3]
    start = run.block("state")[0, 1:6:2]
    wanted = u + predicted.commanded
    ideal = start + period * (np.cumsum(wanted, axis=0) - wanted)
    cut = np.zeros_like(wanted)
    cut_off(make_limits(limits, period), ideal + lead * wanted, start, cut)
    true_velocity = run.block("state")[:-1, 1:6:2] + predicted.state[:-1, 1:6:2]
    force = rig.velocity_gains * (ideal + lead * wanted + cut - true_velocity) - [0.0, 0.0, rig.weight]
    excess = np.clip(force, -np.array(limits.force), np.array(limits.force)) - force
    ports.drive[:] = (operator.by_slip @ (cut + excess / rig.velocity_gains)[:, :, None])[:, :, 0]
    return Equivalent(ports, operator)


@jit
def cut_off(limits, wanted, start, cut):
    """What limits take from the set-points `wanted` (N, 3), into `cut`; the tracker's integral follows."""
    previous, shift = start.copy(), np.zeros(3)
    for k in range(len(wanted)):
        for axis in range(3):
            asked = wanted[k, axis] + shift[axis]
            previous[axis] = limited(limits, axis, asked, previous[axis])
            shift[axis] += previous[axis] - asked
            cut[k, axis] = shift[axis]


def rubbed(
    run: Run, loop: TrajectoryLoop, friction: Friction, predicted: Deviation, operator: DriveOperator
) -> Equivalent:
    """Friction along a predicted trajectory; at rest, where it is up to Coulomb's, it is taken as none."""
    rig, ports = run.scenario.rig, no_errors(loop)
    u, d = run.block("input")[:-1, :3], run.block("disturbance")[:-1]
    states = (run.block("state") + predicted.state[:, :10])[:-1]
    rates, joint_rates = states[:, 1:6:2], states[:, 7::2]
    force = -np.array(friction.viscous) * rates - np.array(friction.coulomb) * np.tanh(rates / STICTION_SPEED)
    torque = -friction.pivot_viscous * joint_rates
    torque -= friction.pivot_coulomb * np.tanh(joint_rates / STICTION_RATE)
    length, cos_beta = states[:, 4], np.cos(states[:, 8])
    inertia = rig.load_mass * length**2
    ports.disturbance[:] = torque / np.column_stack([inertia * cos_beta**2, inertia])
    reaction = rope_pull(rig, states, u, d + ports.disturbance) - rope_pull(rig, states, u, d)
    pulled = reaction + force / rig.driven_masses
    ports.drive[:] = (operator.by_slip @ (rig.time_constants * pulled)[:, :, None])[:, :, 0]
    return Equivalent(ports, operator)
