"""What a law in C declares of tuning and size; libraries that were built before it could."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cranectl.controllers.controller import Parameter
from cranectl.controllers.doors.c_law import HEADER
from cranectl.controllers.doors.opening import close_laws, open_law
from cranectl.controllers.registry import controller_design, load_controller
from cranectl.reference import load_scenario
from cranectl.simulate import simulate_run
from cranectl.support.errors import InputError
from tests.controllers.law_files import built

DAMPING = Parameter("damping", 8.0, "1/s", "damper", 0.0, 1e4)
STIFFNESS = Parameter("stiffness", 16.0, "1/s^2", "spring", 0.0, 1e4)


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    yield
    close_laws()


def test_it_says_where_to_search_and_how_its_numbers_go_with_size(tmp_path: Path) -> None:
    name = open_law(str(built(tmp_path, tuning=", {2.0, 100.0}, -1.0")))
    searched = Parameter(
        "stiffness", 16.0, "1/s^2", "spring", 0.0, 1e4, search=(2.0, 100.0), length_power=-1.0
    )
    assert load_controller(name).parameters == (searched, DAMPING)
    design = controller_design(name, load_scenario("ship-to-shore"))
    assert design.parameters == {"stiffness": pytest.approx(16.0 * 1.4 / 40.0, rel=5e-3), "damping": 8.0}


@pytest.mark.parametrize("bounds", ["3.0, 0.3", "-1.0, 1.0", "1.0, 1.0 / 0.0", "0.0 / 0.0, 1.0", "1.0, 1.0"])
def test_a_search_that_is_none_is_refused(bounds: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="search of stiffness"):
        open_law(str(built(tmp_path, tuning=f", {{{bounds}}}")))


def test_a_library_of_version_1_runs_as_ever(tmp_path: Path) -> None:
    """Its parameters end with their bounds, so the second one begins where it did."""
    before, _, after = HEADER.read_text(encoding="utf-8").partition("    double search[2];")
    _, end, rest = after.partition("} cranectl_parameter;")
    old = tmp_path / "old"
    old.mkdir()
    (old / HEADER.name).write_text(before.replace("CRANECTL_ABI 2", "CRANECTL_ABI 1") + end + rest)
    assert "CRANECTL_ABI 1" in (old / HEADER.name).read_text()
    runs = []
    for folder in (old, tmp_path):
        name = open_law(str(built(folder)))
        assert load_controller(name).parameters == (STIFFNESS, DAMPING)
        short = load_scenario("fast-diagonal", overrides=["duration=3.2", "disturbances=[]"])
        runs.append(simulate_run(short, plant="analytic", controller=name))
        close_laws()
    assert np.array_equal(runs[0].table, runs[1].table)
