"""Implement a campaign's closed loop by the engine's own tools, with the controller in NumPy or JAX.

The controller is written once more, for arrays of cranes, by code that serves NumPy and JAX. A test checks
that all implementations reach the same state. Each simulates cranes of one model, returns only the last
state, and computes no metrics.
"""

from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch
from mujoco.rollout import Rollout
from numpy.typing import NDArray

from cranectl.controllers import Tracker
from cranectl.design import design_controller, diagonal
from cranectl.planning import load_scenario
from cranectl.plants.mujoco.model import drive_addresses, model_spec, rate_addresses, state_addresses
from cranectl.simulate import Plan
from cranectl.simulate.actuation import Actuation

Array = NDArray[np.float64]
SCENARIO, OVERRIDES = "off-reference", ["duration=7"]  # a path, with the load beside it at the start
DRIVE = "velocity"


class Memory(NamedTuple):
    """States of the controllers of n cranes."""

    zeta: Any  # (n,)
    zeta_dot: Any  # (n,)
    setpoint: Any  # (n, 3)
    robustifier: Any  # (n, 3, order)


class Task:
    """A scenario with its controller and model."""

    def __init__(self, controller: str) -> None:
        self.scenario = load_scenario(SCENARIO, overrides=OVERRIDES)
        self.plan = Plan.of(self.scenario)
        self.design = design_controller(controller, self.scenario.design)
        self.tracker = Tracker.of(self.scenario, self.design)
        self.lag = Actuation.of(self.scenario).lag
        # The sampled robustifier of one axis.
        self.a = diagonal(self.tracker.state_matrix.reshape(-1, 2, 2))
        self.b, self.c = self.tracker.input_matrix, self.tracker.output_matrix
        spec = model_spec(self.scenario.rig, drive=DRIVE, step=self.tracker.period)
        self.model = spec.compile()
        spec.delete(spec.tendon("rope"))  # MJX cannot carry it through a loop in double precision
        self.model_without_tendon = spec.compile()
        self.positions, self.rates = state_addresses(self.model), rate_addresses(self.model)
        self.drives = drive_addresses(self.model)

    def start(self, cranes: int) -> tuple[Array, Array, Memory]:
        """Return positions (n, 5) and rates (n, 5) in the model's order, and the controllers' states."""
        state, reference = self.plan.initial_state, self.plan.reference[0]
        qpos, qvel = np.zeros(5), np.zeros(5)
        qpos[self.positions], qvel[self.rates] = state[0::2], state[1::2]
        ones = np.ones((cranes, 1))
        memory = Memory(
            ones[:, 0] * reference[8],
            ones[:, 0] * reference[11],
            ones * state[1:6:2],
            np.zeros((cranes, 3, len(self.b))),
        )
        return ones * qpos, ones * qvel, memory

    def control(self, xp: Any, q: Any, v: Any, reference: Any, memory: Memory) -> tuple[Any, Memory]:
        """Return velocity set-points (n, 3) [m/s], and the next states of the controllers.

        `xp` is NumPy or JAX's NumPy, and `q` and `v` are positions and rates (n, 5) in the model's order.
        """
        t, dt = self.tracker, self.tracker.period
        zeta, zeta_dot, setpoint, xi = memory
        x_c, y_c, length, alpha, beta = (q[:, k] for k in self.positions)
        x_dot, y_dot, length_dot, alpha_dot, beta_dot = (v[:, k] for k in self.rates)
        cos_a, cos_b, tan_b, p_y = xp.cos(alpha), xp.cos(beta), xp.tan(beta), xp.tan(alpha)
        p_x = tan_b / cos_a
        p_y_dot = alpha_dot * (1 + p_y**2)
        p_x_dot = beta_dot * (1 + tan_b**2) / cos_a + p_x * p_y * alpha_dot
        lift = zeta + t.gravity
        h = length * cos_a * cos_b
        h_dot = length_dot * cos_a * cos_b - length * (
            alpha_dot * xp.sin(alpha) * cos_b + beta_dot * cos_a * xp.sin(beta)
        )
        flat = xp.stack(
            [
                xp.stack([x_c + p_x * h, y_c + p_y * h, -h], -1),
                xp.stack([x_dot + p_x_dot * h + p_x * h_dot, y_dot + p_y_dot * h + p_y * h_dot, -h_dot], -1),
                xp.stack([-p_x * lift, -p_y * lift, zeta], -1),
                xp.stack([-p_x_dot * lift - p_x * zeta_dot, -p_y_dot * lift - p_y * zeta_dot, zeta_dot], -1),
            ]
        )
        error = reference[:12].reshape(4, 1, 3) - flat
        v_bar = xi @ self.c + t.feedthrough * error[0]
        new = reference[12:] + v_bar + xp.tensordot(t.gain, error, 1)
        p_x_dd = -(new[:, 0] + 2 * p_x_dot * zeta_dot + p_x * new[:, 2]) / lift
        p_y_dd = -(new[:, 1] + 2 * p_y_dot * zeta_dot + p_y * new[:, 2]) / lift
        s = xp.sqrt(1 + p_x**2 + p_y**2)
        s_dot = (p_x * p_x_dot + p_y * p_y_dot) / s
        s_dd = (p_x_dot**2 + p_y_dot**2 + p_x * p_x_dd + p_y * p_y_dd - s_dot**2) / s
        u = xp.stack(
            [
                -(t.gravity * p_x + 2 * p_x_dot * h_dot + h * p_x_dd),
                -(t.gravity * p_y + 2 * p_y_dot * h_dot + h * p_y_dd),
                -zeta * s + 2 * h_dot * s_dot + h * s_dd,
            ],
            -1,
        )
        following = Memory(
            zeta + dt * (zeta_dot + 0.5 * dt * new[:, 2]),
            zeta_dot + dt * new[:, 2],
            setpoint + dt * u,
            xi @ self.a.T + error[0][..., None] * self.b,
        )
        return setpoint + self.lag * u, following


def python_loop(task: Task, cranes: int) -> Array:
    """Simulate one crane after the other by the engine's Python binding; return the last states (n, 10)."""
    data = mujoco.MjData(task.model)
    ends = np.zeros((cranes, 10))
    for k in range(cranes):
        q, v, memory = task.start(1)
        mujoco.mj_resetData(task.model, data)
        data.qpos[:], data.qvel[:] = q[0], v[0]
        for reference in task.plan.reference[:-1]:
            command, memory = task.control(np, data.qpos[None], data.qvel[None], reference, memory)
            data.ctrl[task.drives] = command[0]
            mujoco.mj_step(task.model, data)
        ends[k] = [*data.qpos, *data.qvel]
    return ends


def batch_loop(task: Task, cranes: int) -> Array:
    """Simulate all cranes at once by `mujoco.batch` on one thread; return the last states (n, 10)."""
    batch = Batch(task.model, nsim=cranes, nthread=1)
    q, v, ctrl = batch.bind("qpos"), batch.bind("qvel"), batch.bind("ctrl")
    q[:], v[:], memory = task.start(cranes)
    for reference in task.plan.reference[:-1]:
        ctrl[:, task.drives], memory = task.control(np, q, v, reference, memory)
        batch.step()
    return np.hstack([q, v])


def rollout_loop(task: Task, cranes: int) -> Array:
    """Simulate all cranes at once by one-step calls of `mujoco.rollout`; return the last states (n, 10)."""
    q, v, memory = task.start(cranes)
    full = np.hstack([np.zeros((cranes, 1)), q, v])  # time first
    commands = np.zeros((cranes, 1, task.model.nu))
    following, sensors = (np.zeros((cranes, 1, width)) for width in (full.shape[1], task.model.nsensordata))
    models, data = [task.model] * cranes, [mujoco.MjData(task.model)]
    with Rollout(nthread=0) as rollout:
        for reference in task.plan.reference[:-1]:
            q, v = full[:, 1:6], full[:, 6:]
            commands[:, 0, task.drives], memory = task.control(np, q, v, reference, memory)
            rollout.rollout(models, data, full, commands, nstep=1, state=following, sensordata=sensors)
            full = following[:, 0].copy()
    return full[:, 1:]


class MjxLoop:
    """A program for all cranes that JAX compiles in double precision, on all cores."""

    def __init__(self, task: Task, cranes: int) -> None:
        """Compile the program; raise ImportError if MJX is not installed."""
        import jax
        from mujoco import mjx

        jax.config.update("jax_enable_x64", True)
        xp = jax.numpy
        q, v, self._memory = jax.tree.map(xp.asarray, task.start(cranes))
        model = mjx.put_model(task.model_without_tendon)
        at_zero = mjx.put_data(task.model_without_tendon, mujoco.MjData(task.model_without_tendon))
        self._data = jax.vmap(lambda q, v: at_zero.replace(qpos=q, qvel=v))(q, v)
        references = xp.asarray(task.plan.reference[:-1])

        def advance(carry: Any, reference: Any) -> tuple[Any, None]:
            data, memory = carry
            command, memory = task.control(xp, data.qpos, data.qvel, reference, memory)
            data = data.replace(ctrl=data.ctrl.at[:, task.drives].set(command))
            return (jax.vmap(lambda d: mjx.step(model, d))(data), memory), None

        self._run = jax.jit(lambda *start: jax.lax.scan(advance, start, references)[0][0])
        self._run = self._run.lower(self._data, self._memory).compile()

    def __call__(self) -> Array:
        data = self._run(self._data, self._memory)
        return np.hstack([data.qpos, data.qvel])
