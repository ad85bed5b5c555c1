"""FMUs as other tools write them: what they say of units, steps and types is used, or refused by name."""

import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

from cranectl.loaders.opening import close_controllers, open_controller
from cranectl.simulate import Run, simulate_run
from cranectl.support.errors import InputError
from tests.loaders.controller_files import scenario
from tests.tools.export.loaders.fmu_files import INPUTS, Replaced, binary, description, fmu
from tests.tools.export.loaders.test_fmu import damped

# As pythonfmu writes them: a Boolean has no variability, and is said to need its tool.
PYTHON = """\
<ScalarVariable name="on" valueReference="20" causality="input"><Boolean start="true"/></ScalarVariable>
<ScalarVariable name="n" valueReference="21" causality="output"><Integer/></ScalarVariable>
<ScalarVariable name="path" valueReference="22" causality="parameter" variability="tunable">
<String start="a"/></ScalarVariable>
"""
# As the Reference FMUs do: an enumeration with its type, text, bytes, whole numbers.
REFERENCE = """\
<Int32 name="Int32_input" valueReference="20" causality="input" start="0"/>
<Boolean name="Boolean_output" valueReference="21" causality="output"/>
<String name="String_parameter" valueReference="22" causality="parameter" variability="fixed">
<Start value="Set me!"/></String>
<Binary name="Binary_input" valueReference="23" causality="input"><Start value="666f6f"/></Binary>
<Enumeration name="Enumeration_input" valueReference="24" causality="input" declaredType="Option" start="1"/>
"""
OPTION = """\
<TypeDefinitions><EnumerationType name="Option" description="an option"><Item name="Option 1" value="1"/>
</EnumerationType></TypeDefinitions>"""
MILLIMETRES = """<UnitDefinitions>
<Unit name="mm"><BaseUnit m="1" factor="0.001"/><DisplayUnit name="km" factor="1e-6"/></Unit>
<Unit name="mm/s"><BaseUnit m="1" s="-1" factor="0.001"/></Unit>
<Unit name="mm/s2"><BaseUnit m="1" s="-2" factor="0.001"/></Unit>
<Unit name="rpm"><BaseUnit rad="1" s="-1" factor="0.10471975511965977"/></Unit>
<Unit name="g"><BaseUnit kg="1" factor="0.001"/></Unit>
<Unit name="depth"><BaseUnit m="1" offset="3"/></Unit>
</UnitDefinitions>"""
MORE = [
    ("binaries/win64/law.dll", "of Windows"),
    ("binaries/x86_64-windows/law.dll", "of Windows"),
    ("documentation/index.html", "<html/>"),
    ("terminalsAndIcons/terminalsAndIcons.xml", '<fmiTerminalsAndIcons fmiVersion="3.0"/>'),
    ("resources/y.txt", "a"),
]


def written(path: Path, fmi: int, *, before: str = "", kind: str = "", variables: str = "") -> Path:
    """Write an FMU with all that a tool adds; `before` comes before its variables."""
    text = description(fmi, names={}, variables=variables, kind=kind)
    text = text.replace("<ModelVariables>", f"{before}<ModelVariables>")
    return fmu(path, fmi, xml=f'<?xml version="1.0" encoding="ISO-8859-1"?>\n{text}', more=MORE)


def in_units(path: Path, units: dict[str, str], *, fmi: int = 2, defined: str = MILLIMETRES) -> Path:
    """Write an FMU whose variables have units."""
    text = description(fmi, names={}).replace("<ModelVariables>", f"{defined}<ModelVariables>")
    for name, unit in units.items():
        if fmi == 2:
            text = re.sub(rf'(name="{re.escape(name)}"[^>]*><Real)', rf'\1 unit="{unit}"', text)
        else:
            text = text.replace(f'<Float64 name="{name}"', f'<Float64 unit="{unit}" name="{name}"')
    return fmu(path, fmi, xml=text)


def run(path: Path) -> Run:
    close_controllers()
    name = open_controller(str(path))
    return simulate_run(scenario(), plant="analytic", controller=name, drive="velocity")


def refused(path: Path) -> InputError:
    with pytest.raises(InputError) as caught:
        run(path)
    return caught.value


@pytest.mark.parametrize(
    ("fmi", "before", "kind", "variables"),
    [
        (2, "", 'needsExecutionTool="true"', PYTHON),
        (3, OPTION, 'needsExecutionTool="false"', REFERENCE),
        (2, '<DefaultExperiment startTime="0" stopTime="2" tolerance="1e-6" stepSize="0.1"/>',
         'canHandleVariableCommunicationStepSize="true"', ""),
    ],
    ids=["pythonfmu", "Reference-FMUs", "OpenModelica"],
)  # fmt: skip
def test_one_as_another_tool_writes_it_runs(
    fmi: int, before: str, kind: str, variables: str, tmp_path: Path
) -> None:
    path = written(tmp_path / "law.fmu", fmi, before=before, kind=kind, variables=variables)
    found = run(path)
    assert np.array_equal(found.block("state"), damped(tmp_path).block("state"))
    assert set(found.design.parameters) == {"stiffness", "damper_damping"}


@pytest.mark.parametrize("fmi", [2, 3])
def test_units_that_one_defines_are_converted(fmi: int, tmp_path: Path) -> None:
    """The law of the FMU is linear: all in millimetres, it commands the same."""
    units = {name: "mm" for name in INPUTS if name.endswith(("position", "length", "_x", "_y", "_z"))}
    units |= {name: "mm/s" for name in INPUTS if name not in units}
    units |= {f"command.{axis}": "mm/s2" for axis in ("bridge", "trolley", "rope")}
    found, wanted = run(in_units(tmp_path / "law.fmu", units, fmi=fmi)), damped(tmp_path)
    assert np.allclose(found.block("state"), wanted.block("state"), rtol=0.0, atol=1e-12)
    error = found.reference[:, 0] - found.signal("state.bridge_position")
    assert np.allclose(found.signal("controller.error_1_"), 1e3 * error, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("unit", ["m/s2", "m/s^2", "m.s-2", "m/s²", "m / s**2"])
def test_si_units_need_no_definition(unit: str, tmp_path: Path) -> None:
    path = in_units(tmp_path / "law.fmu", {"command.bridge": unit, "state.bridge_position": "m"}, defined="")
    assert np.array_equal(run(path).block("state"), damped(tmp_path).block("state"))


@pytest.mark.parametrize(
    ("name", "unit", "found"),
    [
        ("state.bridge_position", "ft", "input 'state.bridge_position' is in 'ft', which it does not define"),
        ("state.bridge_position", "g", "in 'g', no unit of this kind; state.bridge_position is in m"),
        ("state.rope_length", "depth", "in 'depth', defined as 1 m and an offset of 3"),
        ("command.rope", "rpm", "output 'command.rope' is in 'rpm', no unit of this kind"),
    ],
)
def test_another_unit_is_refused_and_can_be_stated(name: str, unit: str, found: str, tmp_path: Path) -> None:
    path = in_units(tmp_path / "law.fmu", {name: unit})
    error = refused(path)
    assert found in error.found
    remedy = re.search(r"\[units\] (.*)", error.remedy)
    assert remedy is not None
    path.with_suffix(".toml").write_text(f"[units]\n{remedy[1]}\n")
    assert np.array_equal(run(path).block("state"), damped(tmp_path).block("state"))


@pytest.mark.parametrize(
    ("units", "found"),
    [
        ("'error[1]' = 1.0", "error[1] is no variable that a signal is connected to"),
        ("'command.bridge' = 0", "command.bridge = 0"),
        ("'command.bridge' = nan", "command.bridge = nan"),
    ],
)
def test_units_that_cannot_be_are_refused(units: str, found: str, tmp_path: Path) -> None:
    path = fmu(tmp_path / "law.fmu", 2)
    path.with_suffix(".toml").write_text(f"[units]\n{units}\n")
    assert found in refused(path).found


def test_a_step_that_it_prefers_counts_where_it_takes_no_other(tmp_path: Path) -> None:
    path = written(tmp_path / "law.fmu", 2, before='<DefaultExperiment stepSize="0.008"/>')
    error = refused(path)
    assert "has steps of 0.008 s, its controller is given 0.001 s" in error.found
    for every in (error.remedy.partition(" in ")[0], "every = 1"):
        path.with_suffix(".toml").write_text(every)
        assert run(path).status.label == "completed"


def test_aliases_are_one_variable(tmp_path: Path) -> None:
    text = description(3, names={"state.bridge_position": "u", "command.rope": "y3"})
    for name, alias in (("u", "state.bridge_position"), ("y3", "command.rope"), ("stiffness", "k")):
        text = re.sub(rf'<(Float64 name="{name}"[^>]*)/>', rf'<\1><Alias name="{alias}"/></Float64>', text)
    found = run(fmu(tmp_path / "law.fmu", 3, xml=text))
    assert np.array_equal(found.block("state"), damped(tmp_path).block("state"))
    assert set(found.design.parameters) == {"stiffness", "damper_damping"}


def test_what_cannot_be_exchanged_is_named(tmp_path: Path) -> None:
    clock = '<Clock name="tick" valueReference="40" causality="input" intervalVariability="triggered"/>'
    assert "input 'tick' is Clock" in refused(fmu(tmp_path / "law.fmu", 3, variables=clock)).found
    text = description(2, names={}).replace('start="16"', 'start="a lot"')
    assert "'stiffness' has start = 'a lot'" in refused(fmu(tmp_path / "law.fmu", 2, xml=text)).found


def test_names_that_controllers_and_signals_cannot_have(tmp_path: Path) -> None:
    text = description(2, names={"error[1]": "e" * 300}).replace("FmuDamper", "控制器")
    found = run(fmu(tmp_path / "own law.fmu", 2, xml=text))
    assert found.design.name == "own-law"
    assert found.signal(f"controller.{'e' * 200}").any()


def test_one_that_does_not_start_and_needs_a_tool_says_which(tmp_path: Path) -> None:
    text = description(2, names={}, kind='needsExecutionTool="true"')
    text = text.replace('guid="x"', 'guid="x" generationTool="Another 7.0"')
    path = fmu(tmp_path / "law.fmu", 2, xml=text, library=binary(2, Replaced(made="return 0;")))
    assert "it says that it needs the tool that made it: Another 7.0" in refused(path).found


def test_one_with_sources_only_is_to_be_compiled(tmp_path: Path) -> None:
    path = tmp_path / "own law.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description(2, names={}))
        archive.writestr("sources/law.c", "int x;")
    error = refused(path)
    assert "it has none at all, and sources in C" in error.found
    assert f"fmpy compile '{path}'" in error.remedy
