"""The elastic plant: a crane with elastic rope, swinging load, soft frame and friction, as a plant."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.plants.differences import FINE_DIFFERENCE, fastest_rate
from cranectl.plants.elastic.crane import (
    BODY,
    JOINTS,
    RAILS,
    STRETCH,
    STRETCH_RATE,
    ElasticCrane,
    Work,
    hanging_states,
    load_positions,
    make_crane,
    make_work,
    set_damping,
)
from cranectl.plants.elastic.motion import rope_directions
from cranectl.plants.elastic.step import finish_step, stick_or_slip
from cranectl.plants.plant import DRIVES, Drive, Kernels, check_hook, check_rate
from cranectl.scenario import EffectSettings, RigParameters
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, TENSION, TROLLEY, VELOCITY
from cranectl.support import Array, jit

STILL_AIR = np.zeros(6)


class ElasticHandle(NamedTuple):
    """Constants, state and work space: what the kernels need."""

    crane: ElasticCrane
    state: Array  # (22,)
    work: Work


@jit
def measure_joints(handle, state):
    """Write the joint positions and velocities (10,) into `state`."""
    for i in range(2 * JOINTS):
        state[i] = handle.state[i]


@jit
def observe_load(crane, state, work, load):
    """Write load position, velocity and rope tension (7,) into `load`; `work` has the last two."""
    n, _, _ = rope_directions(state[ALPHA], state[BETA])
    pivot = (state[BRIDGE] + state[RAILS], state[TROLLEY] + state[RAILS + 2], 0.0)
    for axis in range(3):
        load[axis] = pivot[axis] + (state[ROPE] - crane.offset + state[STRETCH]) * n[axis]
        load[axis] += crane.offset * state[BODY + axis]
        load[VELOCITY + axis] = work.velocity[axis]
    load[TENSION] = work.tension[0]


@jit
def advance(handle, command, disturbance, wind, load):
    """Advance the crane by one control period; see `Plant.advance`."""
    crane, state, work = handle
    for k in range(crane.substeps):
        stick_or_slip(crane, state, command, disturbance, wind, work)
        if k == 0:
            observe_load(crane, state, work, load)
        finish_step(crane, state, command, disturbance, wind, work)


@jit
def no_warnings(_):
    """Return 0: this plant has no warnings."""
    return 0


class ElasticPlant:
    """The elastic crane behind the plant interface."""

    name = "elastic"
    kernels: Kernels | None = Kernels(measure_joints, advance, no_warnings)  # for the compiled loop
    description = "cranectl.plants.elastic, fixed steps of the method of Dormand and Prince of order 5"

    def __init__(
        self, rig: RigParameters, *, drive: Drive, step: float, substeps: int, effects: EffectSettings
    ) -> None:
        self.drive, self.effects = drive, effects
        self.crane = make_crane(rig, effects, drive, step=step, substeps=substeps)
        self.state = hanging_states(self.crane, np.zeros((1, 10)), np.zeros(1))[0]
        self.work = make_work()

    def retune(self, rig: RigParameters, effects: EffectSettings) -> bool:
        step, substeps = self.crane.step, self.crane.substeps
        self.effects = effects
        self.crane = make_crane(rig, effects, self.drive, step=step, substeps=substeps)
        return True  # also if effects are switched, since each loop takes a new `handle`

    def check_length(self, length: float) -> None:
        """Raise InputError if a rope of `length` [m] is too short for the effects or for the step."""
        if any((self.effects.rope, self.effects.body, self.effects.frame, self.effects.friction)):
            check_hook(self.effects, length)
            step, period = self.crane.step, self.crane.step * self.crane.substeps
            check_rate(self.fastest_rate(length), self.effects, length, step=step, period=period)

    def fastest_rate(self, length: float) -> float:
        """Return the largest modulus of the poles [1/s] about rest with `length` [m] of rope.

        It is computed from finite differences, with joints that slide freely and the viscosity of the last
        `reset`.
        """
        crane = self.crane._replace(has_friction=False, coulomb=(0.0, 0.0, 0.0, 0.0, 0.0))
        joints, work = np.zeros(10), make_work()
        joints[ROPE] = length
        hanging, command = taut_state(crane, joints, self.drive)
        changing = crane.changing

        def rates(state: Array) -> Array:
            stick_or_slip(crane, state, command, STILL_AIR[:2], STILL_AIR, work)
            first_rates: Array = work.rates[0, changing].copy()
            return first_rates

        return fastest_rate(rates, hanging, step=FINE_DIFFERENCE, moved=changing)

    def reset(self, state: Array) -> None:
        check_hook(self.effects, state[ROPE])
        set_damping(self.crane, self.effects, state[ROPE])
        self.state[:] = taut_state(self.crane, state, self.drive)[0]

    @property
    def moving(self) -> NDArray[np.int64]:
        """Indices of the states that can change."""
        return self.crane.changing

    def hanging_states(self, joints: Array, tension: Array) -> Array:
        """Return states (N, 22) along a motion with `joints` (N, 10) and rope tension (N,) [N].

        The rope has its damping ratio at the first of them.
        """
        set_damping(self.crane, self.effects, float(joints[0, ROPE]))
        return hanging_states(self.crane, joints, tension)

    def load_positions(self, states: Array) -> Array:
        """Return the position of the load in the world, (N, 3) [m], of `states` (N, 22)."""
        return load_positions(self.crane, states)

    @property
    def handle(self) -> ElasticHandle:
        return ElasticHandle(self.crane, self.state, self.work)

    def measure(self, state: Array) -> None:
        measure_joints(self.handle, state)

    def advance(self, command: Array, disturbance: Array, wind: Array, load: Array) -> None:
        advance(self.handle, command, disturbance, wind, load)

    def warnings(self) -> int:
        return 0


def taut_state(crane: ElasticCrane, joints: Array, drive: Drive) -> tuple[Array, Array]:
    """Return the state (22,) that starts at `joints` (10,), and the command (3,) that keeps it.

    A rope that can be taut is stretched until its stretch has no acceleration. Velocity drives keep their
    speeds, and force drives hold the weight.
    """
    command = np.zeros(3)
    if DRIVES[drive].at_rest == "rates":
        command[:] = joints[BRIDGE + 1 : ROPE + 2 : 2]
    elif DRIVES[drive].at_rest == "weight":
        command[2] = crane.load_mass * crane.gravity[2]  # negative, as of a winch that winds in
    tension, work = 0.0, make_work()
    for _ in range(3):  # the stretch lowers the load a little, so the tension is refined
        if not crane.has_elastic_rope:
            break
        stretching = []
        for extra in (0.0, 1.0):
            state = hanging_states(crane, joints[None], np.array([tension + extra]))[0]
            stick_or_slip(crane, state, command, STILL_AIR[:2], STILL_AIR, work)
            stretching.append(work.rates[0, STRETCH_RATE])
        # The secant through two tensions 1 N apart gives the one without acceleration.
        free, more = stretching
        tension = max(tension + free / (free - more), 0.0)
    return hanging_states(crane, joints[None], np.array([tension]))[0], command
