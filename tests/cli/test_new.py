"""`cranectl new` writes complete examples; `cranectl list --schema` prints the schemas of documents."""

import json
import re
import shlex
import subprocess
import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from cranectl.cli import new
from cranectl.cli.list import DOCUMENTS
from cranectl.cli.main import main
from cranectl.cli.new import ENDINGS
from cranectl.cli.schemas import json_schema
from cranectl.loaders.opening import close_controllers
from tests.cli.conftest import Command
from tests.conftest import ROOT

pytestmark = pytest.mark.usefixtures("in_empty_directory")


def problems(document: str, text: str) -> list[str]:
    errors = Draft202012Validator(json_schema(document)).iter_errors(tomllib.loads(text))
    return [error.json_path for error in errors]


def test_new_writes_complete_examples() -> None:
    """tests/docs/test_examples.py runs the tests that the examples contain."""
    for kind, ending in ENDINGS.items():
        assert main(["new", kind, f"own-{kind}", "--in", kind]) == 0
        written = {path.name: path.read_text() for path in Path(kind).iterdir()}
        stem = f"own-{kind}".replace("-", "_") if kind.endswith("controller") else f"own-{kind}"
        header = {"cranectl.h"} if ending == "c" else set()
        assert set(written) == {f"{stem}.{ending}", f"test_own_{kind}.py".replace("-", "_"), *header}
        assert not any(word in text for text in written.values() for word in ("NAME", "MODULE"))
        if kind in DOCUMENTS:
            assert problems(kind, written[f"{stem}.toml"]) == []


def test_new_replaces_no_file_and_checks_names(refusal: Command) -> None:
    Path("test_mine.py").write_text("old content")
    for arguments, message in (
        (["scenario", "mine"], "test_mine.py exists"),
        (["scenario", "Mine"], "a scenario named 'Mine'"),
        (["motor", "mine"], "'motor' is not one of"),
        (["rig", "other", "--in", "test_mine.py"], "test_mine.py"),
    ):
        assert message in refusal("new", *arguments)
    assert [path.name for path in Path().iterdir()] == ["test_mine.py"]
    assert Path("test_mine.py").read_text() == "old content"


@pytest.mark.parametrize("is_there", [True, False])
def test_new_says_what_its_test_needs(
    is_there: bool, monkeypatch: pytest.MonkeyPatch, output: Command
) -> None:
    monkeypatch.setattr(new, "find_spec", lambda name: object() if is_there and name == "pytest" else None)
    assert ("python -m pip install pytest" in output("new", "rig", "yard-crane")) != is_there


def typed(command: str) -> int:
    """Return the exit code of a command as a shell would pass it."""
    program, *arguments = shlex.split(command)
    return main(arguments) if program == "cranectl" else subprocess.run([program, *arguments]).returncode


@pytest.mark.parametrize("kind", ["c-controller", "generated-controller"])
def test_the_commands_that_compile_and_run_a_controller_can_be_typed(
    kind: str, output: Command, refusal: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    close_controllers()
    text = output("new", kind, "servo", "--in", "crane's laws")
    (compiles,) = re.findall("compile it: (cc .*)", text)
    (runs,) = re.findall("run it: (cranectl .*)", text)
    source = Path("crane's laws/servo.c")
    assert main(shlex.split(runs)[1:]) == 2, "it is not compiled yet"
    error = refusal("run", "fast-diagonal", "--controller", str(source))
    assert f"{source} is the source of a controller" in error
    assert compiles in error
    assert typed(compiles) == 0
    assert typed(f"{runs} --plants analytic") == 0
    good = source.read_text()
    source.write_text(good.replace(".every = 1", ".every = -1"))
    close_controllers()
    assert typed(compiles) == 0
    Path("crane's laws/cranectl.h").unlink()
    assert typed(runs) == 2
    (again,) = re.findall("compile it again: (cc .*); 'cranectl new", capsys.readouterr().err)
    source.write_text(good)
    assert typed(again) == 0
    close_controllers()
    assert typed(f"{runs} --plants analytic") == 0
    assert main(["new", "c-controller", "name"]) == 0, "as the remedy says"
    close_controllers()


@pytest.mark.parametrize("document", DOCUMENTS)
def test_the_shipped_schemas_are_up_to_date(document: str, output: Command) -> None:
    printed = json.loads(output("list", "--schema", document))
    Draft202012Validator.check_schema(printed)
    shipped = ROOT / "validation" / "schemas" / f"{document}.json"
    assert json.loads(shipped.read_text()) == printed, "run python docs/reference_pages.py --write"


@pytest.mark.parametrize(
    ("document", "folder"), [("scenario", "scenarios"), ("campaign", "campaigns"), ("benchmark", "benchmark")]
)
def test_every_shipped_file_satisfies_its_schema(document: str, folder: str) -> None:
    for path in (ROOT / "validation" / folder).glob("*.toml"):
        text = path.read_text()
        schema = path.parent / text.splitlines()[0].removeprefix("#:schema ")
        assert schema.resolve() == ROOT / "validation" / "schemas" / f"{document}.json"
        assert problems(document, text) == [], path


@pytest.mark.parametrize(
    ("line", "location"),
    [
        ("controler = 'lqr'", "$"),
        ("controller = 'lrq'", "$.controller"),
        ("controller = {name='pid', pid={kp_bridge='much'}}", "$.controller"),
        ("duration = -1.0", "$.duration"),
        ("limits = {max_swy_rad=1.0}", "$.limits"),
        ("limits = {mujoco={max_error_m=-1.0}}", "$.limits.mujoco.max_error_m"),
        ("rig = {bridge_range=[0.0]}", "$.rig.bridge_range"),
        ("reference.segments = [{kind='lin', duration=1.0}]", "$.reference.segments[0]"),
    ],
)
def test_the_schema_locates_an_error(line: str, location: str) -> None:
    start = 'name = "a"\nreference.start = [0.5, 0.5, -0.5]\n'
    valid = (
        "controller = {name='pid', pid={shaper='zv'}}\nlimits = {max_error_m=1.0, mujoco={max_error_m=2.0}}\n"
    )
    assert problems("scenario", f"{start}duration = 1.0\n{valid}") == []
    duration = "" if line.startswith("duration") else "duration = 1.0\n"
    assert problems("scenario", f"{start}{duration}{line}\n") == [location]
