"""Sessions give the signals of a run bit for bit, and take changes and resets between blocks."""

import numpy as np
import pytest

from cranectl.controllers import registry
from cranectl.design import design_controller
from cranectl.planning import load_scenario
from cranectl.plants.plant import DRIVES
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from cranectl.tools.live.session import Session
from tests.conftest import ALL_CONTROLLERS, PLANTS


def session(scenario: Scenario, controller: str = "lqr", **options: object) -> Session:
    return Session(scenario, registry.ALL_CONTROLLERS.design(controller, scenario), **options)


def advance(running: Session, samples: int, block: int = 20) -> dict[str, np.ndarray]:
    """Advance a session by `samples` samples; return their rows by plant."""
    increments: dict[str, list[Run]] = {}
    while samples > 0:
        for run in running.advance(min(block, samples)):
            increments.setdefault(run.plant, []).append(run)
        samples -= block
    return {plant: np.vstack([run.table for run in runs]) for plant, runs in increments.items()}


@pytest.mark.parametrize("block", [1, 7])
@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("controller", ["pole-placement", "lqr+hinf", "pid", "lqr-integral"])
def test_a_session_without_commands_gives_the_signals_of_a_run(
    short: Scenario, controller: str, drive: str, block: int
) -> None:
    prepared = session(short, controller, drive=drive)
    prepared.prepare()
    tables = advance(prepared, 501, block)
    assert list(tables) == list(PLANTS)
    for plant, table in tables.items():
        run = simulate_run(short, plant=plant, drive=drive, controller=controller)
        assert run.status == RunStatus.COMPLETED
        assert np.array_equal(table, run.table)


def test_the_last_reference_and_disturbances_are_held(short: Scenario) -> None:
    running = session(short, plants=["analytic"])
    running.advance(501)
    (run,) = running.advance(300)
    assert run.status == RunStatus.RUNNING
    assert run.time_ns[[0, -1]].tolist() == [501_000_000, 800_000_000]
    assert np.array_equal(run.reference, np.tile(running.plan.reference[-1], (300, 1)))
    assert np.array_equal(run.block("disturbance"), np.ones((300, 2)))


@pytest.mark.parametrize("controller", ALL_CONTROLLERS)
def test_a_new_controller_with_the_same_gains_changes_no_bit(short: Scenario, controller: str) -> None:
    """The session therefore keeps all states: the extension ζ, its rate, set-points and robustifier."""
    running = session(short, controller)
    first = advance(running, 300)
    running.use(running.design.with_gain(running.design.gain))
    second = advance(running, 201)
    for plant in PLANTS:
        expected = simulate_run(short, plant=plant, controller=controller).table
        assert np.array_equal(np.vstack([first[plant], second[plant]]), expected)


def test_another_robustifier_starts_at_rest_and_the_extension_is_kept(short: Scenario) -> None:
    running = session(short, "lqr+hinf")
    advance(running, 300)
    memories = [np.concatenate([loop.memory[:2], loop.inputs.integral]) for loop in running._loops]
    design = design_controller("pole-placement+loop-shaping", short.design)
    running.use(design)
    for run, memory in zip(running.advance(1), memories, strict=True):
        controller = run.block("controller")
        assert controller.shape == (1, 2 + 3 * design.robustifier.sampled_order)
        assert controller[0, :2].tolist() == memory[:2].tolist()
        assert not controller[0, 2:].any()
        assert memory[0] != 0.0
        setpoints = run.block("input")[0, 3:] - short.rig.time_constants * run.block("input")[0, :3]
        assert setpoints == pytest.approx(memory[2:5], abs=1e-15)


def test_set_points_do_not_jump_when_the_kind_of_controller_changes(short: Scenario) -> None:
    """Set-points are kept, the reference continues, and the new controller's signals are recorded."""
    running = session(short, "lqr", plants=["mujoco"], drive="velocity")
    for controller in ("lqr-integral", "pid", "lqr", "lqr-integral"):
        (before,) = running.advance(120)
        running.use(registry.ALL_CONTROLLERS.design(controller, short))
        (after,) = running.advance(1)
        assert after.groups == running.advance(0)[0].groups
        assert after.status == RunStatus.RUNNING
        if controller != "pid":  # pid commands velocities itself
            old, new = before.block("input")[-1], after.block("input")[0]
            lead = short.rig.time_constants
            without = old[3:] if before.design.name == "pid" else old[3:] - lead * old[:3] + 1e-3 * old[:3]
            assert new[3:] - lead * new[:3] == pytest.approx(without, abs=1e-12)
        assert np.array_equal(after.reference[0], running.plan.reference[min(running._samples - 1, 500)])


def test_an_extension_of_a_controller_starts_on_the_reference() -> None:
    running = session(load_scenario("fast-diagonal"), "lqr", plants=["analytic"])
    running.advance(700)
    running.use(registry.ALL_CONTROLLERS.design("flat-velocity", running.scenario))
    (run,) = running.advance(2)
    assert abs(run.reference[1, 8]) > 0.1
    assert run.block("controller")[0, :2] == pytest.approx(run.reference[1, [8, 11]], abs=5e-3)


def test_gains_change_the_motion(short: Scenario) -> None:
    running, unchanged = session(short), session(short)
    for either in (running, unchanged):
        advance(either, 300)
    running.use(running.design.with_gain(running.design.gain * 1.1))
    assert np.abs(running.advance(200)[1].table - unchanged.advance(200)[1].table).max() > 1e-3


def test_unstable_gains_are_refused(short: Scenario) -> None:
    running, unchanged = session(short), session(short)
    with pytest.raises(InputError, match="unstable"):
        running.design.with_gain(np.array([40.0, 60.0, 38.0, -10.0]))
    # Stable in continuous time, but not at 1 ms.
    fast = running.design.with_gain(np.poly([-2500.0] * 4)[:0:-1])
    with pytest.raises(InputError, match="unstable when sampled"):
        running.use(fast)
    assert running.design is unchanged.design
    assert np.array_equal(running.advance(100)[0].table, unchanged.advance(100)[0].table)


def test_with_gain_computes_the_new_poles(short: Scenario) -> None:
    design = design_controller("lqr", short.design).with_gain(np.poly([-2.0, -3.0, -4.0, -5.0])[:0:-1])
    assert design.closed_loop_poles.real == pytest.approx([-5.0, -4.0, -3.0, -2.0], rel=1e-6)
    assert design.name == "lqr, gains by hand"
    assert design.with_gain(design.gain).name == design.name


@pytest.mark.parametrize(("pulse", "column"), [((2.0, 0.0), 6), ((0.0, -3.0), 8)])
@pytest.mark.parametrize("plant", PLANTS)
def test_a_pulse_acts_only_for_its_duration(plant: str, pulse: tuple[float, float], column: int) -> None:
    quiet = load_scenario("fixed-position", overrides=["disturbances=[]"])
    running = session(quiet, plants=[plant])
    running.advance(50)
    running.pulse(pulse, 0.2)
    (run,) = running.advance(300)
    assert np.array_equal(run.block("disturbance")[:200], np.tile(pulse, (200, 1)))
    assert not run.block("disturbance")[200:].any()
    rate = run.block("state")[:, column + 1]
    assert rate[1] == pytest.approx(0.001 * sum(pulse), rel=1e-3)
    assert abs(run.block("state")[200, column]) > 0.01


def test_a_pulse_adds_to_the_disturbances_of_the_scenario(short: Scenario) -> None:
    running = session(short, plants=["analytic"])
    running.advance(150)
    running.pulse((1.0, 0.5), 0.01)
    (run,) = running.advance(20)
    assert run.block("disturbance")[[0, 9, 10]].tolist() == [[2.0, 0.5], [2.0, 0.5], [1.0, 0.0]]
    assert running.plan.disturbance[150].tolist() == [1.0, 0.0], "the pulse has changed the plan"


def test_a_reset_restarts_the_run_and_time_continues(short: Scenario) -> None:
    running = session(short)
    first = advance(running, 333)
    running.pulse((5.0, 5.0), 1.0)
    running.reset()
    assert (running.origin_ns, running.now_ns) == (333_000_000, 333_000_000)
    increments = running.advance(333)
    for run in increments:
        assert np.array_equal(run.table, first[run.plant]), run.plant
        assert run.time_ns[[0, -1]].tolist() == [333_000_000, 665_000_000]
