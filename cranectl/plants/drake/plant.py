"""The Drake plant: accelerations from Drake, behind the plant interface; it uses none of our equations.

Python evaluates each stage of the integrator. That is fast enough for validation, too slow for campaigns.
"""

from importlib.metadata import version
from math import cos, isfinite

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import RigidBody
from scipy.integrate import RK45

from cranectl.plants.differences import fastest_rate
from cranectl.plants.drake.model import AXES, HOOK, JOINTS, LOAD, build_crane, drive_forces
from cranectl.plants.plant import Drive, check_hook, check_rate
from cranectl.plants.surroundings import FORCE, air_drag
from cranectl.scenario import EffectSettings, RigParameters
from cranectl.support import Array

SMALL = 1e-6  # step of finite differences [m, rad, m/s, rad/s]


class DrakePlant:
    """The rig in Drake behind the plant interface."""

    name = "drake"
    kernels = None

    def __init__(
        self, rig: RigParameters, *, drive: Drive, step: float, substeps: int, effects: EffectSettings
    ) -> None:
        self.drive, self.effects = drive, effects
        self.step, self.substeps = step, substeps
        self.load_mass, self.drag = rig.load_mass, air_drag(effects)
        self.in_air = effects.wind is not None
        self.crane = build_crane(rig, drive, effects)
        self.context = self.crane.CreateDefaultContext()
        self.load, self.trolley = (self.crane.GetBodyByName(name) for name in (LOAD, "trolley"))
        self.end = self.crane.GetBodyByName(HOOK if effects.body else LOAD)  # of the rope
        self.hook_mass = effects.body.hook_mass if effects.body else 0.0
        self.gravity = self.crane.gravity_field().gravity_vector()
        joints = [self.crane.GetJointByName(name) for name in JOINTS]
        self.positions = np.array([joint.position_start() for joint in joints])
        self.velocities = np.array([joint.velocity_start() for joint in joints])
        self.actuators = [int(self.crane.GetJointActuatorByName(name).input_start()) for name in AXES]
        self.gain, self.offset = drive_forces(rig, drive, effects)
        self.state = np.zeros(self.crane.num_multibody_states())
        self.disturbance, self.wind = np.zeros(2), np.zeros(6)
        self.equivalent = np.zeros(3)  # force [N] on a body that replaces the disturbance's torque

    @property
    def description(self) -> str:
        software = f"Drake {version('drake')}, pydrake.multibody"
        return f"cranectl.plants.drake.model in {software}; fixed steps of Dormand and Prince, order 5"

    @property
    def handle(self) -> None:
        """No compiled code steps this plant."""

    def retune(self, rig: RigParameters, effects: EffectSettings) -> bool:  # noqa: ARG002
        """Return False: only campaigns retune plants, and this plant is too slow for them."""
        return False

    def check_length(self, length: float) -> None:
        """Raise InputError if a rope of `length` [m] is too short for the effects or for the step."""
        if self.effects.frame or self.effects.friction or self.effects.body:
            check_hook(self.effects, length)
            step, period = self.step, self.step * self.substeps
            check_rate(self.fastest_rate(length), self.effects, length, step=step, period=period)

    def fastest_rate(self, length: float) -> float:
        """Return the largest modulus of the poles [1/s] about rest with `length` [m] of rope."""
        self.hold(np.zeros(3), np.zeros(2), np.zeros(6))
        hanging = np.zeros_like(self.state)
        hanging[self.positions[2]] = length
        return fastest_rate(self.rates, hanging, step=SMALL)

    def reset(self, state: Array) -> None:
        check_hook(self.effects, state[4])
        self.state[:] = 0.0  # also of frame and body, which begin at rest
        self.state[self.positions] = state[0::2]
        self.state[self.crane.num_positions() + self.velocities] = state[1::2]

    def measure(self, state: Array) -> None:
        state[0::2] = self.state[self.positions]
        state[1::2] = self.state[self.crane.num_positions() + self.velocities]

    def advance(self, command: Array, disturbance: Array, wind: Array, load: Array) -> None:
        self.hold(command, disturbance, wind)
        self.observe_load(load)
        self.integrate(self.step * self.substeps)

    def warnings(self) -> int:
        return 0

    def hold(self, command: Array, disturbance: Array, wind: Array) -> None:
        """Set command, disturbance and wind, which stay constant over a control period."""
        forces = np.zeros(self.crane.num_actuators())
        forces[self.actuators] = self.gain * command + self.offset
        self.crane.get_actuation_input_port().FixValue(self.context, forces)
        self.disturbance, self.wind = disturbance, wind
        self.equivalent = np.zeros(3)
        self._turn_joint(0.0, 0.0)  # `rates` applies a disturbance only if there is one

    def observe_load(self, load: Array) -> None:
        """Write position and velocity of the load and the tension of the rope into `load` (7,)."""
        # `rates` also puts the state into the context, from which all below is read.
        if not isfinite(self.rates(self.state).sum()):
            load[:] = np.nan
            return
        load[:3] = self.load.EvalPoseInWorld(self.context).translation()
        load[3:6] = self.load.EvalSpatialVelocityInWorld(self.context).translational()
        up = self.end.EvalPoseInWorld(self.context).rotation().matrix()[:, 2]  # along the rope
        # The force of a disturbance on a body is across the rope, and so not in the tension.
        load[6] = up @ (self.pull(self.load, self.load_mass) - self.air_force())
        if self.hook_mass > 0.0:
            load[6] += up @ self.pull(self.end, self.hook_mass)

    def pull(self, body: RigidBody, mass: float) -> Array:
        """Return the force [N] besides its weight that makes a `body` of `mass` [kg] move as it does."""
        acceleration = body.EvalSpatialAccelerationInWorld(self.context).translational()
        force: Array = mass * (acceleration - self.gravity)
        return force

    def integrate(self, duration: float) -> None:
        """Advance the state by `duration` [s] in steps of the Dormand-Prince method of order 5."""
        stages = np.zeros((RK45.n_stages, len(self.state)))
        for _ in range(round(duration / self.step)):
            for s in range(RK45.n_stages):
                stages[s] = self.rates(self.state + self.step * (RK45.A[s, :s] @ stages[:s]))
            self.state += self.step * (RK45.B @ stages)

    def rates(self, state: Array) -> Array:
        """Return the derivative of Drake's positions and velocities, or NaN if Drake fails."""
        if not isfinite(state.sum()):  # Drake would end the process
            return np.full_like(state, np.nan)
        try:
            self.crane.SetPositionsAndVelocities(self.context, state)
            if self.disturbance.any():
                self._disturb()
            if self.in_air or self.effects.body:
                self._push_bodies()
            rates: Array = self.crane.EvalTimeDerivatives(self.context).CopyToVector()
        except RuntimeError:  # a load at the pivot has no inertia about it
            return np.full_like(state, np.nan)
        return rates

    def air_force(self) -> Array:
        """Return the drag plus the other force in `wind` on the load (x, y, z) [N], at the present state."""
        if not self.in_air:
            return np.zeros(3)
        through = self.wind[:FORCE] - self.load.EvalSpatialVelocityInWorld(self.context).translational()
        force: Array = self.drag * np.linalg.norm(through) * through + self.wind[FORCE:]
        return force

    def _disturb(self) -> None:
        """Apply the thesis's disturbance at the present state, as a torque or, on a body, as a force."""
        length, _, beta = self.crane.GetPositions(self.context)[self.positions[2:]]
        if self.effects.body:
            across = self.end.EvalPoseInWorld(self.context).rotation().matrix()[:, :2]  # by beta, by alpha
            along = np.array([self.disturbance[1], cos(beta) * self.disturbance[0]])
            self.equivalent = self.load_mass * length * (across @ along)
            return
        inertia = self.load_mass * length * length
        self._turn_joint(inertia * cos(beta) ** 2 * self.disturbance[0], inertia * self.disturbance[1])

    def _turn_joint(self, alpha: float, beta: float) -> None:
        torques = np.zeros(self.crane.num_velocities())
        torques[self.velocities[3:]] = alpha, beta
        self.crane.get_applied_generalized_force_input_port().FixValue(self.context, torques)

    def _push_bodies(self) -> None:
        """Apply the force on the load, and to the trolley the opposite of the disturbance's force."""
        pushes = []
        for body, force in (
            (self.load, self.air_force() + self.equivalent),
            (self.trolley, -self.equivalent),
        ):
            push = ExternallyAppliedSpatialForce()
            push.body_index, push.p_BoBq_B = body.index(), np.zeros(3)
            push.F_Bq_W = SpatialForce(np.zeros(3), force)
            pushes.append(push)
        self.crane.get_applied_spatial_force_input_port().FixValue(self.context, Value(pushes))
