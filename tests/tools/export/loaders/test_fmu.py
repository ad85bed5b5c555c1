"""FMUs as laws: the bits of the same law in Python, a new instance for each run, what a broken one leaves."""

import stat
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cranectl.campaign.results import read_results
from cranectl.cli.main import main
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.loaders.opening import close_controllers, open_controller
from cranectl.log.reader import read_log
from cranectl.simulate import Run, simulate_run
from cranectl.support.errors import InputError
from cranectl.tools.live.session import Session
from tests.loaders.controller_files import ASKED, LAW, campaign_file, samples_before_failure, scenario
from tests.tools.export.loaders.fmu_files import Replaced, binary, description, fmu

BOTH = pytest.mark.parametrize("fmi", [2, 3])


def damped(folder: Path, plant: str = "analytic") -> Run:
    """By the law in Python."""
    (folder / "law.py").write_text(LAW)
    name = open_controller(f"{folder / 'law.py'}:damper")
    return simulate_run(scenario(), plant=plant, controller=name, drive="velocity")


def test_an_fmu_gives_the_bits_of_the_same_law_in_python_run_after_run(tmp_path: Path) -> None:
    names = []
    for fmi in (2, 3):
        path = fmu(tmp_path / f"law{fmi}.fmu", fmi)
        path.with_suffix(".toml").write_text(f"name = 'fmu-{fmi}'")
        names.append(open_controller(str(path)))
    for plant in ("analytic", "mujoco"):
        wanted = damped(tmp_path, plant)
        assert len(wanted.time_ns) == 3201
        for name in (*names, *names):
            run = simulate_run(scenario(), plant=plant, controller=name, drive="velocity")
            assert np.array_equal(run.block("state"), wanted.block("state"))
            error = run.signal("controller.error_1_")
            assert np.array_equal(error, wanted.reference[:, 0] - run.signal("state.bridge_position"))


@BOTH
def test_variables_by_a_table_the_rest_is_declared_and_logged(fmi: int, tmp_path: Path) -> None:
    path = fmu(tmp_path / "law.fmu", fmi, names={"state.rope_length": "x[3]", "command.rope": "y3"})
    table = 'title = "a damper"\nevery = 4\n'
    table += '[inputs]\n"x[3]" = "state.rope_length"\n[outputs]\ny3 = "command.rope"\n'
    path.with_suffix(".toml").write_text(table)
    log = tmp_path / "run.mcap"
    set_ = ["--set", "controller.fmu-damper.damper_damping=9", "--plants", "analytic", "--every", "1"]
    assert main(["run", "fast-diagonal", "--controller", str(path), *ASKED, *set_, "--out", str(log)]) == 0
    close_controllers()  # a log is read without its law
    (run,) = read_log(log).values()
    assert run.design.parameters == {"stiffness": 16.0, "damper_damping": 9.0}
    assert run.design.origin.source == table
    commanded = run.signal("input.bridge_acceleration")
    error, rate = run.signal("controller.error_1_"), run.signal("state.bridge_velocity")
    expected = 16.0 * error + 9.0 * (run.reference[:, 3] - rate)
    assert np.allclose(commanded[::4], expected[::4], rtol=0.0, atol=1e-12)
    assert np.array_equal(commanded, np.repeat(commanded[::4], 4)[: len(commanded)])
    assert np.ptp(commanded) > 0.1


@BOTH
def test_an_fmu_of_one_axis_holds_the_others_and_has_constants(fmi: int, tmp_path: Path) -> None:
    """Inputs of other axes are constants, one that nothing names is a parameter with its start value."""
    names = {"command.trolley": "y2", "command.rope": "y3", "reference.load_z_dot": "bias"}
    path = fmu(tmp_path / "law.fmu", fmi, names=names)
    refused(path, "no output is command.trolley", "'command.trolley' = 'held'")
    table = "[outputs]\n'command.trolley' = 'held'\n'command.rope' = 'held'\n"
    path.with_suffix(".toml").write_text(
        f"name = 'one-axis'\n{table}[inputs]\n'state.bridge_velocity' = 0.25\n"
    )
    name = open_controller(str(path))
    for plant in ("analytic", "mujoco"):
        run = simulate_run(scenario(), plant=plant, controller=name)
        assert run.design.parameters == {"stiffness": 16.0, "damper_damping": 8.0, "bias": 0.0}
        commands = {axis: run.signal(f"input.{axis}_acceleration") for axis in ("bridge", "trolley", "rope")}
        expected = 16.0 * run.signal("controller.error_1_") + 8.0 * (run.reference[:, 3] - 0.25)
        assert np.allclose(commands["bridge"][:-1], expected[:-1], rtol=0.0, atol=1e-12)
        assert not commands["trolley"].any()
        assert not commands["rope"].any()
        assert np.ptp(run.signal("state.trolley_position")) < 1e-12


def test_encoders_are_measured_where_the_table_says_so(tmp_path: Path) -> None:
    path = fmu(tmp_path / "law.fmu", 2)
    read = {"trolley_position": "encoders.trolley_position", "rope_length": "encoders.rope_length"}
    read |= {"bridge_position": "encoders.beta", "bridge_velocity": "encoders.alpha"}
    read |= {"trolley_velocity": "reference.load_z_dot", "rope_length_rate": "reference.load_x_d4"}
    rows = "".join(f"'state.{name}' = '{signal}'\n" for name, signal in read.items())
    path.with_suffix(".toml").write_text(f"[inputs]\n{rows}")
    run = simulate_run(scenario(), plant="analytic", controller=open_controller(str(path)))
    state, wanted = run.block("state"), run.reference
    given = [(0, 8, state[:, 6]), (1, 2, wanted[:, 5]), (2, 4, wanted[:, 12])]
    assert len(state) > 200  # until the rope is too short
    for axis, measured, rate in given:
        sign = -1.0 if axis == 2 else 1.0
        spring = 16.0 * (sign * wanted[:, axis] - state[:, measured])
        expected = spring + 8.0 * (sign * wanted[:, 3 + axis] - rate)
        assert np.allclose(run.block("input")[:, axis], expected, rtol=0.0, atol=1e-9)


@BOTH
def test_a_campaign_makes_an_instance_for_each_run_and_frees_it(
    fmi: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    note = 'FILE *f = fopen("%s", "a"); fputc(\'x\', f); fclose(f);'
    library = binary(fmi, Replaced(made=note % "made", freed=note % "freed"))
    fmu(tmp_path / "law.fmu", fmi, library=library)
    Path("law.py").write_text(LAW)
    campaign_file("law.py:damper", "law.fmu", runs=3)
    assert main(["campaign", "run", "own.toml", "--out", "result", "--trust", "--workers", "2"]) == 0
    results = read_results("result")
    for plant in ("analytic", "mujoco"):
        wanted, found = (results.table.take(results.rows(plant, law)) for law in ("damper", "fmu-damper"))
        assert found.drop(["controller"]).equals(wanted.drop(["controller"]))
        assert set(found["status"].to_pylist()) == {"completed"}
    made = len(Path("made").read_text())
    assert made == len(Path("freed").read_text())
    assert made > 6  # and when it is opened


def test_one_instance_in_a_process_where_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    fmu(tmp_path / "law.fmu", 2, kind='canBeInstantiatedOnlyOncePerProcess="true"')
    for plant in ("analytic", "mujoco"):
        run = simulate_run(scenario(), plant=plant, controller=open_controller("law.fmu"))
        assert run.status.label == "completed"
    campaign_file("law.fmu", runs=3)
    assert main(["campaign", "run", "own.toml", "--out", "result", "--trust", "--workers", "1"]) == 0
    assert "only once in a process" in capfd.readouterr().err
    ends = read_results("result").table["status"].to_pylist()
    assert sorted(ends) == ["completed"] + 5 * ["controller-failed"]


def test_steps_of_its_own_fit_into_those_of_the_law(tmp_path: Path) -> None:
    path = fmu(tmp_path / "law.fmu", 3, kind='fixedInternalStepSize="0.004"')
    with pytest.raises(InputError, match=r"steps of 0\.004 s, its controller is given 0\.001 s"):
        simulate_run(scenario(), plant="analytic", controller=open_controller(str(path)))
    path.with_suffix(".toml").write_text("every = 8\nname = 'slow'")
    run = simulate_run(scenario(), plant="analytic", controller=open_controller(str(path)))
    assert run.status.label == "completed"


def test_a_live_session_goes_over_to_one_and_starts_again(tmp_path: Path) -> None:
    crane = scenario()
    session = Session(crane, ALL_CONTROLLERS.design("lqr", crane), plants=["analytic"], drive="ideal")
    session.advance(300)
    session.use(ALL_CONTROLLERS.design(open_controller(str(fmu(tmp_path / "law.fmu", 2))), crane))
    for _ in range(2):
        (run,) = session.advance(200)
        error = run.reference[:, 0] - run.signal("state.bridge_position")
        assert np.array_equal(run.signal("controller.error_1_"), error)
        session.reset()


# Broken ones


def refused(path: Path, *found: str) -> None:
    with pytest.raises(InputError) as caught:
        open_controller(str(path))
    for part in found:
        assert part in str(caught.value)


def test_what_would_be_written_elsewhere_is_refused(tmp_path: Path) -> None:
    link = zipfile.ZipInfo("resources/link")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    cases: dict[str, tuple[zipfile.ZipInfo | str, str]] = {
        "outside of its directory": ("resources/../../../evil", "x"),
        "link: 'resources/link'": (link, "/etc/passwd"),
        "/evil": ("/evil", "x"),
    }
    for k, (found, entry) in enumerate(cases.items()):
        refused(fmu(tmp_path / f"{k}.fmu", 2, more=[entry]), found)
    assert not list(tmp_path.rglob("evil"))


def test_what_is_too_large_or_without_a_reader_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cranectl.tools.export.loaders.fmu.MAX_UNPACKED_BYTES", 10)
    refused(fmu(tmp_path / "law.fmu", 2, more=[("large", "x")]), "more than 10 bytes")
    monkeypatch.setitem(sys.modules, "fmpy", None)
    refused(tmp_path / "law.fmu", "pip install 'cranectl[fmi]'")


def _changed(fmi: int, old: str, new: str) -> Callable[[Path], Path]:
    """Write an FMU whose description is changed at its first place with `old`."""
    return lambda path: fmu(path, fmi, xml=description(fmi, names={}).replace(old, new, 1))


def _replaced(fmi: int, **parts: str) -> Callable[[Path], Path]:
    """Write an FMU with a broken binary."""
    return lambda path: fmu(path, fmi, library=binary(fmi, Replaced(**parts)))


def _renamed(name: str, other: str) -> Callable[[Path], Path]:
    """Write an FMU in which one variable has another name."""
    return lambda path: fmu(path, 2, names={name: other})


def _escape(path: Path) -> Path:
    """Name as binary, up from the binaries of the FMU, a library beside it, which must not be loaded."""
    outside = path.with_name("outside.so")
    outside.write_bytes(binary(2).read_bytes())
    name = "../" * 40 + str(outside.with_suffix("")).lstrip("/")
    return _changed(2, 'Identifier="law"', f'Identifier="{name}"')(path)


def _no_zip(path: Path) -> Path:
    path.write_bytes(b"PK of another kind")
    return path


ARRAY = """<Float64 name="state.alpha" valueReference="40" causality="input" start="0 0">
<Dimension start="2"/></Float64>"""
BOOLEAN = """<ScalarVariable name="state.alpha" valueReference="40" causality="input" variability="discrete">
<Boolean start="true"/></ScalarVariable>"""
FMI1 = '"1.0" modelIdentifier="law" numberOfContinuousStates="0" numberOfEventIndicators="0"'
BAD: dict[str, Callable[[Path], Path]] = {  # what the error says
    "cannot be unpacked": _no_zip,
    "allowed: an FMU for co-simulation, FMI 2.0 or 3.0": _changed(2, '"2.0"', '"1.0"'),
    "description cannot be read": lambda path: fmu(path, 2, xml="<a"),
    "no binary binaries/linux64/x.so, it has linux64": _changed(2, 'Identifier="law"', 'Identifier="x"'),
    "input 'state.x'": _renamed("state.rope_length", "state.x"),
    "which is no identifier of C": _escape,
    "did you mean 'state.rope_length'?": _renamed("state.rope_length", "state.rope_lenght"),
    "no output is command.rope": _renamed("command.rope", "y3"),
    "input 'state.trolley_position' has valueReference = -1": _changed(
        3, 'valueReference="2"', 'valueReference="-1"'
    ),
    "input 'state.alpha' is an array of Float64": lambda path: fmu(path, 3, variables=ARRAY),
    "input 'state.alpha' is Boolean": lambda path: fmu(path, 2, variables=BOOLEAN),
    "Instantiate gives no instance: no licence %d": _replaced(
        2, made="return 0;", said='f->logger(0, name, 3, "", "no licence %d", 7);'
    ),
    "fmi3EnterInitializationMode returns fmi3Error: not today": _replaced(3, initialised="3"),
    "with SIGABRT": _replaced(2, made="abort();"),
    "no function fmi2": lambda path: fmu(path, 2, library=binary(3)),
}


@pytest.mark.parametrize("found", BAD)
def test_what_is_no_fmu_to_run_is_refused(found: str, tmp_path: Path) -> None:
    refused(BAD[found](tmp_path / "law.fmu"), found)


@pytest.mark.parametrize(
    ("change", "found", "remedy", "good"),
    [
        (_changed(2, "CoSimulation", "ModelExchange"), "model exchange", "for co-simulation", 2),
        (_changed(3, "CoSimulation", "ModelExchange"), "model exchange", "for co-simulation", 3),
        (_changed(3, "CoSimulation", "ScheduledExecution"), "scheduled execution", "for co-simulation", 3),
        (_changed(2, '"2.0"', FMI1), "version 1.0", "as FMI 2.0 or 3.0", 2),
    ],
)
def test_another_kind_of_fmu_is_to_be_exported_as_one_that_runs(
    change: Callable[[Path], Path], found: str, remedy: str, good: int, tmp_path: Path
) -> None:
    path = tmp_path / "law.fmu"
    refused(change(path), found, f"remedy:  export it {remedy}")
    path.unlink()
    assert open_controller(str(fmu(path, good)))


@pytest.mark.parametrize(
    ("table", "found"),
    [
        ("[inputs]\nrope = 'state.alpha'", "no input 'rope'"),
        ("[outputs]\n'error[1]' = 'command.hook'", "command.hook"),
        ("[outputs]\n'error[1]' = 'command.rope'", "2 outputs are command.rope"),
        ("[inputs]\n'state.rope_length' = 'encoders.rope_length'", "no signal is"),
        ("every = 0", "every"),
        ("[outputs]\n'command.rope' = 'held'", "an output is 'held' and command.rope"),
        ("[outputs]\n'error[1]' = 'held'", "write the command whose axis is held"),
        ("command = 'force'\n[outputs]\n'command.rope' = 'held'", "no force does not hold"),
        (
            "[outputs]\n'command.bridge' = 'held'\n'command.trolley' = 'held'\n'command.rope' = 'held'",
            "all axes are 'held'",
        ),
        ("[inputs]\n'state.rope_length' = true", "state.rope_length"),
        ("colour = 1", "colour"),
        ("name = 'A law'", "A law"),
        ("name = ", "law.toml"),
    ],
)
def test_a_table_that_is_wrong_is_refused(table: str, found: str, tmp_path: Path) -> None:
    path = fmu(tmp_path / "law.fmu", 2)
    path.with_suffix(".toml").write_text(table)
    refused(path, found)


@pytest.mark.parametrize(
    ("fmi", "replaced", "said"),
    [
        (2, Replaced(after="3"), "at 1.2 s its fmi2DoStep returns fmi2Error: no more, %s"),
        (2, Replaced(after="-1"), "at 1.2 s its fmi2DoStep returns -1, which is no status: no more, %s"),
        (3, Replaced(after="4"), "at 1.2 s its fmi3DoStep returns fmi3Fatal"),
        (3, Replaced(terminated="1"), "at 1.2 s its fmi3DoStep returns fmi3Discard"),
        (2, Replaced(broken="if (m->steps > 1200) p[0] = 0.0 / 0.0;"), ""),
        (2, Replaced(broken="if (m->steps > 1200) abort();"), "ended its process with SIGABRT"),
        (3, Replaced(broken="while (m->steps > 1200) m->v[17] *= 0.5;"), "took more than 1 s for a block"),
    ],
)
def test_an_fmu_that_fails_ends_its_run_only(
    fmi: int, replaced: Replaced, said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = fmu(tmp_path / "law.fmu", fmi, library=binary(fmi, replaced))
    samples = samples_before_failure(str(path), tmp_path / "run.mcap", "--timeout", "1")
    assert samples == (1000 if "process" in said or "block" in said else 1200)
    assert said in capfd.readouterr().err
