"""Following a remedy that names an option works on the refused input.

Remedies that name a key or a value are in `test_key_remedies_*.py`.
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
from tests.cli.option_cases import CAMPAIGN, CASES, FILES, LOGS, RUN
from tests.remedies import PLACEHOLDER, prepared, remedy_test

pytestmark = pytest.mark.usefixtures("in_copy_of_files")


def copy_logs() -> None:
    shutil.copy("again.mcap", "again.mcap.4711.part")
    for folder in ("newer", "golden"):
        Path(folder).mkdir()
        shutil.copy("one.mcap", folder)


prepared_files = prepared(
    FILES,
    [
        *(f"{command} --out {name}" for name, command in LOGS.items()),
        "log overlay one.mcap two.mcap --out over.mcap",
        f"{CAMPAIGN} result",
        "new scenario short --in there",
    ],
    copy_logs,
)


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[[str, str], None]:
    """Return a function that checks that a command is refused with a text."""

    def check(command: str, text: str) -> None:
        capsys.readouterr()
        assert main(command.split()) == 2
        error = capsys.readouterr().err
        assert re.search(".*".join(map(re.escape, text.split(PLACEHOLDER))), error), error

    return check


Refused = Callable[[str, str], None]


test_a_suggested_option_works_on_the_refused_input = remedy_test(CASES, "")


# Messages that need more than a command.


def edit_manifest(change: Callable[[dict[str, Any]], Any]) -> None:
    path = Path("result", MANIFEST_FILE)
    manifest = json.loads(path.read_text())
    change(manifest)
    path.write_text(json.dumps(manifest))


@pytest.mark.parametrize("command", [f"{CAMPAIGN} new", f"{CAMPAIGN} result --resume --despite-differences"])
def test_a_result_of_other_software_is_resumed_only_on_request(command: str, refused: Refused) -> None:
    edit_manifest(lambda manifest: manifest["versions"].update(numpy="1.0"))
    refused(
        f"{CAMPAIGN} result --resume", "install those, choose another place with --out, or add --despite-dif"
    )
    assert main(command.split()) == 0


def test_a_result_in_use_by_another_process_is_refused(refused: Refused) -> None:
    with FileLock(Path("result", LOCK_FILE)):
        refused(f"{CAMPAIGN} result --resume", "wait for it, or choose another place with --out")
        assert main(f"{CAMPAIGN} new".split()) == 0
    assert main(f"{CAMPAIGN} result --resume".split()) == 0


def test_a_campaign_is_resumed_after_a_full_disk(refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    def write_to_full_disk(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "full")

    with monkeypatch.context() as patch:
        patch.setattr("cranectl.campaign.results.write_part", write_to_full_disk)
        refused(f"{CAMPAIGN} new", "make room and go on with --resume: finished batches are kept")
    assert main(f"{CAMPAIGN} new --resume".split()) == 0


def test_an_incomplete_result_without_its_command_can_be_resumed(refused: Refused) -> None:
    edit_manifest(lambda manifest: manifest.pop("command"))
    next(Path("result", PARTS).iterdir()).unlink()
    refused("campaign report result", "the command that began it and --resume")
    assert main(f"{CAMPAIGN} result --resume".split()) == 0
    assert main(["campaign", "report", "result", "--out", "page.html"]) == 0


def test_timeout_allows_a_slow_controller(capfd: pytest.CaptureFixture[str]) -> None:
    run = f"{RUN} analytic --controller slow.py:slow --out slow.mcap --timeout"
    assert main([*run.split(), "1"]) == 3
    assert "took more than 1 s for a block; --timeout allows more" in capfd.readouterr().err
    close_controllers()
    assert main([*run.split(), "600"]) in (0, 1)


DISTURBED = "--set disturbances=[{joint='alpha',start=0.1,magnitude=0.1}]"


@pytest.mark.parametrize(
    ("entry", "options", "text", "remedied"),
    [
        ({"drives": ("velocity",)}, "", "take '--drive {}'", [f"{RUN} analytic --drive velocity"]),
        ({"fixed": {"load_mass": 1.0}}, "--set rig.load_mass=2.0", "add {}, or choose other plants with",
         [f"{RUN} analytic --set rig.load_mass=1.0", f"{RUN} mujoco --set rig.load_mass=2.0"]),
        ({"lacks": {"disturbances": "which has none"}}, DISTURBED, "{}, or add --set 'disturbances=[]'",
         [f"{RUN} mujoco {DISTURBED}", f"{RUN} analytic {DISTURBED} --set disturbances=[]"]),
    ],
)  # fmt: skip
def test_the_remedy_for_a_limited_plant_works(
    entry: dict[str, Any], options: str, text: str, remedied: list[str],
    refused: Refused, monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """A plant of another package may have such limits."""
    monkeypatch.setitem(PLANTS._entries, "analytic", replace(PLANTS["analytic"], **entry))  # type: ignore[attr-defined]
    refused(f"{RUN} analytic {options}", text)
    for command in remedied:
        assert main(command.split()) in (0, 1), command
