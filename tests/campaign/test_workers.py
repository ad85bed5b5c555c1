"""The rows of a campaign have the same bits as single runs, in any order."""

import errno
import os
import signal
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from cranectl.campaign import Campaign, sample_values, sampled_scenario
from cranectl.campaign.definition import Batch, nominal_scenario
from cranectl.campaign.table import METRIC_COLUMNS, Row, metric_values, row_columns
from cranectl.campaign.worker import PreparedCampaign, StoppedError, Worker
from cranectl.campaign.workers import Children, ChildWorker, run_batches
from cranectl.loaders.opening import open_controller
from cranectl.metrics import RunMetrics, run_metrics
from cranectl.scenario import NANOSECONDS
from cranectl.simulate import PlannedReference, Run, simulate_run
from cranectl.support.errors import MachineError
from tests.campaign.campaigns import LAG, MASS, PUSH, SEED, campaign, choice, fixed, run_batch, uniform
from tests.conftest import PLANTS
from tests.pace import HANG

SHORT = ["duration=0.25", "disturbances.0.start=0.05", "disturbances.0.end=0.2", "disturbances.1.start=0.1"]
OFFSET = uniform(-0.02, 0.02)
UNCERTAIN = {
    "rig.load_mass": MASS, "rig.winch_time_constant": LAG, "rig.gravity": uniform(9.7, 9.9),
    "disturbances.0.magnitude": PUSH, "effects.friction.pivot_viscous": uniform(0.0, 0.01),
    "effects.sensing.seed": SEED, "effects.delay.seconds": uniform(0.0, 0.005), "effects.wind.seed": SEED,
    "initial.load_offset.0": OFFSET, "initial.alpha_offset": OFFSET, "control.period": choice(0.001, 0.002),
}  # fmt: skip
NO_FORCES = ["effects.friction.coulomb=[0.0,0.0,0.0]", "effects.friction.viscous=[0.0,0.0,0.0]"]
HEAVY = "lqr+hinf"


def short(uncertain: dict[str, Any] | None = None, *extra: str, **changes: Any) -> Campaign:
    settings = {
        "scenario": "fixed-position", "set": [*SHORT, *extra], "runs": 6, "controllers": ["lqr", HEAVY],
    }  # fmt: skip
    return campaign(UNCERTAIN if uncertain is None else uncertain, **(settings | changes))


@pytest.fixture(scope="module")
def both() -> Campaign:
    """Return a campaign on both plants, with all effects that both can show."""
    return short(None, *NO_FORCES, plants=list(PLANTS))


def alone(of: Campaign, sample: int, plant: str, controller: str) -> Run:
    """Simulate one sample of a campaign as a single run."""
    (values,) = sample_values(of, sample, sample + 1)
    sampled = sampled_scenario(of, values)
    return simulate_run(
        sampled, nominal=nominal_scenario(of, sampled), plant=plant, drive=of.settings.drive,
        controller=controller,
    )  # fmt: skip


def assert_row_is(row: Row, run: Run) -> None:
    for name, value in metric_values(run_metrics(run)).items():
        assert row[name] == value, name
    assert row["status"] == run.status.label
    assert row["end_s"] == run.end_ns / NANOSECONDS


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("controller", ["lqr", HEAVY])
def test_rows_are_those_of_single_runs(both: Campaign, plant: str, controller: str) -> None:
    rows = run_batch(both, Batch(plant, controller, 1, 4))
    assert [row["sample"] for row in rows] == [1, 2, 3]
    for row in rows:
        assert_row_is(row, alone(both, int(row["sample"] or 0), plant, controller))
    assert rows[0]["rms_error_m"] != rows[1]["rms_error_m"]
    assert {row["control.period"] for row in rows} == {0.001, 0.002}
    assert list(rows[0]) == [column.name for column in row_columns(both)]


@pytest.mark.parametrize("plant", PLANTS)
def test_a_sampled_control_period_is_that_of_the_scenario(plant: str) -> None:
    """The controller and the plant's number of steps belong to the control period of the sample."""
    period, mass = {"control.period": choice(0.001, 0.005)}, {"rig.load_mass": fixed(1.0)}
    fine = short(period, sampling="grid", runs=None, plants=[plant])
    coarse = short(mass, "control.period=0.005", "control.physics_step=0.001", runs=1, plants=[plant])
    row = run_batch(fine, Batch(plant, "lqr", 0, 2))[1]
    (expected,) = run_batch(coarse, Batch(plant, "lqr", 0, 1))
    assert row["control.period"] == 0.005
    assert row["status"] == "completed"
    names = [name for name in METRIC_COLUMNS if row[name] == row[name]]
    assert [row[name] for name in names] == [expected[name] for name in names]


EFFECTS = {
    "rig.load_mass": MASS,
    "effects.limits.force.2": uniform(10.5, 14.0),
    "effects.friction.coulomb.0": MASS,
    "effects.friction.viscous.1": MASS,
    "effects.rope.stiffness": uniform(2e4, 8e4, distribution="log-uniform"),
    "effects.rope.damping_ratio": uniform(0.0, 0.3),
    "effects.rope.mass": choice(0.0, 0.003, 0.02),
    "effects.body.hook_offset": uniform(0.0, 0.1),
    "effects.body.inertia": uniform(1e-3, 3e-3),
    "effects.body.swing_damping": uniform(0.0, 3e-3),
    "effects.frame.frequency.0": uniform(6.0, 12.0),
    "effects.frame.damping_ratio": uniform(0.0, 0.05),
    "effects.frame.mass": uniform(10.0, 30.0),
}


def test_rows_are_those_of_single_runs_with_every_effect_of_the_engine() -> None:
    all_effects = short(EFFECTS, "control.physics_step=0.0005", runs=4)
    for row in run_batch(all_effects, Batch("mujoco", "lqr", 0, 4)):
        assert row["reason"] == ""
        assert_row_is(row, alone(all_effects, int(row["sample"] or 0), "mujoco", "lqr"))


def test_the_controller_knows_the_nominal_crane_only(both: Campaign) -> None:
    """A controller that knew the sample would give another run; the plant has the sample's parameters."""
    (values,) = sample_values(both, 0, 1)
    scenario = sampled_scenario(both, values)
    options: dict[str, Any] = {"plant": "analytic", "drive": "velocity", "controller": "lqr"}
    known = simulate_run(scenario, nominal=both.nominal, **options)
    informed = simulate_run(scenario, **options)
    nominal = simulate_run(both.nominal, **options)
    for other in (informed, nominal):
        assert (known.table != other.table).any()
    assert (known.reference == nominal.reference).all()
    offset = known.block("state")[0] - nominal.block("state")[0]
    assert offset[0] == pytest.approx(scenario.initial.load_offset[0])
    assert offset[6] == pytest.approx(scenario.initial.alpha_offset)


def test_rows_depend_neither_on_workers_nor_on_order(both: Campaign) -> None:
    batches = [Batch(p, c, k, k + 2) for k in (0, 2) for p in PLANTS for c in ("lqr", HEAVY)]
    one, two = dict(run_batches(both, batches)), dict(run_batches(both, batches[::-1], workers=2))
    assert one == two
    assert len(one) == len(batches)


def test_a_sample_that_is_no_scenario_or_too_stiff_is_a_failed_row_and_the_next_one_runs() -> None:
    ends = {"disturbances.0.start": uniform(0.01, 0.19), "disturbances.0.end": uniform(0.06, 0.2)}
    rows = run_batch(short(ends, runs=40), Batch("analytic", "lqr", 0, 40))
    failed = [row for row in rows if row["status"] == "failed"]
    assert 0 < len(failed) < 40
    assert "InputError: " in str(failed[0]["reason"])
    assert "must end after its start" in str(failed[0]["reason"])
    assert failed[0]["end_s"] == 0.0
    assert all(failed[0][name] is None for name in METRIC_COLUMNS)
    assert failed[0]["disturbances.0.start"] is not None
    stiff = short({"effects.rope.stiffness": choice(5e4, 1e9)}, runs=8)
    rows = run_batch(stiff, Batch("mujoco", "lqr", 0, 8))
    values = [row["effects.rope.stiffness"] for row in rows]
    assert {5e4, 1e9} == set(values)
    for value, row in zip(values, rows, strict=True):
        assert row["status"] == ("failed" if value == 1e9 else "completed"), row["reason"]
    assert "too fast for steps" in str(rows[values.index(1e9)]["reason"])
    after = next(k for k in range(8) if 1e9 in values[:k] and values[k] == 5e4)
    assert_row_is(rows[after], alone(stiff, after, "mujoco", "lqr"))


def test_a_run_that_stops_says_why_and_keeps_its_metrics() -> None:
    slack = short({"disturbances.1.magnitude": fixed(400.0)}, runs=1)
    (row,) = run_batch(slack, Batch("mujoco", "lqr", 0, 1))
    assert row["status"] == "slack-rope"
    assert row["reason"] == "the rope went slack, in the plant or as the tracker sees it"
    assert 0.1 < float(row["end_s"] or 0.0) < 0.25
    assert float(row["max_error_m"] or 0.0) > 0.0


def test_errors_in_the_program_are_told_of_a_sample_and_raised_of_a_worker(
    both: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: Any) -> None:
        raise ZeroDivisionError("of a worker")

    batch = Batch("analytic", "lqr", 0, 1)
    monkeypatch.setattr("cranectl.campaign.worker.Accumulator", broken)
    (row,) = run_batch(both, batch)
    assert (row["status"], row["reason"]) == ("failed", "ZeroDivisionError: of a worker")
    monkeypatch.setattr("cranectl.campaign.workers.Worker", broken)
    with pytest.raises(ZeroDivisionError):
        list(run_batches(both, [batch], workers=2))


def test_a_worker_stops_within_a_block(both: Campaign) -> None:
    calls = []

    def stop() -> bool:
        calls.append(True)
        return len(calls) > 1

    with pytest.raises(StoppedError):
        Worker(PreparedCampaign(both)).run_batch(Batch("analytic", "lqr", 0, 6), stop)
    assert len(calls) == 2


def test_leaving_ends_the_threads_and_keeps_whole_batches(both: Campaign) -> None:
    batches = [Batch("analytic", "lqr", k, k + 1) for k in range(6)]
    for batch, rows in run_batches(both, batches, workers=2):
        assert batch in batches
        assert len(rows) == 1
        break
    assert not any(thread.name.startswith("worker") for thread in threading.enumerate())


def test_every_metric_has_its_columns(both: Campaign) -> None:
    metrics = run_metrics(alone(both, 0, "analytic", "lqr"))
    assert isinstance(metrics, RunMetrics)
    values = metric_values(metrics)
    assert list(values) == list(METRIC_COLUMNS)
    assert values["final_load_m_z"] == metrics.final_load_m[2]
    assert values["drive_path_m_rope"] == metrics.drive_path_m[2]
    assert values["max_abs_angle_rad_beta"] == metrics.max_abs_angle_rad[1]
    assert values["outside_first_s_bridge"] is None
    assert values["outside_time_s_bridge"] == 0.0


PLAN = "cranectl.simulate.plan.PlannedReference.plan"


def _failing(kind: type[Exception], times: int, *arguments_of_error: Any) -> Any:
    """Return a method like `PlannedReference.plan` that first fails `times` times, as if a machine did."""
    left, plan = [times], PlannedReference.plan

    def planned(*arguments: Any) -> Any:
        left[0] -= 1
        if left[0] >= 0:
            raise kind(*arguments_of_error)
        return plan(*arguments)

    return planned


FAILURES: list[tuple[Any, ...]] = [
    (MemoryError,),
    (OSError, errno.ENOSPC, "No space left on device"),
    (OSError, errno.EMFILE, "Too many open files"),
]


@pytest.mark.parametrize("failure", FAILURES)
def test_what_the_machine_keeps_from_running_is_run_again_and_is_no_row(
    failure: tuple[Any, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    small = short({"rig.load_mass": MASS}, runs=2, plants=["analytic"], controllers=["lqr"])
    batch, prepared = Batch("analytic", "lqr", 0, 2), PreparedCampaign(small)
    expected = Worker(prepared).run_batch(batch)
    kind, *arguments = failure
    monkeypatch.setattr(PLAN, _failing(kind, 2, *arguments))
    assert Worker(prepared).run_batch(batch) == expected
    monkeypatch.undo()
    monkeypatch.setattr(PLAN, _failing(kind, 9, *arguments))
    with pytest.raises(MachineError, match=f"the machine failed: {kind.__name__}.*in sample 0 with lqr"):
        Worker(prepared).run_batch(batch)
    monkeypatch.undo()
    monkeypatch.setattr(PLAN, _failing(OSError, 9, errno.ENOENT, "no file"))
    row, _ = Worker(prepared).run_batch(batch)
    assert (row["status"], "no file" in str(row["reason"])) == ("failed", True), "it fails by itself"


LAW = """
import os, shutil
import numpy as np
from cranectl import Controller

def prepare(nominal):
    program = os.posix_spawn(shutil.which("sleep"), ["sleep", "600"], {})
    with open("pid", "w") as file:
        file.write(str(program))
    return np.zeros(1), np.zeros(1)

def step(parameters, measured, reference, memory, command):
    return 0

STARTS = Controller("starts", "starts a program", step, prepare)
"""


def test_what_a_worker_has_started_ends_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise a program that reads nothing more would run for ever."""
    monkeypatch.chdir(tmp_path)
    Path("law.py").write_text(LAW)
    starting = short(
        {"rig.load_mass": MASS}, controllers=[open_controller("law.py:STARTS")], plants=["analytic"]
    )
    with Children() as children:
        prepared = PreparedCampaign(starting)
        of_parent = int(Path("pid").read_text())
        os.kill(of_parent, signal.SIGKILL)  # of this process, which has prepared it too
        os.waitpid(of_parent, 0)
        worker = ChildWorker(prepared, children, HANG)
        worker.run_batch(Batch("analytic", "starts", 0, 1))
        worker.close()
        started = int(Path("pid").read_text())
        assert started != of_parent
    deadline = time.monotonic() + HANG
    while is_running(started) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not is_running(started)


def is_running(number: int) -> bool:
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    return True
