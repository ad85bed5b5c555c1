"""States, runs and fixtures that many tests share."""

import functools
import gc
import logging
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
from cranectl.plants import registry
from cranectl.scenario import Scenario
from cranectl.scenario.load import ScenarioFile, scenario_names
from cranectl.simulate import Run, simulate_run

ROOT = Path(__file__).parent.parent
PLANTS = registry.PLANTS.by_default  # plants that need extra packages have their own tests
PAIR = ("analytic", "mujoco")
ALL_SCENARIOS = scenario_names()
ALL_CONTROLLERS = CONTROLLERS
STILL = np.zeros(6)  # no wind, and no force on the load


def controllers_of(scenario: str) -> tuple[str, ...]:
    """Return the controllers with which `validate` runs a shipped scenario: the flat family, or its own."""
    own = ScenarioFile.read(scenario).controller.name
    return ALL_CONTROLLERS if own in ALL_CONTROLLERS else (own,)


def pytest_collection_finish() -> None:
    """Search what was imported and collected for garbage only once: a tenth of the time goes there."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


def random_states(n: int, seed: int = 0) -> np.ndarray:
    """Return random states of the operating envelope, shape (n, 10), in the order of SignalGroup.STATE."""
    rng = np.random.default_rng(seed)
    low = [0.0, -1.0, 0.0, -1.0, 0.1, -0.5, -0.8, -2.0, -0.8, -2.0]
    high = [2.0, 1.0, 1.54, 1.0, 1.4, 0.5, 0.8, 2.0, 0.8, 2.0]
    return rng.uniform(low, high, size=(n, 10))


def split(state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinates and their rates, each in the order x_c, y_c, l, alpha, beta."""
    return state[0::2], state[1::2]


@functools.cache
def closed_loop(scenario: str, controller: str, plant: str, drive: str = "ideal", *overrides: str) -> Run:
    """Simulate a whole run, once per process."""
    chosen = load_scenario(scenario, overrides=overrides)
    return simulate_run(chosen, plant=plant, drive=drive, controller=controller)


def cut(run: Run, samples: int, **changes: Any) -> Run:
    """Return a run with only its first samples, and with other `changes` of its fields."""
    return replace(
        run, time_ns=run.time_ns[:samples], table=run.table[:samples], reference=run.reference[:samples],
        **changes,
    )  # fmt: skip


@pytest.fixture
def in_empty_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Change to an empty directory, for tests that run commands."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def no_model_afterwards() -> Iterator[None]:
    """Forget the model files that a test has named."""
    yield
    registry.PLANTS.forget_model_files()


def short_scenario() -> Scenario:
    """Return a disturbed scenario of half a second, for tests that need any run."""
    return load_scenario(
        "fixed-position", overrides=["duration=0.5", "disturbances.0.start=0.1", "disturbances.1.start=0.2"]
    )


@pytest.fixture(scope="session")
def short() -> Scenario:
    """Return `short_scenario`."""
    return short_scenario()


@pytest.fixture
def cluster() -> "Iterator[Any]":
    """Start a cluster with workers in threads, which start faster than processes and behave the same."""
    from distributed import LocalCluster  # of an extra

    from cranectl.campaign.cluster import NO_DASHBOARD

    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        **NO_DASHBOARD,
        memory_limit=0,
        silence_logs=logging.CRITICAL,
    ) as cluster:
        yield cluster
