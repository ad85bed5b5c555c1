"""Read the state of a crane from two sites of its model, the pivot and the load, in place of its joints."""

from math import asin, atan2, cos, sqrt
from typing import NamedTuple

import mujoco
import numpy as np

from cranectl.plants.mujoco.engine import SITE, mj_com_pos, mj_com_vel, mj_kinematics, mj_object_velocity
from cranectl.support import Array, InputError, jit

AXES = ("bridge", "trolley", "rope", "alpha", "beta")
MAX_NEWTON_STEPS = 50
PLACED = 1e-10  # [m, rad] from the state that the sites are to show; one more step then reaches rounding


class SiteViews(NamedTuple):
    """Views of the sites of a model whose joints may have any names and arrangement."""

    active: bool  # False for the shipped model, whose joints are the state
    pivot: Array  # (3,) position [m]
    load: Array  # (3,) position [m]
    pivot_id: int
    load_id: int
    pivot_motion: Array  # (6,) angular and linear velocity, work space
    load_motion: Array  # (6,)
    shown: Array  # (10,) state, work space
    has_winch: bool  # whether the rope can change its length; the next two are read only then
    winch_inertia: float  # referred to the rope [kg]
    winch_ratio: float  # velocity of the winch's actuator over that of the rope


_NONE = np.zeros(0)
NO_SITES = SiteViews(False, _NONE, _NONE, 0, 0, _NONE, _NONE, _NONE, True, 0.0, 0.0)


@jit
def state_of_sites(pivot, load, pivot_velocity, load_velocity, state):
    """Write the state (10,) that positions [m] and velocities [m/s] of pivot and load (3,) show."""
    x, y, z = load[0] - pivot[0], load[1] - pivot[1], load[2] - pivot[2]
    v_x = load_velocity[0] - pivot_velocity[0]
    v_y = load_velocity[1] - pivot_velocity[1]
    v_z = load_velocity[2] - pivot_velocity[2]
    across = y * y + z * z  # square of the distance from the x axis
    length = sqrt(x * x + across)
    rate = (x * v_x + y * v_y + z * v_z) / length
    beta = asin(x / length)
    state[0], state[1] = pivot[0], pivot_velocity[0]
    state[2], state[3] = pivot[1], pivot_velocity[1]
    state[4], state[5] = length, rate
    state[6], state[7] = atan2(y, -z), (y * v_z - z * v_y) / across
    state[8], state[9] = beta, (v_x - rate * x / length) / (length * cos(beta))


@jit
def measure_sites(rig, state):
    """Write the state (10,) that the sites show at the present positions and velocities of the joints."""
    sites = rig.sites
    mj_kinematics(rig.model, rig.data)
    mj_com_pos(rig.model, rig.data)
    mj_com_vel(rig.model, rig.data)
    mj_object_velocity(rig.model, rig.data, SITE, sites.pivot_id, sites.pivot_motion.ctypes.data, 0)
    mj_object_velocity(rig.model, rig.data, SITE, sites.load_id, sites.load_motion.ctypes.data, 0)
    state_of_sites(sites.pivot, sites.load, sites.pivot_motion[3:], sites.load_motion[3:], state)


@jit
def swing_of(rig):
    """Return rope length, alpha and beta at the positions for which the engine computes forces now."""
    sites = rig.sites
    if not sites.active:
        return rig.qpos[rig.joints[2]], rig.qpos[rig.joints[3]], rig.qpos[rig.joints[4]]
    state_of_sites(sites.pivot, sites.load, sites.pivot_motion[3:], sites.load_motion[3:], sites.shown)
    return sites.shown[4], sites.shown[6], sites.shown[8]


@jit
def rope_acceleration(seen, sensors):
    """Return the second derivative of the distance from pivot to load [m/s²], as sensors show it.

    Sensors have the values of `own_file.SENSORS`. Gravity is in both accelerations alike.
    """
    square, rate, speed, pull = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        way = sensors[seen[i]] - sensors[seen[7 + i]]
        velocity = sensors[seen[3 + i]] - sensors[seen[10 + i]]
        square += way * way
        rate += way * velocity
        speed += velocity * velocity
        pull += way * (sensors[seen[16 + i]] - sensors[seen[13 + i]])
    return (pull + speed - rate * rate / square) / sqrt(square)


@jit
def pull_along_rope(seen, sensors):
    """Return the part of the load's acceleration towards the pivot that gravity does not cause [m/s²]."""
    square, pull = 0.0, 0.0
    for i in range(3):
        square += (sensors[seen[7 + i]] - sensors[seen[i]]) ** 2
        pull += (sensors[seen[7 + i]] - sensors[seen[i]]) * sensors[seen[16 + i]]
    return pull / sqrt(square)


@jit
def read_load_of_sites(rig, load):
    """Write height of the load below the pivot [m] and force of the rope [N] into `load`.

    The values are those at the start of the step. The force on a winch follows from that of its drive and its
    acceleration, and the force in a fixed rope from the acceleration of the load.
    """
    seen, sensors, sites = rig.load_sensors, rig.sensors, rig.sites
    load[2] = sensors[seen[2]] - sensors[seen[9]]
    if not sites.has_winch:
        load[6] = rig.load_mass * pull_along_rope(seen, sensors)
        return
    load[6] = sites.winch_inertia * rope_acceleration(seen, sensors) - sites.winch_ratio * sensors[seen[6]]


class SiteModel:
    """A compiled model whose sites of pivot and load show the state of a crane."""

    def __init__(self, model: mujoco.MjModel, sites: tuple[str, str], source: object) -> None:
        """Take a model with these `sites`; errors name its `source`."""
        self.model, self.source = model, source
        self.sites = tuple(model.site(name).id for name in sites)

    def show(self, data: mujoco.MjData) -> tuple[Array, Array]:
        """Return the state (10,) that the sites show, and the gradient (5, nv) of its positions."""
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        columns = np.zeros((2, 3, self.model.nv))
        for jacobian, site in zip(columns, self.sites, strict=True):
            mujoco.mj_jacSite(self.model, data, jacobian, None, site)
        pivot, load = (data.site_xpos[site] for site in self.sites)
        state, gradient = np.zeros(10), np.zeros((5, self.model.nv))
        if np.array_equal(pivot, load):
            return state, gradient
        for k in range(self.model.nv):
            velocities = np.ascontiguousarray(columns[:, :, k])
            state_of_sites(pivot, load, velocities[0], velocities[1], state)
            gradient[:, k] = state[1::2]
        velocities = columns @ data.qvel
        state_of_sites(pivot, load, velocities[0], velocities[1], state)
        return state, gradient

    def place(self, data: mujoco.MjData, state: Array) -> Array:
        """Set joints and rates in `data` so that the sites show `state` (10,), by Newton's method.

        What the sites do not show stays as near to where it is as possible. Returns the gradient (5, nv)
        there. Raises InputError if the model cannot be there.
        """
        is_near = False
        for _ in range(MAX_NEWTON_STEPS):
            shown, gradient = self.show(data)
            inverse = np.linalg.pinv(gradient)
            if is_near:
                data.qvel[:] = inverse @ state[1::2]
                return gradient
            missing = state[0::2] - shown[0::2]
            mujoco.mj_integratePos(self.model, data.qpos, inverse @ missing, 1.0)
            is_near = bool(np.abs(missing).max() < PLACED)
        positions = ", ".join(f"{axis} {value:.4g}" for axis, value in zip(AXES, state[0::2], strict=True))
        raise InputError(
            f"{self.source}: no joints bring its sites to {positions}",
            allowed="states that its joints can reach",
            remedy="begin the reference where the model can be, or name the points that the rope connects as "
            "pivot and load",
        )
