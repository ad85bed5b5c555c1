"""`energy-coupling` and `kinetic-energy-coupling`: spring and damper, weighted by the crane's energy.

    cranectl run fast-diagonal --controller validation/benchmark/energy_coupling.py:ENERGY_COUPLING
    cranectl run fast-diagonal --controller validation/benchmark/energy_coupling.py:KINETIC_ENERGY_COUPLING

These are the E² coupling law and the gantry kinetic energy law. The crane is F = P v' + w with the rates v of
the drives (`cranectl.model.dynamics`). e is the deviation of the drives from the set-point, W = (0, 0, m g)
is the weight that the winch holds, and E is the kinetic energy plus m g l (1 - cos a cos b):

    E' = v·(F + W),    s = k_E E (energy-coupling) or k_E (kinetic-energy-coupling)
    (s P + K_v) v' = -K_p e - K_d v - s (w + W)
    V = k_E E²/2 or k_E E, plus (v·K_v v + e·K_p e)/2,    V' = -v·K_d v

So the crane moves as if a spring and a damper drove the masses s P + K_v in place of P.

- Measured: the full state.
- Assumed: known masses, no friction.
- Certain: the structure and V, which were derived anew; the paper may write them otherwise. The source has
  two drives and constant rope length. Here the winch is a third drive, so V falls while hoisting too. K_v,
  K_p and K_d are diagonal and proportional to the masses that the drives move, where the source has numbers.
- Limits: E² is of fourth order in the swing, so small swing is hardly damped. Under a constant disturbance,
  which leans the rope, K_p e = -s (w + W) remains.

References
----------
Fang, Dixon, Dawson and Zergeroglu, IEEE/ASME Trans. Mechatronics 8 (2003).
"""

import numpy as np

from cranectl.controllers.common import AXIS_MASSES, MASSES, masses_at
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots
from cranectl.model.dynamics import (
    AxisMasses,
    axis_masses,
    drive_forces,
    forced_accelerations,
    rope_direction,
    rope_direction_rate,
)
from cranectl.signals import (
    ALPHA,
    ALPHA_RATE,
    BETA,
    BETA_RATE,
    BRIDGE_RATE,
    ROPE,
    ROPE_RATE,
    TROLLEY_RATE,
    Signal,
    Z,
)
from cranectl.support.jit import jit

PARAMETERS = Slots(masses=MASSES, coupling=1, exponent=1, inertia=3, stiffness=3, damping=3)
MEMORY = Slots(energy=1)


@jit
def energy(masses, state):
    """Return the kinetic energy plus the potential energy above that of a plumb rope [J]."""
    n = rope_direction(state[ALPHA], state[BETA])
    n_rate = rope_direction_rate(state[ALPHA], state[ALPHA_RATE], state[BETA], state[BETA_RATE])
    bridge, trolley, winch = state[BRIDGE_RATE], state[TROLLEY_RATE], state[ROPE_RATE]
    v_x = bridge + winch * n[0] + state[ROPE] * n_rate[0]
    v_y = trolley + winch * n[1] + state[ROPE] * n_rate[1]
    v_z = winch * n[2] + state[ROPE] * n_rate[2]
    drives = masses.bridge * bridge**2 + masses.trolley * trolley**2 + masses.winch * winch**2
    lift = masses.gravity * state[ROPE] * (1.0 + n[2])
    return 0.5 * drives + masses.load * (0.5 * (v_x**2 + v_y**2 + v_z**2) + lift)


@jit
def spring(parameters, measured, reference, axis):
    """Return the force -K_p e - K_d v of an axis [N]."""
    target = -reference[Z] if axis == Z else reference[axis]
    pull = parameters[PARAMETERS.stiffness + axis] * (measured[2 * axis] - target)
    return -pull - parameters[PARAMETERS.damping + axis] * measured[2 * axis + 1]


def step(parameters, measured, reference, memory, command):
    """Compute the forces (3,) [N] of one sample from state and set-point."""
    masses = masses_at(parameters, PARAMETERS.masses)
    memory[MEMORY.energy] = energy(masses, measured)
    s = parameters[PARAMETERS.coupling] * memory[MEMORY.energy] ** parameters[PARAMETERS.exponent]
    felt = AxisMasses(
        s * masses.bridge + parameters[PARAMETERS.inertia],
        s * masses.trolley + parameters[PARAMETERS.inertia + 1],
        s * masses.winch + parameters[PARAMETERS.inertia + 2],
        s * masses.load,
        masses.gravity,
    )
    x, y = spring(parameters, measured, reference, 0), spring(parameters, measured, reference, 1)
    rope = spring(parameters, measured, reference, 2) - s * masses.load * masses.gravity
    u_x, u_y, u_l = forced_accelerations(felt, measured, x, y, rope)
    command[0], command[1], command[2] = drive_forces(masses, measured, u_x, u_y, u_l)
    return 0


def prepared(nominal, exponent):
    """Return the arrays of parameters and initial memory for s = k_E E^exponent."""
    rig, length, settings = nominal.rig, nominal.state[ROPE], nominal.parameters
    pace = settings["frequency"] * np.sqrt(rig.gravity / length)
    coupling = settings["coupling"] / (rig.weight * length) ** exponent
    parameters = PARAMETERS.array(
        masses=axis_masses(rig),
        coupling=coupling,
        exponent=exponent,
        inertia=rig.driven_masses,
        stiffness=pace**2 * rig.driven_masses,
        damping=2.0 * settings["damping"] * pace * rig.driven_masses,
    )
    return parameters, MEMORY.array()


def energy_controller(name, title, exponent, coupling):
    """Return one of the two controllers; `coupling` is the default of k_E."""
    unit = "k_E m g l" if exponent else "k_E"
    return Controller(
        name=name,
        title=title,
        step=step,
        prepare=lambda nominal: prepared(nominal, exponent),
        reads=(*AXIS_MASSES, "driven_masses", "weight"),
        command="force",
        follows="set-point",
        parameters=(
            Parameter(
                "frequency", 0.35, "1", "√(K_p/K_v) over √(g/l) of the start", 0.0, 10.0, search=(0.1, 1.0)
            ),
            Parameter("damping", 1.0, "1", "K_d/√(4 K_p K_v)", 0.0, 10.0, search=(0.2, 4.0)),
            Parameter(
                "coupling", coupling, "1", unit, 0.0, 1e3, search=(0.1 * coupling, 10.0 * coupling)
            ),
        ),
        logged=MEMORY.logged(
            energy=[Signal("energy", "E", "J", "of the crane, none at rest with a plumb rope")]
        ),
    )  # fmt: skip


ENERGY_COUPLING = energy_controller(
    "energy-coupling", "E² coupling: spring and damper, drives heavier by the energy", 1.0, 3.0
)
KINETIC_ENERGY_COUPLING = energy_controller(
    "kinetic-energy-coupling", "gantry kinetic energy coupling: spring, damper, heavier drives", 0.0, 1.0
)
