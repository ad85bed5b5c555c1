"""A loop gives the same bits in one piece, in blocks of any size, and by single samples."""

import numpy as np
import pytest

from cranectl.controllers import ALL_CONTROLLERS
from cranectl.plants import PLANTS as ALL_PLANTS
from cranectl.scenario import Scenario
from cranectl.simulate import Loop
from cranectl.simulate.plan import Plan
from cranectl.simulate.prepared import PreparedController
from cranectl.simulate.run import Run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from tests.conftest import PLANTS, closed_loop

CONTROLLER, DRIVE = "lqr+loop-shaping", "velocity"
LIMITS = "effects.limits={force=[1e9,1e9,1e9], velocity=[0.2,0.2,0.2]}"
EFFECTS = ["effects.delay.seconds=0.003", "effects.sensing.seed=3", LIMITS]
STOPPING = ["rig.bridge_range=[0.9, 1.05]", "workspace.on_exit='stop'"]
SIZES = [1, 7, 1000]
ROWS = 1000  # of records that are overwritten


def make_run(*overrides: str, plant: str = "analytic") -> Run:
    """Return a run of 1.2 s, whose load is pushed."""
    pushed = "disturbances=[{joint='beta', start=0.1, magnitude=3.0}]"
    return closed_loop("fixed-position", CONTROLLER, plant, DRIVE, "duration=1.2", pushed, *overrides)


def make_loop(scenario: Scenario, plant: str = "analytic", *, endless: bool = False, rows: int = 0) -> Loop:
    """Return a new loop; `rows` is the number of rows of its records, or 0 for new arrays at each call."""
    design, plan = ALL_CONTROLLERS.design(CONTROLLER, scenario), Plan.of(scenario)
    controller = PreparedController.of(scenario, design, DRIVE, plan)
    crane = ALL_PLANTS.make(plant, scenario, DRIVE)
    return Loop(plan, crane, controller, endless=endless, records=controller.records(rows) if rows else None)


def in_blocks(loop: Loop, size: int) -> tuple[bytes, bytes]:
    """Return the bytes of times and signals of a run in blocks of `size` samples."""
    times, tables = [], []
    while not loop.is_finished:
        time_ns, record, reference, path_record = loop.advance(size)
        assert (
            reference.tobytes() == loop.plan.reference[loop.samples - len(record) :][: len(record)].tobytes()
        )
        times.append(time_ns.copy())
        path = None if loop.path is None else path_record
        tables.append(Run.whole_record(loop.scenario, record, path, loop.plan.wind[: len(record)]).copy())
    return np.concatenate(times).tobytes(), np.vstack(tables).tobytes()


@pytest.mark.parametrize("overrides", [[], EFFECTS, STOPPING], ids=["plain", "effects", "stopping"])
@pytest.mark.parametrize("plant", PLANTS)
def test_a_run_has_the_same_bits_in_blocks_of_any_size(plant: str, overrides: list[str]) -> None:
    run = make_run(*overrides, plant=plant)
    assert run.status == (RunStatus.WORKSPACE_LEFT if overrides == STOPPING else RunStatus.COMPLETED)
    assert run.has("measurement") == (overrides == EFFECTS)
    for size in SIZES:
        for rows in (0, ROWS):
            loop = make_loop(run.scenario, plant, rows=rows)
            assert in_blocks(loop, size) == (run.time_ns.tobytes(), run.table.tobytes())
            assert (loop.status, loop.end_ns, loop.samples) == (run.status, run.end_ns, len(run.table))
            assert len(loop.advance(size)[0]) == 0, "a finished loop goes on"


@pytest.mark.parametrize("plant", ["mujoco", "elastic"])
def test_a_rope_that_becomes_short_is_judged_with_the_damping_of_its_start(plant: str) -> None:
    """From 1.2 m to 0.5 m, the time constant of a much damped rope becomes shorter than the step allows."""
    rope = "effects.rope={stiffness=4e3, damping_ratio=5.0, mass=0.0}"
    make_run(rope, "control.physics_step=0.0005", plant=plant)
    with pytest.raises(InputError, match=r"0\.5 m of rope"):
        closed_loop("fast-diagonal", CONTROLLER, plant, DRIVE, rope, "control.physics_step=0.0005")


@pytest.mark.parametrize("size", SIZES)
def test_an_endless_loop_has_the_bits_of_a_run_and_goes_on_after_it(size: int) -> None:
    run = make_run(*EFFECTS)
    loop = make_loop(run.scenario, endless=True)
    loop.origin_ns = 5
    parts = [loop.part(size) for _ in range(-(-len(run.table) // size) + 3)]
    table = np.vstack([part.table for part in parts])
    assert len(table) > len(run.table)
    assert table[: len(run.table)].tobytes() == run.table.tobytes()
    assert loop.status == RunStatus.RUNNING
    assert parts[-1].end_ns == parts[-1].time_ns[-1] == 5 + (len(table) - 1) * run.scenario.period_ns


def test_the_rest_of_a_run_has_the_bits_of_the_run() -> None:
    run = make_run(*EFFECTS)
    loop = make_loop(run.scenario)
    loop.advance(123)
    rest = loop.run()
    assert rest.table.tobytes() == run.table[123:].tobytes()
    assert rest.time_ns.tobytes() == run.time_ns[123:].tobytes()
    assert (rest.status, rest.end_ns) == (run.status, run.end_ns)


@pytest.mark.parametrize("part", ["memory", "integral", "path"])
def test_a_change_of_what_a_loop_keeps_changes_the_bits(part: str) -> None:
    """Otherwise the comparisons above would not show that blocks hand it on."""
    loops = [make_loop(make_run(*EFFECTS).scenario) for _ in range(2)]
    for loop in loops:
        loop.advance(500)
    assert loops[1].path is not None
    kept = {"memory": loops[1].memory, "integral": loops[1].inputs.integral, "path": loops[1].path.estimate}
    kept[part][:] += 1e-9
    assert len({in_blocks(loop, 7)[1] for loop in loops}) == 2
