"""Compare `nmpc` with CasADi: the model is that which CasADi writes now, and plans are those of IPOPT."""

import ctypes
from pathlib import Path

import casadi
import numpy as np
import pytest

from tests.benchmark.nmpc import FOLDER, build_library
from validation.benchmark.nmpc.model import functions, write

N, EVERY, GRAVITY, PERIOD = 40, 25, 9.81, 0.025
RATE, EFFORT = 0.3, 0.03
PUSH = np.array([0.3, -0.4])


def test_model_is_what_casadi_writes(tmp_path: Path) -> None:
    write(tmp_path)
    (first, *now), (_, *then) = (
        (folder / "model.c").read_text().splitlines() for folder in (tmp_path, FOLDER)
    )
    assert "CasADi" in first, "the first line has CasADi's version, which may differ"
    assert now == then


def improve_plan(
    library: Path, limits: np.ndarray, state: np.ndarray, path: np.ndarray, times: int
) -> np.ndarray:
    """Return inputs (N, 3) after `times` iterations from zero; `path` (N, 6) has position and velocity."""
    improve = ctypes.CDLL(str(library)).nmpc_improve
    improve.restype, improve.argtypes = None, [np.ctypeslib.ndpointer(flags="C")] * 4
    rows, plan = np.zeros((EVERY * N + 1, 15)), np.zeros((N, 9))
    rows[EVERY::EVERY, :6] = path
    for _ in range(times):
        improve(np.array([RATE, EFFORT, *limits, GRAVITY, PERIOD]), np.append(state, PUSH), rows, plan)
    return plan[:, :3]


def solve_by_ipopt(limits: np.ndarray, state: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Solve the same problem with states as unknowns too, other derivatives and an interior-point method."""
    slope, load = functions()
    opti, length = casadi.Opti(), state[4]
    x, u = opti.variable(10, N + 1), opti.variable(3, N)
    opti.subject_to(x[:, 0] == state)
    cost = 0.0
    for k in range(N):
        middle = x[:, k] + 0.5 * PERIOD * slope(x[:, k], u[:, k], PUSH, GRAVITY)[0]
        opti.subject_to(x[:, k + 1] == x[:, k] + PERIOD * slope(middle, u[:, k], PUSH, GRAVITY)[0])
        error = load(x[:, k + 1])[0] - path[k]
        cost += casadi.sumsqr(error[:3]) / length**2 + RATE * casadi.sumsqr(error[3:]) / (GRAVITY * length)
        cost += EFFORT * casadi.sumsqr(u[:, k]) / GRAVITY**2
        opti.subject_to(opti.bounded(-limits[0] * GRAVITY, u[:, k], limits[0] * GRAVITY))
        largest = limits[1] * np.sqrt(GRAVITY * length)
        opti.subject_to(opti.bounded(-largest, x[1:6:2, k + 1], largest))
    opti.minimize(cost)
    opti.set_initial(x, np.tile(state[:, None], N + 1))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "tol": 1e-10})
    return np.asarray(opti.solve().value(u)).T


@pytest.mark.parametrize(
    ("limits", "binding"), [((1.0, 1.0), ()), ((0.1, 1.0), (0,)), ((1.0, 0.15), (1,)), ((0.1, 0.1), (0, 1))]
)
def test_plans_agree_with_ipopt(
    tmp_path: Path, limits: tuple[float, float], binding: tuple[int, ...]
) -> None:
    """The load swings first, and the path hoists. The test iterates often, the controller once per plan."""
    state = np.array([0.3, 0.1, 0.4, -0.05, 0.9, 0.0, 0.1, -0.3, -0.15, 0.2])
    share = np.linspace(1.0 / N, 1.0, N)[:, None]
    path = np.hstack([[0.3, 0.4, -0.9] + share * [0.3, 0.1, 0.2], np.tile([0.3, 0.1, 0.2], (N, 1))])
    expected = solve_by_ipopt(np.array(limits), state, path)
    plans = improve_plan(build_library(tmp_path), np.array(limits), state, path, 20)
    np.testing.assert_allclose(plans, expected, atol=2e-4)
    speeds = state[1:6:2] + PERIOD * np.cumsum(expected, axis=0)
    used = (
        np.abs(expected).max() / (limits[0] * GRAVITY),
        np.abs(speeds).max() / (limits[1] * np.sqrt(GRAVITY * 0.9)),
    )
    assert [k for k in (0, 1) if used[k] > 0.999] == list(binding)
