"""Messages that name an option: each is taken on the very input that caused it, or has a reason why not.

Others of the kind are in `test_remedies`; remedies that name a key or a value in `test_key_remedies_*`.
"""

import errno
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock

from cranectl.campaign.results import LOCK_FILE, MANIFEST_FILE, PARTS
from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers
from cranectl.plants.registry import PLANTS
from tests.cli.option_cases import (
    BEGAN,
    CAMPAIGN,
    CASES,
    DIFFERENCES,
    DISTURBED,
    DRIVE,
    FIXED,
    KNOWN,
    LOGS,
    MORE,
    ROOM,
    RUN,
    WAIT,
    Case,
)
from tests.cli.options import texts_with_options
from tests.cli.test_remedies import CASES as TRIED
from tests.cli.test_remedies import FILES
from tests.remedies import HOLE

pytestmark = pytest.mark.usefixtures("in_copy")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs, folders of them, and a result of a campaign."""
    folder = tmp_path_factory.mktemp("made")
    for name, text in {**FILES, **MORE}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    (folder / "renamed.toml").write_text(MORE["longer.toml"].replace('"short"', '"longer"'))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name, command in LOGS.items():
            assert main([*command.split(), "--out", name]) == 0
        assert main([*CAMPAIGN.split(), "result"]) == 0
        assert main(["new", "scenario", "short", "--in", "there"]) == 0
    for part in ("newer", "golden"):
        (folder / part).mkdir()
        shutil.copy(folder / "one.mcap", folder / part / "one.mcap")
    shutil.copy(folder / "again.mcap", folder / "again.mcap.4711.part")
    return folder


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[[str, str], None]:
    """Check that a command is refused with a text."""

    def check(command: str, text: str) -> None:
        capsys.readouterr()
        assert main(command.split()) == 2
        error = capsys.readouterr().err
        assert re.search(".*".join(map(re.escape, text.split(HOLE))), error), error

    return check


Refused = Callable[[str, str], None]


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.source}: {case.text}")
def test_an_option_works_on_what_was_refused(case: Case, refused: Refused) -> None:
    refused(case.refused, case.text)
    for command in case.taken:
        assert main(command.split()) in (0, 1), command


# What needs more than a command to be refused.


def changed_manifest(change: Callable[[dict[str, Any]], Any]) -> None:
    path = Path("result", MANIFEST_FILE)
    manifest = json.loads(path.read_text())
    change(manifest)
    path.write_text(json.dumps(manifest))


@pytest.mark.parametrize("command", [f"{CAMPAIGN} new", f"{CAMPAIGN} result --resume --despite-differences"])
def test_a_result_by_other_software(command: str, refused: Refused) -> None:
    changed_manifest(lambda manifest: manifest["versions"].update(numpy="1.0"))
    refused(f"{CAMPAIGN} result --resume", DIFFERENCES)
    assert main(command.split()) == 0


def test_a_result_that_another_process_writes(refused: Refused) -> None:
    with FileLock(Path("result", LOCK_FILE)):
        refused(f"{CAMPAIGN} result --resume", WAIT)
        assert main(f"{CAMPAIGN} new".split()) == 0
    assert main(f"{CAMPAIGN} result --resume".split()) == 0


def test_a_result_on_a_full_disk(refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "full")

    with monkeypatch.context() as patch:
        patch.setattr("cranectl.campaign.results.write_part", full)
        refused(f"{CAMPAIGN} new", ROOM)
    assert main(f"{CAMPAIGN} new --resume".split()) == 0


def test_a_result_that_does_not_say_how_it_was_begun(refused: Refused) -> None:
    changed_manifest(lambda manifest: manifest.pop("command"))
    next(Path("result", PARTS).iterdir()).unlink()
    refused("campaign report result", BEGAN)
    assert main(f"{CAMPAIGN} result --resume".split()) == 0
    assert main(["campaign", "report", "result", "--out", "page.html"]) == 0


def test_a_controller_that_is_given_more_patience(capfd: pytest.CaptureFixture[str]) -> None:
    run = f"{RUN} analytic --controller slow.py:slow --out slow.mcap --patience"
    assert main([*run.split(), "1"]) == 3
    assert "took more than 1 s for a block; --patience allows more" in capfd.readouterr().err
    close_controllers()
    assert main([*run.split(), "600"]) in (0, 1)


@pytest.mark.parametrize(
    ("entry", "added", "text", "taken"),
    [
        ({"drives": ("velocity",)}, "", DRIVE, (f"{RUN} analytic --drive velocity",)),
        (
            {"fixed": {"load_mass": 1.0}},
            " --set rig.load_mass=2.0",
            FIXED,
            (f"{RUN} analytic --set rig.load_mass=1.0", f"{RUN} mujoco --set rig.load_mass=2.0"),
        ),
        (
            {"lacks": {"disturbances": "which has none"}},
            " --set disturbances=[{joint='alpha',start=0.1,magnitude=0.1}]",
            DISTURBED,
            (
                f"{RUN} mujoco --set disturbances=[{{joint='alpha',start=0.1,magnitude=0.1}}]",
                f"{RUN} analytic --set disturbances=[{{joint='alpha',start=0.1,magnitude=0.1}}] "
                "--set disturbances=[]",
            ),
        ),
    ],
)
def test_a_plant_that_lacks_something(
    entry: dict[str, Any],
    added: str,
    text: str,
    taken: tuple[str, ...],
    refused: Refused,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As one of another package may."""
    monkeypatch.setitem(PLANTS._entries, "analytic", replace(PLANTS["analytic"], **entry))  # type: ignore[attr-defined]
    refused(f"{RUN} analytic{added}", text)
    for command in taken:
        assert main(command.split()) in (0, 1), command


def test_no_other_text_of_the_package_names_an_option() -> None:
    """Each is tried here or in `test_remedies`, or has a reason."""
    found = texts_with_options()
    tried = {(case.source, case.text) for case in CASES}
    assert tried <= found
    rest = found - tried
    for file, part in KNOWN:
        named = {(source, text) for source, text in rest if source == file and part in text}
        assert named, f"{file} has no longer: {part}"
        rest -= named
    assert not [text for _, text in rest if not any(is_told(told, text) for _, told, _ in TRIED)]


def is_told(told: str, text: str) -> bool:
    """Return True if what a command has told is a text with its holes filled in, or a part of it."""
    filled = (re.fullmatch(".*".join(map(re.escape, part.split(HOLE))), told) for part in text.split(", "))
    return told in text or any(filled)
