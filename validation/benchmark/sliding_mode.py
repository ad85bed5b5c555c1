"""`sliding-mode-observer`: first-order sliding mode of drive and swing, with a Luenberger observer.

    cranectl run fast-diagonal --controller validation/benchmark/sliding_mode.py:SLIDING_MODE_OBSERVER

For each horizontal axis, the deviations e of the drive and b of the angle refer to the state that the flat
map gives for the path. u_d is the input for the path, and p = sqrt(g/l):

    s = e' + lambda e - kappa b        lambda = p l_1, kappa = l p l_2
    u = u_d - lambda e' + kappa b' - W s - K sat(s/phi)    W = p w, K = g k, phi = l p f

So s' = -W s - K sat(s/phi). s reaches the layer |s| < phi in finite time, and has the pole -(W + K/phi)
within it. On s = 0 the poles of the crane are p times the roots of (r² + 1)(r + l_1) + l_2 r², by default
three at -p/sqrt(3). The rope has s = e' + p e. For each drive the observer has two poles at -o p, and for
each angle -o p ± i p, with p at the start of the path. It predicts with the equations of motion.

- Measured: encoders.
- Assumed: slow hoisting; masses are not used. The paper commands forces, and the loop computes them from u
  for force drives.
- Certain: the structure. The gains of the source were not accessible.
- Limits: neither surface nor observer has an integral. A constant disturbance that leans the rope by b leaves
  e near kappa b / lambda, 8 l b by default.

References
----------
Almutairi and Zribi, J. Vibration and Control 15 (2009).
"""

from math import exp, sqrt

from numba import carray

from cranectl.controllers.common import saturate, state_on_path
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.observer import EXPECTED, JOINTS, Observer, correct, initial_estimate, predict
from cranectl.controllers.slots import Slots, per_axis
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, TROLLEY, X, Z
from cranectl.status import RunStatus
from cranectl.support.jit import jit

PARAMETERS = Slots(
    period=1, gravity=1, position_gain=1, velocity_gain=1, slope=1, sway_slope=1, reach=1, switch=1, layer=1
)
MEMORY = Slots(estimate=EXPECTED.size, desired=10, inputs=3, surface=3, begun=1)


@jit
def reaching_term(parameters, surface, length):
    """Return -W s - K sat(s/phi) [m/s²] at a rope length [m]."""
    gravity = parameters[PARAMETERS.gravity]
    share = surface / (parameters[PARAMETERS.layer] * sqrt(gravity * length))
    switched = parameters[PARAMETERS.switch] * saturate(share, 1.0)
    return -parameters[PARAMETERS.reach] * sqrt(gravity / length) * surface - gravity * switched


def step(parameters, measured, reference, memory, command):
    """Compute the accelerations (3,) [m/s²] of one sample from encoders and path."""
    stored = carray(memory, (MEMORY.size,))
    estimate = stored[: MEMORY.desired]
    desired, inputs = stored[MEMORY.desired : MEMORY.inputs], stored[MEMORY.inputs : MEMORY.surface]
    gravity = parameters[PARAMETERS.gravity]
    observer = Observer(
        parameters[PARAMETERS.position_gain],
        parameters[PARAMETERS.velocity_gain],
        0.0,
        parameters[PARAMETERS.period],
        gravity,
    )
    for joint in range(JOINTS):
        if stored[MEMORY.begun] == 0.0:
            estimate[EXPECTED.position + joint] = measured[joint]
        correct(observer, joint, measured[joint], estimate)
    stored[MEMORY.begun] = 1.0
    length = estimate[EXPECTED.position + 2]
    if length <= 0.0 or not state_on_path(reference, gravity, desired, inputs):
        return RunStatus.SLACK_ROPE
    pole = sqrt(gravity / length)
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        error = estimate[EXPECTED.position + joint // 2] - desired[joint]
        rate = estimate[EXPECTED.velocity + joint // 2] - desired[joint + 1]
        swing = estimate[EXPECTED.position + angle // 2] - desired[angle]
        swing_rate = estimate[EXPECTED.velocity + angle // 2] - desired[angle + 1]
        slope, sway_slope = (
            parameters[PARAMETERS.slope] * pole,
            parameters[PARAMETERS.sway_slope] * pole * length,
        )
        stored[MEMORY.surface + axis] = rate + slope * error - sway_slope * swing
        inputs[axis] += sway_slope * swing_rate - slope * rate
    rate = estimate[EXPECTED.velocity + 2] - desired[ROPE + 1]
    stored[MEMORY.surface + Z] = rate + pole * (length - desired[ROPE])
    inputs[Z] -= pole * rate
    for axis in range(3):
        inputs[axis] += reaching_term(parameters, stored[MEMORY.surface + axis], length)
        command[axis] = inputs[axis]
    predict(observer, inputs, estimate)
    return 0


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    gravity, period = nominal.rig.gravity, nominal.period
    bandwidth = float(nominal.parameters["observer"]) * sqrt(gravity / nominal.state[ROPE])
    decay = exp(-bandwidth * period)
    names = ("slope", "sway_slope", "reach", "switch", "layer")
    parameters = PARAMETERS.array(
        period=period,
        gravity=gravity,
        position_gain=1.0 - decay**2,
        velocity_gain=(1.0 - decay) ** 2 / period,
        **{name: nominal.parameters[name] for name in names},
    )
    return parameters, MEMORY.array(estimate=initial_estimate(nominal.state))


SLIDING_MODE_OBSERVER = Controller(
    name="sliding-mode-observer",
    title="sliding mode with sway in its surface and a boundary layer, Luenberger observer on encoders",
    step=step,
    prepare=prepare,
    reads=("gravity",),
    measures="encoders",
    parameters=(
        Parameter("slope", 0.19245, "1", "l_1, lambda over sqrt(g/l)", 0.0, 1e3, search=(0.05, 4.0)),
        Parameter("sway_slope", 1.5396, "1", "l_2, kappa over sqrt(g l)", 0.0, 1e3, search=(0.1, 6.0)),
        Parameter("reach", 2.0, "1", "w, W over sqrt(g/l)", 0.0, 1e3, search=(0.2, 10.0)),
        Parameter("switch", 0.05, "1", "k, K over g", 0.0, 1e3, search=(0.005, 0.5)),
        Parameter("layer", 0.02, "1", "f, phi over sqrt(g l)", 1e-6, 1e3, search=(0.005, 0.2)),
        Parameter("observer", 10.0, "1", "o, over sqrt(g/l)", 0.1, 1e3, search=(3.0, 30.0)),
    ),
    logged=MEMORY.logged(surface=per_axis("surface", "s", "m/s", "sliding surface", "xyl")),
)
