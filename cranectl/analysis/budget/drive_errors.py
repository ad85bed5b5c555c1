"""What stands between a command and a drive that obeys it, as equivalent disturbances along a motion.

limits       set-points and forces cut off; a force on a servo is worth a shift of its set-point
delay        u(t - T_d) - u(t)
friction     its force on the axes, its torque on the joint
"""

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.propagation import Deviation, FrictionPort, Ports, no_errors
from cranectl.analysis.budget.trajectory_loop import TrajectoryLoop
from cranectl.scenario.effects import DriveLimits, Friction
from cranectl.simulate import Run
from cranectl.simulate.signal_path import limited, make_limits
from cranectl.support.jit import jit

Array = NDArray[np.float64]


def delayed(loop: TrajectoryLoop, commands: Array, samples: int) -> Ports:
    """`commands` (N - 1, 3) that arrive late, less punctual ones; before the first the drives rest."""
    ports = no_errors(loop)
    arriving = np.vstack([np.zeros((min(samples, len(commands)), 3)), commands])
    ports.arriving[:] = arriving[: len(commands)] - commands
    return ports


def limited_commands(run: Run, loop: TrajectoryLoop, limits: DriveLimits, predicted: Deviation) -> Ports:
    """Set-points and forces cut off along a predicted trajectory, less free ones."""
    rig, ports, period = run.scenario.rig, no_errors(loop), loop.period
    u = run.block("input")[:-1, :3]
    start = run.block("state")[0, 1:6:2]
    wanted = u + predicted.commanded
    ideal = start + period * (np.cumsum(wanted, axis=0) - wanted)
    cut = np.zeros_like(wanted)
    cut_off(make_limits(limits, period), ideal + loop.lead * wanted, start, cut)
    true_velocity = run.block("state")[:-1, 1:6:2] + predicted.state[:-1, 1:6:2]
    force = rig.velocity_gains * (ideal + loop.lead * wanted + cut - true_velocity) - [0.0, 0.0, rig.weight]
    excess = np.clip(force, -np.array(limits.force), np.array(limits.force)) - force
    ports.drive[:] = cut + excess / rig.velocity_gains
    return ports


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


def friction_of(run: Run, friction: Friction) -> FrictionPort:
    """Friction as a shift of the set-points of servos and an angular acceleration of the joint."""
    rig, states = run.scenario.rig, run.block("state")
    inertia = rig.load_mass * states[:-1, 4] ** 2
    worth = np.empty((len(inertia), 5))
    worth[:, :3] = rig.velocity_gains
    worth[:, 3], worth[:, 4] = inertia * np.cos(states[:-1, 8]) ** 2, inertia
    viscous = np.array([*friction.viscous, *(friction.pivot_viscous,) * 2])
    coulomb = np.array([*friction.coulomb, *(friction.pivot_coulomb,) * 2])
    return FrictionPort(np.ascontiguousarray(states[:, 1::2]), viscous / worth, coulomb / worth)
