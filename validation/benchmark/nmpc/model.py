"""Generate `model.c` by CasADi: the crane and the Jacobians with which `nmpc.c` predicts.

    python validation/benchmark/nmpc/model.py    after `make extras`, writes model.c anew

The parts of CasADi's sources that it copies into the file are under the licence MIT-0.
"""

from pathlib import Path
from types import FunctionType

import casadi

from cranectl.model.dynamics import angular_accelerations, rope_direction, rope_direction_rate

HERE = Path(__file__).parent


def symbolic(function):
    """Return a compiled `function` of the package as a function of CasADi's symbols."""
    return FunctionType(function.py_func.__code__, {"sin": casadi.sin, "cos": casadi.cos})


def functions():
    """Return `crane_slope` and `crane_load` with their Jacobians, column by column.

    `crane_slope` gives the derivative of the state (10,), and `crane_load` the position and velocity of the
    load (6,). The argument d contains disturbances of the angles [rad/s²].
    """
    x, u, d, g = (casadi.SX.sym(*named) for named in (("x", 10), ("u", 3), ("d", 2), ("g", 1)))
    bridge, bridge_rate, trolley, trolley_rate, length, rope_rate, *angles = casadi.vertsplit(x)
    alpha, alpha_rate, beta, beta_rate = angles
    alpha_ddot, beta_ddot = symbolic(angular_accelerations)(length, rope_rate, *angles, u[0], u[1], g)
    rates = (bridge_rate, u[0], trolley_rate, u[1], rope_rate, u[2])
    slope = casadi.vertcat(*rates, alpha_rate, alpha_ddot + d[0], beta_rate, beta_ddot + d[1])
    n = casadi.vertcat(*symbolic(rope_direction)(alpha, beta))
    n_dot = casadi.vertcat(*symbolic(rope_direction_rate)(*angles))
    load = casadi.vertcat(bridge, trolley, 0) + length * n
    load_rate = casadi.vertcat(bridge_rate, trolley_rate, 0) + rope_rate * n + length * n_dot
    seen = casadi.vertcat(load, load_rate)

    def dense(value, *arguments):
        return [value, *(casadi.densify(casadi.jacobian(value, argument)) for argument in arguments)]

    return [
        casadi.Function("crane_slope", [x, u, d, g], dense(slope, x, u)),
        casadi.Function("crane_load", [x], dense(seen, x)),
    ]


def write(folder):
    """Write `model.c` into `folder`."""
    generator = casadi.CodeGenerator("model.c")
    for function in functions():
        generator.add(function)
    generator.generate(f"{folder}/")


if __name__ == "__main__":
    write(HERE)
