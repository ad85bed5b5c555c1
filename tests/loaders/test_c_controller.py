"""What a controller in C declares of tuning, size and period; libraries built before it could."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.controllers.controller import Parameter
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.loaders.c_controller import HEADER
from cranectl.loaders.opening import open_controller
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from tests.benchmark.linear_loop import nominal_at
from tests.loaders.controller_files import built

DAMPING = Parameter("damping", 8.0, "1/s", "damper", 0.0, 1e4)
STIFFNESS = Parameter("stiffness", 16.0, "1/s^2", "spring", 0.0, 1e4)


def test_it_says_where_to_search_and_how_its_numbers_go_with_size(tmp_path: Path) -> None:
    name = open_controller(str(built(tmp_path, tuning=", {2.0, 100.0}, -1.0")))
    searched = Parameter(
        "stiffness", 16.0, "1/s^2", "spring", 0.0, 1e4, search=(2.0, 100.0), length_power=-1.0
    )
    assert ALL_CONTROLLERS[name].parameters == (searched, DAMPING)
    design = ALL_CONTROLLERS.design(name, load_scenario("ship-to-shore"))
    assert design.parameters == {"stiffness": pytest.approx(16.0 * 1.4 / 40.0, rel=5e-3), "damping": 8.0}


SEARCHES = ("3.0, 0.3", "-1.0, 1.0", "1.0, 1.0 / 0.0", "0.0 / 0.0, 1.0", "1.0, 1.0")
PERIODS = ("-0.01", "1e-9", "1e9", "0.0 / 0.0", "1.0 / 0.0")
REFUSED = [
    *(("tuning", f", {{{bounds}}}", "search of stiffness") for bounds in SEARCHES),
    *(("more", f", .period = {period}", r"c-servo\.period = .*\nallowed:.* from 1e-06 to 600, or none")
      for period in PERIODS),
    ("more", ', .reads = "gravity mass"', "reads names 'mass', allowed is gravity, bridge_mass"),
]  # fmt: skip


@pytest.mark.parametrize(("part", "text", "found"), REFUSED)
def test_what_cannot_be_declared_is_refused(part: str, text: str, found: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=found):
        open_controller(str(built(tmp_path, **{part: text})))


@pytest.mark.parametrize("reads", ["gravity load_mass", "gravity", ""])
def test_a_library_gets_what_it_declares_to_read(reads: str, tmp_path: Path) -> None:
    """The mass of the load is its third parameter; what it did not declare is NaN."""
    law = ALL_CONTROLLERS[open_controller(str(built(tmp_path, more=f', .reads = "{reads}"')))]
    assert law.reads == tuple(reads.split())
    nominal = nominal_at(law, 0.8)
    given = law.prepare(nominal)[0][2]
    assert given == nominal.rig.load_mass if "load_mass" in reads else np.isnan(given)


MASSES = {
    "gravity": 9.7, "bridge_mass": 6.5, "trolley_mass": 2.25, "trolley_motor_mass": 3.5, "winch_mass": 0.75,
    "load_mass": 1.25,
}  # fmt: skip


@pytest.mark.parametrize("name", MASSES)
def test_a_library_gets_each_number_of_the_crane(name: str, tmp_path: Path) -> None:
    law = ALL_CONTROLLERS[open_controller(str(built(tmp_path, read_mass=name)))]
    nominal = nominal_at(law, 0.8)
    rig = nominal.rig.model_copy(update=MASSES)
    assert law.prepare(nominal._replace(rig=rig))[0][2] == MASSES[name]


@pytest.mark.parametrize(("every", "control"), [(1, 0.01), (2, 0.005)])
def test_a_library_that_was_made_for_a_period_runs_with_no_other(
    every: int, control: float, tmp_path: Path
) -> None:
    name = open_controller(str(built(tmp_path, declared=f"D.every = {every};", more=", .period = 0.01f")))
    short = ["duration=0.1", "disturbances=[]", "reference.segments=[]"]
    with pytest.raises(InputError) as raised:
        simulate_run(load_scenario("fast-diagonal", overrides=short), plant="analytic", controller=name)
    assert f"made for steps of 0.01 s, this run gives it steps of {0.001 * every:g} s" in str(raised.value)
    assert f"control.period = {control}" in raised.value.allowed
    assert f"--set control.period={control} " in raised.value.remedy
    other = load_scenario("fast-diagonal", overrides=[*short, f"control.period={control}"])
    assert simulate_run(other, plant="analytic", controller=name).status == RunStatus.COMPLETED


@pytest.mark.usefixtures("in_empty_directory")
def test_generated_code_states_its_sample_time(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "generated-controller", "embedded"]) == 0
    flags = ["-O2", "-shared", "-fPIC", "-ffp-contract=off"]
    subprocess.run(["cc", *flags, "-o", "embedded.so", "embedded.c"], check=True)
    run = ["run", "fast-diagonal", "--controller", "embedded.so", "--plants", "analytic"]
    assert main([*run, "--set", "control.period=0.01"]) == 2
    output = capsys.readouterr().err
    assert "embedded was made for steps of 0.001 s, this run gives it steps of 0.01 s" in output
    assert main([*run, "--set", "control.period=0.001"]) == 0


def test_the_header_names_every_status_that_a_step_may_return() -> None:
    found = re.findall(r"CRANECTL_(\w+) = (\d+)", HEADER.read_text(encoding="utf-8"))
    wanted = [status for status in RunStatus if status <= RunStatus.NON_FINITE]
    assert [(name, int(number)) for name, number in found] == [
        (status.name, status.value) for status in wanted if status != RunStatus.COMPLETED
    ]
