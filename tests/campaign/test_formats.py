"""Results of this format stay readable: `samples` has one, and what another format has is refused."""

import functools
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from cranectl.campaign import table as columns
from cranectl.campaign.manifest import FORMAT
from cranectl.campaign.results import MANIFEST_FILE, Store, read_results
from cranectl.campaign.summary import summarize
from cranectl.cli.main import main
from cranectl.support.errors import InputError
from cranectl.support.provenance import Provenance

SAMPLES = Path(__file__).parent / "samples"
SAMPLE = f"format-{FORMAT}"
# Largest error of each sample with lqr, read from the parts by pyarrow alone.
ERRORS = [
    0.04711652747316714,
    0.07450149957616926,
    0.03959036077762523,
    0.030515855312749945,
    0.05766577166052214,
    0.10030105336646963,
]


@pytest.fixture
def samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Copy all samples, and enter their folder."""
    shutil.copytree(SAMPLES, tmp_path / "samples")
    monkeypatch.chdir(tmp_path / "samples")
    return tmp_path / "samples"


def test_its_numbers_are_what_they_were() -> None:
    assert [path.name for path in SAMPLES.iterdir()] == [SAMPLE]
    assert json.loads((SAMPLES / SAMPLE / MANIFEST_FILE).read_text())["format"] == FORMAT
    results = read_results(SAMPLES / SAMPLE)
    assert results.missing == ()
    assert results.column("max_error_m")[:6].tolist() == ERRORS
    assert np.isnan(results.column("min_clearance_m")).all(), "without obstacles"
    assert results.row(5)["rig.winch_time_constant"] == 0.027448522737539484
    lqr = summarize(results)[0]
    assert (lqr.runs, lqr.failures, lqr.worst_sample) == (6, 2, 5)
    assert lqr.median_max_error_m == pytest.approx(0.05239114956684464, rel=1e-15)


def test_it_can_be_reported(samples: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["campaign", "report", SAMPLE, "--out", "page.html", "--json", "found.json"]
    assert main(command) == 0
    out = capsys.readouterr().out
    assert "33.3  9.7-70.0     0.0524" in out
    assert f"sources 70bca0eedddf5057, now {Provenance.fingerprints()['sources']}" in out
    makers = json.loads((samples / "found.json").read_text())["software"]
    assert [maker["runs"] for maker in makers] == [6, 6]
    assert [maker["versions"]["sources"] for maker in makers] == ["70bca0eedddf5057", "0123456789abcdef"]
    assert "sources" in (samples / "page.html").read_text()


def test_a_result_of_other_velocity_drives_is_not_resumed(samples: Path) -> None:
    """Old and new runs in one table would be runs of two different cranes."""
    before = read_results(SAMPLE)
    manifest = (samples / SAMPLE / MANIFEST_FILE).read_bytes()
    with (
        pytest.raises(InputError, match="velocity_drives is absent, not servos"),
        Store.open(before.campaign, Path(SAMPLE), resume=True, despite_differences=True),
    ):
        pass
    assert (samples / SAMPLE / MANIFEST_FILE).read_bytes() == manifest


def test_columns_may_be_described_in_other_words(monkeypatch: pytest.MonkeyPatch) -> None:
    reworded = columns.METRIC_COLUMNS["max_error_m"]._replace(description="how far off the load was at most")
    monkeypatch.setitem(columns.METRIC_COLUMNS, "max_error_m", reworded)
    results = read_results(SAMPLES / SAMPLE)
    assert results.table.schema.field("max_error_m").metadata[b"description"].startswith(b"how far off")
    monkeypatch.setitem(columns.METRIC_COLUMNS, "max_error_m", reworded._replace(unit="mm"))
    with pytest.raises(InputError, match="its columns are not those of the campaign"):
        read_results(SAMPLES / SAMPLE)


@pytest.mark.parametrize(
    ("text", "found", "remedy"),
    [
        ('{"format": 4}', "campaign.json has format 4", "version of cranectl that wrote it"),
        ('{"format": 2}', "campaign.json has format 2", "version of cranectl that wrote it"),
        ('{"format": true}', "not the manifest of a campaign", "run the campaign again"),
        ('{"format": [1]}', "not the manifest of a campaign", "run the campaign again"),
        ("[" * 20_000, "campaign.json", "remove the directory"),
        ('{"a":' * 20_000, "campaign.json", "remove the directory"),
    ],
)
def test_records_that_cannot_be_read(samples: Path, text: str, found: str, remedy: str) -> None:
    (samples / SAMPLE / MANIFEST_FILE).write_text(text)
    with pytest.raises(InputError) as caught:
        read_results(SAMPLE)
    assert found in caught.value.found
    assert remedy in caught.value.remedy


TABLES = [
    ["accepted"],
    ["models"],
    ["campaign"],
    ["versions"],
    ["scenario", "rig"],
    ["scenario", "disturbances"],
    ["scenario", "reference"],
    ["scenario", "reference", "segments"],
]
NAME = ["campaign", "name"]


@pytest.mark.parametrize(
    ("keys", "damaged"),
    [
        *((keys, damaged) for keys in TABLES for damaged in (None, "a", ["a"], [None], 7)),
        *((NAME, damaged) for damaged in (None, ["a"], 7)),
    ],
)
def test_a_manifest_must_have_what_results_are_compared_by(
    samples: Path, keys: list[str], damaged: object
) -> None:
    path = samples / SAMPLE / MANIFEST_FILE
    manifest = json.loads(path.read_text())
    *tables, last = keys
    functools.reduce(dict.__getitem__, tables, manifest)[last] = damaged
    path.write_text(json.dumps(manifest))
    with pytest.raises(InputError, match="not the manifest of a campaign"):
        read_results(SAMPLE)
