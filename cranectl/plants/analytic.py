"""The analytic plant: the Lagrange model of the crane, integrated with fixed DOP853 steps."""

from math import cos, sin, sqrt, tanh
from typing import NamedTuple

import numpy as np

from cranectl.model import (
    angular_accelerations,
    forced_accelerations,
    rope_direction,
    rope_direction_rate,
    specific_rope_force,
)
from cranectl.plants.analytic_rig import AnalyticRig, make_rig
from cranectl.plants.dop853 import STAGES, A, B
from cranectl.plants.plant import DRIVES, Drive, Kernels
from cranectl.plants.surroundings import FORCE, STICTION_RATE
from cranectl.scenario import EffectSettings, RigParameters
from cranectl.signals import (
    ALPHA,
    ALPHA_RATE,
    BETA,
    BETA_RATE,
    BRIDGE,
    BRIDGE_RATE,
    ROPE,
    ROPE_RATE,
    TENSION,
    TROLLEY,
    TROLLEY_RATE,
    VELOCITY,
    X,
    Y,
    Z,
)
from cranectl.support import Array, jit


@jit
def outer_force(passive, state, wind):
    """Return the force on the load (x, y, z) [N] of air, sloping rails and disturbances; `wind` (6,)."""
    if passive is None:
        return 0.0, 0.0, 0.0
    n = rope_direction(state[ALPHA], state[BETA])
    n_dot = rope_direction_rate(state[ALPHA], state[ALPHA_RATE], state[BETA], state[BETA_RATE])
    v_x = wind[0] - state[BRIDGE_RATE] - state[ROPE_RATE] * n[0] - state[ROPE] * n_dot[0]
    v_y = wind[1] - state[TROLLEY_RATE] - state[ROPE_RATE] * n[1] - state[ROPE] * n_dot[1]
    v_z = wind[2] - state[ROPE_RATE] * n[2] - state[ROPE] * n_dot[2]
    factor = passive.drag * sqrt(v_x * v_x + v_y * v_y + v_z * v_z)
    tilt = passive.tilt
    return (
        factor * v_x + tilt[0] + wind[FORCE],
        factor * v_y + tilt[1] + wind[FORCE + 1],
        factor * v_z + tilt[2] + wind[FORCE + 2],
    )


@jit
def passive_accelerations(passive, load_mass, state, wind):
    """Compute the part of (alpha'', beta'') [rad/s²] that wind, outer forces and pivot friction cause."""
    if passive is None:
        return 0.0, 0.0
    sa, ca, sb, cb = sin(state[ALPHA]), cos(state[ALPHA]), sin(state[BETA]), cos(state[BETA])
    f_x, f_y, f_z = outer_force(passive, state, wind)
    # Torques over inertias, of a force f: l f dn/dalpha / (m l² cos² beta), l f dn/dbeta / (m l²).
    arm = 1.0 / (load_mass * state[ROPE])
    alpha = arm * (ca * f_y + sa * f_z) / cb
    beta = arm * (cb * f_x - sb * sa * f_y + ca * sb * f_z)
    friction_alpha = pivot_torque(passive, state[ALPHA_RATE]) * arm / (state[ROPE] * cb * cb)
    friction_beta = pivot_torque(passive, state[BETA_RATE]) * arm / state[ROPE]
    return alpha + friction_alpha, beta + friction_beta


@jit
def pivot_torque(passive, rate):
    """Return the friction [N m] of a cardan axis that turns with `rate`; Coulomb's is smooth at rest."""
    return -passive.pivot_viscous * rate - passive.pivot_coulomb * tanh(rate / STICTION_RATE)


@jit
def drive_accelerations(drives, rig, state, command, disturbance, wind):
    """Return the accelerations (x_c'', y_c'', l'') [m/s²] that the drives cause.

    The drives feel forces on the load and torques of its joint, except the part that moves the load across
    the rope.
    """
    if drives is None:
        return command[0], command[1], command[2]
    n = rope_direction(state[ALPHA], state[BETA])
    sa, ca, sb, cb = sin(state[ALPHA]), cos(state[ALPHA]), sin(state[BETA]), cos(state[BETA])
    f_x, f_y, f_z = outer_force(rig.passive, state, wind)
    passive = passive_accelerations(rig.passive, rig.load_mass, state, wind)
    alpha = rig.load_mass * state[ROPE] * (passive[0] + disturbance[0])
    beta = rig.load_mass * state[ROPE] * (passive[1] + disturbance[1])
    gain, damping = drives.gain, drives.damping
    bridge = gain[0] * command[0] - damping[0] * state[BRIDGE_RATE]
    trolley = gain[1] * command[1] - damping[1] * state[TROLLEY_RATE]
    winch = gain[2] * command[2] - damping[2] * state[ROPE_RATE] - drives.holding_force
    # Across the rope acts m l (alpha'' dn/dalpha + beta'' dn/dbeta), which has no part along n.
    return forced_accelerations(
        drives.masses,
        state,
        bridge + drives.slope[0] + f_x - cb * beta,
        trolley + drives.slope[1] + f_y - (ca * cb * alpha - sa * sb * beta),
        winch + f_x * n[0] + f_y * n[1] + f_z * n[2],
    )


@jit
def derivative(rig, state, accelerations, disturbance, wind, rate):
    """Write the state derivative (10,) into `rate`: the thesis's (3.22) with drives and disturbances."""
    u_x, u_y, u_l = accelerations[0], accelerations[1], accelerations[2]
    alpha_ddot, beta_ddot = angular_accelerations(
        state[ROPE], state[ROPE_RATE], state[ALPHA], state[ALPHA_RATE], state[BETA], state[BETA_RATE],
        u_x, u_y, rig.gravity,
    )  # fmt: skip
    passive = passive_accelerations(rig.passive, rig.load_mass, state, wind)
    rate[BRIDGE], rate[BRIDGE_RATE] = state[BRIDGE_RATE], u_x
    rate[TROLLEY], rate[TROLLEY_RATE] = state[TROLLEY_RATE], u_y
    rate[ROPE], rate[ROPE_RATE] = state[ROPE_RATE], u_l
    rate[ALPHA], rate[ALPHA_RATE] = state[ALPHA_RATE], alpha_ddot + passive[0] + disturbance[0]
    rate[BETA], rate[BETA_RATE] = state[BETA_RATE], beta_ddot + passive[1] + disturbance[1]


@jit
def integrate(rig, state, command, disturbance, wind, stages, stage_state):
    """Advance `state` by one DOP853 step; `stages` (12, 10) and `stage_state` (10,) are work space."""
    for s in range(STAGES):
        for i in range(10):
            increment = 0.0
            for j in range(s):
                increment += A[s, j] * stages[j, i]
            stage_state[i] = state[i] + rig.step * increment
        accelerations = drive_accelerations(rig.drives, rig, stage_state, command, disturbance, wind)
        derivative(rig, stage_state, accelerations, disturbance, wind, stages[s])
    for i in range(10):
        increment = 0.0
        for s in range(STAGES):
            increment += B[s] * stages[s, i]
        state[i] += rig.step * increment


@jit
def observe_load(rig, state, accelerations, wind, load):
    """Write load position, velocity and rope tension (7,) into `load`, at these drive accelerations."""
    length, length_rate = state[ROPE], state[ROPE_RATE]
    n = rope_direction(state[ALPHA], state[BETA])
    n_dot = rope_direction_rate(state[ALPHA], state[ALPHA_RATE], state[BETA], state[BETA_RATE])
    load[X] = state[BRIDGE] + length * n[0]
    load[Y] = state[TROLLEY] + length * n[1]
    load[Z] = length * n[2]
    load[VELOCITY + X] = state[BRIDGE_RATE] + length_rate * n[0] + length * n_dot[0]
    load[VELOCITY + Y] = state[TROLLEY_RATE] + length_rate * n[1] + length * n_dot[1]
    load[VELOCITY + Z] = length_rate * n[2] + length * n_dot[2]
    u_x, u_y, u_l = accelerations[0], accelerations[1], accelerations[2]
    force = specific_rope_force(
        length, state[ALPHA], state[ALPHA_RATE], state[BETA], state[BETA_RATE], u_x, u_y, u_l, rig.gravity
    )
    f_x, f_y, f_z = outer_force(rig.passive, state, wind)
    # `force` is along n, away from the trolley: negative where the rope pulls.
    load[TENSION] = -rig.load_mass * force + (f_x * n[0] + f_y * n[1] + f_z * n[2])


class AnalyticCrane(NamedTuple):
    """Constants, state and work space of the analytic plant: what its kernels need."""

    rig: AnalyticRig
    state: Array  # (10,)
    stages: Array  # (12, 10)
    stage_state: Array  # (10,)


@jit
def measure_joints(crane, state):
    """Write the joint positions and velocities (10,) into `state`."""
    for i in range(10):
        state[i] = crane.state[i]


@jit
def advance(crane, command, disturbance, wind, load):
    """Advance the crane by one control period; see `Plant.advance`."""
    accelerations = drive_accelerations(crane.rig.drives, crane.rig, crane.state, command, disturbance, wind)
    observe_load(crane.rig, crane.state, accelerations, wind, load)
    for _ in range(crane.rig.substeps):
        integrate(crane.rig, crane.state, command, disturbance, wind, crane.stages, crane.stage_state)


@jit
def no_warnings(_):
    """Return 0: this plant has no warnings."""
    return 0


class AnalyticPlant:
    """The Lagrange model behind the plant interface."""

    name = "analytic"
    kernels: Kernels | None = Kernels(measure_joints, advance, no_warnings)  # for the compiled loop
    description = "cranectl.model.dynamics, fixed-step DOP853"

    def __init__(
        self,
        rig: RigParameters,
        *,
        drive: Drive,
        step: float,
        substeps: int,
        effects: EffectSettings = EffectSettings(),
    ) -> None:
        self.drive = drive
        if DRIVES[drive].is_servo:
            self.description = f"{self.description}, velocity servos"
        self.rig = make_rig(rig, drive, effects, substeps=substeps, step=step)
        self.state = np.zeros(10)
        self.stages, self.stage_state = np.zeros((STAGES, 10)), np.zeros(10)

    def retune(self, rig: RigParameters, effects: EffectSettings) -> bool:
        substeps, step = self.rig.substeps, self.rig.step
        self.rig = make_rig(rig, self.drive, effects, substeps=substeps, step=step)
        return True  # also if effects are switched, since each loop takes a new `handle`

    def check_length(self, length: float) -> None:
        """Accept any rope length."""

    def reset(self, state: Array) -> None:
        self.state[:] = state

    @property
    def handle(self) -> AnalyticCrane:
        return AnalyticCrane(self.rig, self.state, self.stages, self.stage_state)

    def measure(self, state: Array) -> None:
        state[:] = self.state

    def advance(self, command: Array, disturbance: Array, wind: Array, load: Array) -> None:
        advance(self.handle, command, disturbance, wind, load)

    def warnings(self) -> int:
        return 0
