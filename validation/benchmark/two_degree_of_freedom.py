"""`two-degree-of-freedom`: Glover-McFarlane loop shaping, and a prefilter by which the crane follows a model.

    cranectl run fast-diagonal --controller validation/benchmark/two_degree_of_freedom.py:TWO_DOF

Source: Limebeer, Kasenally, Perkins, Automatica 29 (1993), as in Skogestad and Postlethwaite, Multivariable
Feedback Control, 2nd ed., 9.4.3; Popescu, Petre and Bobasu use it on a crane. With time in units of
sqrt(l/g), from the drive's velocity to the load's position x = x_c + l b, near plumb,

    G_s = gain / (s (s² + 1)) = M⁻¹ N, normalised    T_ref = (speed / (s + speed))³    u = K_1 r + K_2 x

and K = [K_1 K_2] has nearly the least norm from (r, phi) to (u, x, rho (x - rho T_ref r)), where K_1 is given
rho r, and phi disturbs the coprime factor, x = G_s u + M⁻¹ phi. SLICOT's SB10AD finds it; K_1 is scaled so
that T_ref(0) is met. The model lags: so r is T_ref⁻¹ z_d, which the path's derivatives give. The
rope follows the path's depth with one pole. Assumes: full state for x, velocity drives, one rope length, the
middle of the path's; masses are not used. Certain: the method; the weights of Popescu and others are not at
hand. A standing push leaves nothing: behind it the drive integrates. Hoisting detunes it.
"""

from functools import lru_cache
from math import sqrt

import control
import numpy as np
from numba import carray
from scipy.linalg import block_diag, solve_continuous_are

from cranectl.controllers.controller import Controller, Parameter
from cranectl.design.hinf_synthesis import hinf_controller
from cranectl.model.dynamics import rope_direction
from cranectl.signals import ACCELERATION, ALPHA, BETA, BRIDGE, JERK, ROPE, TROLLEY, VELOCITY, X, Z

BACK_OFF = 1.05  # from the smallest norm, where K has a pole that grows without bound
ORDER = 6  # of K: the crane's and the model's states

# Places of parameters and memory; A, B, C, D of K as it is sampled, D and columns of B for r_f and x.
SPEED, ROPE_POLE, GAINS = 0, 1, 2
NUMBERS = GAINS + ORDER * ORDER + 3 * ORDER + 2
STATE, ORIGIN, BEGUN, MEMORY = 0, 2 * ORDER, 2 * ORDER + 2, 2 * ORDER + 3


def step(parameters, measured, reference, memory, command):
    """One sample; see `controller`. State and path in, set-points of velocity out."""
    numbers, held = carray(parameters, (NUMBERS,)), carray(memory, (MEMORY,))
    a = numbers[GAINS : GAINS + ORDER * ORDER].reshape((ORDER, ORDER))
    b = numbers[GAINS + ORDER * ORDER : NUMBERS - ORDER - 2].reshape((ORDER, 2))
    c, d = numbers[NUMBERS - ORDER - 2 : NUMBERS - 2], numbers[NUMBERS - 2 :]
    speed, lean = numbers[SPEED], rope_direction(measured[ALPHA], measured[BETA])
    for axis in range(2):
        joint = BRIDGE if axis == X else TROLLEY
        if held[BEGUN] == 0.0:
            held[ORIGIN + axis] = reference[axis]
        asked = reference[axis] - held[ORIGIN + axis] + 3.0 * reference[VELOCITY + axis] / speed
        asked += 3.0 * reference[ACCELERATION + axis] / speed**2 + reference[JERK + axis] / speed**3
        load = measured[joint] + measured[ROPE] * lean[axis] - held[ORIGIN + axis]
        state = held[STATE + ORDER * axis : STATE + ORDER * (axis + 1)]
        command[axis] = d[0] * asked + d[1] * load
        following = np.empty(ORDER)
        for i in range(ORDER):
            command[axis] += c[i] * state[i]
            following[i] = b[i, 0] * asked + b[i, 1] * load
            for j in range(ORDER):
                following[i] += a[i, j] * state[j]
        state[:] = following
    held[BEGUN] = 1.0
    command[Z] = -reference[VELOCITY + Z] - numbers[ROPE_POLE] * (measured[ROPE] + reference[Z])
    return 0


def shaped_plant(gain):
    """G_s: states x, x', x_c; input the drive's velocity."""
    a = [[0.0, 1.0, 0.0], [-1.0, 0.0, 1.0], [0.0, 0.0, 0.0]]
    return control.ss(a, [[0.0], [0.0], [gain]], [[1.0, 0.0, 0.0]], [[0.0]])


def model(speed):
    """T_ref."""
    a = speed * (np.eye(3, k=-1) - np.eye(3))
    return control.ss(a, [[speed], [0.0], [0.0]], [[0.0, 0.0, 1.0]], [[0.0]])


def generalised_plant(gain, speed, rho):
    """From (r, phi, u) to (u, x, rho (x - rho T_ref r); rho r, x), (9.91) and (9.92) of the book."""
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
    """(K from (r, x) to the drive's velocity, its norm over the smallest), in units of sqrt(l/g) and l."""
    found = hinf_controller(
        generalised_plant(gain, speed, rho), 1, 2, name="two-degree-of-freedom", back_off=BACK_OFF
    )
    k = gain * found.controller
    followed, fed_back = k.dcgain()[0]
    return k * np.diag([-fed_back / followed, 1.0]), found


def prepare(nominal):
    """Parameters and memory."""
    given = nominal.parameters
    k, _ = controller(*(float(given[name]) for name in ("gain", "speed", "rho")))
    depths = -nominal.reference[:, Z]
    w = sqrt(nominal.rig.gravity / (0.5 * (depths.min() + depths.max())))
    slowed = control.ss(w * k.A, w * k.B, w * k.C, w * k.D)
    sampled = control.sample_system(slowed, nominal.period, "tustin")
    matrices = [matrix.ravel() for matrix in (sampled.A, sampled.B, sampled.C, sampled.D)]
    return np.concatenate([[w * given["speed"], w * given["rope_pole"]], *matrices]), np.zeros(MEMORY)


TWO_DOF = Controller(
    name="two-degree-of-freedom",
    title="H-infinity loop shaping with a prefilter that follows a model",
    step=step,
    prepare=prepare,
    command="velocity",
    parameters=(
        Parameter("gain", 0.8, "sqrt(g/l)", "weight W_1 that shapes the loop", 1e-3, 1e3, search=(0.1, 3.0)),
        Parameter("speed", 1.0, "sqrt(g/l)", "poles of the model T_ref", 1e-2, 1e2, search=(0.3, 6.0)),
        Parameter("rho", 1.0, "1", "of following against robustness", 1e-2, 1e2, search=(0.3, 5.0)),
        Parameter("rope_pole", 1.0, "sqrt(g/l)", "of the rope's length", 0.0, 1e3, search=(0.3, 6.0)),
    ),
)
