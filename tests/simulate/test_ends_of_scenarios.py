"""Both ends of every number of a scenario go through a run: finite results, or what to do.

The cases come from the schema. Numbers that other commands read first have tests beside those, `ELSEWHERE`.
"""

import math
import sys
from typing import Any

import numpy as np
import pytest

from cranectl.metrics import Limits, LimitVerdict, run_metrics
from cranectl.planning import load_scenario, plan_motions
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from cranectl.support.errors import InputError
from cranectl.support.trees import Tree
from tests.conftest import ROOT
from tests.ranges import Key, ends, has_found_allowed_and_remedy, put, result_or_refusal, share_of
from tests.simulate.test_idle_settings import label

SHARE = 30
BASE: dict[str, Any] = load_scenario(
    "fixed-position",
    overrides=[
        "duration=0.02", "reference.segments=[]", "initial.load_offset=[0.01, 0.0, 0.0]",
        "disturbances=[{joint='alpha', magnitude=1.0, start=0.005, end=0.01}, "
        "{force=[1.0, 1.0, 1.0], start=0.01}]",
        "obstacles=[{name='box', low=[1.0, 0.8, -1.4], high=[1.2, 1.0, -0.9]}]",
        "limits.rms_error_m=0.05", "limits.min_rope_tension_n=0.1", "control.physics_step=0.001",
    ],
).model_dump(mode="json", exclude_none=True)  # fmt: skip
# By the start of a key: the tests that try both ends of its range, or why no test does.
ELSEWHERE = {
    "planning": "tests/reference/test_ends_of_ranges.py",
    "reference.segments": "tests/reference/test_ends_of_ranges.py",
    "rig.effects": "tests/simulate/test_ends_of_effects.py, as the numbers of effects",
    "rig.look": "drawn only",
    "rig": "tests/reference/test_ends_of_ranges.py",
    "effects": "tests/simulate/test_ends_of_effects.py",
    "design": "tests/design/test_ends_of_ranges.py",
    "controller": "tests/controllers/test_ends_of_ranges.py",
}
# Other settings that go with a number, so that there are few steps and they divide it.
WITH: dict[tuple[str, float], dict[str, float]] = {
    ("duration", 600.0): {"control.period": 0.02, "control.physics_step": 0.02},
    ("duration", 1e-6): {"control.period": 1e-6, "control.physics_step": 1e-6},
    ("control.period", 600.0): {"duration": 600.0, "control.physics_step": 0.02},
    ("control.period", 1e-6): {"control.physics_step": 1e-6},
    ("control.physics_step", 1e-6): {"control.period": 1e-6},
}


def name_of(key: Key) -> str:
    return ".".join(map(str, key))


def where_else(name: str) -> str | None:
    fitting = [key_start for key_start in ELSEWHERE if f"{name}.".startswith(f"{key_start}.")]
    return ELSEWHERE[max(fitting, key=len)] if fitting else None


def cases() -> list[tuple[str, dict[str, Any]]]:
    cases_by_name = {}
    limits = [(("limits", "rms_error_m"), value) for value in (0.0, sys.float_info.max)]  # no bound above
    for key, value in (*ends(Scenario), *limits):
        name = name_of(key)
        if where_else(name) is not None:
            continue
        for whole in (key, *((*key[:k], 1, *key[k + 1 :]) for k, part in enumerate(key) if part == 0)):
            try:
                table = put(BASE, whole, value)
            except (LookupError, TypeError):
                continue  # a disturbance has either of two kinds of numbers
            for other, number in WITH.get((name, value), {}).items():
                table = put(table, tuple(other.split(".")), number)
            if name in ("duration", "control.period", "control.physics_step"):
                table["disturbances"] = []
            cases_by_name[f"{name_of(whole)}={value!r}"] = table
    return list(cases_by_name.items())


CASES = cases()


def run_of(table: dict[str, Any]) -> Run:
    scenario = plan_motions(Scenario.from_table(table, "s.toml"))
    return simulate_run(scenario, plant="analytic", controller="lqr")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", share_of(CASES, SHARE, ("duration", "control")), ids=lambda case: case[0])
def test_a_run_is_finite_and_whole_or_is_refused_with_what_to_do(case: tuple[str, dict[str, Any]]) -> None:
    run = result_or_refusal(lambda: run_of(case[1]))
    if isinstance(run, InputError):
        assert has_found_allowed_and_remedy(str(run))
        return
    assert np.isfinite(run.table).all()
    if not run.status.stopped:
        assert len(run.time_ns) == run.scenario.steps + 1
        assert run.time_ns[-1] == run.scenario.steps * run.scenario.period_ns
    metrics = run_metrics(run)
    assert metrics is not None
    numbers = [value for _, value in Tree(metrics.to_json()).leaves() if isinstance(value, float)]
    assert not any(map(math.isnan, numbers))
    for verdict in LimitVerdict.judge(metrics, Limits.by_plant(run.scenario, ["analytic"])["analytic"]):
        assert isinstance(verdict.kept, bool)


def test_every_number_of_a_scenario_is_tried_or_has_a_reason() -> None:
    tried = {label(name.rpartition("=")[0]) for name, _ in CASES}
    numbers = {name_of(key) for key, _ in ends(Scenario)}
    assert {name for name in numbers if label(name) not in tried and where_else(name) is None} == set()
    assert {
        key_start for key_start in ELSEWHERE if not any(f"{n}.".startswith(f"{key_start}.") for n in numbers)
    } == {
        "controller"  # whose parameters the schema does not know
    }
    files = [ROOT / reason.partition(",")[0] for reason in ELSEWHERE.values() if reason.startswith("tests/")]
    assert all(file.is_file() for file in files)
    assert {"duration", "control.period", "metrics.settling_tolerance", "log.every"} <= tried
    assert {"disturbances.start", "disturbances.force", "obstacles.low", "limits.rms_error_m"} <= tried
