"""The sampled kernel."""

import ctypes
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import cont2discrete

from cranectl import signals
from cranectl.controllers.controller import ROPE_SLACK, ROPE_TAUT, Nominal
from cranectl.controllers.flat import (
    FLAT_CONTROLLERS,
    MEMORY,
    MIN_TENSION,
    Tracker,
    begin,
    control_step,
    make_tracker,
    robustify,
)
from cranectl.design import Design, Robustifier, design_controller
from cranectl.design.linear_systems import closed_loop_poles
from cranectl.model.flatness import flat_output, linearising_input
from cranectl.scenario.rig import RigParameters
from cranectl.status import RunStatus
from tests.conftest import random_states

G, PERIOD = 9.81, 0.001
DOUBLES = ctypes.POINTER(ctypes.c_double)


def tracker_of(design: Design) -> Tracker:
    return make_tracker(design, period=PERIOD, gravity=G)


def memory_of(design: Design, zeta: float = 0.3, zeta_dot: float = -0.2) -> np.ndarray:
    """Memory of a tracker that has begun, with its robustifiers at rest."""
    return np.array([zeta, zeta_dot, 1.0, 0.0, *np.zeros(3 * design.robustifier.sampled_order)])


def robust_design() -> Design:
    """An oscillating mode, an integrator and a stiff pole, with feed-through."""
    a = np.array([[-1.0, 5.0, 0.0, 0.0], [-5.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -4e4]])
    robustifier = Robustifier(a, np.array([1.0, -2.0, 0.5, 4e4]), np.array([0.3, 0.4, 2.0, -1.0]), 0.7)
    plain = design_controller("lqr")
    poles = closed_loop_poles(replace(plain, robustifier=robustifier).open_loop())
    return replace(plain, robustifier=robustifier, closed_loop_poles=poles)


def step(
    design: Design, state: np.ndarray, reference: np.ndarray, memory: np.ndarray
) -> tuple[int, np.ndarray]:
    row = np.full(signals.COLUMN.width + 3 * design.robustifier.sampled_order, np.nan)
    return control_step(tracker_of(design), state, reference, memory, row), row


def test_control_law_is_the_sum_it_should_be() -> None:
    """v = z_d'''' + K e with e = z_d - z, then the linearising control law; (3.47)."""
    rng = np.random.default_rng(2)
    design = design_controller("pole-placement")
    for state in random_states(100):
        reference = rng.normal(size=15)
        memory = memory_of(design)
        status, row = step(design, state, reference, memory.copy())
        assert status == RunStatus.RUNNING
        flat = np.zeros(15)
        flat_output(state, 0.3, -0.2, G, flat)
        error = (reference[:12] - flat[:12]).reshape(4, 3)
        v = reference[12:] + design.gain @ error
        u = linearising_input(state, 0.3, -0.2, *v, G)
        assert row[signals.COLUMN.input : signals.COLUMN.input + 3] == pytest.approx(np.array(u), rel=1e-12)
        assert row[signals.COLUMN.virtual_input : signals.COLUMN.virtual_input + 3] == pytest.approx(v)
        assert row[signals.COLUMN.error : signals.COLUMN.error + 12] == pytest.approx(error.ravel())


def test_memory_advances_by_one_held_period() -> None:
    design = design_controller("lqr")
    state, reference = random_states(1)[0], np.arange(15) * 0.01
    memory = memory_of(design)
    before = memory.copy()
    _, row = step(design, state, reference, memory)
    v_z = row[signals.COLUMN.virtual_input + 2]
    assert memory[1] == pytest.approx(before[1] + PERIOD * v_z, rel=1e-14)
    assert memory[0] == pytest.approx(before[0] + PERIOD * before[1] + 0.5 * PERIOD**2 * v_z, rel=1e-14)
    assert row[signals.COLUMN.controller :].tolist() == before[:2].tolist()


def test_robustifier_is_the_sampled_system_it_stands_for() -> None:
    """It equals SciPy's zero-order hold of the whole matrix, axis by axis."""
    design = robust_design()
    tracker, r = tracker_of(design), design.robustifier
    n = r.order
    a, b, *_ = cont2discrete((r.a, r.b[:, np.newaxis], r.c[np.newaxis], np.array([[r.d]])), PERIOD)
    memory = np.zeros(MEMORY.robustifier + 3 * n)
    x = np.zeros((3, n))
    for errors in np.random.default_rng(4).normal(size=(200, 3)):
        for axis in range(3):
            expected = r.c @ x[axis] + r.d * errors[axis]
            assert robustify(tracker, axis, errors[axis], memory) == pytest.approx(expected, rel=1e-11)
            x[axis] = a @ x[axis] + b[:, 0] * errors[axis]
    assert memory[MEMORY.robustifier :] == pytest.approx(x.ravel(), rel=1e-11)


def test_robustifier_adds_to_v_and_its_states_are_recorded() -> None:
    design, plain = robust_design(), design_controller("lqr")
    state, reference = random_states(1)[0], np.arange(15) * 0.01
    memory = memory_of(design)
    memory[MEMORY.robustifier :] = np.arange(12.0)
    states = memory[MEMORY.robustifier :].copy()
    _, row = step(design, state, reference, memory)
    _, base = step(plain, state, reference, memory_of(plain))
    first = signals.COLUMN.virtual_input
    v_bar = row[first + 3 : first + 6]
    r = design.robustifier
    error = row[signals.COLUMN.error : signals.COLUMN.error + 3]
    assert v_bar == pytest.approx(states.reshape(3, 4) @ r.c + r.d * error, rel=1e-12)
    assert abs(v_bar).min() > 0.0
    assert row[first : first + 3] == pytest.approx(base[first : first + 3] + v_bar)
    assert row[signals.COLUMN.controller + 2 :].tolist() == states.tolist()


@pytest.mark.parametrize(
    ("index", "value", "zeta", "status"),
    [
        (4, 0.0, 0.0, RunStatus.LENGTH_SINGULAR),
        (4, -0.1, 0.0, RunStatus.LENGTH_SINGULAR),
        (6, np.pi / 2, 0.0, RunStatus.ANGLE_SINGULAR),
        (6, -2.0, 0.0, RunStatus.ANGLE_SINGULAR),
        (8, 1.6, 0.0, RunStatus.ANGLE_SINGULAR),
        (8, -np.pi / 2, 0.0, RunStatus.ANGLE_SINGULAR),
        (1, np.nan, 0.0, RunStatus.NON_FINITE),
        (9, np.inf, 0.0, RunStatus.NON_FINITE),
        (0, 1.0, np.nan, RunStatus.NON_FINITE),
        (0, 1.0, -G, RunStatus.SLACK_ROPE),
        (0, 1.0, -2 * G, RunStatus.SLACK_ROPE),
    ],
)
def test_singular_states_are_refused_and_nothing_is_written(
    index: int, value: float, zeta: float, status: RunStatus
) -> None:
    state = random_states(1)[0]
    state[index] = value
    design = design_controller("lqr")
    memory = memory_of(design, zeta, 0.0)
    before = memory.copy()
    code, row = step(design, state, np.zeros(15), memory)
    assert RunStatus(code) == status
    assert np.isnan(row).all()
    assert np.array_equal(memory, before, equal_nan=True)


class Stepped:
    """The step of a design as the loop calls it, with its memory."""

    def __init__(self, design: Design) -> None:
        nominal = Nominal(RigParameters(), "ideal", PERIOD, np.zeros((1, 15)), np.zeros(10), {}, design)
        self.parameters, self.memory = FLAT_CONTROLLERS["lqr"].prepare(nominal)
        self.width = signals.COLUMN.width + 3 * design.robustifier.sampled_order
        self.command = np.zeros(3)

    def __call__(self, state: np.ndarray, reference: np.ndarray) -> int:
        """One sample; returns the status."""
        step = FLAT_CONTROLLERS["lqr"].step
        arrays = (self.parameters, np.append(state, [0.0, 0.0]), reference, self.memory, self.command)
        return step(*(array.ctypes.data_as(DOUBLES) for array in arrays))

    @property
    def row(self) -> np.ndarray:
        """The row of the record that its memory ends with."""
        return self.memory[-self.width :]


@pytest.mark.parametrize("design", [design_controller("lqr"), robust_design()], ids=["plain", "robust"])
def test_the_step_by_address_is_the_kernel_from_the_start_of_its_reference(design: Design) -> None:
    rng, stepped = np.random.default_rng(5), Stepped(design)
    memory = memory_of(design)
    memory[MEMORY.begun] = 0.0
    for state in random_states(5):
        reference = 0.1 * rng.normal(size=15)
        begin(reference, memory)
        status, row = step(design, state, reference, memory)
        assert stepped(state, reference) == status == RunStatus.RUNNING
        assert np.array_equal(stepped.command, row[signals.COLUMN.input : signals.COLUMN.input + 3])
        recorded = slice(signals.COLUMN.flat_output, None)
        assert np.array_equal(stepped.row[recorded], row[recorded])
        assert np.array_equal(stepped.memory[: len(memory)], memory)


def test_while_the_rope_is_slack_the_step_waits_and_then_goes_on() -> None:
    stepped, state, reference = Stepped(robust_design()), random_states(1)[0], np.arange(15) * 0.01
    states = slice(MEMORY.robustifier, -stepped.width)
    assert stepped(state, reference) == RunStatus.RUNNING
    before, command = stepped.memory[states].copy(), stepped.command.copy()
    stepped.memory[MEMORY.slack] = ROPE_SLACK
    assert stepped(state, reference) == RunStatus.RUNNING
    assert before.any()
    assert np.array_equal(stepped.memory[states], before)
    assert np.array_equal(stepped.command, command)
    first = signals.COLUMN.flat_output
    assert stepped.row[first + 6 : first + 9].tolist() == [0.0, 0.0, -G], "the load falls freely"
    assert not stepped.row[first + 12 : first + 15].any()
    assert not stepped.row[signals.COLUMN.virtual_input : signals.COLUMN.virtual_input + 6].any()
    stepped.memory[MEMORY.slack] = ROPE_TAUT
    assert stepped(state, reference) == RunStatus.RUNNING
    assert not np.array_equal(stepped.memory[states], before)


def test_only_a_run_that_recovers_has_the_extension_kept_from_a_slack_rope() -> None:
    state, falling = random_states(1)[0], np.zeros(15)
    falling[8] = -2.0 * G
    stops, recovers = Stepped(design_controller("lqr")), Stepped(design_controller("lqr"))
    recovers.memory[MEMORY.slack] = ROPE_TAUT
    assert stops(state, falling) == RunStatus.SLACK_ROPE
    assert recovers(state, falling) == RunStatus.RUNNING
    assert recovers.row[signals.COLUMN.controller + MEMORY.zeta] == (MIN_TENSION - 1.0) * G


def test_a_command_that_is_no_number_ends_the_run_as_such() -> None:
    stepped, reference = Stepped(design_controller("lqr")), np.zeros(15)
    reference[12] = np.inf
    assert stepped(random_states(1)[0], reference) == RunStatus.NON_FINITE
