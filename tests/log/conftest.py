"""A log that many tests read, cut, corrupt or send: 0.3 s of both plants in several chunks."""

from pathlib import Path

import pytest

from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run


@pytest.fixture(scope="session")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    overrides = ["duration=0.3", "disturbances.0.start=0.1", "disturbances.1.start=0.2"]
    scenario = load_scenario("fixed-position", overrides=overrides)
    runs = [simulate_run(scenario, plant=plant) for plant in ("analytic", "mujoco")]
    return write_log(tmp_path_factory.mktemp("logs") / "small.mcap", runs)


@pytest.fixture(scope="session")
def runs(log: Path) -> dict[str, Run]:
    return read_log(log)
