"""`cranectl design --export` writes what its README says, and its commands work as they stand there."""

import shlex
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers
from cranectl.support.errors import InputError
from cranectl.tools.export.package import exported_files
from cranectl.tools.export.unit import Unit
from tests.docs.test_docs import blocks
from tests.tools.export.exported import library, prepared


@pytest.mark.parametrize("name", ["lqr+loop-shaping", "flat-velocity"])
def test_the_commands_of_the_readme_work(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The library runs in the scenario, and the same files are made again."""
    monkeypatch.chdir(tmp_path)
    changed = ["--set", "initial.load_offset=[0.01, 0, 0]"]
    assert main(["design", name, "--scenario", "fast-diagonal", *changed, "--export", "new/as-c"]) == 0
    assert "exported: new/as-c; new/as-c/README.md says" in capsys.readouterr().out
    monkeypatch.chdir("new/as-c")
    stem = name.replace("+", "_").replace("-", "_")
    files = {"README.md", "main.c", "vectors.h", "reference.h", "cranectl.h", f"{stem}.h"}
    files |= {f"{stem}.c", f"cranectl_{stem}.c"}
    assert {path.name for path in Path().iterdir()} == files
    readme = Path("README.md").read_text(encoding="utf-8")
    assert all(f"`{file}`" in readme for file in files - {"README.md"})
    programs = []
    for _, text in blocks(Path("README.md")):
        for line in text.splitlines():
            program, *arguments = shlex.split(line)
            programs.append(program)
            if arguments[:1] == ["design"]:
                assert main(arguments) == 0
                made = {path.name: path.read_bytes() for path in Path("new/as-c").iterdir()}
                assert made == {path.name: path.read_bytes() for path in Path().iterdir() if path.is_file()}
            elif program == "cranectl":
                assert main([*arguments, "--plants", "analytic"]) == 0
            else:
                subprocess.run([program, *arguments], check=True, capture_output=True)
    assert programs == ["cranectl", "cc", "./replay", "cc", "cranectl"]


def test_both_exports_share_one_translation_and_cannot_be_exported_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Libraries and FMUs have no source in Python: the remedy is the controller from which they were made."""
    monkeypatch.chdir(tmp_path)
    translated, step = [], Unit.step
    monkeypatch.setattr(
        Unit, "step", lambda unit, *given: (translated.append(given[1]), step(unit, *given))[1]
    )
    scenario = ["--scenario", "fast-diagonal", "--set", "duration=4"]
    assert main(["design", "lqr", *scenario, "--export", ".", "--fmu", "lqr.fmu"]) == 0
    assert translated == ["cranectl_lqr_step", "cranectl_lqr_sample"]
    library(Path(), "lqr")
    capsys.readouterr()
    for file, option in (("lqr.so", ["--export", "again"]), ("lqr.fmu", ["--fmu", "again.fmu"])):
        close_controllers()
        assert main(["design", file, *scenario, *option]) == 2
        error = " ".join(capsys.readouterr().err.split())
        assert f"found: {file} has no Python source to translate: it is a library, an FMU" in error
        assert "remedy: export the Python controller that it was made from, or compile its own" in error


def test_other_scenarios_give_other_numbers(tmp_path: Path) -> None:
    """The rig, settings and period of the scenario are those of the code."""
    texts = []
    for folder, changes in (("a", []), ("b", ["control.period=0.002", "design.poles=[-3,-3.5,-4,-5]"])):
        options = [word for change in changes for word in ("--set", change)]
        command = ["design", "pole-placement", "--scenario", "fast-diagonal", *options]
        assert main([*command, "--export", str(tmp_path / folder)]) == 0
        texts.append({path.name: path.read_text(encoding="utf-8") for path in (tmp_path / folder).iterdir()})
    a, b = texts
    assert "PERIOD 0.001 " in a["pole_placement.h"]
    assert "PERIOD 0.002 " in b["pole_placement.h"]
    function = "/* cranectl.controllers.flat.begin"
    assert a["pole_placement.c"].split(function)[0] != b["pole_placement.c"].split(function)[0]
    assert a["pole_placement.c"].split(function)[1] == b["pole_placement.c"].split(function)[1]


def test_a_reference_that_is_too_long_is_refused() -> None:
    """The remedy is a duration with half as many samples as are allowed."""
    exported = prepared("lqr")
    rows = np.zeros((100_001, 15))
    compiled = exported.prepared.compiled._replace(reference=rows)
    longer = replace(exported, prepared=replace(exported.prepared, compiled=compiled))
    with pytest.raises(InputError, match="100001 samples") as refused:
        exported_files(longer, "")
    assert refused.value.remedy == "add --set duration=50, or take a shorter scenario"
