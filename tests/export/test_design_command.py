"""`cranectl design --export` writes what its README says, and its commands work as they stand there."""

import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.export import exported_files
from cranectl.loaders.opening import close_controllers
from cranectl.support.errors import InputError
from tests.docs.test_docs import blocks
from tests.export.exported import prepared


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    """Close the libraries that a test has opened."""
    yield
    close_controllers()


@pytest.mark.parametrize("name", ["lqr+loop-shaping", "flat-velocity"])
def test_the_commands_of_the_readme_work(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["design", name, "--scenario", "fast-diagonal", "--export", "new/as-c"]) == 0
    assert "exported: new/as-c; new/as-c/README.md says" in capsys.readouterr().out
    monkeypatch.chdir("new/as-c")
    stem = name.replace("+", "_").replace("-", "_")
    files = {
        "README.md",
        "main.c",
        "vectors.h",
        f"{stem}.c",
        f"{stem}.h",
        f"cranectl_{stem}.c",
        "cranectl.h",
        "reference.h",
    }
    assert {path.name for path in Path().iterdir()} == files
    readme = Path("README.md").read_text(encoding="utf-8")
    assert all(f"`{file}`" in readme for file in files - {"README.md"})
    programs = []
    for _, text in blocks(Path("README.md")):
        for line in text.splitlines():
            program, *arguments = shlex.split(line)
            programs.append(program)
            if program == "cranectl":
                assert main([*arguments, "--plants", "analytic"]) == 0
            else:
                subprocess.run([program, *arguments], check=True, capture_output=True)
    assert programs == ["cc", "./replay", "cc", "cranectl"]


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
    with pytest.raises(InputError, match="100001 samples") as refused:
        exported_files(exported._replace(compiled=exported.compiled._replace(reference=rows)))
    assert refused.value.remedy == "add --set duration=50, or take a shorter scenario"
