"""The memory of a run is bounded before it begins: never too little, and only some times too much."""

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from cranectl.campaign.load import load_campaign
from cranectl.campaign.worker import PreparedCampaign
from cranectl.cases import Case
from cranectl.cli.main import main
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.simulate import RunMemory, memory, simulate_run
from cranectl.support.errors import InputError
from cranectl.tools.robustness.ladder import evaluate_levels

FINE = ("control.period=1e-6", "control.physics_step=1e-6")
ENDLESS = (*FINE, "duration=600", "disturbances=[]")
OVERHEAD = 8e6  # [bytes] of everything except arrays
SMALLEST_PART = 0.15  # of the bound, which counts four copies; runs without a signal path hold one


def scenario(*overrides: str, duration: float = 15.0) -> Scenario:
    return load_scenario("fixed-position", overrides=[f"duration={duration}", "disturbances=[]", *overrides])


def peak(work: Callable[[], object]) -> int:
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the list to which each check adds the bound of bytes that it finds."""
    needs: list[float] = []
    bound = memory._bound

    def noting_bound(scenarios: list[Scenario], columns: int) -> int:
        needs.append(bound(scenarios, columns))
        return needs[-1]

    monkeypatch.setattr(memory, "_bound", noting_bound)
    return needs


CASES = [
    ("lqr", ("analytic",), "ideal", ()),
    ("lqr", ("analytic", "elastic", "mujoco"), "ideal", ()),
    ("lqr", ("analytic", "mujoco"), "ideal", ("log.every=1",)),
    ("lqr", ("analytic", "mujoco"), "ideal", ("log.every=7",)),
    ("lqr+loop-shaping", ("elastic", "mujoco"), "velocity", ("effects={sensing={}, delay={}, wind={}}",)),
]


@pytest.mark.slow
@pytest.mark.parametrize(("controller", "plants", "drive", "overrides"), CASES)
def test_a_case_needs_at_most_the_bound_and_no_tiny_part_of_it(
    controller: str, plants: tuple[str, ...], drive: str, overrides: tuple[str, ...], tmp_path: Path,
    counted: list[float],
) -> None:  # fmt: skip
    case = Case.of(
        scenario(*overrides), controller=controller, drive=drive, plants=plants, log=tmp_path / "a.mcap"
    )  # type: ignore[arg-type]
    Case.of(scenario(*overrides, duration=0.1), controller=controller, drive=drive, plants=plants,
            log=tmp_path / "b.mcap").run()  # type: ignore[arg-type]  # fmt: skip
    counted.clear()
    used = peak(lambda: case.run())
    assert SMALLEST_PART * max(counted) < used < max(counted) + OVERHEAD


def test_a_ladder_needs_at_most_the_bound(counted: list[float]) -> None:
    long_scenario = scenario(duration=4.0)
    list(evaluate_levels(long_scenario, "lqr", top="engine"))
    counted.clear()
    assert peak(lambda: list(evaluate_levels(long_scenario, "lqr", top="engine"))) < max(counted) + OVERHEAD


@pytest.mark.usefixtures("in_empty_directory")
@pytest.mark.parametrize(
    "command",
    [
        "run fixed-position --plants analytic",
        "run fixed-position",
        "run fixed-position --drive velocity --plants mujoco",
        "ladder fixed-position",
        "live fixed-position --port 0",
    ],
)
def test_a_run_that_needs_too_much_memory_is_refused_before_it_starts(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    sets = [part for setting in ENDLESS for part in ("--set", setting)]
    codes: list[int] = []
    assert peak(lambda: codes.append(main([*command.split(), *sets]))) < 1e8
    assert codes == [2]
    message = capsys.readouterr().err
    assert "would take" in message
    assert "control.period" in message.partition("remedy:")[2]
    assert not list(Path().rglob("*.mcap"))


def test_the_remedy_for_too_much_memory_works() -> None:
    with pytest.raises(InputError, match="would take") as caught:
        simulate_run(scenario(*ENDLESS), controller="lqr")
    period = caught.value.remedy.split()[3].rstrip(",")
    RunMemory(scenario(*ENDLESS[1:], f"control.period={period}")).check_planned()


def test_the_bound_is_four_copies_of_all_columns(counted: list[float]) -> None:
    short = scenario(duration=1.0)
    RunMemory(short).check_planned()
    RunMemory(short).check_several(ALL_CONTROLLERS.design("lqr", short), 0, "nothing", columns=5)
    assert counted == [1001 * (memory.PLANNED + more) * 8 * 4 for more in (0, 5)]


def test_ten_minutes_at_a_millisecond_fit_into_memory() -> None:
    long_scenario = scenario(duration=600.0)
    design = ALL_CONTROLLERS.design("lqr", long_scenario)
    RunMemory(long_scenario).check_runs(design, "ideal", 2)
    with pytest.raises(InputError, match="fewer plants"):
        RunMemory(long_scenario).check_runs(design, "ideal", 9)


def test_the_control_periods_of_a_campaign_are_counted_together(tmp_path: Path) -> None:
    (tmp_path / "many.toml").write_text(
        'name = "many"\nscenario = "fixed-position"\ncontrollers = ["lqr"]\nruns = 1\n'
        'set = ["duration=600", "disturbances=[]", "control.physics_step=5e-5"]\n'
        '[uncertain.control.period]\ndistribution = "choice"\n'
        f"values = {[1e-3 * k for k in (1, 2, 3, 4, 5, 6, 8, 10)] + [0.0005, 0.00025, 0.0002]}\n"
        "[uncertain.rig.load_mass]\n"
        'distribution = "uniform"\nlow = 0.9\nhigh = 1.1\n'
    )
    with pytest.raises(InputError, match="would take"):
        PreparedCampaign(load_campaign(tmp_path / "many.toml"))
