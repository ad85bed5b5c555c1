"""Runs: the compiled and the Python loop give the same bits, and every reason for which a run stops."""

import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from cranectl import signals
from cranectl.controllers.registry import controller_names
from cranectl.planning import load_scenario
from cranectl.plants import PLANTS as ALL_PLANTS
from cranectl.plants.plant import DRIVES
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from cranectl.simulate.actuation import UnloadedDrives
from cranectl.simulate.loops import LoopInputs, judge_sample
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from tests.conftest import ALL_CONTROLLERS, PAIR, PLANTS, closed_loop

make_plant = ALL_PLANTS.make


def same(a: Run, b: Run) -> bool:
    return (
        a.status == b.status
        and a.end_ns == b.end_ns
        and np.array_equal(a.table, b.table)
        and np.array_equal(a.time_ns, b.time_ns)
    )


SIGNAL_PATH = (  # whose limits act, while the load is brought to rest
    "reference.segments=[]", "initial.load_offset=[0.3,0.3,0.0]",
    "effects.sensing={angle_resolution=0.001, seed=3}", "effects.delay.seconds=0.004",
    "effects.limits={force=[1e9,1e9,1e9], acceleration=[0.5,0.5,0.5], velocity=[0.2,0.2,0.2]}",
)  # fmt: skip
LOOPS = [
    *product(("lqr", "pole-placement+hinf", "lqr+loop-shaping"), PLANTS, DRIVES, [()]),
    *product(["lqr"], PLANTS, ["velocity"], [SIGNAL_PATH]),
    *product(("pid", "lqr-integral", "flat-velocity"), ["analytic"], ["velocity"], [(), SIGNAL_PATH]),
]


@pytest.mark.parametrize(("controller", "plant", "drive", "effects"), LOOPS)
def test_compiled_and_python_loop_give_the_same_bits(
    controller: str, plant: str, drive: str, effects: tuple[str, ...]
) -> None:
    """The run has a line and an arc, both disturbances, and two physics steps in a period."""
    overrides = [
        "duration=2.0", "control.physics_step=0.0005", "disturbances.0.start=0.5",
        "disturbances.1.start=1.0", "reference.segments.0.duration=1.5",
        "reference.segments.1.duration=0.5", "reference.segments.0.to=[0.4,0.3,-0.3]",
        "reference.segments.1.angle=-0.1", *effects,
    ]  # fmt: skip
    loaded = load_scenario("settled-trajectory", overrides=overrides)
    runs = [
        simulate_run(loaded, plant=plant, drive=drive, controller=controller, compiled=compiled)
        for compiled in (True, False)
    ]
    assert runs[0].status == RunStatus.COMPLETED
    assert len(runs[0].table) == 2001
    assert same(*runs)
    assert np.isfinite(runs[0].table).all()
    assert np.ptp(runs[0].block("state")[:, :6:2], axis=0).max() > 0.1
    assert not effects or runs[0].block("command")[:, 3:].any(), "limits act"


@pytest.mark.parametrize("controller", ALL_CONTROLLERS)
@pytest.mark.parametrize("plant", PLANTS)
def test_a_run_that_starts_on_its_reference_starts_without_a_transient(plant: str, controller: str) -> None:
    """What error there is comes from holding the input over a period, and halves with it.

    Started from rest instead, without the reference's third derivative, it would be a hundred times larger.
    """
    largest = []
    line = "reference.segments=[{kind='line', to=[1.65,0.77,-0.7], duration=10.0, time_law='degree-5'}]"
    for period in (0.001, 0.0005):
        steps = f"control.period={period}", "control.physics_step=0.0005"
        short = line, "duration=10.0", "disturbances=[]"
        scenario = load_scenario("settled-trajectory", overrides=[*steps, *short])
        run = simulate_run(scenario, plant=plant, controller=controller)
        assert run.block("error")[0] == pytest.approx(np.zeros(12), abs=1e-12)
        largest.append(np.abs(run.block("error")[run.time <= 1.0, :3]).max())
    assert largest[0] < 2e-5
    assert largest[0] / largest[1] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("plant", PLANTS)
def test_disturbances_act_from_their_sample_to_their_end(plant: str) -> None:
    alpha = "{joint='alpha', start=0.1, magnitude=1.0}"
    beta = "{joint='beta', start=0.2, end=0.3, magnitude=-0.5}"
    pushed = "duration=0.5", f"disturbances=[{alpha}, {beta}]"
    run = closed_loop("fixed-position", "lqr", plant, "ideal", *pushed)
    active = [np.flatnonzero(column) for column in run.block("disturbance").T]
    assert [(samples[0], samples[-1]) for samples in active] == [(100, 500), (200, 299)]
    alpha_rate = run.signal("state.alpha_rate")
    assert not alpha_rate[:101].any()
    assert alpha_rate[101] == pytest.approx(1e-3, rel=1e-3)


def stop(plant: str, *overrides: str, compiled: bool = True, controller: str = "lqr") -> Run:
    scenario = load_scenario("fixed-position", overrides=["duration=3.0", "disturbances=[]", *overrides])
    return simulate_run(scenario, plant=plant, compiled=compiled, controller=controller)


NARROW = ("rig.bridge_range=[0.9, 1.05]", "workspace.on_exit='stop'")


def kick(joint: str, magnitude: float) -> str:
    return f"disturbances=[{{joint='{joint}', start=0.5, magnitude={magnitude}}}]"


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("plant", PLANTS)
def test_run_stops_where_the_workspace_is_left(plant: str, compiled: bool) -> None:
    run = stop(plant, kick("beta", 3.0), *NARROW, compiled=compiled)
    assert run.status == RunStatus.WORKSPACE_LEFT
    position = run.signal("state.bridge_position")
    assert 0.9 <= position[:-1].min() <= position[:-1].max() <= 1.05
    assert not 0.9 <= position[-1] <= 1.05
    assert run.end_ns == run.time_ns[-1]


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    ("kicked", "gravity", "statuses"),
    [
        (20.0, 9.81, {RunStatus.LENGTH_SINGULAR}),
        (-25.0, 2.0, {RunStatus.SLACK_ROPE, RunStatus.ANGLE_SINGULAR}),  # both within a millisecond
    ],
)
def test_run_stops_at_a_singularity(
    plant: str, compiled: bool, kicked: float, gravity: float, statuses: set[RunStatus]
) -> None:
    run = stop(plant, kick("alpha", kicked), f"rig.gravity={gravity}", compiled=compiled)
    assert run.status in statuses
    assert 500 < len(run.time_ns) < 3000
    assert np.isfinite(run.table).all()
    assert run.end_ns - run.time_ns[-1] == 1_000_000, "the sample that could not be controlled"


def test_plants_stop_together_for_the_same_reason() -> None:
    """They stop within a few samples of each other and with the same status."""
    for overrides in ([kick("alpha", 20.0)], [kick("beta", 3.0), *NARROW]):
        a, b = (stop(plant, *overrides) for plant in PAIR)
        assert a.status == b.status
        assert abs(a.end_ns - b.end_ns) <= 2_000_000


@pytest.mark.parametrize(
    ("tension", "status"),
    [
        (1e-9, RunStatus.RUNNING),
        (0.0, RunStatus.SLACK_ROPE),
        (-1.0, RunStatus.SLACK_ROPE),
        (np.nan, RunStatus.NON_FINITE),
        (np.inf, RunStatus.NON_FINITE),
    ],
)
def test_the_rope_tension_of_the_plant_is_judged(tension: float, status: RunStatus) -> None:
    """The tension of the plant decides, not the zeta of the tracker."""
    row = np.zeros(signals.COLUMN.width)
    row[signals.COLUMN.tension] = tension
    none = np.zeros((0, 2))
    inputs = LoopInputs(
        controller=None, actuation=None, integral=np.zeros(3), unloaded=None,  # type: ignore[arg-type]
        reference=none, disturbance=none, wind=none, workspace=np.zeros((3, 2)), stop_outside=False,
        command_column=signals.COLUMN.input, recover=False, slack=np.zeros(1),
    )  # fmt: skip
    assert RunStatus(judge_sample.py_func(inputs, row)) == status


@pytest.mark.parametrize("plant", PLANTS)
def test_run_stops_when_a_state_is_no_number(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, plant: str
) -> None:
    """If a plant breaks in the middle of a run, all samples before that remain."""
    monkeypatch.chdir(tmp_path)  # the engine writes a log of its warnings
    crane = make_plant(plant, load_scenario("fixed-position"), "ideal")
    advance, calls = crane.advance, iter(range(10**6))

    def break_down(command: np.ndarray, disturbance: np.ndarray, wind: np.ndarray, load: np.ndarray) -> None:
        broken = np.full(2, np.nan) if next(calls) == 250 else disturbance
        advance(command, broken, wind, load)

    monkeypatch.setattr(crane, "advance", break_down)
    monkeypatch.setattr(crane, "warnings", lambda: 0)
    monkeypatch.setattr(ALL_PLANTS, "make", lambda *_: crane)
    run = stop(plant, compiled=False)
    assert run.status == RunStatus.NON_FINITE
    assert len(run.time_ns) in {250, 251}, "the engine's tension already shows it at the sample itself"
    assert run.end_ns in {250_000_000, 251_000_000}
    assert np.isfinite(run.table).all()


def test_run_stops_when_the_engine_warns(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Both loops read the engine's counter of warnings."""
    monkeypatch.chdir(tmp_path)
    for compiled in (True, False):
        crane = make_plant("mujoco", load_scenario("fixed-position"), "ideal")
        reset = crane.reset

        def reset_then_warn(state: np.ndarray, crane=crane, reset=reset) -> None:
            reset(state)
            crane.rig.warnings[0] = 1

        monkeypatch.setattr(crane, "reset", reset_then_warn)
        monkeypatch.setattr(ALL_PLANTS, "make", lambda *_, crane=crane: crane)
        run = stop("mujoco", compiled=compiled)
        assert run.status == RunStatus.ENGINE_WARNING
        assert len(run.time_ns) == 1


@pytest.mark.parametrize("plant", PLANTS)
def test_ctrl_c_keeps_what_was_run(plant: str) -> None:
    scenario = load_scenario("fixed-position", overrides=["duration=20"])
    seconds = []

    def progress(amount: float) -> None:
        seconds.append(amount)
        if len(seconds) == 3:
            raise KeyboardInterrupt

    run = simulate_run(scenario, plant=plant, progress=progress)
    assert run.status == RunStatus.INTERRUPTED
    assert len(run.time_ns) == 3000
    assert run.end_ns == run.time_ns[-1]
    assert sum(seconds) == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("keyword", "value", "known"),
    [
        ("plant", "mujocco", "analytic, elastic, mujoco, "),
        ("drive", "ideel", "ideal, velocity, force"),
        ("controller", "lqrr", ", ".join(controller_names())),
    ],
)
def test_unknown_names_list_the_known(short: Scenario, keyword: str, value: str, known: str) -> None:
    with pytest.raises(InputError) as caught:
        simulate_run(short, **{keyword: value})
    assert caught.value.allowed.startswith(known)


@pytest.mark.slow
def test_a_second_process_compiles_nothing() -> None:
    script = """
import numba
import numba.core.event as event
from cranectl.planning import load_scenario
compiled = []
class Count(event.Listener):
    def on_start(self, event): compiled.append(event.data["dispatcher"])
    def on_end(self, event): pass
with event.install_listener("numba:compile", Count()):
    from cranectl.simulate import simulate_run
    scenario = load_scenario("fixed-position", overrides=["duration=0.1", "disturbances=[]"])
    for plant in ("analytic", "mujoco"):
        for drive in ("ideal", "velocity"):
            simulate_run(scenario, plant=plant, drive=drive)
    print(len(compiled))
    numba.njit(lambda x: x)(1.0)
    print(len(compiled))
"""
    for _ in range(2):  # the first may have to
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    before, after = map(int, done.stdout.split())
    assert before == 0
    assert after == 1, "what is compiled must show"


@pytest.mark.parametrize("drive", ["ideal", "velocity", "force"])
@pytest.mark.parametrize("controller", ["pid", "flat-velocity", "lqr"])
def test_recorded_accelerations_of_set_points_reach_neither_plant_nor_observer(
    controller: str, drive: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Runs with encoders are equal to the bit whatever the memory of these accelerations begins with."""
    scenario = load_scenario(
        "off-reference", overrides=["effects.sensing={}", "effects.delay={}", "rig.load_mass=3.0"]
    )
    run = simulate_run(scenario, plant="mujoco", controller=controller, drive=drive)
    make = UnloadedDrives.of
    monkeypatch.setattr(UnloadedDrives, "of", lambda *given: make(*given)._replace(velocity=np.full(3, 9.0)))
    other = simulate_run(scenario, plant="mujoco", controller=controller, drive=drive)
    recorded = signals.COLUMN.input + np.arange(3)
    assert np.delete(run.table, recorded, axis=1).tobytes() == (
        np.delete(other.table, recorded, axis=1).tobytes()
    )
    is_changed = controller != "lqr" and drive != "ideal"
    assert (run.table[0, recorded] != other.table[0, recorded]).all() == is_changed
