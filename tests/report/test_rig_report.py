"""The pages of a ladder and of a rig: what the commands say is on them, once."""

import json
import re
from pathlib import Path

import pytest

from cranectl.analysis.advice import IMPROVEMENTS
from cranectl.analysis.levels import NAMES
from cranectl.cli.main import main

pytestmark = pytest.mark.usefixtures("in_empty_directory")

SHORT = ["--set", "duration=1.0", "--set", "disturbances.0.start=0.1", "--set", "disturbances.1.start=0.2"]


def anchors(page: str) -> list[str]:
    return re.findall(r'<(?:section|figure)[^>]* id="([^"]+)"', page)


def test_the_page_of_a_ladder(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["ladder", "fixed-position", *SHORT, "--top", "delay", "--report", "a.html", "--json", "a.json"]
    assert main(command) == 0
    assert "sensing" in capsys.readouterr().out
    assert Path("logs/fixed-position/pole-placement-ladder.mcap").exists()
    page = Path("a.html").read_text()
    data = json.loads(Path("a.json").read_text())
    assert [level["level"] for level in data["levels"]] == list(NAMES[:7])
    for level in data["levels"]:
        assert f">{level['level']}<" in page
        if level["cumulative"]:
            assert f"{1e3 * level['cumulative']['max']:.3g}" in page
    assert "friction" not in page
    assert page.count("<svg") == 2
    assert len(anchors(page)) == len(set(anchors(page)))
    assert main(command) == 0
    assert Path("a.html").read_text() == page


def test_the_page_of_a_rig(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["advise", "fixed-position", *SHORT, "--controller", "lqr+loop-shaping"]
    assert main([*command, "--report", "rig.html", "--json", "rig.json"]) == 0
    assert "Take lqr+loop-shaping: guaranteed" in capsys.readouterr().out
    page, data = Path("rig.html").read_text(), json.loads(Path("rig.json").read_text())
    assert "Take lqr+loop-shaping: guaranteed" in page
    assert data["recommended"] == "lqr+loop-shaping"
    assert len(data["improvements"]) == IMPROVEMENTS
    for improvement in data["improvements"]:
        assert improvement["change"] in page
    assert all(f">{name}<" in page for name in NAMES), "the whole ladder"
    for budgeted in ("observer", "quantisation", "friction"):
        assert f">{budgeted}<" in page
    assert page.count("<svg") == 4
    assert len(anchors(page)) == len(set(anchors(page)))
    assert not re.search(r'(?:src|href)="https?:', page), "it needs no network"


def test_a_place_that_cannot_be_written_is_found_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("file").touch()
    for command in (["ladder", "fixed-position"], ["advise", "fixed-position"]):
        assert main([*command, "--report", "file/a.html"]) == 2
        assert "cannot write file/a.html" in capsys.readouterr().err
    assert not list(tmp_path.rglob("*.mcap"))
