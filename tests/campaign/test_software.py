"""A result of two versions of the software is refused, or accepted and reported run by run."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from cranectl.campaign.definition import Batch
from cranectl.campaign.results import MANIFEST_FILE, PARTS, read_results
from cranectl.campaign.table import part_name, write_part
from cranectl.cli.main import main
from cranectl.support.provenance import Provenance
from tests.support.test_provenance import copy_checkout

LAST = Batch("analytic", "pole-placement", 128, 160)
RESUME = ["campaign", "run", "small.toml", "--out", "result", "--resume"]
CHANGED = {"sources": "00ff00ff00ff00ff"}
FROM_ELSEWHERE = """\
import sys
sys.path[0] = sys.argv.pop(1)
from cranectl.cli.main import main
sys.exit(main())
"""


@pytest.fixture(autouse=True)
def in_directory_of_result(in_directory_with_campaign: Path, finished: Path) -> None:
    """And a result without its last part."""
    shutil.copytree(finished, in_directory_with_campaign / "result")
    Path("result", PARTS, part_name(LAST)).unlink()


def contents() -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in Path("result").rglob("*.*") if path.suffix != ".lock"}


def test_a_result_is_not_resumed_by_other_physics(tmp_path: Path) -> None:
    """Gravity in the sources is 5 % larger, which only the fingerprint shows."""
    checkout = copy_checkout(tmp_path / "checkout")
    dynamics = checkout / "cranectl" / "model" / "dynamics.py"
    text = dynamics.read_text()
    changed = text.replace("- gravity * sa", "- 1.05 * gravity * sa")
    assert changed != text
    dynamics.write_text(changed)
    before = contents()
    command = [sys.executable, "-c", FROM_ELSEWHERE, str(checkout), *RESUME]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 2, ended.stderr
    assert f"made by other software: sources {Provenance.fingerprints()['sources']}, now " in ended.stderr
    assert "models" not in ended.stderr.partition("allowed")[0]
    assert "--despite-differences" in ended.stderr
    assert contents() == before


def test_what_is_accepted_is_told(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    installed = Provenance.fingerprints()
    with monkeypatch.context() as patched:
        patched.setattr(Provenance, "fingerprints", lambda: installed | CHANGED)
        assert main(RESUME) == 2
        capsys.readouterr()
        assert main([*RESUME, "--despite-differences", "--json", "found.json"]) == 0
        out = capsys.readouterr().out
        mixed = "ade by 2 sets of sources or versions: 288 runs, 32 runs"
        note = f"288 runs by other software than is installed: sources {installed['sources']}, now 00ff"
        makers = json.loads(Path("found.json").read_text())["software"]
        assert [(maker["runs"], bool(maker["differences"])) for maker in makers] == [(288, True), (32, False)]
        assert makers[1]["versions"]["sources"] == CHANGED["sources"]
        assert main(["campaign", "report", "result", "--out", "page.html"]) == 0
        page = Path("page.html").read_text()
        for phrase in (mixed, note):
            assert phrase in out
            assert phrase in page
        assert "sources, software 2" in page
        assert main(RESUME) == 0, "accepted once"
    results = read_results("result")
    assert len(results) == 320
    last = (results.column("controller") == LAST.controller) & (results.column("sample") >= LAST.first)
    assert np.array_equal(results.made_by, last)
    assert main(RESUME) == 0, "what began it may go on"


def test_one_program_says_nothing_but_in_record_and_parts(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*RESUME, "--json", "found.json"]) == 0
    assert "software" not in capsys.readouterr().out
    (maker,) = json.loads(Path("found.json").read_text())["software"]
    assert (maker["runs"], maker["differences"]) == (320, [])
    assert json.loads(Path("result", MANIFEST_FILE).read_text())["accepted"] == []
    metadata = parquet.read_schema(next(Path("result", PARTS).iterdir())).metadata
    assert {
        name: metadata[name.encode()].decode() for name in Provenance.fingerprints()
    } == Provenance.fingerprints()


def test_a_replay_that_differs_names_the_other_program(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One bit of one metric is changed, in a part that is valid otherwise."""
    replay = ["campaign", "replay", "result", "--run", "0", "--controller", "lqr", "--json", "found.json"]
    now = Provenance.fingerprints() | CHANGED
    monkeypatch.setattr(Provenance, "fingerprints", lambda: now)
    assert main(replay) == 0, "the bits decide"
    assert "made by other software: sources " in capsys.readouterr().out
    results = read_results("result", unfinished=True)
    batch = Batch("analytic", "lqr", 0, 64)
    rows = results.table.slice(0, 64).to_pylist()
    rows[0]["rms_error_m"] = float(np.nextafter(rows[0]["rms_error_m"], 1.0))
    write_part(Path("result", PARTS, part_name(batch)), results.campaign, results.origins[0], batch, rows)
    assert main(replay) == 1
    out = " ".join(capsys.readouterr().out.split())
    assert "FAILED run 0 with lqr on analytic" in out
    assert "rms_error_m is" in out
    assert Path("result/replays/analytic-lqr-0000000.mcap").exists()
    assert f"made by other software: sources {results.origins[0].versions['sources']}, now 00ff" in out
    (replayed,) = json.loads(Path("found.json").read_text())["replays"]
    assert len(replayed["software_differences"]) == 1
    assert replayed["same"] is False
