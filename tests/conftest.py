"""Shared states and runs."""

import functools
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does; before NumPy is loaded

import numpy as np
import pytest

from cranectl.design import CONTROLLERS
from cranectl.planning import load_scenario
from cranectl.plants.registry import default_plants
from cranectl.scenario import Scenario
from cranectl.scenario.load import scenario_names
from cranectl.simulate import Run, simulate_run
from tests import reads

ROOT = Path(__file__).parent.parent
PLANTS = default_plants()  # those of extras have tests of their own
PAIR = ("analytic", "mujoco")
ALL_SCENARIOS = scenario_names()
ALL_CONTROLLERS = CONTROLLERS
STILL = np.zeros(6)  # air, and no force on the load


def random_states(n: int, seed: int = 0) -> np.ndarray:
    """Regular states of the operating envelope, shape (n, 10), order of signals.STATE."""
    rng = np.random.default_rng(seed)
    low = [0.0, -1.0, 0.0, -1.0, 0.1, -0.5, -0.8, -2.0, -0.8, -2.0]
    high = [2.0, 1.0, 1.54, 1.0, 1.4, 0.5, 0.8, 2.0, 0.8, 2.0]
    return rng.uniform(low, high, size=(n, 10))


def split(state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(q, qd) in the order x_c, y_c, l, alpha, beta."""
    return state[0::2], state[1::2]


@functools.cache
def closed_loop(scenario: str, controller: str, plant: str, drive: str = "ideal") -> Run:
    """A full run, computed once per process."""
    return simulate_run(load_scenario(scenario), plant=plant, drive=drive, controller=controller)


def cut(run: Run, samples: int, **changes: Any) -> Run:
    """The first samples of a run, and what else is said of it then."""
    return replace(
        run, time_ns=run.time_ns[:samples], table=run.table[:samples], reference=run.reference[:samples],
        **changes,
    )  # fmt: skip


if reads.LISTED:
    reads.watch()

    @pytest.fixture(scope="session", autouse=True)
    def _reads_what_is_listed() -> Iterator[None]:
        """Fail where a test reads a file that `.ci/proven.py` would not look at for changes."""
        yield
        unlisted = sorted(reads.unlisted())
        assert not unlisted, f"name these in SETS of .ci/proven.py: {', '.join(unlisted)}"


@pytest.fixture
def in_empty_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """For `pytestmark` of files that run commands."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def short() -> Scenario:
    """A disturbed half second, for tests that only need some run."""
    return load_scenario(
        "fixed-position", overrides=["duration=0.5", "disturbances.0.start=0.1", "disturbances.1.start=0.2"]
    )
