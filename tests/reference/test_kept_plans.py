"""Plans are reused between processes, unchanged, and never for other settings."""

import importlib
import pickle
from pathlib import Path
from typing import Any

import pytest

from cranectl.log.events import events
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario, plan, review
from cranectl.planning.review import Review
from cranectl.scenario import Scenario, Segment
from cranectl.scenario.held_files import HeldFiles
from cranectl.simulate import simulate_run

# Faces of rooms have functions of these names.
kept = importlib.import_module("cranectl.support.kept")

MOVES = [
    '{kind="move",to=[0.8,0.6,-0.7],plane=true}',
    '{kind="line",to=[0.8,0.6,-0.7],time_law="minimum-time"}',
    '{kind="arc",centre=[0.5,0.8],angle=1.0,duration="shortest"}',
    '{kind="waypoints",points=[[0.5,0.5,-0.7],[0.7,0.6,-0.7],[0.8,0.8,-0.7]],time_law="minimum-time"}',
    '{kind="line",to=[0.8,0.5,-0.7],time_law="minimum-time",blend=0.05},'
    '{kind="line",to=[0.8,0.9,-0.7],time_law="minimum-time"}',
]


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "cache_directory", lambda: tmp_path)


def scenario(move: str, *overrides: str) -> Scenario:
    """Load a scenario as a new process does."""
    plan._SEGMENTS.clear()
    base = ["disturbances=[]", "reference.start=[0.5,0.5,-0.7]", f"reference.segments=[{move}]", *overrides]
    return load_scenario("fixed-position", overrides=base)


def planned(move: str, *overrides: str) -> tuple[Segment, ...]:
    return scenario(move, *overrides).reference.segments


def forbid_planning(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> Segment:
        raise AssertionError("planned again")

    monkeypatch.setattr(plan, "plan_move", fail)
    monkeypatch.setattr(plan, "plan_along", fail)
    monkeypatch.setattr(plan, "plan_with_blends", fail)


def assert_same(again: tuple[Segment, ...], first: tuple[Segment, ...]) -> None:
    assert again == first
    assert [s.model_dump_json() for s in again] == [s.model_dump_json() for s in first]


@pytest.mark.parametrize("move", MOVES[3:])
def test_a_stored_plan_equals_the_planned_one(move: str, monkeypatch: pytest.MonkeyPatch) -> None:
    first = planned(move)
    forbid_planning(monkeypatch)
    assert_same(planned(move), first)


def test_a_setting_that_affects_the_plan_is_planned_again(monkeypatch: pytest.MonkeyPatch) -> None:
    planned(MOVES[2])
    forbid_planning(monkeypatch)
    planned(MOVES[2])
    planned(MOVES[2], "log.every=2")
    for override in ("planning.share=0.5", "rig.load_mass=2.0", "planning.refinement=2"):
        with pytest.raises(AssertionError, match="planned again"):
            planned(MOVES[2], override)
    monkeypatch.setattr(plan, "version", lambda _: "another")
    with pytest.raises(AssertionError, match="planned again"):
        planned(MOVES[2])


def test_a_log_states_the_proof_of_a_stored_plan_without_proving_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = scenario(f"{MOVES[0]},{MOVES[2]},{MOVES[1]}", "duration=20.0")
    claims = [review.summary for review in Review.of(original)]
    assert len(claims) == 2, "the shortest duration of a given law is no motion in minimum time"
    assert all("proven on" in claim for claim in claims)

    def fail(*_: Any, **__: Any) -> None:
        raise AssertionError("proven again")

    for name in ("prove", "_review"):
        monkeypatch.setattr(review, name, fail)
    forbid_planning(monkeypatch)
    kept_plan = scenario(f"{MOVES[0]},{MOVES[2]},{MOVES[1]}", "duration=20.0")
    assert_same(kept_plan.reference.segments, original.reference.segments)
    run = simulate_run(pickle.loads(pickle.dumps(kept_plan)), plant="analytic", controller="lqr")
    messages = [event.message for event in events(run)]
    assert messages[1:4] == [f"reference: {text}" for text in (claims[0], "arc", claims[1])]
    log = write_log(tmp_path / "run.mcap", [run])
    assert [event.message for event in events(read_log(log)["analytic"])] == messages
    HeldFiles(tmp_path).write(kept_plan.held_files)
    again = Scenario.from_table(kept_plan.model_dump(), "again")
    assert again.with_files(HeldFiles(tmp_path).read()) == kept_plan != again
