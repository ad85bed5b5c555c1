"""A session with a controller from a file runs in a child process, and survives its failure."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.loaders.opening import close_controllers, open_controller
from cranectl.planning import load_scenario
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from cranectl.tools.live.child_session import ChildSession
from cranectl.tools.live.hand import HandRequest
from cranectl.tools.live.session import Session
from tests.loaders.controller_files import LAW, built
from tests.pace import HANG

SCENARIO = load_scenario("fast-diagonal")
PLANTS = ("analytic", "mujoco")


@pytest.fixture(autouse=True)
def _close_controllers() -> Iterator[None]:
    yield
    close_controllers()


def assert_equal_increments(session: Session, child: ChildSession, samples: int) -> None:
    for run, other in zip(session.advance(samples), child.advance(samples), strict=True):
        assert (run.plant, run.design.name) == (other.plant, other.design.name)
        for name in ("time_ns", "table", "reference"):
            assert np.array_equal(getattr(run, name), getattr(other, name))
    for name in ("now_ns", "origin_ns", "moving"):
        assert getattr(session, name) == getattr(child, name)


def test_a_session_in_a_child_process_equals_one_in_this_process(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "law.py").write_text(LAW)
    design = ALL_CONTROLLERS.design(open_controller(f"{tmp_path}/law.py:damper"), SCENARIO)
    session = Session(SCENARIO, design, plants=PLANTS)
    child = ChildSession(SCENARIO, design, plants=PLANTS)
    for either in (session, child):
        either.prepare()
    for act in (
        lambda session: session.pulse((0.5, 0.0), 0.1),
        lambda session: session.use(ALL_CONTROLLERS.design("lqr", SCENARIO)),
        lambda session: session.use(design),
        lambda session: session.reset(),
    ):
        for either in (session, child):
            act(either)
        for samples in (20, 0, 30):
            assert_equal_increments(session, child, samples)
    assert child._child is not None
    child._child.connection.close()  # as if the parent had ended
    process = child._child._process
    assert process is not None
    process.join(HANG)
    assert process.exitcode == 0
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("if (m[3] > 600.0) *(volatile int *)0 = 1;", "ended its process with SIGSEGV"),
        ("while (m[3] > 600.0) u[0] = 0.5 * (u[0] + m[3]);", "took more than 1 s for a block"),
    ],
)
def test_a_failing_controller_stops_the_plants_until_the_next_reset(
    fault: str, message: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    design = ALL_CONTROLLERS.design(open_controller(str(built(tmp_path, broken=fault))), SCENARIO)
    session = ChildSession(SCENARIO, design, plants=PLANTS)
    session.prepare()
    assert all(len(run.time_ns) == 550 for run in session.advance(550))
    session._timeout = 1.0
    for _ in range(2):
        for run in session.advance(100):
            assert run.status == RunStatus.CONTROLLER_FAILED
            assert len(run.time_ns) == 0
            assert run.end_ns == session.now_ns == 550 * SCENARIO.period_ns
    assert not session.moving
    assert capfd.readouterr().err.count(message) == 1
    session._timeout = HANG
    session.reset()
    assert session.moving
    runs = session.advance(10)
    assert [run.time_ns[0] for run in runs] == [550 * SCENARIO.period_ns] * 2
    assert session.origin_ns == 550 * SCENARIO.period_ns


def test_a_session_in_a_child_process_is_driven_by_hand_in_the_same_way() -> None:
    scenario = load_scenario("fixed-position", overrides=["disturbances=[]"])
    design = ALL_CONTROLLERS.design("lqr", scenario)
    session = Session(scenario, design, plants=PLANTS)
    child = ChildSession(scenario, design, plants=PLANTS)
    for act in (
        lambda session: session.steer(HandRequest(False, 0.3, 0.0, -0.1)),
        lambda session: session.steer(HandRequest(True, 0.5, 0.5, -0.5)),
        lambda session: session.reset(),
    ):
        assert session.driven_scenario() == child.driven_scenario()
        for either in (session, child):
            act(either)
        assert_equal_increments(session, child, 300)
    with pytest.raises(InputError, match="moves the load until"):
        ChildSession(SCENARIO, ALL_CONTROLLERS.design("lqr", SCENARIO), plants=PLANTS).steer(
            HandRequest(True, 1.0, 0.5, -0.5)
        )
