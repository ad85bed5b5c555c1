"""A session with a law from outside: as any other, and what remains when the law ends it."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cranectl.controllers.registry import controller_design
from cranectl.live.child_session import ChildSession
from cranectl.live.hand import HandRequest
from cranectl.live.session import Session
from cranectl.loaders.opening import close_controllers, open_controller
from cranectl.planning import load_scenario
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from tests.loaders.law_files import LAW, built
from tests.pace import HANG

SCENARIO = load_scenario("fast-diagonal")
PLANTS = ("analytic", "mujoco")


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    yield
    close_controllers()


def test_it_goes_as_a_session_does(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "law.py").write_text(LAW)
    design = controller_design(open_controller(f"{tmp_path}/law.py:damper"), SCENARIO)
    here = Session(SCENARIO, design, plants=PLANTS)
    there = ChildSession(SCENARIO, design, plants=PLANTS)
    for session in (here, there):
        session.prepare()
    for act in (
        lambda session: session.pulse((0.5, 0.0), 0.1),
        lambda session: session.use(controller_design("lqr", SCENARIO)),
        lambda session: session.use(design),
        lambda session: session.reset(),
    ):
        for session in (here, there):
            act(session)
        for samples in (20, 0, 30):
            for run, other in zip(here.advance(samples), there.advance(samples), strict=True):
                assert run.plant == other.plant
                assert run.design.name == other.design.name
                assert np.array_equal(run.time_ns, other.time_ns)
                assert np.array_equal(run.table, other.table)
        assert (here.now_ns, here.origin_ns, here.moving) == (there.now_ns, there.origin_ns, there.moving)
    assert there._child is not None
    there._child.connection.close()  # as where the parent has ended
    process = there._child._process
    assert process is not None
    process.join(HANG)
    assert process.exitcode == 0
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ("if (m[3] > 600.0) *(volatile int *)0 = 1;", "ended its process with SIGSEGV"),
        ("while (m[3] > 600.0) u[0] = 0.5 * (u[0] + m[3]);", "took more than 1 s for a block"),
    ],
)
def test_a_law_that_fails_stops_the_plants_until_the_next_start(
    broken: str, said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    design = controller_design(open_controller(str(built(tmp_path, broken=broken))), SCENARIO)
    session = ChildSession(SCENARIO, design, plants=PLANTS)
    session.prepare()
    assert all(len(run.time_ns) == 550 for run in session.advance(550))
    session._patience = 1.0
    for _ in range(2):
        for run in session.advance(100):
            assert run.status == RunStatus.CONTROLLER_FAILED
            assert len(run.time_ns) == 0
            assert run.end_ns == session.now_ns == 550 * SCENARIO.period_ns
    assert not session.moving
    assert capfd.readouterr().err.count(said) == 1
    session._patience = HANG
    session.reset()
    assert session.moving
    again = session.advance(10)
    assert [run.time_ns[0] for run in again] == [550 * SCENARIO.period_ns] * 2
    assert session.origin_ns == 550 * SCENARIO.period_ns


def test_it_is_driven_as_a_session_is() -> None:
    scenario = load_scenario("fixed-position", overrides=["disturbances=[]"])
    design = controller_design("lqr", scenario)
    here = Session(scenario, design, plants=PLANTS)
    there = ChildSession(scenario, design, plants=PLANTS)
    for act in (
        lambda session: session.steer(HandRequest(False, 0.3, 0.0, -0.1)),
        lambda session: session.steer(HandRequest(True, 0.5, 0.5, -0.5)),
        lambda session: session.reset(),
    ):
        assert here.driven() == there.driven()
        for session in (here, there):
            act(session)
        for run, other in zip(here.advance(300), there.advance(300), strict=True):
            assert np.array_equal(run.reference, other.reference)
            assert np.array_equal(run.table, other.table)
    with pytest.raises(InputError, match="moves the load until"):
        ChildSession(SCENARIO, controller_design("lqr", SCENARIO), plants=PLANTS).steer(
            HandRequest(True, 1.0, 0.5, -0.5)
        )
