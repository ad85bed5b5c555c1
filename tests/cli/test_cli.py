"""The command line as users and CI use it: results, JSON, exit codes, and errors for invalid input."""

import importlib.metadata
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.compare.agreement import agreement_limits
from cranectl.controllers.registry import controller_names
from cranectl.design import CONTROLLERS
from cranectl.log.reader import read_log
from cranectl.plants.plant import DRIVES
from cranectl.plants.registry import PLANTS
from cranectl.scenario.load import ScenarioFile, scenario_names
from cranectl.status import RunStatus
from tests.cli.arguments import SHORT, STOP
from tests.cli.conftest import Command, json_of
from tests.pace import HANG
from tests.remedies import prepared

pytestmark = pytest.mark.usefixtures("in_empty_directory")


def test_list_names_all_controllers_scenarios_plants_and_drives(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "--json", "-"]) == 0
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert result["controllers"] == list(controller_names())
    keys = {"name", "title", "duration", "controller"}  # which `list` reads without checking the rest
    scenarios = [ScenarioFile.read(name).model_dump(include=keys) for name in scenario_names()]
    assert result["scenarios"] == scenarios
    for name in (*controller_names(), *scenario_names(), *PLANTS, *DRIVES):
        assert name in captured.err, "tables go to standard error when JSON takes standard output"


def test_run_writes_the_log_to_the_printed_path(output: Command) -> None:
    out = output("run", "fixed-position", *SHORT, "--controller", "lqr")
    log = Path("logs/fixed-position/lqr-ideal.mcap")
    assert f"log: {log}" in out
    assert len(re.findall(r"\n  lqr, \w+ .* yes *(?=\n)", out)) == 2, "the plants agree"
    runs = read_log(log)
    assert list(runs) == ["analytic", "elastic", "mujoco"]
    assert runs["mujoco"].design.name == "lqr"


def test_run_simulates_one_plant_with_options(output: Command) -> None:
    Path("rig.toml").write_text("load_mass = 3.0\n")
    options = "--plant mujoco --drive velocity --rig rig.toml --every 1 --out my.mcap --json run.json"
    assert "Agreement" not in output("run", "fixed-position", *SHORT, *options.split())
    (run,) = read_log("my.mcap").values()
    assert (run.plant, run.drive) == ("mujoco", "velocity")
    assert (run.scenario.rig.load_mass, len(run.time_ns)) == (3.0, 501)
    result = json.loads(Path("run.json").read_text())
    assert result["agreements"] == []
    assert result["runs"][0]["log"] == "my.mcap"


def test_validate_writes_all_runs_and_agreements_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", "fixed-position", *SHORT, "--json", "-"]) == 0
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert set(result) == {"passed", "interrupted", "runs", "agreements", "failed", "lost"}
    assert result["passed"] is True
    assert {(r["scenario"], r["controller"], r["plant"], r["drive"]) for r in result["runs"]} == {
        ("fixed-position", controller, plant, drive)
        for controller in CONTROLLERS
        for plant in PLANTS.by_default
        for drive in ("ideal", "velocity")
    }
    for run in result["runs"]:
        assert run["status"] == "completed"
        assert Path(run["log"]).exists()
        assert run["metrics"]["max_error_m"] > 0
    for agreement in result["agreements"]:
        assert set(agreement) == {
            "scenario", "controller", "plant", "reference", "drive", "max_load_error_m",
            "max_angle_error_rad", "limit_m", "limit_rad", "passed", "limits", "curing_step_s",
        }  # fmt: skip
        assert agreement["passed"] is True
        assert agreement["max_load_error_m"] < agreement["limit_m"] == agreement_limits("ideal").load_m
    assert "passed" in captured.err, "tables go to standard error when JSON takes standard output"


def test_a_stopped_run_prints_the_reason_and_leaves_a_readable_log(output: Command) -> None:
    out = output("run", "fixed-position", *STOP, code=3)
    assert "length-singular" in out
    assert "the rope length is not positive" in out
    runs = read_log("logs/fixed-position/pole-placement-ideal.mcap")
    assert runs["mujoco"].status == RunStatus.LENGTH_SINGULAR
    assert main(["validate", "fixed-position", *STOP, "--controller", "lqr"]) == 3


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_design_as_json_describes_the_whole_loop(output: Command, name: str) -> None:
    design = json.loads(output("design", name, "--json", "-"))
    assert {"name", "gain", "closed_loop_poles", "gamma", "stability_margin", "robustifier"} <= set(design)
    assert design["name"] == name
    empty = {"A": np.zeros((0, 0)), "B": np.zeros((0, 1)), "C": np.zeros((1, 0)), "D": [[0.0]]}
    robustifier = design["robustifier"] or empty
    a, b, c, d = (np.array(robustifier[key]) for key in "ABCD")
    chain, n = np.diag(np.ones(3), 1), len(a)
    gain = np.array([design["gain"]]) + d @ np.eye(4)[:1]
    closed = np.block([[chain - np.eye(4)[:, 3:] @ gain, -np.eye(4)[:, 3:] @ c], [b @ np.eye(4)[:1], a]])
    poles = [complex(*pole) for pole in design["closed_loop_poles"]]
    assert len(poles) == 4 + n
    assert np.sort(np.abs(np.linalg.eigvals(closed))) == pytest.approx(np.sort(np.abs(poles)), rel=1e-2)
    assert (design["robustifier"] is None) == ("+" not in name) == (design["gamma"] is None)
    assert (design["stability_margin"] is None) == ("loop-shaping" not in name)


def test_design_uses_the_named_scenario_and_settings() -> None:
    def gamma_ratio(*arguments: str) -> float:
        design = json_of("design", "lqr+loop-shaping", *arguments)
        return float(design["gamma_achieved"] / design["gamma"])

    assert gamma_ratio() == pytest.approx(1.01, abs=2e-4)
    assert gamma_ratio("--scenario", "fixed-position") == pytest.approx(1.001, abs=2e-5)
    assert gamma_ratio("--set", "design.loop_shaping.back_off=1.1") > 1.05


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["svg", "pdf", "png"])
def test_a_design_plot_is_reproducible(output: Command, suffix: str) -> None:
    for name in ("a", "b"):
        out = output("design", "lqr+hinf", "--plot", f"{name}.{suffix}")
        assert "gamma" in out
        assert "phase margin" in out
    assert Path(f"a.{suffix}").read_bytes() == Path(f"b.{suffix}").read_bytes()
    assert Path(f"a.{suffix}").stat().st_size > 10_000


RUN = f"run fixed-position {' '.join(SHORT)} --controller lqr+hinf --set rig.load_mass=2 --drive"
prepared_files = prepared({}, [f"{RUN} {drive} --out {drive}.mcap" for drive in ("ideal", "velocity")])


def test_info_describes_a_log(prepared_files: Path, output: Command) -> None:
    log = str(prepared_files / "ideal.mcap")
    out = output("info", log)
    for expected in (
        "fixed-position: Hold the load", "lqr+hinf, ideal drives", "completed at 0.5 s", "rig.load_mass",
        "disturbances 1 rad/s² on alpha from 0.1 s; 1 rad/s² on beta from 0.2 s\n",
        "0.001 s, one sample of 4", "passed", "mujoco 4", "scenario.json", "checksums and counts are right",
        "/mujoco/state", "cranectl.Controller6",
    ):  # fmt: skip
        assert expected in out
    description = json.loads(output("info", log, "--json", "-"))
    topics = {topic["topic"]: topic for topic in description["topics"]}
    assert topics["/analytic/state"]["rate_hz"] == pytest.approx(250.0, rel=0.01)
    assert topics["/run/info"]["rate_hz"] is None
    assert description["scenario"]["rig"]["load_mass"] == 2.0
    assert description["agreement"]["passed"] is True
    assert description["messages"] == sum(topic["messages"] for topic in description["topics"])
    assert [run["plant"] for run in description["runs"]] == ["analytic", "elastic", "mujoco"]


def test_compare_takes_one_or_two_logs(prepared_files: Path, output: Command) -> None:
    logs = [str(prepared_files / f"{drive}.mcap") for drive in ("ideal", "velocity")]
    comparison, _ = json.loads(output("compare", logs[0], "--json", "-"))["comparisons"]
    assert comparison["max_load_error_m"] < 1e-7
    assert {"signal", "unit", "max_abs", "at_s", "rms", "final"} == set(comparison["signals"][0])
    out = output("compare", *logs)
    assert "analytic/velocity minus" in out
    assert "mujoco/velocity minus" in out
    assert "load.rope_tension" in out


# Errors in scenarios, logs and names have their own tests. These cases show that every option reports them.
INVALID_COMMANDS = {
    "run fixed-positon": "did you mean 'fixed-position'?",
    "run absent.toml": "cannot read absent.toml",
    "run fixed-position --controller lqrr": "did you mean 'lqr'?",
    "run fixed-position --controller lqg": "allowed: ",
    "run fixed-position --controller lqr+hinf+hinf": "did you mean 'lqr+hinf'?",
    "run fixed-position --plant real": "unknown plant 'real'",
    "run fixed-position --drive velocty": "did you mean 'velocity'?",
    "run fixed-position --set rig.load_mas=2": "did you mean 'load_mass'?",
    "run fixed-position --set rig.load_mas=2 --set duration=x --set log.every=0": "rig.load_mas",
    "run fixed-position --set reference.start=[3,0.77,-0.7]": "leaves the workspace",
    "run settled-trajectory --set reference.continuity=4": "the reference jumps",
    "run settled-trajectory --set reference.segments.0.to=[0.1,0.1,-0.15]": "zero length",
    "run fixed-position --set reference.segments=[{kind='line',to=[1,0.77,-1.3],duration=0.4}]": "slack rope",
    "run fixed-position --rig absent.toml": "cannot read absent.toml",
    "run fixed-position --every 0": "greater than or equal to 1",
    "run fixed-position --every few": "not a valid integer",
    "run fixed-position --nonsense": "No such option",
    "run fixed-position --set control.period=0.1 --set control.physics_step=0.001 --controller lqr+hinf": (
        "unstable when sampled"
    ),
    "list --json file/list.json": "cannot write file/list.json",
    "validate --json .": "a directory",
    "run": "Missing argument",
    "runn": "Did you mean 'run'?",
    "validate nothing": "unknown scenario",
    "validate --controller lqg": "unknown controller",
    "validate --jobs 0": "a whole number from 1 to 1024",
    "validate --drive any": "unknown drive",
    "certify lqr --drive force": "force drives",
    "design lqr+hnf": "did you mean 'lqr+hinf'?",
    "design lqr --plot design.xyz": ".svg, .pdf, .png",
    f"design lqr --plot {os.devnull}/design.svg": "cannot write /dev/null/design.svg",
    "design lqr --scenario fixed": "unknown scenario",
    "design lqr+hinf --set design.hinf.back_off=0.9": "greater than or equal to 1",
    "info absent.mcap": "cannot read absent.mcap",
    "info x\0.mcap": "null character",
    "log recover .": "cannot read .",
    "compare absent.mcap": "cannot read absent.mcap",
}


@pytest.mark.parametrize(("line", "expected"), INVALID_COMMANDS.items())
def test_bad_input_is_explained(refusal: Command, line: str, expected: str) -> None:
    Path("file").write_text("")
    assert expected in refusal(*line.split(" "))
    assert not Path("logs").exists(), "a directory was created for invalid input"


def test_an_unwritable_logs_directory_is_reported_before_the_simulation(
    refusal: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file in place of the directory cannot be written into, not even by root."""
    Path("logs").write_text("")

    def simulate(*_: object, **__: object) -> None:
        raise AssertionError("simulated although the log cannot be written")

    monkeypatch.setattr("cranectl.cases.case.simulate_run", simulate)
    error = refusal("run", "fixed-position")
    assert "cannot write logs/fixed-position" in error
    assert "--out" in error
    assert "cannot write" in refusal("validate")


def test_json_can_be_written_to_a_device() -> None:
    assert main(["list", "--json", os.devnull]) == 0
    assert Path(os.devnull).is_char_device()


ANNOUNCE = """
import sys
from cranectl.simulate import Loop
run = Loop.run
def announce(loop, **options):
    options["progress"] = lambda seconds: print("running", flush=True)
    return run(loop, **options)
Loop.run = announce
from cranectl.cli.main import main
sys.exit(main())
"""


@pytest.mark.slow
@pytest.mark.parametrize("signal_number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_closes_the_log(signal_number: signal.Signals) -> None:
    """The signal is sent as soon as the simulation has started; the run takes much longer."""
    run = "run fixed-position --plant mujoco --set duration=600 --out long.mcap"
    command = [sys.executable, "-c", ANNOUNCE, *run.split()]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "running\n"
    process.send_signal(signal_number)
    out, error = process.communicate(timeout=HANG)
    assert process.returncode == 130, error
    assert "Traceback" not in error
    assert "interrupted" in out
    (run,) = read_log("long.mcap").values()
    assert run.status == RunStatus.INTERRUPTED
    assert 0 < run.end_ns < 600_000_000_000
    assert [path.name for path in Path().iterdir()] == ["long.mcap"]


@pytest.mark.slow
def test_a_run_works_with_an_unwritable_home_directory() -> None:
    """The home directory is a file, into which not even root can write."""
    Path("home").write_text("")
    home = str(Path("home").absolute())
    environment = {"HOME": home, "XDG_CACHE_HOME": f"{home}/cache", "PATH": os.defpath}
    command = [sys.executable, "-m", "cranectl", "run", "fixed-position", *SHORT, "--plant", "analytic"]
    result = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in result.stderr


def test_module_and_console_script_print_the_version() -> None:
    for command in ([sys.executable, "-m", "cranectl"], [str(Path(sys.executable).parent / "cranectl")]):
        result = subprocess.run([*command, "--version"], capture_output=True, text=True, check=True)
        assert importlib.metadata.version("cranectl") in result.stdout
