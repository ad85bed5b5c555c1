"""The MuJoCo plant: `models/crane.xml` behind the plant interface. Knows nothing of our equations."""

from math import cos, sqrt
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.effects.settings import NO_EFFECTS, EffectSettings
from cranectl.effects.wind import air_drag
from cranectl.jit import jit
from cranectl.parameters import RigParameters
from cranectl.plants.interface import Drive
from cranectl.plants.mujoco_model import (
    compiled_model,
    drive_addresses,
    sensor_addresses,
    state_addresses,
)
from cranectl.plants.mujoco_step import mj_step

Array = NDArray[np.float64]


class MujocoRig(NamedTuple):
    """Views into one MjModel/MjData pair, and where things are in them."""

    model: int  # address
    data: int  # address
    qpos: Array
    qvel: Array
    ctrl: Array
    applied: Array  # qfrc_applied
    sensors: Array  # sensordata
    joints: NDArray[np.int64]  # (5,) x_c, y_c, l, alpha, beta
    drives: NDArray[np.int64]  # (3,)
    load_sensors: NDArray[np.int64]  # (7,)
    warnings: NDArray[np.int32]  # counts of the engine's numerical warnings
    load_mass: float
    wrench: Array  # (6,) xfrc_applied of the load: force, torque
    drag: float  # force over the square of the load's speed through the air [kg/m]
    substeps: int
    step: float  # [s]


@jit
def measure_joints(rig, state):
    """Joint positions and velocities (10,) into `state`, order of `signals.STATE`."""
    for i in range(5):
        state[2 * i] = rig.qpos[rig.joints[i]]
        state[2 * i + 1] = rig.qvel[rig.joints[i]]


@jit
def apply_disturbance(rig, disturbance):
    """Hinge torques that add `disturbance` (2,) [rad/s²] to the cardan accelerations over one physics step.

    The torque is held over the step while rope and angle move, so it is computed for the middle of the step.
    """
    length_joint, alpha_joint, beta_joint = rig.joints[2], rig.joints[3], rig.joints[4]
    half = 0.5 * rig.step
    length = rig.qpos[length_joint] + half * rig.qvel[length_joint]
    cos_beta = cos(rig.qpos[beta_joint] + half * rig.qvel[beta_joint])
    inertia = rig.load_mass * length * length
    rig.applied[alpha_joint] = inertia * cos_beta * cos_beta * disturbance[0]
    rig.applied[beta_joint] = inertia * disturbance[1]


@jit
def apply_drag(rig, wind):
    """Drag on the load in air that moves with `wind` (3,); held over the step."""
    if rig.drag == 0.0:
        return
    v_x = wind[0] - rig.sensors[rig.load_sensors[3]]
    v_y = wind[1] - rig.sensors[rig.load_sensors[4]]
    v_z = wind[2] - rig.sensors[rig.load_sensors[5]]
    factor = rig.drag * sqrt(v_x * v_x + v_y * v_y + v_z * v_z)
    rig.wrench[0], rig.wrench[1], rig.wrench[2] = factor * v_x, factor * v_y, factor * v_z


@jit
def set_command(rig, command):
    """Hold `command` (3,) on the drives."""
    for i in range(3):
        rig.ctrl[rig.drives[i]] = command[i]


@jit
def read_load(rig, load):
    """Load position, velocity and rope tension (7,) as the engine's sensors had them before its last step."""
    for i in range(7):
        load[i] = rig.sensors[rig.load_sensors[i]]


@jit
def advance_mujoco(rig, command, disturbance, wind, load):
    """One control period; see `Plant.advance`."""
    set_command(rig, command)
    for k in range(rig.substeps):
        apply_disturbance(rig, disturbance)
        apply_drag(rig, wind)
        mj_step(rig.model, rig.data)
        if k == 0:
            read_load(rig, load)


class MujocoPlant:
    """The MuJoCo rig behind the plant interface; steps through the Python binding.

    The compiled loop steps the same data through `rig`, bit for bit the same.
    """

    name = "mujoco"

    def __init__(
        self,
        rig: RigParameters,
        *,
        drive: Drive,
        step: float,
        substeps: int,
        effects: EffectSettings = NO_EFFECTS,
    ) -> None:
        """`step`: physics step [s]; `substeps`: steps per control period."""
        self.drive = drive
        self.model, self.description = compiled_model(rig, drive, step)
        self.data = mujoco.MjData(self.model)
        self.rig = MujocoRig(
            model=self.model._address,
            data=self.data._address,
            qpos=self.data.qpos,
            qvel=self.data.qvel,
            ctrl=self.data.ctrl,
            applied=self.data.qfrc_applied,
            sensors=self.data.sensordata,
            joints=state_addresses(self.model),
            drives=drive_addresses(self.model),
            load_sensors=sensor_addresses(self.model),
            warnings=self.data.warning.number,
            load_mass=rig.load_mass,
            wrench=self.data.xfrc_applied[self.model.body("load").id],
            drag=air_drag(effects),
            substeps=substeps,
            step=step,
        )

    def reset(self, state: Array) -> None:
        # A first step through the binding: were the model broken, the compiled loop would end the process.
        self._set_state(state)
        mujoco.mj_step(self.model, self.data)
        self._set_state(state)

    def _set_state(self, state: Array) -> None:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self.rig.joints] = state[0::2]
        self.data.qvel[self.rig.joints] = state[1::2]

    def measure(self, state: Array) -> None:
        measure_joints(self.rig, state)

    def advance(self, command: Array, disturbance: Array, wind: Array, load: Array) -> None:
        set_command(self.rig, command)
        for k in range(self.rig.substeps):
            apply_disturbance(self.rig, disturbance)
            apply_drag(self.rig, wind)
            mujoco.mj_step(self.model, self.data)
            if k == 0:
                read_load(self.rig, load)

    def warnings(self) -> int:
        return int(self.rig.warnings.sum())
