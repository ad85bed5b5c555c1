"""Every number in a file, and every count of the Python interface, has an upper bound that is told."""

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import cranectl
from cranectl.cli.list import DOCUMENTS
from cranectl.cli.schemas import json_schema
from cranectl.scenario import Scenario
from cranectl.simulate.memory import check_several_plans
from cranectl.simulate.open_runs import MAX_CRANES
from cranectl.support.documents import MAX_DOCUMENT_BYTES
from cranectl.support.errors import InputError

UPPER = ("maximum", "exclusiveMaximum", "enum", "const")
# Numbers that no work or memory grows with, by the class that has them; the reason why none has a bound.
UNBOUNDED = {
    "Limits": "a limit of a metric is compared, nothing else",
    "LimitSettings": "the same, in a scenario",
    "Spline": "knots, of which a rule says that they end at the longest duration",
    "FitNumbers": "a log tells them, nothing reads them",
    "Driven": "recorded commands, whose number has a bound",
    "ControllerSettings": "each controller declares the range of its parameters",
    "BlendedPath": "lengths that a plan has computed, checked against its path",
    **dict.fromkeys(
        ("Choice", "Fixed", "LogUniform", "Normal", "Uniform"),
        "values of a key, whose own bound is checked for every draw",
    ),
}


def numbers(node: Any, owner: str) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield class, kind and schema of every number below `node`."""
    if isinstance(node, list):
        for item in node:
            yield from numbers(item, owner)
    if not isinstance(node, dict):
        return
    if node.get("type") in ("integer", "number"):
        yield owner, node["type"], node
    for key, child in node.items():
        names = child if key == "$defs" else {owner: child}
        for name, definition in names.items():
            yield from numbers(definition, name)


@pytest.mark.parametrize("document", sorted(DOCUMENTS))
def test_every_number_of_a_file_has_an_upper_bound(document: str) -> None:
    found = list(numbers(json_schema(document), document))
    unbounded = [(owner, kind, schema) for owner, kind, schema in found if not set(UPPER) & set(schema)]
    assert len(found) > 5
    told = [owner for owner, kind, _ in unbounded if kind == "integer"]
    assert set(told) <= {"FitNumbers"}
    assert {owner for owner, _, _ in unbounded} <= UNBOUNDED.keys()


def test_the_walk_finds_a_number_without_a_bound() -> None:
    schema = {"$defs": {"A": {"properties": {"n": {"type": "integer", "minimum": 1}}}}, "type": "object"}
    assert [(owner, kind) for owner, kind, _ in numbers(schema, "file")] == [("A", "integer")]


def test_a_list_in_a_file_is_bounded_by_the_size_of_the_file() -> None:
    assert MAX_DOCUMENT_BYTES <= 2**20


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return cranectl.load_scenario("fixed-position", overrides=["duration=0.1", "disturbances=[]"])


def test_cranes_of_a_sequence_without_an_end_are_refused(scenario: Scenario) -> None:
    with pytest.raises(InputError, match=f"allowed: 1 to {MAX_CRANES} cranes"):
        cranectl.open_runs(itertools.repeat(scenario))


def test_references_of_many_long_scenarios_are_refused_before_they_are_computed(scenario: Scenario) -> None:
    control = scenario.control.model_copy(update={"period": 1e-3})
    long = scenario.model_copy(update={"duration": 600.0, "control": control})
    many = [long.model_copy(update={"title": str(k)}) for k in range(80)]
    with pytest.raises(InputError, match=r"the references of 80 different scenarios(.|\n)*at most 32 GiB"):
        check_several_plans(many)
    check_several_plans(many[:2])


@pytest.mark.parametrize("samples", [10**9, 10**400, 0, 1.5, None])
def test_samples_of_a_step_have_a_bound(scenario: Scenario, samples: Any) -> None:
    one, many = cranectl.open_run(scenario), cranectl.open_runs([scenario])
    with pytest.raises(InputError, match="a whole number from 1 to 10000000"):
        one.step([0.0, 0.0, 0.0], samples=samples)
    with pytest.raises(InputError, match="a whole number from 1 to 10000000"):
        many.step(np.zeros((1, 3)), samples=samples)
