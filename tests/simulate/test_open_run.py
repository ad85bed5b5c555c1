"""A crane stepped from a program gives the bits of a run, alone and among many cranes."""

import copy
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import cranectl
from cranectl import RunStatus, Scenario, open_run, open_runs
from cranectl.planning import load_scenario
from cranectl.plants.plant import DRIVES
from cranectl.simulate import Run, simulate_run
from tests.conftest import PLANTS

EFFECTS = [  # all that change a command or what happens to it; and noise, gusts and friction
    "effects.limits.velocity=[0.3,0.3,0.2]", "effects.sensing.seed=3", "effects.delay.seconds=0.004",
    "effects.installation.dead_zone=[0.002,0.002,0.002]", "effects.installation.drive_gain=[1.05,0.97,1.0]",
    "effects.friction.pivot_viscous=0.01", "effects.wind.mean=[1.0,0.5,0.0]",
]  # fmt: skip
SENSING = ["effects.sensing.seed=3", "effects.delay.seconds=0.004"]  # which every plant and drive has


def moving(*overrides: str) -> Scenario:
    """Return half a second of a disturbed motion along all axes."""
    return load_scenario(
        "fixed-position",
        overrides=[
            "duration=0.5", "disturbances.0.start=0.1", "disturbances.1.start=0.2",
            "initial.load_offset=[0.05,-0.04,0.03]", *overrides,
        ],
    )  # fmt: skip


def commands_of(run: Run) -> np.ndarray:
    """Return the commands (N, 3) that the controller of a run gave."""
    if run.drive == "force":
        return run.block("command")[:, :3]
    return run.block("input")[:, :3] if run.drive == "ideal" else run.block("input")[:, 3:]


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("plant", PLANTS)
def test_the_commands_of_a_run_give_its_bits(plant: str, drive: str) -> None:
    scenario = moving()
    run = simulate_run(scenario, plant=plant, drive=drive, controller="lqr")
    stepped = open_run(scenario, plant=plant, drive=drive)
    rounding = 1e-12 if drive == "force" else 0.0  # forces become accelerations, and forces again
    for k, command in enumerate(commands_of(run)):
        assert stepped.time == pytest.approx(k * 1e-3)
        assert stepped.state == pytest.approx(run.block("state")[k], abs=rounding, rel=0.0)
        stepped.step(command)
        assert [*stepped.load, stepped.tension] == pytest.approx(run.block("load")[k], abs=rounding, rel=0.0)
    again = stepped.recorded()
    assert again.status == run.status == RunStatus.COMPLETED
    assert again.end_ns == run.end_ns
    assert np.array_equal(again.block("disturbance"), run.block("disturbance"))
    assert again.block("error") == pytest.approx(run.block("error")[:, :6], abs=rounding, rel=0.0)
    assert again.block("state")[:, :6].std(axis=0).min() > 5e-4  # it moves


@pytest.mark.parametrize("plant", ["elastic", "mujoco"])
def test_effects_act_on_commands_as_in_a_run(plant: str) -> None:
    scenario = moving(*EFFECTS)
    run = simulate_run(scenario, plant=plant, drive="velocity", controller="pid")  # it commands velocities
    stepped = open_run(scenario, plant=plant, drive="velocity")
    for command in commands_of(run):
        stepped.step(command)
    again = stepped.recorded()
    for group in ("state", "load", "measurement", "command"):
        assert np.array_equal(again.block(group), run.block(group))
    assert not np.array_equal(run.block("command")[:, :3], commands_of(run))


def varied(i: int) -> Scenario:
    """Return one of several cranes: every second one has a signal path."""
    return moving(f"rig.load_mass={1.0 + 0.1 * i}", *(SENSING if i % 2 else []))


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("plant", [*PLANTS, "python"])
def test_many_cranes_give_the_bits_of_each_alone(
    plant: str, drive: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The plant `python` is one that has no compiled kernels."""
    if plant == "python":
        monkeypatch.setattr("cranectl.plants.elastic.plant.ElasticPlant.kernels", None)
        plant = "elastic"
    scenarios = [varied(i) for i in range(5)]
    together = open_runs(scenarios, plant=plant, drive=drive)
    alone = [open_run(scenario, plant=plant, drive=drive) for scenario in scenarios]
    seeds = range(10, 10 + len(alone))
    assert np.array_equal(
        together.reset(seeds=seeds), [run.reset(seed=seed) for run, seed in zip(alone, seeds, strict=True)]
    )
    size = np.array([0.3, 0.3, 0.1]) if drive != "force" else np.array([5.0, 2.0, 0.5])
    offset = np.array([0.0, 0.0, -9.81]) if drive == "force" else np.zeros(3)
    draw = np.random.default_rng(4)
    for samples in (1, 7, 300):  # the last one is longer than the rows that are computed at a time
        commands = offset + draw.uniform(-size, size, size=(len(alone), 3))
        states = together.step(commands, samples)
        expected = [run.step(command, samples) for run, command in zip(alone, commands, strict=True)]
        assert np.array_equal(states, expected)
        assert np.array_equal(together.states, states)
        assert np.array_equal(together.loads, [run.load for run in alone])
        assert np.array_equal(together.tensions, [run.tension for run in alone])
        assert np.array_equal(together.references, [run.reference for run in alone])
        assert np.array_equal(together.time, [run.time for run in alone])
        assert together.statuses == [run.status for run in alone]


def test_a_crane_that_has_stopped_waits_until_it_is_reset() -> None:
    cranes = open_runs([moving("workspace.on_exit=stop")] * 2, drive="velocity")
    for _ in range(30):
        cranes.step([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]], samples=100)
    assert cranes.statuses == [RunStatus.WORKSPACE_LEFT, RunStatus.RUNNING]
    assert cranes.time[0] < cranes.time[1] == pytest.approx(3.0)
    before = cranes.states
    after = cranes.reset(cranes=[0])
    assert np.array_equal(after[1], before[1])
    assert cranes.statuses == [RunStatus.RUNNING] * 2
    assert cranes.time.tolist() == [0.0, pytest.approx(3.0)]
    alone = open_run(moving("workspace.on_exit=stop"), drive="velocity")
    assert np.array_equal(cranes.states[0], alone.state)
    cranes.step([[0.1, 0.0, 0.0]] * 2, samples=50)
    assert np.array_equal(cranes.states[0], alone.step([0.1, 0.0, 0.0], samples=50))


def test_a_run_that_stopped_is_recorded_until_there() -> None:
    crane = open_run(moving("workspace.on_exit=stop", "duration=5.0"), drive="velocity")
    crane.step([1.0, 0.0, 0.0], samples=4000)
    state = crane.state
    assert np.array_equal(crane.step([-1.0, 0.0, 0.0]), state)
    run = crane.recorded()
    assert run.status == crane.status == RunStatus.WORKSPACE_LEFT
    assert run.end_s == run.time[-1] == pytest.approx(crane.time, abs=1.1e-3)


def test_a_run_can_go_on_after_the_end_and_is_recorded_to_the_end(tmp_path: Path) -> None:
    crane = open_run(moving(), drive="velocity")
    with pytest.raises(cranectl.InputError, match="no sample"):
        crane.recorded()
    crane.step([0.0, 0.0, 0.0], samples=200)
    assert (crane.recorded().status, crane.recorded().end_s) == (RunStatus.INTERRUPTED, 0.199)
    crane.step([0.0, 0.0, 0.0], samples=1000)
    assert crane.time == pytest.approx(1.2)
    assert np.array_equal(crane.reference, crane.recorded().reference[-1])
    run = crane.recorded()
    assert (run.status, run.end_s) == (RunStatus.COMPLETED, 0.5)
    cranectl.write_log(tmp_path / "stepped.mcap", [run])
    (read,) = cranectl.read_log(tmp_path / "stepped.mcap").values()
    assert read.controller == "commands"
    assert np.array_equal(read.block("state"), run.every(read.scenario.log.every).block("state"))
    assert cranectl.run_metrics(run).max_error_m > 0.01


def test_a_reset_starts_where_it_is_told() -> None:
    crane = open_run(moving(*EFFECTS), plant="elastic", drive="velocity")
    start = crane.state
    wanted = np.array([1.0, 0.1, 0.5, 0.0, 0.8, 0.0, 0.05, -0.1, 0.0, 0.2])
    assert crane.reset(wanted) == pytest.approx(wanted, abs=1e-15)
    assert np.array_equal(crane.reset(), start)


def test_a_seed_draws_start_noise_and_gusts() -> None:
    scenario = moving(*EFFECTS)
    crane = open_run(scenario, plant="elastic", drive="velocity")
    starts = np.array([crane.reset(seed=seed) for seed in range(200)])
    assert not starts[:, 1::2].any()
    low, high = scenario.rig.workspace.T
    share = (starts[:, :5:2] - low) / (high - low)
    assert share.min() == pytest.approx(0.1, abs=0.02)
    assert share.max() == pytest.approx(0.9, abs=0.02)
    runs = {}
    for name, seed in (("first", 7), ("same", 7), ("other", 8), ("none", None)):
        crane.reset(np.array([1.0, 0.0, 0.7, 0.0, 0.8, 0.0, 0.0, 0.0, 0.0, 0.0]), seed=seed)
        crane.step([0.0, 0.0, 0.0], samples=100)
        runs[name] = crane.recorded()
    assert np.array_equal(runs["first"].table, runs["same"].table)
    for name in ("other", "none"):
        for group in ("measurement", "state"):
            assert np.abs(runs["first"].block(group) - runs[name].block(group)).max() > 1e-9
    assert runs["first"].scenario.effects.sensing.seed != runs["first"].scenario.effects.wind.seed


@pytest.mark.parametrize(
    ("method", "arguments", "expected"),
    [
        ("step", {"command": [0.0, 0.0]}, "command = [0.0, 0.0], of shape (2,)"),
        ("step", {"command": [0.0, 0.0, np.nan]}, "with nan at [2]"),
        ("step", {"command": "fast"}, "command = 'fast'"),
        ("step", {"command": [0.0, 0.0, 0.0], "samples": 0}, "samples = 0"),
        ("step", {"command": [0.0, 0.0, 0.0], "samples": 1.5}, "samples = 1.5"),
        ("reset", {"state": np.zeros(9)}, "state = "),
        ("reset", {"state": [9.0, 0, 0.5, 0, 0.8, 0, 0, 0, 0, 0]}, "bridge_position = 9 m, of 0 to 2"),
        ("reset", {"target": [1.0, 0.5, -9.0]}, "the target is outside the workspace: rope_length = 9 m"),
        ("reset", {"target": [1.0, 0.5]}, "target = [1.0, 0.5]"),
        ("reset", {"state": [1.0, 0, 0.5, 0, 0.8, 0, 1.6, 0, 0, 0]}, "a cardan angle"),
        ("reset", {"seed": -1}, "seed = -1"),
    ],
)
def test_a_wrong_call_is_refused_and_changes_nothing(
    method: str, arguments: dict[str, object], expected: str
) -> None:
    crane = open_run(moving())
    state = crane.step([0.1, 0.1, 0.1], samples=10)
    with pytest.raises(cranectl.InputError) as error:
        getattr(crane, method)(**arguments)
    assert expected in error.value.found
    assert np.array_equal(crane.state, state)
    assert crane.time == pytest.approx(0.01)


@pytest.mark.parametrize("periods", [[], [0.001, 0.002]], ids=str)
def test_cranes_of_several_periods_are_refused(periods: list[float]) -> None:
    with pytest.raises(cranectl.InputError) as error:
        open_runs([moving(f"control.period={period}") for period in periods])
    assert error.value.found == f"{len(periods)} control periods in {len(periods)} scenarios"


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"seeds": [1]}, "2, 1, 2, 2 states, seeds, targets and scenarios for 2 cranes"),
        ({"states": np.zeros((3, 10))}, "3, 2, 2, 2"),
        ({"cranes": [0], "targets": np.zeros((2, 3))}, "1, 1, 2, 1"),
        ({"scenarios": [moving()]}, "2, 2, 2, 1"),
        ({"scenarios": [moving("control.period=0.002"), moving()]}, "2 control periods"),
        ({"scenarios": [moving(), "fixed-position"]}, "scenarios = 'fixed-position'"),
        ({"targets": 0.3}, "targets = 0.3"),
        *(({"cranes": cranes}, f"cranes = {cranes}") for cranes in ([2], [-1], [1, 1], [1.0], 1, [True])),
    ],
)
def test_a_wrong_reset_of_many_is_refused(arguments: dict[str, object], expected: str) -> None:
    cranes = open_runs([moving()] * 2)
    with pytest.raises(cranectl.InputError) as error:
        cranes.reset(**arguments)
    assert expected in error.value.found


def test_a_refused_reset_leaves_cranes_that_can_be_stepped() -> None:
    """Their compiled form refers to the memory of the new start."""
    cranes, alone = open_runs([moving()] * 2), open_run(moving())
    start = alone.state
    with pytest.raises(cranectl.InputError, match="outside the workspace"):
        cranes.reset([start, start + 9.0])
    waste = [np.full(1000, 1e300) for _ in range(100)]  # in the place of freed memory
    states = cranes.step(np.full((2, 3), 0.1), samples=100)
    assert np.array_equal(states, [alone.step([0.1, 0.1, 0.1], samples=100)] * 2)
    assert len(waste) == 100


@pytest.mark.parametrize("plant", [*PLANTS])
def test_cranes_begin_again_with_other_scenarios(plant: str) -> None:
    """Another load, another duration, and effects that need another plant: each is as a crane of its own."""
    scenarios = [varied(i) for i in range(4)]
    cranes = open_runs(scenarios, plant=plant, drive="velocity")
    cranes.step(np.full((4, 3), 0.05), samples=50)
    heavier, longer, sensing = moving("rig.load_mass=1.9"), moving("duration=4"), varied(7)
    cranes.reset(cranes=[0, 2, 3], seeds=[5, 6, 7], scenarios=[heavier, sensing, longer])
    assert cranes.scenarios == (heavier, scenarios[1], sensing, longer)
    alone = [open_run(scenario, plant=plant, drive="velocity") for scenario in cranes.scenarios]
    alone[1].step([0.05] * 3, samples=50)
    for k, seed in ((0, 5), (2, 6), (3, 7)):
        alone[k].reset(seed=seed)
    commands = np.random.default_rng(3).uniform(-0.1, 0.1, size=(4, 3))
    expected = [run.step(command, 300) for run, command in zip(alone, commands, strict=True)]
    assert np.array_equal(cranes.step(commands, 300), expected)
    assert cranes.tensions[0] > 1.5 * cranes.tensions[3]


def test_refused_scenarios_change_no_crane() -> None:
    before = [moving(), moving("rig.load_mass=2")]
    cranes = open_runs(before)
    with pytest.raises(cranectl.InputError, match="control periods"):
        cranes.reset(scenarios=[moving("rig.load_mass=1.5"), moving("control.period=0.002")])
    assert list(cranes.scenarios) == before


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_a_plant_that_cannot_be_made_leaves_all_cranes_as_they_were(
    plant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = [moving("rig.load_mass=1.2"), moving()]
    cranes, expected = (open_runs(before, plant=plant, drive="velocity") for _ in range(2))

    def refuse(*_: object) -> None:
        raise cranectl.InputError("no plant", allowed="one", remedy="none")

    monkeypatch.setattr(type(cranectl.plants.PLANTS), "make", refuse)
    finer = moving("control.physics_step=0.0001")  # which takes another plant
    with pytest.raises(cranectl.InputError, match="no plant"):
        cranes.reset(scenarios=[moving("rig.load_mass=1.9"), finer])
    assert list(cranes.scenarios) == before
    commands = np.full((2, 3), 0.1)
    assert np.array_equal(cranes.step(commands, samples=200), expected.step(commands, samples=200))
    assert np.array_equal(cranes.tensions, expected.tensions)


@pytest.mark.parametrize(("cranes", "begun"), [([False, True, False], [1]), ([], []), ([2, 0], [0, 2])])
def test_cranes_are_chosen_by_number_or_mask(cranes: list[int], begun: list[int]) -> None:
    together = open_runs([moving()] * 3)
    together.step(np.full((3, 3), 0.1), samples=5)
    together.reset(cranes=cranes)
    assert np.flatnonzero(together.time == 0.0).tolist() == begun


def test_a_target_replaces_the_reference(tmp_path: Path) -> None:
    target = np.array([1.2, 0.5, -0.6])
    crane, cranes = open_run(moving()), open_runs([moving()] * 2)
    crane.reset(seed=1, target=target)
    cranes.reset(seeds=[1, 1], targets=[target, target + 0.1])
    crane.step([0.0, 0.0, 0.0], samples=300)
    cranes.step(np.zeros((2, 3)), samples=300)
    expected = np.concatenate([target, np.zeros(12)])
    assert np.array_equal(crane.reference, expected)
    assert np.array_equal(cranes.references[0], expected)
    assert np.array_equal(cranes.references[1, :3], target + 0.1)
    run = crane.recorded()
    assert np.array_equal(run.reference, np.tile(expected, (300, 1)))
    assert run.block("error")[:, :3] == pytest.approx(target - run.load_position, abs=1e-12)
    cranectl.write_log(tmp_path / "target.mcap", [run])  # which refuses what its scenario does not say
    crane.reset()
    assert not np.array_equal(crane.reference[:3], target)


def test_measurements_are_those_of_a_controller() -> None:
    crane = open_run(moving(*EFFECTS), plant="elastic", drive="velocity")
    cranes = open_runs([moving(*EFFECTS), moving()], plant="elastic", drive="velocity")
    assert np.isnan(crane.measured[:10]).all()
    crane.step([0.1, 0.0, 0.0], samples=50)
    cranes.step([[0.1, 0.0, 0.0]] * 2, samples=50)
    assert np.array_equal(crane.measured, crane.recorded().block("measurement")[-1])
    assert np.array_equal(crane.measured, cranes.measured[0])
    other = open_run(moving(), plant="elastic", drive="velocity")
    other.step([0.1, 0.0, 0.0], samples=50)
    assert np.array_equal(cranes.measured[1], [*other.recorded().block("state")[-1], 0.0, 0.0])


@pytest.mark.parametrize("copier", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_copy_is_refused(copier: Callable[[object], object]) -> None:
    """Its compiled code would change the memory of the original."""
    for run in (open_run(moving()), open_runs([moving()])):
        with pytest.raises(TypeError, match="cannot be copied"):
            copier(run)


def test_an_unknown_plant_or_drive_is_refused() -> None:
    for arguments in ({"plant": "paper"}, {"drive": "steam"}):
        with pytest.raises(cranectl.InputError, match="unknown"):
            open_run(moving(), **arguments)


def test_what_a_run_returns_can_be_changed_without_harm() -> None:
    run, cranes = open_run(moving(), drive="velocity"), open_runs([moving()] * 2, drive="velocity")
    run.step([0.1, 0.0, 0.0], 10)
    cranes.step([[0.1, 0.0, 0.0]] * 2, 10)
    for source, names in (
        (run, ("state", "measured", "load", "reference")),
        (cranes, ("states", "measured", "loads", "tensions", "references", "time")),
    ):
        for name in names:
            returned = getattr(source, name)
            before = returned.copy()
            returned[:] = 7.0
            assert np.array_equal(getattr(source, name), before), name
    returned = run.recorded().table
    returned[:] = 7.0
    assert not (run.recorded().table == 7.0).any()


@pytest.mark.parametrize("plant", PLANTS[1:])
def test_a_run_with_a_hook_begins_where_it_can_and_stops_where_it_cannot_go(plant: str) -> None:
    """The rig's shortest rope of 0.05 m ends above the hook; the rope with which the run begins does not."""
    scenario = moving("effects.body={}", "workspace.on_exit='stop'", "disturbances=[]")
    assert scenario.effects.body is not None
    hook = scenario.effects.body.hook_offset
    assert hook > scenario.rig.rope_range[0]
    crane = open_run(scenario, plant=plant, drive="velocity")
    state = crane.step([0.0, 0.0, -0.3], samples=5000)
    assert crane.status == RunStatus.WORKSPACE_LEFT
    assert state[4] == pytest.approx(hook, abs=1e-3)
    with pytest.raises(cranectl.InputError, match="hook_offset"):
        crane.reset([1.0, 0.0, 0.77, 0.0, 0.9 * hook, 0.0, 0.0, 0.0, 0.0, 0.0])
    drawn = [crane.reset(seed=seed)[4] for seed in range(20)]
    assert min(drawn) > hook
