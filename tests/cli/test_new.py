"""`cranectl new` and `cranectl list --schema`: what people write, begun and checked for them."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from cranectl.cli.list import DOCUMENTS, json_schema
from cranectl.cli.main import main
from cranectl.cli.new import ENDINGS
from tests.conftest import ROOT

pytestmark = pytest.mark.usefixtures("in_empty_directory")


def problems(document: str, text: str) -> list[str]:
    found = Draft202012Validator(json_schema(document)).iter_errors(tomllib.loads(text))
    return [error.json_path for error in found]


def test_examples_are_whole() -> None:
    """That they prove themselves is tests/docs/test_examples.py."""
    for kind, ending in ENDINGS.items():
        assert main(["new", kind, f"own-{kind}", "--in", kind]) == 0
        written = {path.name: path.read_text() for path in Path(kind).iterdir()}
        stem = f"own-{kind}".replace("-", "_") if kind.endswith("controller") else f"own-{kind}"
        beside = {"cranectl.h"} if ending == "c" else set()
        assert set(written) == {f"{stem}.{ending}", f"test_own_{kind}.py".replace("-", "_"), *beside}
        assert not any(word in text for text in written.values() for word in ("NAME", "MODULE"))
        if kind in DOCUMENTS:
            assert problems(kind, written[f"{stem}.toml"]) == []


def test_nothing_is_replaced_and_names_are_checked(capsys: pytest.CaptureFixture[str]) -> None:
    Path("test_mine.py").write_text("of before")
    for arguments, found in (
        (["scenario", "mine"], "test_mine.py exists"),
        (["scenario", "Mine"], "a scenario named 'Mine'"),
        (["motor", "mine"], "'motor' is not one of"),
        (["rig", "other", "--in", "test_mine.py"], "test_mine.py"),
    ):
        assert main(["new", *arguments]) == 2
        assert found in capsys.readouterr().err
    assert [path.name for path in Path().iterdir()] == ["test_mine.py"]
    assert Path("test_mine.py").read_text() == "of before"


@pytest.mark.parametrize("document", DOCUMENTS)
def test_the_shipped_schemas_are_todays(document: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "--schema", document]) == 0
    printed: dict[str, Any] = json.loads(capsys.readouterr().out)
    Draft202012Validator.check_schema(printed)
    shipped = ROOT / "validation" / "schemas" / f"{document}.json"
    assert json.loads(shipped.read_text()) == printed, "run python docs/reference_pages.py --write"


@pytest.mark.parametrize(
    ("document", "folder"), [("scenario", "scenarios"), ("campaign", "campaigns"), ("benchmark", "benchmark")]
)
def test_every_shipped_file_names_its_schema_and_keeps_it(document: str, folder: str) -> None:
    for path in (ROOT / "validation" / folder).glob("*.toml"):
        text = path.read_text()
        named = path.parent / text.splitlines()[0].removeprefix("#:schema ")
        assert named.resolve() == ROOT / "validation" / "schemas" / f"{document}.json"
        assert problems(document, text) == [], path


@pytest.mark.parametrize(
    ("line", "where"),
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
def test_an_editor_sees_what_is_wrong(line: str, where: str) -> None:
    good = 'name = "a"\nreference.start = [0.5, 0.5, -0.5]\n'
    right = (
        "controller = {name='pid', pid={shaper='zv'}}\nlimits = {max_error_m=1.0, mujoco={max_error_m=2.0}}\n"
    )
    assert problems("scenario", f"{good}duration = 1.0\n{right}") == []
    duration = "" if line.startswith("duration") else "duration = 1.0\n"
    assert problems("scenario", f"{good}{duration}{line}\n") == [where]
