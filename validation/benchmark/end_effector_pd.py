"""`end-effector-pd`: a spring and a damper act on the drive's position minus a part of the load's lead.

    cranectl run fast-diagonal --controller validation/benchmark/end_effector_pd.py:END_EFFECTOR_PD

e is the drive's deviation from the set-point, and n is the rope's direction. k = K / (M + m), where M is the
mass that the drive moves, and m that of the load:

    F = -k_p (e - k n) - k_d (e' - k n')

At constant rope length l, the power F (e' - k n') flows into a storage function, so that

    V = E + K (l n'·n'/2 + g (1 + n_z)) - sum over x, y of (m l k n'² - k_p (e - k n)²)/2
    V' = - sum of k_d (e' - k n')²

E is the crane's energy as in `energy-coupling`. The winch is a servo that holds the rope length against the
tension.

- Measured: the full state.
- Assumed: constant rope length, no friction, known masses. The winch needs the masses, and so does the ratio
  of the two k, without which V would not exist.
- Certain: the planar law up to its gains; V for both axes was derived here.
- Limits: a constant disturbance that leans the rope leaves e = (k + S/k_p) n, where S is the tension.

References
----------
Sun and Fang, IEEE Trans. Industrial Electronics 59 (2012), for a planar crane with constant rope length.
"""

import numpy as np

from cranectl.controllers.common import AXIS_MASSES, MASSES, masses_at, winch_servo
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots, per_axis
from cranectl.model.dynamics import axis_masses, rope_direction, rope_direction_rate
from cranectl.signals import ALPHA, ALPHA_RATE, BETA, BETA_RATE, ROPE, Y

PARAMETERS = Slots(masses=MASSES, stiffness=2, damping=2, lead=2, hoist=1)
MEMORY = Slots(error=2)


def step(parameters, measured, reference, memory, command):
    """Compute the forces (3,) [N] of one sample from state and set-point."""
    n = rope_direction(measured[ALPHA], measured[BETA])
    n_rate = rope_direction_rate(measured[ALPHA], measured[ALPHA_RATE], measured[BETA], measured[BETA_RATE])
    for axis in range(2):
        lead = parameters[PARAMETERS.lead + axis]
        error = measured[2 * axis] - reference[axis] - lead * n[axis]
        rate = measured[2 * axis + 1] - lead * n_rate[axis]
        command[axis] = (
            -parameters[PARAMETERS.stiffness + axis] * error - parameters[PARAMETERS.damping + axis] * rate
        )
        memory[MEMORY.error + axis] = error
    masses = masses_at(parameters, PARAMETERS.masses)
    winch_servo(masses, parameters[PARAMETERS.hoist], measured, reference, command)
    return 0


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    masses, length, settings = axis_masses(nominal.rig), nominal.state[ROPE], nominal.parameters
    pace = np.sqrt(masses.gravity / length)
    moved = np.array([masses.bridge, masses.trolley]) + masses.load
    stiffness = moved * (settings["frequency"] * pace) ** 2
    damping = moved * 2.0 * settings["damping"] * settings["frequency"] * pace
    parameters = PARAMETERS.array(
        masses=masses,
        stiffness=stiffness,
        damping=damping,
        lead=settings["lead"] * length * moved[Y] / moved,
        hoist=settings["hoist"] * pace,
    )
    return parameters, MEMORY.array()


END_EFFECTOR_PD = Controller(
    name="end-effector-pd",
    title="spring and damper on the drives, less a part of the load's lead",
    step=step,
    prepare=prepare,
    reads=AXIS_MASSES,
    command="force",
    follows="set-point",
    parameters=(
        Parameter(
            "frequency", 0.33, "1", "√(k_p/(M + m)) over √(g/l) of the start", 0.0, 10.0, search=(0.1, 1.0)
        ),
        Parameter("damping", 0.9, "1", "k_d/√(4 k_p (M + m))", 0.0, 10.0, search=(0.2, 4.0)),
        Parameter("lead", 2.0, "1", "k of the trolley, in rope lengths", 0.0, 100.0, search=(0.2, 10.0)),
        Parameter("hoist", 0.7, "1", "pole of the winch's servo, over √(g/l)", 0.0, 100.0, search=(0.2, 5.0)),
    ),
    logged=MEMORY.logged(error=per_axis("coupled_error", "xi", "m", "e - k n")),
)
