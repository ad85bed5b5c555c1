"""A hidden crane that several tests identify."""

import pytest

from cranectl.simulate import Run
from cranectl.tools.measured.identification import Identification, identify
from tests.tools.measured.hidden import LAB, NUMBERS, measured_run


@pytest.fixture(scope="session")
def runs() -> list[Run]:
    return [measured_run(LAB, NUMBERS, seed) for seed in range(3)]


@pytest.fixture(scope="session")
def clean() -> Run:
    """Return a run that is not used for the identification."""
    return measured_run(LAB, NUMBERS, 50)


@pytest.fixture(scope="session")
def result(runs: list[Run]) -> Identification:
    return identify(runs, LAB)
