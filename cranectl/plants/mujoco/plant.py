"""The MuJoCo plant: `models/crane.xml` behind the plant interface; it uses none of our equations."""

import copy
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.plants.mujoco.disturbed_step import StageWork, stage_work, step_in_stages
from cranectl.plants.mujoco.effects import EFFECT_MODELS, derive_constants, write_model
from cranectl.plants.mujoco.engine import mj_step
from cranectl.plants.mujoco.linearisation import Equilibrium, find_equilibrium
from cranectl.plants.mujoco.model import (
    compiled_model,
    drive_addresses,
    fastest_rate,
    model_description,
    model_entries,
    rate_addresses,
    sensor_addresses,
    state_addresses,
    structure_of,
)
from cranectl.plants.mujoco.rope import DISTANCE, ElasticRope, elastic_rope, set_damping, start_taut
from cranectl.plants.mujoco.sites import NO_SITES, SiteViews, measure_sites, read_load_of_sites
from cranectl.plants.plant import DRIVES, Drive, Kernels, check_hook, check_rate
from cranectl.plants.surroundings import air_drag
from cranectl.scenario import EffectSettings, RigParameters
from cranectl.support import Array, jit


class MujocoRig(NamedTuple):
    """Views into one MjModel/MjData pair, with the indices of joints, drives and sensors in them."""

    model: int  # address
    data: int  # address
    qpos: Array
    qvel: Array
    ctrl: Array
    applied: Array  # qfrc_applied
    sensors: Array  # sensordata
    joints: NDArray[np.int64]  # (5,) indices in qpos of x_c, y_c, l, alpha, beta
    rates: NDArray[np.int64]  # (5,) indices of the same joints in qvel
    distance: NDArray[np.int64]  # (2,) indices in qpos and qvel of the distance from pivot to rope end
    axes: NDArray[np.int64]  # (n,) those that have a drive, of bridge, trolley and winch
    drives: NDArray[np.int64]  # (n,) indices in ctrl
    scale: Array  # (n,) control over command
    integrates: bool  # whether the drives are position servos, whose set-points follow velocity commands
    load_sensors: NDArray[np.int64]  # indices in sensordata of position, velocity, tension of the load
    warnings: NDArray[np.int32]  # counts of the engine's numerical warnings
    load_mass: float
    air: Array  # (3,) drag and other forces on the load [N]
    wrench: Array  # (6,) xfrc_applied of the load: force, torque
    reaction: Array  # (6,) of the trolley
    has_body: bool  # whether a disturbance is a force on the load instead of torques at the cardan hinges
    sites: SiteViews
    rope: ElasticRope
    in_air: bool  # whether the effect `wind` is on, which sets `air`
    drag: float  # force over the square of the load's speed through the air [kg/m]
    work: StageWork
    substeps: int
    step: float  # [s]


@jit
def measure_joints(rig, state):
    """Write the joint positions and velocities (10,) into `state`, in the order of `SignalGroup.STATE`."""
    if rig.sites.active:
        measure_sites(rig, state)
        return
    for i in range(5):
        state[2 * i] = rig.qpos[rig.joints[i]]
        state[2 * i + 1] = rig.qvel[rig.rates[i]]


@jit
def set_command(rig, command):
    """Write `command` (3,), in the unit of the drive, into the engine's controls."""
    if not rig.integrates:
        for i in range(rig.axes.shape[0]):
            rig.ctrl[rig.drives[i]] = rig.scale[i] * command[rig.axes[i]]


@jit
def move_set_points(rig, command):
    """Move the set-points of position servos by half a physics step at the velocity `command` (3,)."""
    if rig.integrates:
        for i in range(rig.axes.shape[0]):
            rig.ctrl[rig.drives[i]] += 0.5 * rig.step * rig.scale[i] * command[rig.axes[i]]


@jit
def read_load(rig, load):
    """Write load position, velocity and rope tension (7,) at the beginning of the last step into `load`."""
    for i in range(7):
        load[i] = rig.sensors[rig.load_sensors[i]]
    if rig.sites.active:
        read_load_of_sites(rig, load)


@jit
def advance(rig, command, disturbance, wind, load):
    """Advance the crane by one control period; see `Plant.advance`."""
    set_command(rig, command)
    changing = rig.in_air or rig.rope.active or disturbance[0] != 0.0 or disturbance[1] != 0.0
    for k in range(rig.substeps):
        move_set_points(rig, command)  # to the middle of the step, during which they are held
        if changing:
            step_in_stages(rig, disturbance, wind)
        else:
            mj_step(rig.model, rig.data)
        move_set_points(rig, command)
        if k == 0:
            read_load(rig, load)


@jit
def count_warnings(rig):
    """Return the number of numerical warnings of the engine since the last reset."""
    return rig.warnings.sum()


def views_of(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    effects: EffectSettings,
    *,
    step: float,
    substeps: int,
    bodies: tuple[int, int],
    swing: int = -1,
    **addresses: Any,
) -> MujocoRig:
    """Return the views of a model with `addresses`; `bodies` are those of load and trolley."""
    load, trolley = bodies
    return MujocoRig(
        model=model._address,
        data=data._address,
        qpos=data.qpos,
        qvel=data.qvel,
        ctrl=data.ctrl,
        applied=data.qfrc_applied,
        sensors=data.sensordata,
        warnings=data.warning.number,
        air=np.zeros(3),
        wrench=data.xfrc_applied[load],
        reaction=data.xfrc_applied[trolley],
        rope=elastic_rope(model, effects),
        in_air=effects.wind is not None,
        drag=air_drag(effects),
        work=stage_work(model, data, swing=swing, sensors=len(addresses["load_sensors"])),
        substeps=substeps,
        step=step,
        **addresses,
    )


class MujocoPlant:
    """The MuJoCo crane as a plant."""

    name = "mujoco"
    shows = tuple(EFFECT_MODELS)
    kernels = Kernels(measure_joints, advance, count_warnings)

    def __init__(
        self, rig: RigParameters, *, drive: Drive, step: float, substeps: int, effects: EffectSettings
    ) -> None:
        self.drive = drive
        self.parameters, self.effects = rig, _physical(effects)
        self.model = copy.copy(compiled_model(rig, drive, step, self.effects))
        self.data = mujoco.MjData(self.model)
        distance = self.model.joint(DISTANCE if effects.rope else "rope_length")
        self.rig = views_of(
            self.model,
            self.data,
            effects,
            step=step,
            substeps=substeps,
            bodies=(self.model.body("load").id, self.model.body("trolley").id),
            swing=int(self.model.joint("swing").dofadr[0]) if effects.body else -1,
            joints=state_addresses(self.model),
            rates=rate_addresses(self.model),
            distance=np.array([distance.qposadr[0], distance.dofadr[0]], dtype=np.int64),
            axes=np.arange(3),
            drives=drive_addresses(self.model),
            scale=np.ones(3),
            integrates=False,
            load_sensors=sensor_addresses(self.model),
            load_mass=rig.load_mass,
            has_body=effects.body is not None,
            sites=NO_SITES,
        )

    @property
    def description(self) -> str:
        """The model as drawn, in MJCF."""
        return model_description(self.parameters, self.drive, self.rig.step, self.effects)

    def retune(self, rig: RigParameters, effects: EffectSettings) -> bool:
        physical = _physical(effects)
        if structure_of(physical) != structure_of(self.effects) or rig.moves != self.parameters.moves:
            return False
        self.parameters, self.effects = rig, physical
        write_model(self.model, model_entries(rig, self.drive, physical))
        derive_constants(self.model, self.data)
        self.rig = self.rig._replace(
            load_mass=rig.load_mass,
            rope=elastic_rope(self.model, effects),
            in_air=effects.wind is not None,
            drag=air_drag(effects),
        )
        return True

    def reset(self, state: Array) -> None:
        if self.effects.rope:  # the poles that are checked below depend on its damping
            hanging = self.parameters.hanging_mass(self.effects)
            set_damping(self.rig.rope, self.effects.rope, hanging, state[4])
        self.check_length(state[4])
        # The first step goes through the binding, which raises an exception if the model is broken. In
        # compiled code such a model would end the process.
        self._restart(state)
        mujoco.mj_step(self.model, self.data)
        self._restart(state)

    def check_length(self, length: float) -> None:
        """Raise InputError if a rope of `length` [m] is too short for the effects or for the step."""
        if not self.effects.names:
            return
        check_hook(self.effects, length)
        trial, state = mujoco.MjData(self.model), np.zeros(10)
        state[4] = length
        self._write_state(trial, state)
        rate, step = fastest_rate(self.model, trial), self.rig.step
        check_rate(rate, self.effects, length, step=step, period=step * self.rig.substeps)

    def find_equilibrium(self, start: Array, *, tilt: Array, air: Array) -> Equilibrium | None:
        """Return the equilibrium near the joints `start` (10,), with its rope length and rate, or None.

        Parameters
        ----------
        start : Array
            Joints (10,) of the crane without effects, in the order of `SignalGroup.STATE`.
        tilt : Array
            Disturbance (2,) of the angles [rad/s²].
        air : Array
            Wind (6,), as in `Plant.advance`.
        """
        return find_equilibrium(self, start, tilt=tilt, air=air)

    def set_command(self, command: Array) -> None:
        """Write `command` (3,) into the engine without advancing it."""
        set_command(self.rig, command)

    def _restart(self, state: Array) -> None:
        """Reset the engine, then write `state` (10,) into it."""
        mujoco.mj_resetData(self.model, self.data)
        self._write_state(self.data, state)

    def _write_state(self, data: mujoco.MjData, state: Array) -> None:
        """Write `state` (10,) into `data`; an elastic rope starts taut, and its drives hold it."""
        data.qpos[self.rig.joints] = state[0::2]
        data.qvel[self.rig.rates] = state[1::2]
        if self.rig.rope.active:
            if DRIVES[self.drive].at_rest == "rates":
                data.ctrl[self.rig.drives] = state[1:6:2]  # else the drives and the rope would brake
            elif DRIVES[self.drive].at_rest == "weight":
                data.ctrl[self.rig.drives[2]] = -self.parameters.weight  # else the load would fall
            start_taut(self.model, data, self.rig.rope)

    @property
    def handle(self) -> MujocoRig:
        return self.rig

    def measure(self, state: Array) -> None:
        measure_joints(self.rig, state)

    def advance(self, command: Array, disturbance: Array, wind: Array, load: Array) -> None:
        advance(self.rig, command, disturbance, wind, load)

    def warnings(self) -> int:
        return int(count_warnings(self.rig))


def _physical(effects: EffectSettings) -> EffectSettings:
    """Return only the effects that change the model, so that others cause no new compilation."""
    return EffectSettings().model_copy(
        update={name: getattr(effects, name) for name in (*EFFECT_MODELS, "installation")}
    )
