"""A run that contradicts itself is neither written nor read, whatever part of it was changed."""

import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from cranectl.design import CONTROLLERS, design_controller
from cranectl.log.consistency import Sampling, check_run, check_runs
from cranectl.log.reader import read_log, read_signal
from cranectl.log.writer import write_log, write_logged
from cranectl.mcap_columns.records import DamageError
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import LogError
from tests.conftest import closed_loop

EVERY = 4
MANY_EXAMPLES = settings(max_examples=200, deadline=None)


@functools.cache
def completed() -> Run:
    """Return a run with 26 regular samples, and a last one between two regular times."""
    scenario = load_scenario(
        "fixed-position", overrides=["duration=0.102", "disturbances=[{joint='beta', start=0, magnitude=1}]"]
    )
    return simulate_run(scenario, plant="analytic", controller="lqr+hinf").every(EVERY)


@functools.cache
def stopped() -> Run:
    """Return a run that stops one period after its last sample, because its rope length is not positive."""
    overrides = ["duration=2", "disturbances=[{joint='alpha', start=0.5, magnitude=20.0}]"]
    return simulate_run(load_scenario("fixed-position", overrides=overrides), plant="analytic").every(EVERY)


def refused(run: Run) -> str:
    with pytest.raises(DamageError) as caught:
        check_runs([run], EVERY)
    return str(caught.value)


def remove_row(run: Run, row: int) -> Run:
    rows = np.delete(np.arange(len(run.time_ns)), row)
    return replace(run, time_ns=run.time_ns[rows], table=run.table[rows], reference=run.reference[rows])


def changed(values: np.ndarray, index: tuple[int, ...], value: float) -> np.ndarray:
    copy = values.copy()
    copy[index] = value
    return copy


@pytest.mark.parametrize("every", [1, 7, 10**9])
@pytest.mark.parametrize(
    ("scenario", "controller"),
    [
        *(("fixed-position", controller) for controller in CONTROLLERS),
        *((name, "lqr") for name in ("slack-rope", "near-slack", "settled-trajectory")),
    ],
)
def test_runs_are_consistent(scenario: str, controller: str, every: int) -> None:
    check_runs([closed_loop(scenario, controller, "mujoco").every(every)], every)


RUNS = st.sampled_from([completed, stopped])


@MANY_EXAMPLES
@given(make_run=RUNS, data=st.data())
def test_a_changed_time_is_refused(make_run: Callable[[], Run], data: st.DataObject) -> None:
    run = make_run()
    row = data.draw(st.integers(0, len(run.time_ns) - 1))
    low = int(run.time_ns[row - 1]) + 1 if row else -(10**9)
    high = int(run.time_ns[row + 1]) - 1 if row < len(run.time_ns) - 1 else 3 * 10**9
    time_ns = data.draw(st.integers(low, high))
    # The last sample of a stopped run may be at its end.
    assume(time_ns not in (run.time_ns[row], *([run.end_ns] if row == len(run.time_ns) - 1 else [])))
    refused(replace(run, time_ns=changed(run.time_ns, (row,), time_ns)))


@MANY_EXAMPLES
@given(make_run=RUNS, data=st.data())
def test_a_missing_sample_is_refused(make_run: Callable[[], Run], data: st.DataObject) -> None:
    run = make_run()
    refused(remove_row(run, data.draw(st.integers(0, len(run.time_ns) - 1))))


@MANY_EXAMPLES
@given(data=st.data(), value=st.floats())
def test_a_changed_reference_value_is_refused(data: st.DataObject, value: float) -> None:
    run = completed()
    index = tuple(data.draw(st.integers(0, size - 1)) for size in run.reference.shape)
    assume(not abs(value - run.reference[index]) <= 1e-9)
    refused(replace(run, reference=changed(run.reference, index, value)))


@MANY_EXAMPLES
@given(make_run=RUNS, end_ns=st.integers(-(10**9), 10**10) | st.integers(0, 2500).map(lambda ms: ms * 10**6))
def test_a_changed_end_is_refused(make_run: Callable[[], Run], end_ns: int) -> None:
    run = make_run()
    last_ns = int(run.time_ns[-1])
    assume(end_ns not in ((run.end_ns,) if run.status == RunStatus.COMPLETED else (last_ns, run.end_ns)))
    refused(replace(run, end_ns=end_ns))


@pytest.mark.parametrize("status", [RunStatus.RUNNING, RunStatus.COMPLETED, RunStatus.INTERRUPTED])
def test_a_stopped_run_with_another_status_is_refused(status: RunStatus) -> None:
    refused(replace(stopped(), status=status))


def test_a_run_without_samples_must_end_at_its_start() -> None:
    empty = remove_row(replace(stopped(), end_ns=0), slice(None))  # type: ignore[arg-type]
    check_runs([empty], EVERY)
    assert "without a sample" in refused(replace(empty, end_ns=1_000_000))
    assert "but its scenario ends at" in refused(replace(empty, status=RunStatus.COMPLETED))


def test_only_the_last_sample_of_a_stopped_run_may_be_invalid() -> None:
    run = stopped()
    check_runs([replace(run, table=changed(run.table, (-1, 3), np.nan))], EVERY)
    assert "is nan" in refused(replace(run, table=changed(run.table, (-2, 3), np.nan)))
    assert "reference/load" in refused(replace(run, reference=changed(run.reference, (-1, 3), np.nan)))


def test_segments_of_a_session_must_begin_at_their_declared_time() -> None:
    full_run = completed()
    late = {"time_ns": full_run.time_ns + 7_000_000, "end_ns": full_run.end_ns + 7_000_000}
    segment = replace(full_run, status=RunStatus.INTERRUPTED, **late)
    sampling = Sampling(segment.scenario, EVERY, 7_000_000)
    check_run(segment, sampling)
    check_run(segment, replace(sampling, from_ns=4_000_000))
    check_run(replace(segment, status=RunStatus.COMPLETED), sampling)
    for from_ns in (3_000_000, 8_000_000, 6_999_999):
        with pytest.raises(DamageError, match=r"begins at|no control sample"):
            check_run(segment, replace(sampling, from_ns=from_ns))
    with pytest.raises(DamageError, match="every 4 control samples"):
        check_run(remove_row(segment, 3), sampling)


def test_runs_of_one_log_must_have_the_same_design() -> None:
    other = replace(completed(), plant="mujoco")
    check_runs([completed(), other], EVERY)
    check_runs([stopped(), replace(stopped(), plant="mujoco")], EVERY)
    with pytest.raises(DamageError, match="cannot be in one log"):
        check_runs([completed(), replace(other, design=design_controller("lqr"))], EVERY)
    with pytest.raises(DamageError, match="cannot be in one log"):
        check_runs([completed(), completed()], EVERY)


# The writer.


def test_a_contradictory_run_is_not_written(tmp_path: Path) -> None:
    run = completed()
    logged = write_log(tmp_path / "good.mcap", [run], every=EVERY)
    before = logged.read_bytes()
    for wrong, every in (
        (replace(run, table=changed(run.table, (3, 3), np.nan)), EVERY),
        (remove_row(run, 3), EVERY),
        (run, 1),
        (run, 6),
    ):
        with pytest.raises(LogError, match="it would contradict itself") as caught:
            write_log(logged, [wrong], every=every)
        assert str(logged) in caught.value.found
    with pytest.raises(LogError, match="every 8 control samples"):
        write_logged(logged, [run], 8)
    assert logged.read_bytes() == before
    assert list(tmp_path.iterdir()) == [logged]


def test_the_logging_rate_counts_control_samples(tmp_path: Path) -> None:
    """The option `every` counts control samples of a run, not the samples that a log holds of it."""
    logged = write_log(tmp_path / "a.mcap", [completed()], every=EVERY)
    run = read_log(logged)["analytic"]
    assert write_log(tmp_path / "b.mcap", [run], every=EVERY).read_bytes() == logged.read_bytes()
    thin = read_log(write_log(tmp_path / "c.mcap", [run], every=12))["analytic"]
    assert np.diff(thin.time_ns)[:-1].tolist() == [12_000_000] * 8
    assert thin.time_ns[-1] == run.time_ns[-1]


def test_a_stopped_run_with_an_invalid_last_sample_is_written_and_read(tmp_path: Path) -> None:
    run = stopped()
    wrong = replace(run, table=changed(run.table, (-1, 20), np.inf))
    path = write_log(tmp_path / "a.mcap", [wrong], every=EVERY)
    assert read_log(path)["analytic"].table.tobytes() == wrong.table.tobytes()
    names = [f"analytic/{group.name}.{name}" for group in run.groups for name in group.names]
    assert np.isinf(read_signal(path, names[20])[1][-1])
