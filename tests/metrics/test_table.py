"""Test the table of metrics, which all uses follow from, and metrics of other packages."""

import json
import pickle
import re
from importlib.metadata import EntryPoint
from pathlib import Path

import pyarrow.parquet as parquet
import pytest

from cranectl.metrics import Metric, RunMetrics
from cranectl.metrics.table import METRICS
from cranectl.support.errors import InputError
from tests.conftest import ROOT
from tests.packages import install, run_all_beside

PAGE = (ROOT / "docs" / "reference" / "metrics.md").read_text(encoding="utf-8")
UNITS = {"m_s2": "m/s²", "rad": "rad", "m": "m", "s": "s", "n": "N", "j": "J"}  # by the end of a name
CAMPAIGN = """\
name = "small"
scenario = "fixed-position"
controllers = ["lqr"]
runs = 2
set = ["duration=0.3", "disturbances=[]"]

[uncertain.rig.load_mass]
distribution = "uniform"
low = 0.5
high = 2.0

[limits]
max_rope_tension_n = 12.0
"""


@pytest.mark.parametrize("metric", METRICS, ids=lambda metric: metric.name)
def test_a_row_is_consistent(metric: Metric) -> None:
    """Names contain units, and a limited or compared metric is a number with a better side."""
    assert UNITS[re.search("_(m_s2|[a-z]+)$", metric.name)[1]] == metric.unit
    if metric.limited or metric.compared:
        assert metric.better
        assert metric.recorded
        assert metric.columns == (metric.name,)


def test_names_are_there_once() -> None:
    columns = [column for metric in METRICS for column in metric.columns]
    assert len(set(columns)) == len(columns)
    assert [name for name in columns if Metric.low_is_bad(name)] == ["min_clearance_m", "min_rope_tension_n"]
    places = [metric.row.place for metric in METRICS if metric.row.label]
    assert len(set(places)) == len(places)


def test_metrics_of_a_run_are_attributes() -> None:
    metrics = RunMetrics("completed", 1.0, {"overshoot_m": None, "max_error_m": 0.1})
    assert (metrics.overshoot_m, metrics.max_error_m) == (None, 0.1)
    assert pickle.loads(pickle.dumps(metrics)) == metrics
    with pytest.raises(AttributeError, match="no metric 'max_eror_m'"):
        metrics.max_eror_m  # noqa: B018


@pytest.mark.slow
def test_a_metric_from_outside_is_everywhere(tmp_path: Path) -> None:
    """The example of the docs page works in its own package: one row and a kernel.

    `tests/test_extensions.py` has the pages.
    """
    (code,) = re.findall(r"```python\n(from cranectl.metrics import Metric.*?)```", PAGE, re.DOTALL)
    (entry,) = re.findall(r'cranectl.metrics"\]\n(.*)\n', PAGE)
    install(tmp_path, "crane-metrics", code, f"[cranectl.metrics]\n{entry}".replace('"', ""))
    (tmp_path / "small.toml").write_text(CAMPAIGN)
    shown = run_all_beside(
        tmp_path,
        "run fixed-position --plants analytic --set duration=0.3 --set disturbances=[] --json run.json",
        "campaign run small.toml --out result --json small.json",
    )
    # 1 kg that hangs still, to the last of its three digits
    assert re.search(r"rope tension, max +N +9\.81\d", shown)
    assert shown.index("time outside") < shown.index("rope tension, max"), "after those that have a place"
    runs = json.loads((tmp_path / "run.json").read_text())["runs"]
    tensions = [run["metrics"]["max_rope_tension_n"] for run in runs]
    assert tensions == pytest.approx([9.81] * len(runs), abs=0.01)

    (part,) = (tmp_path / "result" / "parts").iterdir()
    rows = parquet.read_table(part)
    column = rows.schema.field("max_rope_tension_n").metadata
    assert (column[b"unit"], column[b"description"]) == (b"N", b"largest tension of the rope")
    masses, tensions = rows["rig.load_mass"].to_pylist(), rows["max_rope_tension_n"].to_pylist()
    assert tensions == pytest.approx([9.81 * mass for mass in masses], rel=0.01)
    beyond = sum(tension > 12.0 for tension in tensions)
    assert 0 < beyond < 2
    (group,) = json.loads((tmp_path / "small.json").read_text())["groups"]
    assert group["broken"] == {"max_rope_tension_n": beyond}


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("no_such_module:METRIC", "cranectl.metrics: No module named 'no_such_module'"),
        ("math:pi", "math:pi of the entry points cranectl.metrics: float is no Metric"),
        ("cranectl.metrics.table:METRICS", ": tuple is no Metric"),
        ("tests.metrics.test_table:TAKEN", "the name 'end_s' is taken"),
        ("tests.metrics.test_table:TWICE", "the name 'max_error_m' is taken"),
    ],
)
def test_what_is_no_metric_is_refused(entry: str, message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    entries = [EntryPoint("mine", entry, "cranectl.metrics")]
    monkeypatch.setattr("importlib.metadata.entry_points", lambda **_: entries)
    with pytest.raises(InputError) as caught:
        Metric.all.__wrapped__()
    assert message in caught.value.found


TWICE = METRICS[0]
TAKEN = Metric("end_s", "", "s", "", "", lambda _: 0.0)
