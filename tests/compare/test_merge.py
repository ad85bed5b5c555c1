"""What may go into one log, and what may not."""

from dataclasses import replace

import pytest

from cranectl.compare.merge import merged_pair, refuse_differences
from cranectl.plants.registry import PLANTS
from cranectl.scenario import Scenario, load_scenario
from cranectl.simulate import Run, simulate_run
from cranectl.support.errors import InputError


@pytest.fixture
def pair(short: Scenario) -> tuple[Run, Run]:
    analytic, mujoco = (simulate_run(short, plant=plant, controller="lqr").every(4) for plant in PLANTS)
    return analytic, mujoco


def test_analytic_comes_first_and_nothing_is_left_out(pair: tuple[Run, Run]) -> None:
    for a, b in (pair, pair[::-1]):
        merged = merged_pair(a, b)
        assert all(run is before for run, before in zip(merged, pair, strict=True))


def test_ends_may_differ(pair: tuple[Run, Run]) -> None:
    a, b = pair
    shorter = replace(b, time_ns=b.time_ns[:9].copy(), table=b.table[:9], reference=b.reference[:9])
    shorter.time_ns[-1] -= 1_000_000  # the last sample of a run that stops lies anywhere
    assert len(merged_pair(a, shorter)[1].time_ns) == 9


def test_what_one_log_cannot_hold(short: Scenario, pair: tuple[Run, Run]) -> None:
    a, b = pair

    def refused(other: Run, expected: str) -> None:
        with pytest.raises(InputError, match=expected):
            merged_pair(a, other)

    refused(a, "both logs hold the run of analytic")
    refused(replace(b, drive="velocity"), "different drives, ideal and velocity")
    other = simulate_run(short, plant="mujoco", controller="lqr+hinf").every(4)
    refused(other, r"different controllers, lqr and lqr\+hinf")
    refused(replace(other, design=replace(other.design, name="lqr")), "different numbers of recorded signals")
    refused(simulate_run(short, plant="mujoco", controller="lqr"), "different times of their samples")
    unstarted = replace(b, time_ns=b.time_ns[:0], table=b.table[:0], reference=b.reference[:0])
    refused(unstarted, "no samples in common")
    overrides = ["duration=0.5", "disturbances=[]", "reference.start=[1.0,0.7,-0.7]"]
    moved = load_scenario("fixed-position", overrides=overrides)
    refused(simulate_run(moved, plant="mujoco", controller="lqr").every(4), "different references")


def test_differences_are_named_up_to_ten() -> None:
    refuse_differences("nothing", (), described="analytic")
    with pytest.raises(InputError) as caught:
        refuse_differences(
            "the runs differ in", [f"field{k}: 1 and 2" for k in range(12)], described="analytic"
        )
    assert "field0: 1 and 2; " in caught.value.found
    assert caught.value.found.endswith("field9: 1 and 2; and 2 more")
    assert "--despite-differences" in caught.value.remedy
