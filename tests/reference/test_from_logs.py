"""Logs as references, and logs that contain the file of their reference."""

import contextlib
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cranectl.campaign.definition import sampled_scenario
from cranectl.cli.main import main
from cranectl.log.description import LogDescription
from cranectl.log.export import export_table, exporters
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.reference import Trajectory
from cranectl.scenario import Scenario
from cranectl.scenario.effects import NO_EFFECTS
from cranectl.scenario.segments import Spline
from cranectl.simulate import Run, simulate_run
from cranectl.support.errors import InputError
from cranectl.tools.robustness.levels import replace_effects
from tests.campaign.campaigns import MASS, campaign
from tests.reference.recordings import SAMPLES, START, TO, motion, scenario_of, write_csv

OF_LOG = "kind = 'samples'\nfile = 'run.mcap'\n"


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Run]:
    directory = tmp_path_factory.mktemp("logged")
    scenario = scenario_of(directory, f"kind = 'line'\nto = {TO.tolist()}\nduration = 6.0", duration=8.0)
    run = simulate_run(scenario, plant="analytic")
    return write_log(directory / "run.mcap", [run]).parent, run


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Run]:
    directory = tmp_path_factory.mktemp("recorded")
    write_csv(directory / "teach.csv", motion(2.0, noise=1e-4))
    return directory, simulate_run(scenario_of(directory, SAMPLES, duration=2.0), plant="analytic")


@pytest.mark.parametrize(
    ("topic", "position", "snap"),
    [
        # Knots are refined to 0.1 µm; z'''' errs by 8 % of its peak in the span where the motion ends, since
        # the fifth derivative of the time law jumps there.
        ("reference/load", 5e-7, 0.1),
        # The plant's own motion: sampling at 1 ms costs 31 µm.
        ("analytic/load", 4e-5, 0.1),
    ],
)
def test_the_motion_in_a_log_is_followed_again(
    logged: tuple[Path, Run], topic: str, position: float, snap: float
) -> None:
    directory, run = logged
    scenario = scenario_of(directory, f"{OF_LOG}topic = '{topic}'")
    rows = Trajectory.of(scenario.reference).sample(run.time_ns / 1e9)
    assert rows[:, :3] == pytest.approx(run.reference[:, :3], abs=position)
    peak = np.abs(run.reference[:, 12:]).max()
    assert np.abs(rows[:, 12:] - run.reference[:, 12:]).max() < snap * peak
    assert simulate_run(scenario, plant="analytic").status.label == "completed"


def test_an_unknown_topic_is_refused_with_the_topics_of_loads(logged: tuple[Path, Run]) -> None:
    with pytest.raises(InputError) as error:
        scenario_of(logged[0], f"{OF_LOG}topic = 'analytic/laod'")
    assert "unknown topic 'analytic/laod'" in error.value.found
    assert error.value.allowed == "analytic/flat_output, analytic/load, analytic/state, reference/load"
    assert "'analytic/load'?" in error.value.remedy


def test_the_log_contains_the_file_and_replays_to_the_bit(recorded: tuple[Path, Run], tmp_path: Path) -> None:
    directory, run = recorded
    content = (directory / "teach.csv").read_bytes()
    first = write_log(tmp_path / "first.mcap", [run])
    again = read_log(first)["analytic"].scenario
    assert again == run.scenario
    assert list(again.held_files.values()) == [content]
    second = write_log(tmp_path / "second.mcap", [simulate_run(again, plant="analytic")])
    assert second.read_bytes() == first.read_bytes()
    (name,) = (name for name in LogDescription.of(second).attachments if name.startswith("reference/"))
    assert name.endswith("-teach.csv")


def test_a_reference_from_a_log_keeps_only_the_columns_that_it_uses(
    logged: tuple[Path, Run], tmp_path: Path
) -> None:
    scenario = scenario_of(logged[0], OF_LOG)
    (content,) = scenario.held_files.values()
    assert len(content) < 0.2 * (logged[0] / "run.mcap").stat().st_size
    (tmp_path / "columns.parquet").write_bytes(content)
    segment = "kind = 'samples'\nfile = 'columns.parquet'\nunits = {time = 's', length = 'm'}"
    again = scenario_of(tmp_path, segment).reference.segments[0]
    taken = scenario.reference.segments[0]
    assert isinstance(again, Spline)
    assert isinstance(taken, Spline)
    assert again.coefficients == taken.coefficients


def table_and_back(scenario: Scenario) -> Scenario:
    read = Scenario.from_table(scenario.model_dump(mode="json"), "a table")
    return read.with_files(scenario.held_files)


def sampled(scenario: Scenario) -> Scenario:
    return sampled_scenario(replace(campaign({"rig.load_mass": MASS}), nominal=scenario), [1.2])


@pytest.mark.parametrize(
    "copy",
    [
        lambda scenario: pickle.loads(pickle.dumps(scenario)),
        lambda scenario: replace_effects(scenario, NO_EFFECTS),
        table_and_back,
        sampled,
    ],
    ids=["to a worker", "with effects", "by a table", "to a sample"],
)
def test_the_file_stays_with_copies_of_its_scenario(
    recorded: tuple[Path, Run], copy: Callable[[Scenario], Any]
) -> None:
    scenario = recorded[1].scenario
    assert copy(scenario).held_files == scenario.held_files != {}


def test_the_result_of_a_campaign_contains_the_file(recorded: tuple[Path, Run], tmp_path: Path) -> None:
    line = ["campaign", "run", "c.toml", "--out", "r"]
    with contextlib.chdir(tmp_path):
        Path("c.toml").write_text(
            f'name = "c"\nscenario = "{recorded[0] / "taken.toml"}"\ncontrollers = ["lqr"]\nruns = 2\n'
            'plants = ["analytic"]\n'
            'uncertain.rig.load_mass = {distribution = "uniform", low = 0.5, high = 1.5}\n'
            'set = ["duration=2.0"]\n'
        )
        assert main(line) == 0
        assert main(["campaign", "replay", "r", "--run", "1", "--out", "l"]) == 0
        (log,) = Path("l").glob("*.mcap")
        assert read_log(log)["analytic"].scenario.held_files == recorded[1].scenario.held_files != {}
        assert main([*line, "--overwrite"]) == 0
        assert len(list(Path("r/reference").iterdir())) == 1


def test_info_names_the_file_of_the_reference(
    recorded: tuple[Path, Run], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = write_log(tmp_path / "run.mcap", [recorded[1]])
    assert main(["info", str(log)]) == 0
    output = " ".join(capsys.readouterr().out.split())
    (spline,) = recorded[1].scenario.reference.segments
    assert isinstance(spline, Spline)
    assert spline.fit is not None
    assert "segment 0: samples from teach.csv (SHA-256" in output
    assert f"held here): 101 samples, {spline.fit.spans} spans; samples left out are" in output
    assert list(spline.coefficients[0]) == START


def test_an_exported_table_needs_no_units(tmp_path: Path) -> None:
    """The metadata of a Parquet export replace `units`."""
    write_csv(tmp_path / "teach.csv", motion())
    taken = scenario_of(tmp_path, SAMPLES)
    run = simulate_run(taken, plant="analytic", controller="lqr")
    exporters()["parquet"].save(export_table({"analytic": run}), tmp_path / "run.parquet")
    columns = ", ".join(f"{axis} = 'reference.load_{axis}'" for axis in "xyz")
    again = scenario_of(tmp_path, f"kind = 'samples'\nfile = 'run.parquet'\ncolumns = {{{columns}}}")
    time = np.linspace(0.0, 8.0, 81)
    second, first = (Trajectory.of(s.reference).sample(time)[:, :3] for s in (again, taken))
    assert second == pytest.approx(first, abs=1e-6)
