"""`two-degree-of-freedom`: Glover-McFarlane loop shaping, with a prefilter that follows a model.

    cranectl run fast-diagonal --controller validation/benchmark/two_degree_of_freedom.py:TWO_DOF

Times are in units of sqrt(l/g) and lengths of l. From the drive's velocity u to the load's position x = x_c +
l b, near plumb:

    G_s = gain / (s (s² + 1)) = M⁻¹ N, normalised    T_ref = (speed / (s + speed))³    u = K_1 r + K_2 x

K = [K_1 K_2] has nearly the least norm from (r, phi) to (u, x, rho (x - rho T_ref r)), where the input of K_1
is rho r, and phi disturbs the coprime factor: x = G_s u + M⁻¹ phi. SLICOT's SB10AD finds K. K_1 is scaled to
reach the static gain of T_ref. Since the model lags, r is T_ref⁻¹ z_d, from the derivatives of the path. The
rope follows the depth of the path with one pole.

- Measured: the full state, from which x follows.
- Assumed: velocity drives, and one rope length, that in the middle of the path; masses are not used.
- Certain: the method. The weights of the source on cranes were not accessible.
- Limits: hoisting detunes it. A constant disturbance leaves no error, because the drive integrates.

References
----------
Limebeer, Kasenally, Perkins, Automatica 29 (1993), as in Skogestad and Postlethwaite, Multivariable Feedback
Control, 2nd ed., section 9.4.3. On a crane: Popescu, Petre and Bobasu.
"""

from functools import lru_cache
from math import sqrt

import control
import numpy as np
from numba import carray
from scipy.linalg import block_diag, solve_continuous_are

from cranectl.controllers.common import middle_depth
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots
from cranectl.design.hinf_synthesis import hinf_controller
from cranectl.design.linear_systems import rounded_system, slowed_and_sampled
from cranectl.model.dynamics import rope_direction
from cranectl.signals import ACCELERATION, ALPHA, BETA, BRIDGE, JERK, ROPE, TROLLEY, VELOCITY, X, Z

BACK_OFF = 1.05  # norm over the least norm, at which a pole of K grows without bound
ORDER = 6  # of K: states of the crane and of the model

# a, b, c, d: the sampled K; b and d have a column each for r and x.
PARAMETERS = Slots(speed=1, rope_pole=1, a=ORDER * ORDER, b=2 * ORDER, c=ORDER, d=2)
MEMORY = Slots(state=2 * ORDER, origin=2, begun=1)


def step(parameters, measured, reference, memory, command):
    """Compute the velocity set-points (3,) [m/s] of one sample from state and path."""
    numbers, stored = carray(parameters, (PARAMETERS.size,)), carray(memory, (MEMORY.size,))
    a = numbers[PARAMETERS.a : PARAMETERS.b].reshape((ORDER, ORDER))
    b = numbers[PARAMETERS.b : PARAMETERS.c].reshape((ORDER, 2))
    c, d = numbers[PARAMETERS.c : PARAMETERS.d], numbers[PARAMETERS.d :]
    speed, lean = numbers[PARAMETERS.speed], rope_direction(measured[ALPHA], measured[BETA])
    for axis in range(2):
        joint = BRIDGE if axis == X else TROLLEY
        if stored[MEMORY.begun] == 0.0:
            stored[MEMORY.origin + axis] = reference[axis]
        filtered = reference[axis] - stored[MEMORY.origin + axis] + 3.0 * reference[VELOCITY + axis] / speed
        filtered += 3.0 * reference[ACCELERATION + axis] / speed**2 + reference[JERK + axis] / speed**3
        load = measured[joint] + measured[ROPE] * lean[axis] - stored[MEMORY.origin + axis]
        state = stored[MEMORY.state + ORDER * axis :][:ORDER]
        command[axis] = d[0] * filtered + d[1] * load
        following = np.empty(ORDER)
        for i in range(ORDER):
            command[axis] += c[i] * state[i]
            following[i] = b[i, 0] * filtered + b[i, 1] * load
            for j in range(ORDER):
                following[i] += a[i, j] * state[j]
        state[:] = following
    stored[MEMORY.begun] = 1.0
    command[Z] = -reference[VELOCITY + Z] - numbers[PARAMETERS.rope_pole] * (measured[ROPE] + reference[Z])
    return 0


def shaped_plant(gain):
    """Return G_s with the states x, x', x_c and the drive's velocity as input."""
    a = [[0.0, 1.0, 0.0], [-1.0, 0.0, 1.0], [0.0, 0.0, 0.0]]
    return control.ss(a, [[0.0], [0.0], [gain]], [[1.0, 0.0, 0.0]], [[0.0]])


def model(speed):
    """Return T_ref."""
    a = speed * (np.eye(3, k=-1) - np.eye(3))
    return control.ss(a, [[speed], [0.0], [0.0]], [[0.0, 0.0, 1.0]], [[0.0]])


def generalised_plant(gain, speed, rho):
    """Return the plant from (r, phi, u) to (u, x, rho (x - rho T_ref r); rho r, x).

    References
    ----------
    Skogestad and Postlethwaite, equations (9.91) and (9.92).
    """
    g, t = shaped_plant(gain), model(speed)
    injection = solve_continuous_are(g.A.T, g.C.T, g.B @ g.B.T, np.eye(1)) @ g.C.T
    nothing = np.zeros((3, 1))
    x, followed = np.hstack([g.C, 0.0 * t.C]), np.hstack([0.0 * g.C, t.C])
    return control.ss(
        block_diag(g.A, t.A),
        np.block([[nothing, injection, g.B], [t.B, nothing, nothing]]),
        np.vstack([0.0 * x, x, rho * x - rho**2 * followed, 0.0 * x, x]),
        [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, rho, 0.0], [rho, 0.0, 0.0], [0.0, 1.0, 0.0]],
    )


@lru_cache
def controller(gain, speed, rho):
    """Return K from (r, x) to the drive's velocity, and the synthesis, in units of sqrt(l/g) and l."""
    found = hinf_controller(
        generalised_plant(gain, speed, rho), 1, 2, name="two-degree-of-freedom", back_off=BACK_OFF
    )
    k = rounded_system(gain * found.controller)
    followed, fed_back = k.dcgain()[0]
    return k * np.diag([-fed_back / followed, 1.0]), found


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    settings = nominal.parameters
    k, _ = controller(*(float(settings[name]) for name in ("gain", "speed", "rho")))
    w = sqrt(nominal.rig.gravity / middle_depth(nominal.reference))
    sampled = slowed_and_sampled(k, w, nominal.period)
    parameters = PARAMETERS.array(
        speed=w * settings["speed"],
        rope_pole=w * settings["rope_pole"],
        a=sampled.A,
        b=sampled.B,
        c=sampled.C,
        d=sampled.D,
    )
    return parameters, MEMORY.array()


TWO_DOF = Controller(
    name="two-degree-of-freedom",
    title="H-infinity loop shaping with a prefilter that follows a model",
    step=step,
    prepare=prepare,
    reads=("gravity", "path"),
    command="velocity",
    parameters=(
        Parameter("gain", 0.8, "sqrt(g/l)", "weight W_1 that shapes the loop", 1e-3, 1e3, search=(0.1, 3.0)),
        Parameter("speed", 1.0, "sqrt(g/l)", "poles of the model T_ref", 1e-2, 1e2, search=(0.3, 6.0)),
        Parameter("rho", 1.0, "1", "of following against robustness", 1e-2, 1e2, search=(0.3, 5.0)),
        Parameter("rope_pole", 1.0, "sqrt(g/l)", "of the rope's length", 0.0, 1e3, search=(0.3, 6.0)),
    ),
)
