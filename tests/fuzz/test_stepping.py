"""Any sequence of calls of stepped runs, with odd numbers, does what it should or is refused.

After it, the run begins again and moves as a new one does, to the bit.
"""

import contextlib
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

import cranectl
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.signals import SignalGroup
from cranectl.simulate import Run
from cranectl.simulate.open_run import OpenRun
from cranectl.simulate.open_runs import OpenRuns
from cranectl.support.errors import InputError
from tests.fuzz.oracle import call_within, fuzzed

CRANES = 3
NUMBERS = st.one_of(
    st.sampled_from(
        [0.0, 0.1, -0.1, 1.0, -0.0, 1e-300, 1e6, 1e300, -1e300, math.nan, math.inf, 10**400, -(2**70)]
    ),
    st.floats(-2.0, 2.0),
    st.floats(),
)
SINGLE = st.one_of(
    NUMBERS, st.sampled_from([None, "x", "", b"1", True, 1j, [], {}, object(), [[1.0]], "1.0"])
)
WHOLE = st.one_of(
    st.sampled_from([0, 1, -1, 2, 3, 10, 10**8, 2**63, 2**64, -(2**63), 10**400]), st.integers(0, 50), SINGLE
)


def vectors(size: int) -> st.SearchStrategy[Any]:
    """Draw usual, odd or wrongly shaped vectors of about `size` numbers."""
    small = st.lists(st.floats(-0.2, 0.2), min_size=size, max_size=size)
    odd = st.lists(NUMBERS, min_size=size, max_size=size)
    other = st.lists(SINGLE, max_size=size + 2)
    return st.one_of(small, small, odd, odd.map(np.array), other, SINGLE)


def rows(size: int) -> st.SearchStrategy[Any]:
    several = st.lists(vectors(size), min_size=CRANES, max_size=CRANES)
    return st.one_of(several, several, st.lists(vectors(size), max_size=5), SINGLE)


STATES = st.one_of(
    st.none(),
    vectors(10),
    st.just([1.0, 0, 0.7, 0, 0.7, 0, 0.1, 0, 0, 0]),
    st.just([1.0, 0, 0.7, 0, 0.0, 0, 2, 0, 0, 0]),
)
TARGETS = st.one_of(st.none(), vectors(3), st.just([1.0, 0.7, -0.8]))
CALLS = {
    "step": st.fixed_dictionaries({"command": vectors(3)}, optional={"samples": WHOLE}),
    "reset": st.fixed_dictionaries({}, optional={"state": STATES, "seed": WHOLE, "target": TARGETS}),
}
CALLS_OF_MANY = {
    "step": st.fixed_dictionaries({"commands": rows(3)}, optional={"samples": WHOLE}),
    "reset": st.fixed_dictionaries(
        {},
        optional={
            "states": st.one_of(
                st.none(), rows(10), st.just([[1.0, 0, 0.7, 0, 0.7, 0, 0.1, 0, 0, 0]] * CRANES)
            ),
            "seeds": st.one_of(st.none(), st.lists(WHOLE, max_size=4), SINGLE),
            "targets": st.one_of(st.none(), rows(3)),
            "cranes": st.one_of(
                st.none(), st.lists(WHOLE, max_size=4), st.lists(st.booleans(), max_size=4), SINGLE
            ),
        },
    ),
}
READ = ["state", "measured", "load", "tension", "status", "time", "reference"]
READ_OF_MANY = ["states", "measured", "loads", "tensions", "statuses", "time", "references"]
EFFECTS = ["", "effects.delay.seconds=0.003", "effects.sensing.angle_noise=0.001", "effects.wind.gust=1.0"]


def sequences(calls: dict[str, Any], read: list[str]) -> st.SearchStrategy[list[tuple[str, Any]]]:
    """Draw calls with their arguments, and properties that are read or changed in between."""
    one = st.sampled_from(sorted(calls)).flatmap(lambda name: st.tuples(st.just(name), calls[name]))
    access = st.tuples(st.sampled_from(read), st.sampled_from(["read", "write"]))
    return st.lists(st.one_of(one, one, access, st.just(("recorded", {}))), min_size=1, max_size=8)


def scenario(effect: str) -> Scenario:
    changed = ["duration=0.05", "disturbances=[]", "reference.segments=[]", *([effect] if effect else [])]
    return load_scenario("fixed-position", overrides=changed)


def perform(run: OpenRun | OpenRuns, calls: list[tuple[str, Any]]) -> None:
    """Make all calls; raise AssertionError if one does anything but to succeed or to refuse its input."""
    for name, arguments in calls:
        if arguments in ("read", "write"):
            value = getattr(run, name)
            if arguments == "write" and isinstance(value, np.ndarray) and value.ndim:
                value[...] = np.nan  # a copy, or a view that cannot be written, must leave the run alone
            continue
        if not hasattr(run, name):
            continue
        with contextlib.suppress(InputError):
            check_result(getattr(run, name)(**arguments))


def check_result(result: Any) -> None:
    """Raise AssertionError unless it is a run with finite times, or states."""
    if isinstance(result, Run):
        assert np.isfinite(result.time).all()
    else:
        assert result.shape[-1] == len(SignalGroup.STATE)


def motion(run: OpenRun | OpenRuns) -> bytes:
    """Return the bytes of a short motion from the beginning."""
    run.reset()
    command = np.array([0.1, -0.2, 0.05])
    return run.step(
        np.tile(command, (CRANES, 1)) if isinstance(run, OpenRuns) else command, samples=20
    ).tobytes()


@pytest.mark.parametrize(
    ("plant", "drive"), [("analytic", "ideal"), ("mujoco", "velocity"), ("elastic", "force")]
)
@fuzzed(20, effect=st.sampled_from(EFFECTS), calls=sequences(CALLS, READ))
def test_a_stepped_run_survives_any_calls(
    plant: str, drive: str, effect: str, calls: list[tuple[str, Any]]
) -> None:
    run = cranectl.open_run(scenario(effect), plant=plant, drive=drive)
    first = motion(run)
    call_within(lambda: perform(run, calls), 10.0)
    assert motion(run) == first


@pytest.mark.parametrize(
    ("plant", "drive"), [("analytic", "velocity"), ("mujoco", "ideal"), ("elastic", "ideal")]
)
@fuzzed(20, effect=st.sampled_from(EFFECTS), calls=sequences(CALLS_OF_MANY, READ_OF_MANY))
def test_runs_that_are_stepped_together_survive_any_calls(
    plant: str, drive: str, effect: str, calls: list[tuple[str, Any]]
) -> None:
    runs = cranectl.open_runs([scenario(effect)] * CRANES, plant=plant, drive=drive)
    first = motion(runs)
    call_within(lambda: perform(runs, calls), 10.0)
    assert motion(runs) == first
