"""A failure of the machine, such as a killed process, is never a result of the controller."""

from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

import pytest

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.table import Row
from cranectl.campaign.worker import PreparedCampaign
from cranectl.campaign.workers import Children, ChildWorker, run_batches
from cranectl.loaders.opening import close_controllers, open_controller
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run
from cranectl.support.children import Timeout
from cranectl.support.errors import MachineError
from cranectl.tools.benchmark.results import run_trials
from cranectl.tools.benchmark.trials import Trial
from tests.campaign.campaigns import campaign, fixed
from tests.loaders.controller_files import LAW

SHORT = ["duration=3.2", "disturbances=[]"]
# A file holds the number of failures that are left; `failing` returns True if there must be another one.
COUNTED = """
import os, signal
from multiprocessing import parent_process
from pathlib import Path

def failing():
    left = int(Path({counter!r}).read_text())
    if left and (parent_process() is not None or {always}):
        Path({counter!r}).write_text(str(left - 1))
    return left > 0 and (parent_process() is not None or {always})
"""
LOADING = """
if failing():
    raise MemoryError("for what it loads")
"""
STEPPING = """
def broken(parameters, measured, reference, memory, command):
    memory[5] += 1.0
    if memory[5] == 3.0 and str({}) and failing():
        os.kill(os.getpid(), signal.SIGKILL)
    return damper(parameters, measured, reference, memory, command)
"""
ACTIONS = {"loading": LOADING + "broken = interpreted\n", "stepping": STEPPING}


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    yield
    close_controllers()


@pytest.fixture
def failing(tmp_path: Path) -> Callable[..., str]:
    """Return a function that opens a controller whose process fails `times` times during an `action`."""

    def opened(action: str, times: int, *, always: bool = False) -> str:
        counter, file = tmp_path / "left", tmp_path / "own" / "law.py"
        file.parent.mkdir(exist_ok=True)
        counter.write_text(str(times))
        file.write_text(LAW + COUNTED.format(counter=str(counter), always=always) + ACTIONS[action])
        return open_controller(f"{file}:broken")

    return opened


def of(name: str) -> Campaign:
    return campaign({"rig.load_mass": fixed(0.8)}, controllers=[name], plants=["analytic"], runs=1, set=SHORT)


def rows(campaign_to_run: Campaign, timeout: float = 1e9) -> list[Row]:
    with Children() as children:
        worker = ChildWorker(PreparedCampaign(campaign_to_run), children, timeout=timeout)
        try:
            return worker.run_batch(Batch("analytic", campaign_to_run.settings.controllers[0], 0, 1))
        finally:
            worker.close()


@pytest.mark.parametrize("action", ACTIONS)
def test_a_process_that_the_machine_ends_is_no_row_and_is_tried_again(
    action: str, failing: Callable[..., str]
) -> None:
    broken = of(failing(action, 2))
    (row,) = rows(broken)
    assert (row["status"], row["reason"]) == ("completed", "")
    close_controllers()
    with pytest.raises(MachineError, match=r"a worker (with broken ended|cannot begin)"):
        rows(of(failing(action, 9)))


def test_there_is_no_limit_of_time_until_a_run_begins(
    failing: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The clock jumps by an hour whenever it is read, so that compilation seems to take hours."""

    class Jumping(Timeout):
        def __init__(self, pid: int, seconds: float) -> None:
            hours = count()
            super().__init__(pid, seconds, lambda: 3600.0 * next(hours))

    monkeypatch.setattr("cranectl.support.children.Timeout", Jumping)
    (row,) = rows(of(failing("loading", 0)))
    assert (row["status"], row["reason"]) == ("completed", "")


def test_a_single_run_whose_process_is_killed_is_no_run(failing: Callable[..., str]) -> None:
    name = failing("stepping", 1, always=True)
    crane = load_scenario("fast-diagonal", overrides=SHORT)
    with pytest.raises(
        MachineError, match=r"the run with broken ended its process with SIGKILL, from outside"
    ):
        simulate_run(crane, plant="analytic", controller=name, drive="velocity")
    run = simulate_run(crane, plant="analytic", controller=name, drive="velocity")
    assert run.status.label == "completed"


def test_a_piece_of_a_benchmark_that_the_machine_ends_is_run_again(
    failing: Callable[..., str], tmp_path: Path
) -> None:
    name = failing("stepping", 3)
    trial = Trial("published", "analytic", "nominal", "fast-diagonal", name)
    with pytest.raises(MachineError):
        list(run_trials([trial], lambda _: of(name), tmp_path / "out", run_batches, workers=1))
    (ended,) = run_trials([trial], lambda _: of(name), tmp_path / "out", run_batches, workers=1)
    assert ended.not_run == ""
