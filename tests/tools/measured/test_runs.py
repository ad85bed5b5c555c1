"""Everything that reads logs takes the log of a measured crane, also one without angles."""

import io
import json
import re
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.compare.runs import compare_runs
from cranectl.log.reader import read_log
from cranectl.log.scene import MAX_FRAMES, MAX_TRAILS, scene_streams
from cranectl.log.writer import write_log
from cranectl.simulate import Run, simulate_run
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from cranectl.tools.measured.assembly import _slopes
from cranectl.tools.measured.comparison import predict
from cranectl.tools.measured.experiment import CHANNELS
from cranectl.tools.measured.replay import Replay, _parted, default_replay, with_longer_steps
from tests.cli.suggestions import execute, suggested_commands
from tests.plants.own_models import MODELS
from tests.reference.recordings import scenario_of
from tests.tools.measured import hidden
from tests.tools.measured.crane import COMMANDS, columns, imported, mapping, truth, write_csv

MAP = """
name = "monday"
commands = "velocity"
[time]
column = "t"
[signals]
bridge_position = {column = "x", unit = "m"}
trolley_position = {column = "y", unit = "m"}
rope_length = {column = "l", unit = "m"}
bridge_command = {column = "wx", unit = "m/s"}
trolley_command = {column = "wy", unit = "m/s"}
rope_command = {column = "wl", unit = "m/s"}
"""
ANGLES = """
alpha = {column = "alpha", unit = "rad"}
beta = {column = "beta", unit = "rad"}
"""


class Result(NamedTuple):
    exit_code: int
    output: str


def cranectl(*arguments: str | Path) -> Result:
    """Run a command, and return its exit code with all that it prints."""
    output = io.StringIO()
    with redirect_stdout(output), redirect_stderr(output):
        code = main([str(argument) for argument in arguments])
    assert code in (0, 2), output.getvalue()
    return Result(code, output.getvalue())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the log of a measured crane, and one of a crane without measured angles."""
    folder = tmp_path_factory.mktemp("measured")
    write_csv(folder / "a.csv", columns())
    for name, text in (("whole", MAP + ANGLES), ("axes", MAP)):
        (folder / f"{name}.toml").write_text(text)
        arguments = ("--map", folder / f"{name}.toml", "--out", folder / f"{name}.mcap")
        assert cranectl("log", "import", folder / "a.csv", *arguments).exit_code == 0
    return folder


def measured_run(tmp_path: Path, step: int = 1) -> Run:
    path = write_csv(tmp_path / "a.csv", columns(step))
    return imported(path, mapping=mapping(COMMANDS, commands="velocity")).run


@pytest.mark.parametrize("name", ["whole", "axes"])
def test_a_log_has_the_same_run_and_says_where_it_is_from(name: str, folder: Path) -> None:
    run = read_log(folder / f"{name}.mcap")["measured"]
    assert not run.has_reference
    assert run.model.startswith("measured: a.csv (SHA-256 ")
    write_log(folder / "again.mcap", [run])
    assert (folder / "again.mcap").read_bytes() == (folder / f"{name}.mcap").read_bytes()
    assert np.isfinite(run.table).all()


def test_the_same_files_give_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    arguments = ("--map", folder / "whole.toml", "--out", tmp_path / "b.mcap")
    cranectl("log", "import", folder / "a.csv", *arguments)
    assert (tmp_path / "b.mcap").read_bytes() == (folder / "whole.mcap").read_bytes()


@pytest.mark.parametrize("name", ["whole", "axes"])
def test_commands_that_read_logs_take_it(name: str, folder: Path) -> None:
    log = folder / f"{name}.mcap"
    assert "measured     completed at 10 s" in cranectl("info", log).output
    cranectl("report", log, "--out", folder / f"{name}.html")
    page = (folder / f"{name}.html").read_text()
    assert "The run has no reference: there is nothing to judge." in page
    assert "tracking error, RMS" not in page
    assert cranectl("log", "export", log, "--out", folder / f"{name}.parquet").exit_code == 0
    assert cranectl("log", "layout", "single", folder / f"{name}.json", "--log", log).exit_code == 0


def test_what_needs_the_load_refuses_a_run_without_angles(folder: Path) -> None:
    log = folder / "axes.mcap"
    for arguments in (("render", log, folder / "a.png"), ("compare", log)):
        result = cranectl(*arguments)
        assert result.exit_code == 2
        assert "map the columns of both angles" in result.output


def test_a_layout_shows_only_topics_of_the_log(folder: Path) -> None:
    log = folder / "whole.mcap"
    cranectl("log", "layout", "single", folder / "view.json", "--log", log)
    layout = (folder / "view.json").read_text()
    assert "/measured/state" in layout
    for absent in ("/measured/error", "/reference/load.", "/measured/input", "rope_tension"):
        assert absent not in layout


def test_drawings_of_an_hour_take_little_memory(tmp_path: Path) -> None:
    hour = np.arange(0.0, 3600.0, 0.1)
    table = {
        name: np.interp(np.abs(hour % 20.0 - 10.0), columns()["t"], values)
        for name, values in columns().items()
    }
    path = write_csv(tmp_path / "a.csv", table | {"t": hour})
    run = imported(path, mapping=mapping(check_physics=False)).run
    sizes = {stream.topic: len(stream.time_ns) for stream in scene_streams([run])}
    assert 9_000 < sizes["/measured/trail"] <= MAX_TRAILS + 1
    assert 15_000 < sizes["/measured/rope"] <= 1.5 * MAX_FRAMES  # every whole number of samples


@pytest.mark.parametrize("period", [0.033333333, 0.041666667, 0.016666667, 0.04])
def test_lines_between_commands_suit_every_period(period: float, tmp_path: Path) -> None:
    """Parts of 33333333 ns had steps of 5 us, and ends between two samples contradicted the log."""
    write_csv(tmp_path / "a.csv", columns(4))
    (tmp_path / "slow.toml").write_text(f"period = {period}\n{MAP}{ANGLES}")
    log, out = tmp_path / "slow.mcap", tmp_path / "x.mcap"
    assert (
        cranectl("log", "import", tmp_path / "a.csv", "--map", tmp_path / "slow.toml", "--out", log).exit_code
        == 0
    )
    measured = read_log(log)["measured"]
    scenario = with_longer_steps(measured.scenario, "velocity")
    parts, finer = _parted(scenario)
    assert parts == (1 if period == 0.016666667 else 3 if period > 0.04 or period < 0.034 else 4)
    steps, usual = (s.control.period / s.control.physics_step for s in (finer, scenario))
    assert parts * steps <= 4.0 * usual
    predictions = [cranectl("compare", log, "--replay", by, "--out", out) for by in ("lines", "commands")]
    assert [prediction.exit_code for prediction in predictions] == [0, 0]
    lines, held = (float(re.findall(r"at most (\S+) mm apart", text.output)[0]) for text in predictions)
    assert lines < 0.3 * held


def test_measured_and_predicted_runs_share_one_log(folder: Path) -> None:
    log, both = folder / "whole.mcap", folder / "both.mcap"
    result = cranectl(
        "compare", log, "--plants", "mujoco,analytic", "--out", both, "--json", folder / "r.json"
    )
    assert "the loads are at most" in result.output
    predictions = json.loads((folder / "r.json").read_text())["predictions"]
    assert [prediction["plant"] for prediction in predictions] == ["mujoco", "analytic"]
    assert "measured-crane" in cranectl("info", both).output
    cranectl("report", both, "--out", folder / "both.html")
    assert "load, measured minus predicted" in (folder / "both.html").read_text()
    header = cranectl("log", "export", both, "--out", folder / "both.csv", "--signals", "*residual*")
    assert header.exit_code == 0


def test_the_model_of_the_rig_predicts_too(folder: Path, tmp_path: Path) -> None:
    """A model file has no ideal drives, with which a motion could be repeated."""
    (tmp_path / "tendon.xml").write_text((MODELS / "tendon.xml").read_text())
    (tmp_path / "own.toml").write_text('extends = "lab-rig"\nmodel = "tendon.xml"\nwinch_mass = 1e-5\n')
    log, out = tmp_path / "own.mcap", tmp_path / "own.json"
    given = ("--map", folder / "whole.toml", "--rig", tmp_path / "own.toml", "--out", log)
    assert cranectl("log", "import", folder / "a.csv", *given).exit_code == 0
    for options, plants in (
        ([], ["mujoco", "tendon"]),
        (["--replay", "motion"], ["mujoco"]),
        (["--plants", "analytic"], ["analytic"]),
    ):
        assert cranectl("compare", log, *options, "--json", out).exit_code == 0
        predictions = json.loads(out.read_text())["predictions"]
        assert [prediction["plant"] for prediction in predictions] == plants
    refused = cranectl("compare", log, "--replay", "motion", "--plants", tmp_path / "tendon.xml")
    assert refused.exit_code == 2
    assert "take --replay commands, or other --plants" in refused.output
    (tmp_path / "tendon.xml").unlink()
    assert cranectl("compare", log, "--json", out).exit_code == 0
    assert len(json.loads(out.read_text())["predictions"]) == 1


def test_replay_is_for_measured_logs_only(tmp_path: Path) -> None:
    write_log(tmp_path / "run.mcap", [truth()], every=10)
    result = cranectl("compare", tmp_path / "run.mcap", "--replay", "motion")
    assert result.exit_code == 2
    assert "leave out --replay" in result.output
    assert cranectl("compare", tmp_path / "run.mcap", tmp_path / "run.mcap").exit_code == 0


def test_commands_that_an_import_and_a_comparison_suggest_work(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log = ("--out", "measured crane.mcap")
    output = cranectl("log", "import", folder / "a.csv", "--map", folder / "whole.toml", *log).output
    output += cranectl("compare", "measured crane.mcap", "--out", "both of them.mcap").output
    commands = suggested_commands(output)
    assert [command.split()[1] for command in commands] == ["compare", "report"]
    assert [execute(command) for command in commands] == [0, 0]


@pytest.mark.parametrize(
    ("topic", "axes"),
    [
        ("measured/load", ("load.load_x", "load.load_y", "load.load_z")),
        ("measured/axes", ("axes.bridge_position", "axes.trolley_position", "axes.rope_length")),
    ],
)
def test_a_measured_path_becomes_a_reference(topic: str, axes: tuple[str, ...], tmp_path: Path) -> None:
    table = columns()
    if topic == "measured/axes":  # a load cannot stay below a trolley as fast as that of the other file
        s = table["t"] / table["t"][-1]
        moved = s**5 * (126 - 420 * s + 540 * s**2 - 315 * s**3 + 70 * s**4)
        table |= {"x": 0.4 + moved, "y": 0.5 + 0.4 * moved, "l": 0.9 - 0.3 * moved}
    signals = {} if topic == "measured/load" else dict.fromkeys(("alpha", "beta"))
    run = imported(write_csv(tmp_path / "a.csv", table), mapping=mapping(signals)).run
    write_log(tmp_path / "a.mcap", [run])
    path = np.column_stack([run.signal(name) for name in axes])
    path[:, 2] = -np.abs(path[:, 2])
    segment = f"kind = 'samples'\nfile = 'a.mcap'\ntopic = '{topic}'"
    again = simulate_run(scenario_of(tmp_path, segment, path[0].tolist()), plant="analytic", controller="lqr")
    expected = np.column_stack([np.interp(again.time, run.time, values) for values in path.T])
    assert np.abs(again.reference[:, :3] - expected).max() < 1e-3


@pytest.mark.parametrize("plant", ["mujoco", "analytic", "elastic"])
@pytest.mark.parametrize(("replay", "error"), [("commands", 1e-4), ("motion", 2e-4)])
def test_a_replayed_run_is_where_the_measured_one_was(
    plant: str, replay: Replay, error: float, tmp_path: Path
) -> None:
    """Only the smoothing of positions separates them: the initial rates, and the repeated motion."""
    run = measured_run(tmp_path)
    predicted = predict(run, plant, replay)
    assert compare_runs(predicted, run).max_load_error_m < error
    residual = predicted.block("residual")[:, 5:]
    assert np.allclose(residual, run.load_position - predicted.load_position)


def test_a_wrong_load_position_is_shown_in_the_residual(tmp_path: Path) -> None:
    table = columns(1)
    table["beta"] = table["beta"] + 0.01
    path = write_csv(tmp_path / "a.csv", table)
    run = imported(path, mapping=mapping(COMMANDS, commands="velocity")).run
    beta = predict(run, "mujoco", "motion").signal("residual.beta_residual")
    assert np.abs(beta).max() > 0.005


def test_commands_that_were_not_measured_cannot_be_repeated(tmp_path: Path) -> None:
    run = imported(write_csv(tmp_path / "a.csv", columns()), mapping=mapping()).run
    assert default_replay(run) == "motion"
    with pytest.raises(InputError, match="has no commands") as error:
        predict(run, "mujoco", "commands")
    assert error.value.remedy.startswith("replay its motion")
    assert predict(run, "mujoco", "motion").end_s == run.end_s


@pytest.mark.parametrize("drift", [0.0, 6e-4, -6e-4])
@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_commands_keep_their_rows_on_a_clock_that_is_slightly_off(drift: float, jitter: float) -> None:
    """Each command was held for one row more, by which a load is 0.3 m off in a log of 0.155 s.

    A command counts from the sample that is nearest to its stamp.
    """
    rng, period = np.random.default_rng(3), 0.155
    time = period * (1.0 + drift) * np.arange(200)
    time[1:-1] += period * jitter * rng.uniform(-1.0, 1.0, 198)
    speeds = 0.01 * rng.integers(-9, 9, (200, 3))
    joints = np.array([1.0, 0.7, 0.8, 0.0, 0.0]) + np.cumsum(0.1 * speeds[:, [0, 1, 2, 0, 0]], axis=0)
    columns = dict(zip((*CHANNELS, *hidden.COMMANDS), np.hstack([joints, speeds]).T, strict=True))

    def imported_commands(stamps: Array) -> Array:
        signals = hidden.signals_of(columns)
        run = hidden.imported(hidden.LAB, {"t": stamps, **columns}, signals, period=period)
        assert len(run.time) >= 199
        return run.block("command")[:, :3]

    found = imported_commands(time)
    assert np.array_equal(found, speeds[: len(found)])
    time[98:101] = period * np.array([98.0, 99.7, 100.0])
    assert np.array_equal(imported_commands(time)[[98, 99, 100]], speeds[[98, 98, 100]])


def test_a_suggested_map_is_complete_but_for_its_units(folder: Path, tmp_path: Path) -> None:
    assert cranectl("new", "map", folder / "a.csv", "--in", tmp_path).exit_code == 0
    text = (tmp_path / "a-map.toml").read_text()
    assert "#   5: alpha: " in text
    filled = text.replace('column = "t"\nunit = "???"', 'column = "t"\nunit = "s"')
    for line in filled.splitlines():
        unit = "rad" if line.startswith(("alpha", "beta")) else "m/s" if "_command" in line else "m"
        filled = filled.replace(line, line.replace("???", unit))
    (tmp_path / "a-map.toml").write_text(filled)
    result = cranectl(
        "log", "import", folder / "a.csv", "--map", tmp_path / "a-map.toml", "--out", tmp_path / "a.mcap"
    )
    assert result.exit_code == 0
    again = cranectl("new", "map", folder / "a.csv", "--in", tmp_path)
    assert again.exit_code == 2
    assert "exists" in again.output


@pytest.mark.parametrize("begins", [0.0, 0.3])
@pytest.mark.parametrize("replay", ["motion", "commands"])
def test_a_noisy_run_that_rests_at_first_is_predicted_from_rest(
    replay: Replay, begins: float, tmp_path: Path
) -> None:
    """The slope of the first readings is noise: it swung the predicted load by 40 mm."""
    rng, table = np.random.default_rng(2), {}
    for name, values in columns().items():
        noise = {"x": 2e-4, "y": 2e-4, "l": 2e-4, "alpha": 1e-3, "beta": 1e-3}.get(name, 0.0)
        held = np.r_[np.full(400, values[0]), values]
        table[name] = held + noise * rng.standard_normal(len(held))
    table["t"] = 0.005 * np.arange(len(table["x"]))
    settings = mapping(COMMANDS, commands="velocity", **{"from": begins})
    run = imported(write_csv(tmp_path / "a.csv", table), mapping=settings).run
    residual = predict(run, "mujoco", replay).block("residual")
    assert np.linalg.norm(residual[:, 5:], axis=1).max() < 0.008, "noise of 1 mrad below 1 m, five-fold"


@pytest.mark.parametrize("period", [1e-2, 1e-4, 1e-6])
def test_rates_of_fast_samples_are_slopes_and_average_their_noise(period: float) -> None:
    """At 1 µs a cubic would have 100 001 samples, and take minutes."""
    time = period * np.arange(round(0.6 / period))
    noise = 1e-4 * np.random.default_rng(1).standard_normal(len(time))
    calm, noisy = (_slopes(np.sin(3.0 * time) + more, period) for more in (0.0 * noise, noise))
    np.testing.assert_allclose(calm, 3.0 * np.cos(3.0 * time), rtol=0, atol=1e-3)
    middle = slice(len(time) // 4, -len(time) // 4)
    # The slope of a cubic over 0.1 s has the deviation of 75 noise² / samples, over the square of its span.
    expected = 1e-4 * np.sqrt(75.0 / max(0.1 / period, 1.0)) / 0.1
    assert (noisy - calm)[middle].std() < 1.5 * expected
