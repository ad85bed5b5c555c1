"""An FMU does what FMI asks of it, whatever model it has: FMPy finds nothing, and wrong calls are refused."""

import subprocess
import zipfile
from pathlib import Path

import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from cranectl.support.errors import InputError
from cranectl.tools.export.description import base_unit
from cranectl.tools.export.fmu import FOLDERS, FmuVariable, Model, fmu_archive, model_sources
from tests.tools.export.exported import COMPILERS, STRICT
from tests.tools.export.fmus import Instance, standard_functions, symbols

LAG = """
#include "model.h"

int model_initialise(double *values, double *memory)
{
    memory[0] = values[2] = values[4];
    return values[0] <= 0.0;
}

int model_step(double *values, double *memory, int64_t samples)
{
    for (int64_t k = 0; k < samples; k++)
        memory[0] += MODEL_PERIOD / values[0] * (values[1] - memory[0]);
    values[2] = memory[0];
    return values[2] > 1e6;
}
"""
VARIABLES = (
    FmuVariable("lag.T", "parameter", "s", "time constant & more", 0.5, -1.0, 2.0),
    FmuVariable("u", "input", "m/s²", 'the "input"', 1.0),
    FmuVariable("y", "output", "m/s²", "<output>"),
    FmuVariable("mass[1]", "constant", "kg m²", "a number that is built in", 0.1),
    FmuVariable("y_start", "parameter", "", "of the output"),
)
MODEL = Model("lag", "a lag of first order */", VARIABLES, 0.01, 1, {"model.c": LAG})


@pytest.fixture(params=[2, 3])
def fmu(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return an FMU of each version."""
    path = tmp_path / f"lag{request.param}.fmu"
    path.write_bytes(fmu_archive(MODEL, request.param))
    return path


def library(path: Path, folder: Path) -> Path:
    """Return the unpacked library of an FMU."""
    with zipfile.ZipFile(path) as archive:
        (name,) = [name for name in archive.namelist() if name.startswith("binaries/")]
        return Path(archive.extract(name, folder))


def test_fmpy_finds_nothing_and_the_same_model_gives_the_same_bytes(fmu: Path) -> None:
    assert validate_fmu(str(fmu)) == []
    assert fmu.read_bytes() == fmu_archive(MODEL, int(fmu.stem[-1]))


def test_the_library_has_the_functions_of_the_standard_and_no_others(fmu: Path, tmp_path: Path) -> None:
    fmi, unpacked = int(fmu.stem[-1]), library(fmu, tmp_path / "unpacked")
    assert unpacked.parent.name == FOLDERS[fmi]
    functions = standard_functions(fmi)
    assert len(functions) > 30
    assert symbols(unpacked, "defined") == functions


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("fmi", [2, 3])
def test_its_sources_compile_without_a_warning(fmi: int, compiler: str, tmp_path: Path) -> None:
    sources = model_sources(MODEL, fmi)
    for name, text in sources.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    units = [name for name in sources if name.endswith(".c")]
    command = [compiler, *STRICT, "-O2", "-fPIC", "-shared", "-o", "lag.so", *units, "-lm"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")


def test_instances_share_nothing_begin_at_any_time_and_can_be_reset(fmu: Path, tmp_path: Path) -> None:
    a = Instance(fmu, tmp_path / "a", name="a", **{"lag.T": 0.1, "y_start": 0.25})
    b = Instance(fmu, tmp_path / "a", name="b", u=2.0)
    assert [*a.get(["y", "lag.T", "mass[1]"]), *b.get(["y", "lag.T"])] == [0.25, 0.1, 0.1, 0.0, 0.5]
    for _ in range(3):
        a.step(0.01)
        b.step(0.02)
    expected_a, expected_b = 0.25, 0.0
    for _ in range(3):
        expected_a += 0.01 / 0.1 * (1.0 - expected_a)
    for _ in range(6):
        expected_b += 0.01 / 0.5 * (2.0 - expected_b)
    assert [*a.get(["y"]), *b.get(["y"])] == [expected_a, expected_b]
    a.slave.reset()
    a.begin()
    assert a.get(["y", "lag.T"]) == [0.0, 0.5]
    a.close()
    b.step(0.01)
    b.close()
    late = Instance(fmu, tmp_path / "a", start=12.5)
    late.step(0.01)
    assert late.is_second or late.get(["time"]) == [12.51]
    late.close()


def test_wrong_steps_and_wrong_values_are_errors(
    fmu: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The messages say which variable, number or time is wrong."""
    lag = Instance(fmu, tmp_path / "a")
    wrong_steps = [(0.015, 0.0), (0.0, 0.0), (-0.01, 0.0), (0.004, 0.0), (float("nan"), 0.0), (1e9, 0.0)]
    for size, time in [*wrong_steps, (0.01, 0.01), (0.01, float("nan"))]:
        with pytest.raises(FMICallException):
            lag.step(size, time)
    for name, value in (("y", 1.0), ("mass[1]", 1.0), ("lag.T", 1.0), ("u", float("inf"))):
        with pytest.raises(FMICallException):
            lag.set({name: value})
    lag.references["wrong"] = 99
    for wrong in (lambda: lag.set({"wrong": 1.0}), lambda: lag.get(["wrong"])):
        with pytest.raises(FMICallException):
            wrong()
    lag.time = 0.0
    lag.step(0.01)  # it is as if none of that had been asked
    assert lag.get(["y"]) == [0.02]
    lag.set({"u": 1e9})
    with pytest.raises(FMICallException):  # the model cannot go on
        lag.step(0.01)
    said = capfd.readouterr().out
    for message in (
        "a step of 0.015 s is no whole multiple of the period of the model, 0.01 s",
        "a step begins at 0.01 s, but the last one ended at 0 s",
        "mass[1] is set to 1, but only inputs can be set, and parameters before the end of initialisation",
        "u = inf is outside of its bounds, -1.79769e+308 to 1.79769e+308",
        "there is no variable of the value reference 99",
        "the model cannot go on in the step from 0.01 s, status 1 (a number is not finite)",
    ):
        assert message in said
    lag.close()
    with pytest.raises(FMICallException):  # the model refuses it
        Instance(fmu, tmp_path / "a", **{"lag.T": -1.0})


def test_units_are_defined_by_base_units() -> None:
    assert base_unit("m/s²") == {"m": 1, "s": -2}
    assert base_unit("N m s/rad") == {"kg": 1, "m": 2, "s": -1, "rad": -1}
    assert base_unit("kg/m³") == {"kg": 1, "m": -3}
    assert base_unit("1/s") is base_unit("°") is None


def test_a_missing_compiler_and_another_machine_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for compiler, found in (
        ("no-such-compiler", "there is no program no-such-compiler"),
        ("false", "false cannot compile the export: its exit status is 1"),
        ("true", "true cannot compile the export: its exit status is 0"),
    ):
        monkeypatch.setenv("CC", compiler)
        with pytest.raises(InputError, match=found) as refused:
            fmu_archive(MODEL)
        assert compiler != "no-such-compiler" or refused.value.remedy == "correct CC"
    monkeypatch.delenv("CC")
    monkeypatch.setattr("shutil.which", lambda _: None)
    with pytest.raises(InputError, match="there is no program cc") as refused:
        fmu_archive(MODEL)
    assert "apt install gcc" in refused.value.remedy
    monkeypatch.undo()
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    with pytest.raises(InputError, match="aarch64"):
        fmu_archive(MODEL)
