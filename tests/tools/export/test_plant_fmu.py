"""An FMU of a plant gives the numbers of runs, bit for bit, without Python, whatever its parameters are."""

import subprocess
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from cranectl.cli.main import main
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.signals import SignalGroup
from cranectl.simulate import Plan, simulate_run
from cranectl.support.errors import InputError
from cranectl.tools.export.fmu import Model, fmu_archive
from cranectl.tools.export.plant import DRIVEN, plant_model
from cranectl.tools.export.plant_numbers import PlantNumbers
from tests.tools.export.fmus import Instance, symbols

PUSHES = "{start=1.0, end=1.5, force=[0.4,-0.3,0.2]}, {joint='alpha', start=2.0, end=2.5, magnitude=0.5}"
PUSHED = f"disturbances=[{PUSHES}]"
ALL = [f"effects.{name}={{}}" for name in ("rope", "body", "wind", "frame", "friction", "limits")]
NO_SET_POINTS = [
    "effects.limits.force=[60.0,40.0,30.0]",
    *(f"effects.limits.{name}=[1e9,1e9,1e9]" for name in ("velocity", "acceleration")),
]
SMOOTH = ["effects.wind={}", "effects.friction.coulomb=[0,0,0]", "effects.friction.viscous=[0,0,0]"]
CASES = {
    "analytic, velocity": ("analytic", "velocity", [PUSHED]),
    "analytic, force": ("analytic", "force", [*SMOOTH, "effects.installation.tilt=[0.01,-0.02]", PUSHED]),
    "analytic, ideal": ("analytic", "ideal", SMOOTH),
    "elastic, velocity": ("elastic", "velocity", [*ALL, PUSHED]),
    "elastic, force": ("elastic", "force", [*ALL, *NO_SET_POINTS, PUSHED]),
    "elastic, rigid": ("elastic", "force", ["effects.friction={}"]),
}
MODELS: dict[str, Model] = {}  # as they are compiled
STATES = [f"state.{name}" for name in SignalGroup.STATE.names]
LOADS = [f"load.{name}" for name in SignalGroup.LOAD.names]
OF_C = {"calloc", "free", "strcmp", "strlen", "memcpy", "memset", "sin", "cos", "sincos", "tanh", "floor"}
OF_C |= {"fmax", "vsnprintf"}
SECURED = {"__stack_chk_fail", "__vsnprintf_chk"}  # by compilers of some distributions


def scenario_of(case: str) -> Scenario:
    """Return the scenario of a case."""
    return load_scenario("fast-diagonal", overrides=["duration=4", *CASES[case][2]])


def model_of(case: str) -> Model:
    """Return the model of a case, which is compiled once."""
    if case not in MODELS:
        plant, drive, _ = CASES[case]
        MODELS[case] = plant_model(scenario_of(case), plant, drive)
    return MODELS[case]


def fmu_of(case: str, folder: Path, fmi: int = 2) -> Path:
    """Write the FMU of a case."""
    path = folder / f"crane{fmi}.fmu"
    path.write_bytes(fmu_archive(model_of(case), fmi))
    return path


def run_of(case: str) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return states and load of a run, and what acts on its plant, by names of variables."""
    plant, drive, _ = CASES[case]
    scenario = scenario_of(case)
    run = simulate_run(scenario, plant=plant, drive=drive, controller="lqr")
    columns: dict[str, np.ndarray] = {}
    for name, column in zip((f"{g.name}.{n}" for g in run.groups for n in g.names), run.table.T, strict=True):
        columns.setdefault(name, column)  # the first load is that of the plant
    recorded = {"velocity": "input.{}_velocity_setpoint", "ideal": "input.{}_acceleration"}
    if "command.bridge_command" in columns:
        recorded[drive] = "command.{}_command"
    acting = {f"command.{name}": columns[recorded[drive].format(name)] for name in DRIVEN}
    acting |= {name: columns[name] for name in columns if name.startswith("disturbance.")}
    wind = Plan.of(scenario).wind
    acting |= {f"load_force.load_force_{axis}": wind[:, 3 + k] for k, axis in enumerate("xyz")}
    if scenario.effects.wind:
        acting |= {f"wind.{axis}": wind[:, k] for k, axis in enumerate("xyz")}
    return columns, acting


@pytest.mark.parametrize("case", CASES)
def test_the_commands_of_a_run_give_its_bits(case: str, tmp_path: Path) -> None:
    """States, and position and velocity of the load; only the tension depends on the next command."""
    columns, acting = run_of(case)
    names = [*STATES, *LOADS[:6]]
    expected = np.column_stack([columns[name] for name in names])
    assert len(expected) == 4001
    for fmi in (2, 3):
        path = fmu_of(case, tmp_path, fmi)
        assert validate_fmu(str(path)) == []
        crane = Instance(path, tmp_path / f"fmi{fmi}")
        found = []
        for k in range(len(expected)):
            found.append(crane.get(names))
            crane.set({name: column[k] for name, column in acting.items()})
            crane.step(0.001, 0.001 * k)
        assert crane.get(["status"]) == [0.0]
        crane.close()
        assert np.array_equal(np.array(found), expected)


def test_fmpy_itself_simulates_it(tmp_path: Path) -> None:
    columns, acting = run_of("analytic, velocity")
    inputs = {"time": 0.001 * np.arange(len(columns["load.load_x"])), **acting}
    rows = np.rec.fromarrays(list(inputs.values()), names=list(inputs))
    result = fmpy.simulate_fmu(
        str(fmu_of("analytic, velocity", tmp_path)),
        stop_time=4.0,
        step_size=0.001,
        output_interval=0.001,
        input=rows,
        output=["load.load_x", "state.alpha"],
    )
    assert np.abs(result["load.load_x"] - columns["load.load_x"]).max() < 1e-12
    assert np.abs(result["state.alpha"] - columns["state.alpha"]).max() < 1e-12


@pytest.mark.parametrize("case", CASES)
def test_other_parameters_give_the_bits_of_a_plant_made_with_them(case: str, tmp_path: Path) -> None:
    compare_with_plant(case, fmu_of(case, tmp_path))


def test_the_comparison_notices_a_parameter_that_does_nothing(tmp_path: Path) -> None:
    case = "analytic, velocity"
    model = model_of(case)
    (place,) = [k for k, variable in enumerate(model.variables) if variable.name == "rig.winch_time_constant"]
    source = model.sources["plant.c"]
    idle = source.replace(f"values[{place}]", f"model_starts[{place}]")
    assert idle != source
    path = tmp_path / "idle.fmu"
    path.write_bytes(fmu_archive(model._replace(sources={"plant.c": idle})))
    with pytest.raises(AssertionError):
        compare_with_plant(case, path)


def compare_with_plant(case: str, path: Path) -> None:
    """Step an FMU with other parameters beside a plant that is made with them, under random inputs."""
    plant, drive, _ = CASES[case]
    scenario, random = scenario_of(case), np.random.default_rng(3)
    numbers = PlantNumbers(scenario, plant, drive, Plan.of(scenario).initial_state)  # type: ignore[arg-type]
    parameters = [variable for variable in model_of(case).variables if variable.causality == "parameter"]
    assert len(parameters) > 11
    values = {v.name: v.start * random.uniform(0.8, 1.3) + random.uniform(0.0, 0.01) for v in parameters}
    made, start = numbers.plant(values), numbers.start.copy()
    for k, name in enumerate(SignalGroup.STATE.names):
        start[k] = values.get(f"start.{name}", start[k])
    made.reset(start)
    crane = Instance(path, path.with_suffix(""), **values)
    state, load, wind = np.zeros(10), np.zeros(7), np.zeros(6)
    scale, weight = (5.0, 14.0) if drive == "force" else (0.3, 0.0)
    for k in range(400):
        if k % 4 == 0:
            command = random.normal(0.0, scale, 3) - (0.0, 0.0, weight)
            disturbance, wind[3:] = random.normal(0.0, 0.1, 2), random.normal(0.0, 0.2, 3)
            names = [variable.name for variable in model_of(case).variables[:8]]
            named = dict(zip(names, (*command, *disturbance, *wind[3:]), strict=True))
            crane.set(named)
        made.measure(state)
        made.advance(command, disturbance, wind, load)
        if k % 4:  # then the command has not changed, on which the tension depends
            assert crane.get([*STATES, *LOADS]) == [*state, *load]
        crane.step(0.001, 0.001 * k)
    crane.close()


def test_constants_are_what_the_start_depends_on_in_other_ways() -> None:
    constants = {v.name for v in model_of("elastic, velocity").variables if v.causality == "constant"}
    named = {"rig.load_mass", "effects.rope.stiffness", "effects.frame.frequency[1]", "start.rope_length"}
    assert named < constants
    known = {v.name: v for v in model_of("elastic, velocity").variables}
    friction = known["effects.friction.coulomb[2]"]
    assert (friction.causality, friction.unit) == ("parameter", "N")
    assert known["effects.rope.stiffness"].start == 5e4
    assert not any(name.startswith(("rig.rated", "effects.limits.velocity")) for name in known)


@pytest.mark.parametrize("case", ["analytic, force", "elastic, force"])
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_binary_needs_no_python(case: str, fmi: int, tmp_path: Path) -> None:
    fmpy.extract(str(fmu_of(case, tmp_path, fmi)), str(tmp_path / "crane"))
    (library,) = (tmp_path / "crane").rglob("*.so")
    assert symbols(library, "undefined") <= OF_C | SECURED
    shown = subprocess.run(["nm", "-D", library], check=True, capture_output=True, text=True).stdout
    assert not any(word in shown for word in ("Py", "NRT", "numba", "plant_step", "model_"))
    needed = subprocess.run(["ldd", library], check=True, capture_output=True, text=True).stdout
    known = ("linux-vdso", "libm.", "libc.", "/lib")
    assert all(line.strip().startswith(known) for line in needed.splitlines())


def test_a_longer_step_is_as_many_samples_and_instances_share_nothing(tmp_path: Path) -> None:
    path = fmu_of("elastic, rigid", tmp_path)
    heavy = {"rig.load_mass": 2.0}
    one = Instance(path, tmp_path / "crane", **heavy)
    two = Instance(path, tmp_path / "crane", name="two")
    alone = Instance(path, tmp_path / "crane", name="alone", **heavy)
    for crane in (one, two, alone):
        crane.set({"command.bridge": 3.0, "command.rope": -12.0})
    for k in range(10):
        one.step(0.01, 0.01 * k)
        two.step(0.01, 0.01 * k)
    for k in range(100):
        alone.step(0.001, 0.001 * k)
    ends = [crane.get([*STATES, *LOADS, "status"]) for crane in (one, two, alone)]
    assert ends[0] == ends[2] != ends[1]
    one.slave.reset()
    one.begin(**heavy)
    one.set({"command.bridge": 3.0, "command.rope": -12.0})
    one.step(0.1, 0.0)
    assert one.get([*STATES, *LOADS, "status"]) == ends[0]
    for crane in (one, two, alone):
        crane.close()


def test_a_slack_rope_is_reported_and_a_number_that_is_not_finite_is_an_error(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    crane = Instance(fmu_of("analytic, force", tmp_path, 3), tmp_path / "crane")
    crane.step(0.001)
    assert crane.get(["status"]) == [0.0]
    crane.set({"command.rope": 50.0})  # faster than the load falls
    crane.step(0.001)
    assert crane.get(["status"]) == [2.0]
    crane.set({"command.rope": -9.81})
    crane.step(0.001)
    assert crane.get(["status"]) == [0.0]
    crane.set({"command.bridge": 1e300})
    with pytest.raises(FMICallException):
        crane.step(1.0)
    assert "in the step from 0.003 s, status 5 (a number is not finite)" in capfd.readouterr().out
    crane.close()


def test_other_plants_are_refused() -> None:
    with pytest.raises(InputError, match="the mujoco plant as an FMU"):
        plant_model(load_scenario("fast-diagonal"), "mujoco", "velocity")
    with pytest.raises(InputError, match="rope"):
        plant_model(load_scenario("fast-diagonal", overrides=["effects.rope={}"]), "analytic", "velocity")


def test_the_command_runs_the_scenario_and_writes_the_fmu(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    common = ["run", "fast-diagonal", "--plants", "analytic", "--drive", "velocity", "--set", "duration=4"]
    assert main([*common, "--set", PUSHED, "--fmu", "crane.fmu", "--fmi", "3", "--out", "a.mcap"]) == 0
    assert "exported: crane.fmu, the analytic plant with velocity drives" in capsys.readouterr().out
    assert Path("a.mcap").is_file()
    assert Path("crane.fmu").read_bytes() == fmu_archive(model_of("analytic, velocity"), 3)
    Path("crane.fmu").write_text("of another kind", encoding="utf-8")
    assert main([*common, "--fmu", "crane.fmu"]) == 2
    assert Path("crane.fmu").read_text(encoding="utf-8") == "of another kind"
