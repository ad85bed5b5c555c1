"""Logs of other software: `info`, `report`, `compare` and the golden check report the differences."""

import json
import shutil
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.support.provenance import Provenance
from tests.cli.conftest import Command

OTHER = {"sources": "00ff00ff00ff00ff"}
NAMED = "sources 00ff00ff00ff00ff"
SHORT = ["--set", "duration=0.1", "--set", "disturbances=[]", "--plant", "analytic"]


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a log of this version, one of other sources, and one without information on its sources."""
    folder = tmp_path_factory.mktemp("logs")
    own = Provenance.fingerprints()
    for name, sources in (("new", own), ("other", own | OTHER), ("old", {})):
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(Provenance, "fingerprints", lambda sources=sources: sources)
            assert main(["run", "fixed-position", *SHORT, "--out", str(folder / f"{name}.mcap")]) == 0
    return folder


@pytest.fixture(autouse=True)
def in_directory_of_logs(logs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(logs)


def test_the_golden_check_reports_other_software_and_judges_by_numbers(output: Command) -> None:
    check = ["--tolerances", "exact", "--json", "result.json"]
    out = output("compare", "new.mcap", "other.mcap", *check)
    now = Provenance.fingerprints()["sources"]
    assert f"golden was made by other software: {NAMED}, other {now}" in out
    assert json.loads(Path("result.json").read_text())["software_differences"] == [f"{NAMED}, other {now}"]
    shutil.copy("new.mcap", "same.mcap")
    assert "other software" not in output("compare", "new.mcap", "same.mcap", *check)
    assert json.loads(Path("result.json").read_text())["software_differences"] == []
    out = output("compare", "new.mcap", "old.mcap", *check)
    assert out.count("golden was made by other software") == 3
    assert "data unknown, other " in out


def test_compare_reports_other_software(output: Command) -> None:
    out = output("compare", "other.mcap", "new.mcap")
    assert f"made by other software: {NAMED}, other " in out
    assert "other software" not in output("compare", "new.mcap", "new.mcap")


def test_info_reports_other_software(output: Command) -> None:
    out = output("info", "other.mcap")
    assert f"differs      {NAMED}, now {Provenance.fingerprints()['sources']}\n" in out
    assert "differs" not in output("info", "new.mcap")
    assert "sources unknown, now" in output("info", "old.mcap")
    result = json.loads(output("info", "new.mcap", "--json", "-"))
    assert result["software_differences"] == []
    assert Provenance.fingerprints().items() <= result["versions"].items()


def test_report_reports_other_software(output: Command) -> None:
    note = f"other was made by other software than is installed: {NAMED}, now "
    assert note in output("report", "other.mcap", "new.mcap", "--out", "page.html")
    assert note in Path("page.html").read_text()
