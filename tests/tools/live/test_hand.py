"""Sessions that are driven by hand: when driving may begin, when it ends, and that runs repeat it exactly."""

from dataclasses import replace

import numpy as np
import pytest

from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.scenario.recorded import Driven
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.documents import MAX_DOCUMENT_BYTES, TOML
from cranectl.support.errors import InputError
from cranectl.tools.live.hand import HandReference, HandRequest
from cranectl.tools.live.session import Session
from tests.controllers.own_controllers import FOLLOWING, known

SHORT = ("disturbances=[{joint='beta', start=0.3, end=0.5, magnitude=1.0}]", "duration=2.0")
PLANTS = ("analytic", "mujoco")
MOVE = "reference.segments=[{kind='line', to=[0.8, 0.6, -0.6], duration=1.5}, {kind='hold', duration=0.3}]"


def session(*overrides: str, controller: str = "lqr", **options: object) -> Session:
    scenario = load_scenario("fixed-position", overrides=[*SHORT, *overrides])
    return Session(scenario, ALL_CONTROLLERS.design(controller, scenario), plants=PLANTS, **options)


def drive(running: Session, block: int) -> list[list[Run]]:
    """Drive a session for a few seconds by velocity commands and targets, which act between blocks."""
    runs = []
    commands = (
        (340, lambda: running.steer(HandRequest(False, 0.3, -0.2, 0.1))),
        (900, lambda: running.steer(HandRequest(False, -0.45, 0.2, 0.0))),
        (120, lambda: running.steer(HandRequest(True, 0.5, 0.5, -1.0))),
        (600, lambda: running.steer(HandRequest(False, 0.0, 0.0, 0.0))),
        (300, lambda: running.steer(HandRequest(True, 1.5, 1.1, -0.4))),
    )
    for samples, send in commands:
        send()
        running.pulse((0.0, 0.5), 0.2)
        runs += [running.advance(block) for _ in range(samples // block)]
    return runs


@pytest.mark.parametrize(
    ("overrides", "drive_kind", "controller"),
    [
        ((), "ideal", "lqr"),
        ((MOVE,), "velocity", "pole-placement+hinf"),
        ((), "force", "lqr-integral"),
        (
            ("effects={sensing={}, wind={}, limits={force=[1e9,1e9,1e9]}, delay={}}", "planning.share=0.95"),
            "velocity",
            "lqr",
        ),
    ],
    ids=["from the start", "after a move", "a controller called by its address", "with noise and gusts"],
)
def test_a_session_driven_by_hand_is_repeated_bit_for_bit(
    overrides: tuple[str, ...], drive_kind: str, controller: str
) -> None:
    running = session(*overrides, controller=controller, drive=drive_kind)
    runs = [running.advance(1700)] if overrides else []
    runs += drive(running, 20)
    scenario = running.driven_scenario()
    assert scenario is not None
    assert scenario.controller.name == controller
    for k, plant in enumerate(PLANTS):
        repeated = simulate_run(scenario, plant=plant, drive=drive_kind)
        table, reference = (
            np.vstack([getattr(block[k], name) for block in runs]) for name in ("table", "reference")
        )
        assert np.array_equal(repeated.reference[: len(reference)], reference)
        assert np.array_equal(repeated.table[: len(table)], table)
        assert repeated.status == RunStatus.COMPLETED
        assert np.ptp(reference[:, :3], axis=0).min() > 0.02, "the load was not driven along all axes"
        assert np.array_equal(repeated.reference[-1, 3:], np.zeros(12)), "the load does not come to rest"


def test_the_block_size_makes_no_difference() -> None:
    a, b = (np.vstack([runs[0].reference for runs in drive(session(), block)]) for block in (1, 20))
    assert np.array_equal(a, b)


def test_driving_by_hand_begins_only_after_the_reference_has_ended() -> None:
    running = session(MOVE)
    running.advance(1499)
    with pytest.raises(InputError, match=r"moves the load until 1.5 s") as caught:
        running.steer(HandRequest(False, 0.1, 0.0, 0.0))
    assert "reference.segments=[]" in caught.value.remedy
    assert running.driven_scenario() is None
    running.advance(1)
    running.steer(HandRequest(False, 0.0, 0.0, 0.0))
    assert running.driven_scenario() is None, "a velocity command of zero does not begin driving"
    running.steer(HandRequest(False, 0.1, 0.0, 0.0))
    (run, _) = running.advance(1)
    assert run.reference[0, :3] == pytest.approx([0.8, 0.6, -0.6], abs=0.0)
    assert [segment.kind for segment in running.driven_scenario().reference.segments] == ["line", "driven"]


def test_a_reset_ends_driving_by_hand() -> None:
    running = session(MOVE)
    running.advance(1600)
    running.steer(HandRequest(False, 0.4, 0.0, 0.0))
    running.advance(300)
    running.reset()
    assert running.driven_scenario() is None
    runs = running.advance(501)
    assert np.array_equal(runs[0].reference, running.plan.reference[:501])


def test_another_controller_continues_from_the_driven_position() -> None:
    running = session("disturbances=[]")
    running.steer(HandRequest(False, 0.4, 0.0, 0.0))
    running.advance(800)
    for controller in ("pole-placement", "lqr-integral", "lqr"):
        running.use(ALL_CONTROLLERS.design(controller, running.scenario))
        runs = running.advance(400)
        assert max(np.abs(run.block("error")[:, :3]).max() for run in runs) < 2e-3, controller


@pytest.mark.parametrize("declared", [{"preview": 1}, {"follows": "set-point"}])
def test_controllers_with_preview_cannot_be_driven_by_hand(declared: dict) -> None:
    with known(replace(FOLLOWING, **declared)) as name:
        with pytest.raises(InputError, match="needs the reference in advance"):
            session(controller=name).steer(HandRequest(False, 0.1, 0.0, 0.0))
        running = session()
        running.steer(HandRequest(False, 0.1, 0.0, 0.0))
        with pytest.raises(InputError, match="needs the reference in advance"):
            running.use(ALL_CONTROLLERS.design(name, running.scenario))
        assert running.design.name == "lqr"


def test_a_load_outside_the_limits_cannot_be_driven_by_hand() -> None:
    with pytest.raises(InputError, match=r"rests at \(1, 0.77, -1.39\) m, outside") as caught:
        session("reference.start=[1.0, 0.77, -1.39]").steer(HandRequest(False, 0.1, 0.0, 0.0))
    assert "(0.05, 0.05, -1.34) to (1.95, 1.49, -0.1) m" in caught.value.allowed


def test_driving_by_hand_ends_before_the_longest_run_does() -> None:
    """The remaining 10.743 s let the load come to rest, so that a run can repeat the whole drive."""
    scenario = load_scenario("fixed-position", overrides=["reference.segments=[]", "control.period=0.01"])
    hand = HandReference(scenario, 0)
    hand.follow(58_000, HandRequest(False, 0.1, 0.0, 0.0))
    rows = hand.rows(np.arange(58_000, 60_000))
    assert rows[0, 0] < rows[800, 0] < rows[-1, 0]
    assert np.abs(rows[-1, 3:]).max() < 1e-12, "the reference is not at rest"
    with pytest.raises(InputError, match="too long for a scenario that repeats it"):
        hand.follow(58_930, HandRequest(False, 0.1, 0.0, 0.0))
    driven = hand.scenario(60_001, "lqr")
    assert driven.duration == 600.0
    assert isinstance(driven, Scenario)
    with pytest.raises(InputError, match="too long for a scenario that repeats it"):
        HandReference(scenario, 58_930)


def test_too_many_commands_end_driving_by_hand_at_rest() -> None:
    hand = HandReference(load_scenario("fixed-position", overrides=["reference.segments=[]"]), 0)
    for sample in range(Driven.MAX_CHANGES - 2):
        hand.follow(sample, HandRequest(False, 0.1 + 1e-5 * (sample % 1000), -0.12345, 0.12345))
    with pytest.raises(InputError, match="too long for a scenario that repeats it"):
        hand.follow(Driven.MAX_CHANGES, HandRequest(False, 0.2, 0.0, 0.0))
    assert np.array_equal(hand.rows(np.arange(20_000, 35_000))[-1, 3:] < 1e-12, np.full(12, True))
    text = TOML.text(hand.scenario(35_000, "lqr").model_dump(exclude_unset=True))
    assert len(text) < MAX_DOCUMENT_BYTES
    assert len(hand.scenario(35_000, "lqr").reference.segments[-1].wishes) <= Driven.MAX_CHANGES
