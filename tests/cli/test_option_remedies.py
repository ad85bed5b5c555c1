"""Following a remedy that names an option works on the refused input.

Remedies that name a key or a value are in `test_key_remedies_*.py`.
"""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock

from cranectl.campaign.results import LOCK_FILE, MANIFEST_FILE, PARTS
from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers
from cranectl.plants.registry import PLANTS
from tests.cli.conftest import Command
from tests.cli.option_cases import CAMPAIGN, CASES, FILES, LOGS, RUN
from tests.remedies import Case, check, prepared, remedy_test

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

test_a_suggested_option_works_on_the_refused_input = remedy_test(CASES, "")


# Messages that need more than a command.


def test_a_result_in_use_by_another_process_is_refused(refusal: Command) -> None:
    with FileLock(Path("result", LOCK_FILE)):
        error = refusal(*f"{CAMPAIGN} result --resume".split())
        assert "wait for it, or choose another place with --out" in error
        assert main(f"{CAMPAIGN} new".split()) == 0
    assert main(f"{CAMPAIGN} result --resume".split()) == 0


def test_an_incomplete_result_without_its_command_can_be_resumed(refusal: Command) -> None:
    path = Path("result", MANIFEST_FILE)
    manifest = json.loads(path.read_text())
    del manifest["command"]
    path.write_text(json.dumps(manifest))
    next(Path("result", PARTS).iterdir()).unlink()
    assert "the command that began it and --resume" in refusal("campaign", "report", "result")
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
    ("entry", "case"),
    [
        ({"drives": ("velocity",)},
         Case("take '--drive {}'", f"{RUN} analytic", f"{RUN} analytic --drive velocity")),
        ({"fixed": {"load_mass": 1.0}},
         Case("add {}, or choose other plants with", f"{RUN} analytic --set rig.load_mass=2.0",
              f"{RUN} analytic --set rig.load_mass=1.0", f"{RUN} mujoco --set rig.load_mass=2.0")),
        ({"lacks": {"disturbances": "which has none"}},
         Case("{}, or add --set 'disturbances=[]'", f"{RUN} analytic {DISTURBED}",
              f"{RUN} mujoco {DISTURBED}", f"{RUN} analytic {DISTURBED} --set disturbances=[]")),
    ],
)  # fmt: skip
def test_the_remedy_for_a_limited_plant_works(
    entry: dict[str, Any], case: Case, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A plant of another package may have such limits."""
    monkeypatch.setitem(PLANTS._entries, "analytic", replace(PLANTS["analytic"], **entry))  # type: ignore[attr-defined]
    check(case, "", capsys)
