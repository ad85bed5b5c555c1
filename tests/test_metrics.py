from dataclasses import replace

import numpy as np
import pytest

from cranectl.metrics import run_metrics, workspace_violations
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from tests.conftest import closed_loop


@pytest.fixture
def run(short: Scenario) -> Run:
    return simulate_run(short, plant="analytic")


def test_metrics_are_what_they_say(run: Run) -> None:
    metrics = run_metrics(run)
    assert metrics is not None
    distance = np.linalg.norm(run.reference[:, :3] - run.block("load")[:, :3], axis=1)
    assert metrics.max_error_m == distance.max() > 0
    assert metrics.rms_error_m == pytest.approx(np.sqrt(np.mean(distance**2)))
    assert metrics.final_error_m == distance[-1]
    assert metrics.final_load_m == tuple(run.block("load")[-1, :3])
    assert metrics.max_acceleration_m_s2[0] == run.signal("input.bridge_acceleration").max()
    assert metrics.min_acceleration_m_s2[2] == run.signal("input.rope_acceleration").min()
    assert metrics.max_abs_angle_rad[0] == np.abs(run.signal("state.alpha")).max()
    assert metrics.min_rope_tension_n == run.signal("load.rope_tension").min()
    assert metrics.duration_s == 0.5
    assert metrics.workspace_violations == ()


def test_violations_say_which_when_and_how_far() -> None:
    (violation,) = workspace_violations(closed_loop("settled-trajectory", "pole-placement", "mujoco"))
    assert violation.signal == "trolley_position"
    assert violation.first_time_s == pytest.approx(15.749)
    assert violation.max_excess_m == pytest.approx(0.168, abs=1e-3)


def test_violations_on_the_low_side_count_too(run: Run) -> None:
    table = run.table.copy()
    table[100, 4] = 0.01  # rope shorter than allowed
    (violation,) = workspace_violations(replace(run, table=table))
    assert (violation.signal, violation.first_time_s) == ("rope_length", 0.1)
    assert violation.max_excess_m == pytest.approx(0.04)


def test_a_run_without_samples_has_no_metrics(run: Run) -> None:
    empty = replace(run, table=run.table[:0], time_ns=run.time_ns[:0], reference=run.reference[:0])
    assert run_metrics(empty) is None
