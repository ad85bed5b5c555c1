"""Single signals, the speed of the reader, and samples between the regular ones."""

from collections.abc import Callable
from cProfile import Profile
from pathlib import Path
from pstats import Stats

import pytest
from mcap.reader import make_reader

from cranectl.log.reader import read_log, read_signal
from cranectl.log.writer import write_log
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError, LogError
from tests.conftest import closed_loop, cut
from tests.log.corruption import SIGNAL


def test_a_single_signal_equals_that_of_the_whole_log(log: Path, runs: dict[str, Run]) -> None:
    for plant, run in runs.items():
        for group in run.groups:
            for name in group.names:
                times, values = read_signal(log, f"{plant}/{group.name}.{name}")
                assert times.tobytes() == run.time.tobytes()
                assert values.tobytes() == run.signal(f"{group.name}.{name}").tobytes()


def test_a_signal_is_read_by_the_name_that_viewers_use(log: Path, runs: dict[str, Run]) -> None:
    _, reference = read_signal(log, "/reference/load.load_z")
    assert reference.tobytes() == runs["mujoco"].reference[:, 2].tobytes()
    _, difference = read_signal(log, "/diff/state.alpha")
    expected = runs["mujoco"].signal("state.alpha") - runs["analytic"].signal("state.alpha")
    assert difference.tobytes() == expected.tobytes()


@pytest.mark.parametrize(
    "name", ["mujoco/state.alfa", "mujoco/stat.alpha", "alpha", "mujoco/state", "", "mujoco/status.status"]
)
def test_an_unknown_signal_is_refused_with_suggestions(log: Path, name: str) -> None:
    with pytest.raises(InputError) as caught:
        read_signal(log, name)
    assert not isinstance(caught.value, LogError)
    assert f"unknown signal '{name}'" in caught.value.found
    assert caught.value.allowed.count("mujoco/s" if "mujoco/s" in name else "/") >= 1
    assert len(caught.value.allowed) < 500
    assert name != "mujoco/state.alfa" or caught.value.remedy == "did you mean 'mujoco/state.alpha'?"


def calls(function: Callable[[], object]) -> int:
    """Return how many functions a call calls: its work, whatever the machine does besides."""
    profile = Profile()
    profile.runcall(function)
    return int(Stats(profile).total_calls)  # type: ignore[attr-defined]  # told in its documentation alone


@pytest.mark.slow
def test_reading_is_much_faster_than_with_mcap(tmp_path: Path) -> None:
    """Reading 25 s of both plants takes less than a twentieth of the 6 million calls of mcap's iterator.

    A single signal takes less than a fortieth. Measured were a 48th and a 62nd; of the time, 1/11 and 1/19.
    """
    pair = [closed_loop("settled-trajectory", "lqr", plant) for plant in ("analytic", "mujoco")]
    path = write_log(tmp_path / "a.mcap", pair)
    read_log(path)  # compiles

    def iterate() -> None:
        with path.open("rb") as stream:
            for _ in make_reader(stream).iter_messages(log_time_order=False):
                pass

    slow = calls(iterate)
    assert calls(lambda: read_log(path)) < slow / 20.0
    assert calls(lambda: read_signal(path, SIGNAL)) < slow / 40.0


def test_a_sample_between_regular_samples_has_its_reference(tmp_path: Path, short: Scenario) -> None:
    """The last sample of the shorter run may be between two regular samples of the longer one."""
    long, full = (simulate_run(short, plant=plant) for plant in ("analytic", "mujoco"))
    shorter = cut(full, 99, status=RunStatus.INTERRUPTED, end_ns=98_000_000)
    read = read_log(write_log(tmp_path / "a.mcap", [long, shorter]))["mujoco"]
    assert read.reference.shape == (len(read.time_ns), 15)
    assert read.reference.tobytes() == shorter.every(4).reference.tobytes()
