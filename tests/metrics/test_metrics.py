"""Metrics are exact for signals of closed form, equal independent formulas, and do not depend on blocks."""

import functools
from dataclasses import replace
from math import acos, cos, pi, radians, sin, sqrt
from pathlib import Path

import numpy as np
import pytest

from cranectl.cases.case import RunSummary
from cranectl.design import design_controller
from cranectl.metrics import Accumulator, Metric, WorkspaceViolation, run_metrics, workspace_violations
from cranectl.metrics.setup import FLAG_COLUMN, metrics_setup
from cranectl.model.dynamics import kinetic_energy, potential_energy, rope_direction
from cranectl.planning import load_scenario
from cranectl.report.run.page import LogPage
from cranectl.report.run.tables import RunTables
from cranectl.report.table import Cell
from cranectl.scenario import Scenario
from cranectl.scenario.effects import DriveLimits, EffectSettings, Friction
from cranectl.signals import COLUMN
from cranectl.simulate import Plan, Run, simulate_run
from cranectl.status import RunStatus
from tests.conftest import cut

BRIDGE, TROLLEY, ROPE = 0, 2, 4  # positions in the state; velocities are one further
ALPHA, BETA = 6, 8
LIMITED = COLUMN.width + FLAG_COLUMN
SAMPLES, REST = 4001, 2000
VIEWS = {"peak_acceleration_m_s2", "outside_first_s", "outside_excess_m", "outside_time_s"}  # not in JSON
ALL = {"status", "duration_s", "workspace_violations", *(m.name for m in Metric.all())} - VIEWS
AFTER_REST = {
    "settling_time_s", "overshoot_m", "max_rest_error_m", "residual_sway_rad",
    "residual_sway_about_lean_rad", "residual_vibration_m",
}  # fmt: skip


def scenario_of(**changes: object) -> Scenario:
    """Return a scenario with a line of 0.4 m along x in 2 s, then 2 s of rest."""
    line = {"kind": "line", "to": [0.9, 0.5, -0.7], "duration": 2.0}
    table = {
        "name": "synthetic", "duration": 4.0, "reference": {"start": [0.5, 0.5, -0.7], "segments": [line]},
        "effects": {"delay": {"seconds": 0.004}}, **changes,
    }  # fmt: skip
    return Scenario.from_table(table, "test")


@pytest.fixture
def synthetic() -> Run:
    """Return an invented run in which every signal, and so every metric, has a closed form.

    The load is (0.03, 0.04, 0) behind its reference until that rests; then it swings by 0.02 m along x for
    one second and stays 0.004 m beyond its end point.
    """
    scenario = scenario_of()
    t = np.arange(SAMPLES) * 1e-3
    moving, swinging = t < 2.0, (t >= 2.0) & (t < 3.0)
    reference = Plan.of(scenario).reference
    table = np.zeros((SAMPLES, LIMITED + 3))
    table[:, BRIDGE], table[:, BRIDGE + 1] = 1.5 - 0.25 * t, -0.25
    table[:, TROLLEY] = np.where(t <= 2.0, 0.94 + 0.1 * t**2, 1.74 - 0.1 * (4.0 - t) ** 2)
    table[:, TROLLEY + 1] = np.where(t <= 2.0, 0.2 * t, 0.2 * (4.0 - t))
    table[:, ROPE], table[:, ROPE + 1] = 0.9 - 0.1 * t, -0.1
    table[:, BETA] = np.where(moving, 0.1, 0.05)
    beyond = np.where(swinging, 0.02 * np.cos(2.0 * pi * (t - 2.0)), 0.004)
    load = reference[:, :3].copy()
    load[moving] -= (0.03, 0.04, 0.0)
    load[~moving, 0] += beyond[~moving]
    table[:, COLUMN.load : COLUMN.load + 3] = load
    table[:, COLUMN.tension] = 10.0
    table[:, COLUMN.input] = 0.5 * np.sin(0.5 * pi * t)
    table[:, COLUMN.input + 1], table[:, COLUMN.input + 2] = 0.3, -0.2
    table[500:750, LIMITED] = 1.0
    table[700:1000, LIMITED + 2] = 1.0
    return Run(
        scenario=scenario, design=design_controller("pole-placement", scenario.design), plant="analytic",
        drive="ideal", model="", time_ns=np.arange(SAMPLES, dtype=np.int64) * 1_000_000, table=table,
        reference=reference, status=RunStatus.COMPLETED, end_ns=4_000_000_000,
    )  # fmt: skip


def test_signals_of_closed_form(synthetic: Run) -> None:
    swung = 0.02 * cos(2.0 * pi * 0.999)
    # The bridge pulls the load that trails it: power S sin(beta) 0.25 m/s. The trolley starts and stops
    # 2.5 kg under a rope that hangs straight. The winch lifts with 10 N.
    pulled = 1999 * sin(0.1) + 0.5 * (sin(0.1) + sin(0.05)) + 2000 * sin(0.05)
    bridge = 10.0 * 0.25 * 1e-3 * pulled
    expected = {
        "max_error_m": 0.05,
        # cos² over a whole period: half its samples
        "rms_error_m": sqrt((2000 * 0.05**2 + 500 * 0.02**2 + 1001 * 0.004**2) / SAMPLES),
        "final_error_m": 0.004,
        "final_load_m": (0.904, 0.5, -0.7),
        "rest_s": 2.0,
        "settling_time_s": 1.0,
        "overshoot_m": 0.02,
        "max_rest_error_m": 0.02,
        "residual_sway_rad": 0.05,
        "residual_sway_about_lean_rad": 0.0,
        "residual_vibration_m": (0.02, 0.0, 0.0),
        "peak_acceleration_m_s2": (0.5, 0.3, -0.2),
        "max_acceleration_m_s2": (0.5, 0.3, -0.2),
        "min_acceleration_m_s2": (-0.5, 0.3, -0.2),
        "rms_acceleration_m_s2": (0.5 * sqrt(2000 / SAMPLES), 0.3, 0.2),
        "command_variation_m_s2": (2.0, 0.0, 0.0),  # a period of a sine
        "max_abs_angle_rad": (0.0, 0.1),
        "max_sway_rad": 0.1,
        "rms_sway_rad": sqrt((2000 * 0.1**2 + 2001 * 0.05**2) / SAMPLES),
        "min_rope_tension_n": 10.0,
        "drive_path_m": (1.0, 0.8, 0.4),
        "load_path_m": 0.4 + sqrt(0.05**2 + 0.04**2) + 0.04 + (0.02 + swung) + (swung - 0.004),
        "drive_energy_j": (bridge, 0.5 * 2.5 * 0.4**2, 4.0),
        "drive_work_j": (bridge, 0.0, 4.0),
        "saturated_s": 0.5,
        "outside_excess_m": (0.0, 0.2, 0.0),
        "outside_time_s": (0.0, 4.0 - 2.586, 0.0),
    }
    metrics = run_metrics(synthetic)
    for name, value in expected.items():
        assert getattr(metrics, name) == pytest.approx(value, rel=1e-9, abs=1e-12), name
    assert metrics.outside_first_s == (None, 2.586, None)  # 1.74 - 0.1 (4 - t)² > 1.54
    assert metrics.min_clearance_m is None  # `test_clearance` has obstacles
    others = {"outside_first_s", "min_clearance_m"}
    assert metrics.values.keys() == {*expected, *others}, "every metric has its closed form"
    assert (metrics.status, metrics.duration_s) == ("completed", 4.0)
    assert metrics.to_json().keys() == ALL
    (violation,) = metrics.workspace_violations
    assert violation == WorkspaceViolation(
        "trolley_position", 2.586, *(pytest.approx(v) for v in (0.2, 1.414))
    )


def test_sway_about_the_lean_is_not_the_lean(synthetic: Run) -> None:
    """A constant disturbance holds the rope at a lean; of both angles the larger swing about it counts."""
    swings = 2.0 * pi * np.arange(SAMPLES - REST) * 1e-3
    synthetic.table[REST:, BETA] = 0.2 + 0.01 * np.cos(swings)
    synthetic.table[REST:, ALPHA] = -0.1 + 0.03 * np.sin(swings)
    synthetic.table[:REST, ALPHA] = 0.4  # does not rest yet
    assert run_metrics(synthetic).residual_sway_about_lean_rad == pytest.approx(0.03, rel=1e-12)
    assert run_metrics(synthetic).residual_sway_rad > 0.2


def test_only_what_is_beyond_the_end_point_is_overshoot(synthetic: Run) -> None:
    for shift, expected in ((0.01, 0.03), (-0.01, 0.01), (-0.03, 0.0)):
        shifted = column(synthetic, COLUMN.load, shift, slice(REST, None))
        assert run_metrics(shifted).overshoot_m == pytest.approx(expected, rel=1e-12)


def column(run: Run, index: int, value: float, rows: slice) -> Run:
    """Return `run` with `value` added to a column of its record."""
    table = run.table.copy()
    table[rows, index] += value
    return replace(run, table=table)


def fed(run: Run, ends: list[int]) -> bytes:
    """Return the accumulator after blocks that end at `ends`, all in the same buffer."""
    accumulator = Accumulator(run.scenario, run.drive)
    width = LIMITED - FLAG_COLUMN
    record = np.full((len(run.table), width), np.nan)
    stages = np.full((len(run.table), LIMITED + 3 - width), 7.0)
    for first, last in zip([0, *ends], [*ends, len(run.table)], strict=True):
        n = last - first
        record[:n], stages[:n] = run.table[first:last, :width], run.table[first:last, width:]
        rows = slice(first, last)
        accumulator.add(run.time_ns[rows], record[:n], run.reference[rows], stages[:n])
    assert accumulator.finish(run.status, run.end_ns) == run_metrics(run)
    return accumulator.total.tobytes()


def test_blocks_give_the_same_bits(synthetic: Run) -> None:
    whole = fed(synthetic, [])
    assert fed(synthetic, [1000, 2000, 3000, 4000]) == whole
    assert fed(synthetic, list(range(1, SAMPLES))) == whole
    random = np.random.default_rng(0)
    for _ in range(5):
        assert fed(synthetic, sorted(random.integers(0, SAMPLES, 7).tolist())) == whole, "empty blocks too"


@functools.cache
def moved(plant: str, drive: str) -> Run:
    """Simulate a line with hoisting, with disturbances on both axes."""
    scenario = load_scenario(
        "settled-trajectory",
        overrides=[
            "duration=3.0", "reference.segments=[{kind='line', to=[0.9, 0.6, -0.5], duration=2.0}]",
            "disturbances.0.start=0.5", "disturbances.0.end=1.0", "disturbances.1.start=0.8",
            "disturbances.1.end=1.5", "effects.delay.seconds=0.0",
        ],
    )  # fmt: skip
    return simulate_run(scenario, plant=plant, drive=drive, controller="lqr")


DRIVEN = [(plant, drive) for plant in ("analytic", "mujoco") for drive in ("ideal", "velocity")]


@pytest.mark.parametrize(("plant", "drive"), DRIVEN)
def test_work_is_the_change_of_energy(plant: str, drive: str) -> None:
    """The work of drives and disturbances is the change of energy, which needs every term of the forces."""
    run = moved(plant, drive)
    rig, state, d = run.scenario.rig, run.block("state"), run.block("disturbance")
    inertia = rig.load_mass * state[:, 4] ** 2
    push = inertia * (np.cos(state[:, 8]) ** 2 * d[:, 0] * state[:, 7] + d[:, 1] * state[:, 9])
    first, last = (
        kinetic_energy(row[0::2], row[1::2], rig) + potential_energy(row[0::2], rig) for row in state[[0, -1]]
    )
    gained = last - first - np.trapezoid(push, run.time)
    # The tension is that at the start of a period; drives with a lag accelerate less towards its end.
    tolerance = 1e-3 if drive == "ideal" else 6e-3
    assert sum(run_metrics(run).drive_work_j) == pytest.approx(gained, abs=tolerance)
    table = run.table.copy()
    table[:, COLUMN.disturbance : COLUMN.disturbance + 2] = 0.0
    without = run_metrics(replace(run, table=table)).drive_work_j
    reaction = np.subtract(run_metrics(run).drive_work_j, without)
    assert abs(reaction.sum()) > 10.0 * tolerance, "the reaction to the disturbances counts"
    assert abs(gained) > 1.0


@pytest.mark.parametrize("axis", [0, 1])
def test_a_trolley_motor_takes_energy_along_y_alone(axis: int) -> None:
    """Ideal drives move both cranes alike, half a second before the line ends."""
    segments = "[{kind='line', to=[0.9, 0.6, -0.5], duration=2.0}]"
    given = ["duration=2.0", "disturbances=[]", f"reference.segments={segments}", "effects.delay.seconds=0.0"]
    whole = [
        simulate_run(
            load_scenario("settled-trajectory", overrides=[*given, f"rig.trolley_motor_mass={mass}"]),
            plant="analytic", drive="ideal", controller="lqr",
        )
        for mass in (0.0, 3.0)
    ]  # fmt: skip
    runs = [cut(run, 3 * len(run.time_ns) // 4) for run in whole]
    speed = runs[0].block("state")[-1, 2 * axis + 1]
    assert abs(speed) > 0.05
    without, with_motor = (run_metrics(run).drive_work_j[axis] for run in runs)
    assert with_motor - without == pytest.approx(0.5 * 3.0 * speed**2 * axis, abs=1e-9)


def test_power_of_drives_that_run_steadily(synthetic: Run) -> None:
    """Return the forces on the trolley as vectors: the rope's pull, and the reaction to a disturbance."""
    alpha, beta, tension, push = 0.3, -0.4, 12.0, np.array([0.7, -1.1])
    length, velocity, samples = 0.8, np.array([0.3, -0.2, 0.1]), 501
    table = synthetic.table[:samples].copy()
    table[:, [ALPHA, BETA, ROPE, COLUMN.tension]] = alpha, beta, length, tension
    table[:, [BRIDGE + 1, TROLLEY + 1, ROPE + 1]] = velocity
    table[:, COLUMN.disturbance : COLUMN.disturbance + 2] = push
    run = replace(cut(synthetic, samples), table=table)
    later = replace(run, time_ns=run.time_ns + 7_000_000_000)

    def n(a: float, b: float) -> np.ndarray:
        return np.array(rope_direction(a, b))

    step = 1e-6
    turned = [
        (n(alpha + step, beta) - n(alpha - step, beta)) / (2.0 * step),
        (n(alpha, beta + step) - n(alpha, beta - step)) / (2.0 * step),
    ]
    pushed = length * (push[0] * turned[0] + push[1] * turned[1])  # 1 kg, accelerated across the rope
    on_trolley = tension * n(alpha, beta) - pushed
    force = [-on_trolley[0], -on_trolley[1], -tension]
    expected = 0.5 * velocity * force
    assert (np.abs(expected) > 0.05).all()
    assert run_metrics(run).drive_work_j == pytest.approx(expected, rel=1e-8)
    assert run_metrics(run).drive_energy_j == pytest.approx(np.maximum(expected, 0.0), rel=1e-8)
    assert run_metrics(later).drive_work_j == pytest.approx(expected, rel=1e-8), "whenever it starts"
    assert run_metrics(run).max_abs_angle_rad == pytest.approx((0.3, 0.4))
    assert run_metrics(run).rms_sway_rad == pytest.approx(acos(-n(alpha, beta)[2])), "from the plumb line"


def test_friction_of_the_axes_costs_energy() -> None:
    scenario = moved("mujoco", "velocity").scenario
    friction = Friction(
        coulomb=(2.0, 1.0, 1.0), viscous=(4.0, 2.0, 2.0), pivot_coulomb=0.0, pivot_viscous=0.0
    )
    rough = scenario.model_copy(update={"effects": EffectSettings(friction=friction)})
    run = simulate_run(rough, plant="mujoco", drive="velocity", controller="lqr")
    with_friction = run_metrics(run)
    smooth = run_metrics(replace(run, scenario=scenario))
    velocity = np.abs(run.block("state")[:, 1:6:2])
    lost = np.trapezoid(velocity * (2.0, 1.0, 1.0) + velocity**2 * (4.0, 2.0, 2.0), run.time, axis=0)
    assert np.subtract(with_friction.drive_work_j, smooth.drive_work_j) == pytest.approx(lost, rel=1e-9)
    assert metrics_setup(rough, "ideal").coulomb.tolist() == [0.0, 0.0, 0.0], "nothing holds an ideal drive"


def test_limits_that_act_are_timed() -> None:
    scenario = moved("analytic", "velocity").scenario
    limits = DriveLimits(acceleration=(0.5, 4.0, 6.0), force=(1e9, 1e9, 1e9))
    limited = scenario.model_copy(update={"effects": EffectSettings(limits=limits)})
    run = simulate_run(limited, plant="analytic", drive="velocity", controller="lqr+loop-shaping")
    acting = run.block("command")[:, 3:].any(axis=1)
    assert 0.1 < run_metrics(run).saturated_s == pytest.approx(1e-3 * acting[:-1].sum(), rel=1e-9)
    assert run_metrics(moved("analytic", "velocity")).saturated_s == 0.0


ARC = {"kind": "arc", "centre": [0.8, 0.5], "angle": -pi, "duration": 3.0}
LINE = {"kind": "line", "to": [0.7, 0.5, -0.7], "duration": 1.0}
HOLD = {"kind": "hold", "duration": 0.5}
# Along x, then nearly at rest, like a fit of noise.
TAUGHT = {
    "kind": "spline",
    "degree": 7,
    "breaks": [0.5 * k for k in range(8)],
    "coefficients": [
        [x, 0.5 + y, -0.7] for x, y in zip([0.5] * 5 + [0.7] * 9, [0.0] * 8 + [1e-13] * 6, strict=True)
    ],
}


@pytest.mark.parametrize(
    ("segments", "rest", "direction"),
    [
        ([], 0.0, (0.0, 0.0, 0.0)),
        ([HOLD], 0.0, (0.0, 0.0, 0.0)),
        ([LINE, HOLD], 1.0, (1.0, 0.0, 0.0)),
        ([HOLD, LINE], 1.5, (1.0, 0.0, 0.0)),
        ([ARC], 3.0, (0.0, -1.0, 0.0)),  # over the top, down at the other end
        ([TAUGHT], 3.5, (1.0, 0.0, 0.0)),
        ([LINE, HOLD, {**LINE, "to": [0.7, 0.5, -0.9]}, HOLD], 2.5, (0.0, 0.0, -1.0)),
    ],
)
def test_when_and_how_the_reference_comes_to_rest(
    segments: list[dict[str, object]], rest: float, direction: tuple[float, float, float]
) -> None:
    scenario = scenario_of(reference={"start": [0.5, 0.5, -0.7], "segments": segments})
    setup = metrics_setup(scenario, "ideal")
    assert setup.rest_ns == rest * 1e9
    assert setup.direction == pytest.approx(direction, abs=1e-9)
    rows = Plan.of(scenario).reference
    first = round(rest * 1000)
    assert (rows[first:, :6] == rows[-1, :6]).all(), "at rest from there on"
    if first:
        assert (rows[first - 100, 3:6] != 0.0).any(), "and not before"


def test_without_motion_there_is_no_overshoot(short: Scenario) -> None:
    metrics = run_metrics(simulate_run(short, plant="analytic"))
    assert (metrics.rest_s, metrics.overshoot_m) == (0.0, None)
    assert metrics.max_rest_error_m == metrics.max_error_m > 0


def test_a_run_that_ends_before_rest_says_nothing_of_it(synthetic: Run) -> None:
    for rows in (1, 1000, REST + 1):  # the last has one sample at rest
        metrics = run_metrics(replace(cut(synthetic, rows), status=RunStatus.SLACK_ROPE))
        assert all(getattr(metrics, name) is None for name in AFTER_REST)
        assert metrics.status == "slack-rope"
    stopped = run_metrics(replace(cut(synthetic, 3500), status=RunStatus.SLACK_ROPE))
    assert stopped.settling_time_s is None
    assert stopped.overshoot_m == run_metrics(synthetic).overshoot_m
    outside = column(synthetic, COLUMN.load, 0.002, slice(-1, None))
    assert run_metrics(outside).settling_time_s is None, "the load does not stay within the tolerance"


def test_one_sample_is_run_metrics(synthetic: Run) -> None:
    metrics = run_metrics(cut(synthetic, 1))
    assert metrics.max_error_m == metrics.rms_error_m == metrics.final_error_m > 0.0
    assert metrics.drive_path_m == metrics.drive_energy_j == (0.0, 0.0, 0.0)
    assert metrics.load_path_m == 0.0


def test_a_run_without_samples_has_no_metrics(synthetic: Run) -> None:
    empty = cut(synthetic, 0)
    assert run_metrics(empty) is None
    assert workspace_violations(empty) == ()


def test_violations_on_the_low_side_count_too(synthetic: Run) -> None:
    short = column(synthetic, ROPE, 0.01 - synthetic.table[100, ROPE], slice(100, 101))  # rope of 10 mm
    _, violation = workspace_violations(short)
    assert (violation.signal, violation.first_time_s) == ("rope_length", 0.1)
    assert violation.max_excess_m == pytest.approx(0.04)
    assert violation.time_outside_s == pytest.approx(0.001)


def test_the_table_of_a_run(synthetic: Run) -> None:
    run, none = (RunSummary.of(run_or_part, Path()) for run_or_part in (synthetic, cut(synthetic, 0)))
    table = RunTables.metrics({"one": [run, replace(run, plant="twin")], "none": [none]})
    assert table.headings == ("metric", "unit", f"one\n{run.plant}, twin", f"none\n{run.plant}")
    texts = {row[0].text: (row[1].text, row[2].text) for row in table.rows}
    always = sum(bool(metric.row.label and metric.row.always) for metric in Metric.all())
    assert len(texts) == len(table.rows) == always
    assert list(texts)[:3] == ["tracking error, RMS", "tracking error, max", "tracking error, final"]
    assert texts["settling time"] == ("s", "1.000")
    assert texts["residual sway"] == ("°", f"{0.05 / radians(1.0):.3f}")
    assert texts["peak of ẍ_c ÿ_c l̈"] == ("m/s²", "0.500 0.300 -0.200")
    assert texts["time outside x_c y_c l"] == ("s", "0.000 1.414 0.000")
    assert {row[3].text for row in table.rows} == {"-"}
    assert "best" not in {cell.mark for row in table.rows for cell in row}, "there is nothing to compare"
    stopped = RunTables.metrics(
        {"": [RunSummary.of(replace(synthetic, status=RunStatus.SLACK_ROPE), Path())]}
    )
    assert [row[2].text for row in stopped.rows if row[0].text == "settling time"] == ["-"]
    page = LogPage.of({"log": {"analytic": cut(synthetic, 0)}}, "cranectl report")  # without figures
    assert RunTables.metrics({"log": [replace(none, plant="analytic")]}) in page.sections[0].tables


def test_the_best_of_the_runs_that_did_not_stop_is_marked(synthetic: Run) -> None:
    run = RunSummary.of(synthetic, Path())

    def with_values(**values: float) -> RunSummary:
        return replace(run, metrics=replace(run.metrics, values={**run.metrics.values, **values}))

    slack = with_values(max_error_m=0.01, min_rope_tension_n=0.0)
    stopped = replace(with_values(max_error_m=0.0), status=RunStatus.SLACK_ROPE)
    table = RunTables.metrics({"a": [run], "b": [slack], "c": [stopped]})
    marks = {row[0].text: [cell.mark for cell in row[2:]] for row in table.rows}
    assert marks["tracking error, max"] == ["", "best", ""]
    assert marks["rope tension, min"] == ["best", "", ""]
    assert marks["sway, max"] == ["", "", ""], "the same everywhere"
    heavy = RunTables.metrics({"": [with_values(min_rope_tension_n=193741.96)]})
    (row,) = (row for row in heavy.rows if row[0].text == "rope tension, min")
    assert [cell.text for cell in row[1:]] == ["kN", "193.742"]


def test_a_report_marks_a_run_that_left_the_rig(synthetic: Run) -> None:
    runs = [RunSummary.of(run, Path("log")) for run in (synthetic, cut(synthetic, 1000))]
    assert [row[-1] for row in RunTables.runs({"log": runs}).rows] == [
        Cell("0.2000", "bad"),
        Cell("0.0000", ""),
    ]
