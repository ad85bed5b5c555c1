"""A controller, plant, metric, segment and exporter of other packages work in all commands."""

import csv
import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet
import pytest

from tests.packages import install, run_all_beside

pytestmark = pytest.mark.slow

CONTROLLER = """\
import numpy as np
from cranectl import Controller, Logged, Parameter, Signal

def step(parameters, measured, reference, memory, command):
    for axis in range(3):
        target = reference[axis] if axis < 2 else -reference[axis]
        memory[axis] = target - measured[2 * axis]
        command[axis] = parameters[0] * memory[axis] - parameters[1] * measured[2 * axis + 1]
    return 0

SERVO = Controller(
    name="servo",
    title="a spring and a damper on each drive",
    step=step,
    prepare=lambda nominal: (np.array(list(nominal.parameters.values())), np.zeros(3)),
    follows="set-point",
    parameters=(Parameter("stiffness", 1.0, "1/s²", "spring"), Parameter("damping", 2.0, "1/s", "damper")),
    logged=(Logged(0, Signal("bridge_error", "e_x", "m", "of the bridge")),),
)
"""
PLANT = """\
import cranectl
from cranectl.plants.analytic import AnalyticPlant
from cranectl.plants.registry import PLANTS

class MoonPlant(AnalyticPlant):
    name = "moon"
    description = "the analytic plant with a sixth of gravity"

    def __init__(self, rig, **options):
        super().__init__(rig.model_copy(update={"gravity": rig.gravity / 6.0}), **options)

MOON = cranectl.PlantEntry(
    name="moon", label="moon", colour="series-4", where="crane_plant:MoonPlant", batch=4,
    lacks=PLANTS["analytic"].lacks,
)
"""
METRIC = """\
from cranectl.metrics import Metric, Row
from cranectl.signals import COLUMN

def highest(setup, own, time_ns, record, reference, commands):
    own[0] = record[:, COLUMN.load + 2].max(initial=own[0])

HIGHEST = Metric(
    name="highest_load_m", symbol="z_max", unit="m", meaning="highest position of the load",
    definition="max z_3", value=lambda run: run.own["highest_load_m"][0],
    row=Row("load, highest", digits=3), kernel=highest, start=(-1e9,),
)
"""
SEGMENT = """\
from typing import Literal
import numpy as np
from cranectl.scenario.segments import SegmentKind
from cranectl.scenario.settings import Duration, Settings

class Bow(Settings):
    kind: Literal["bow"]
    duration: Duration
    height: float

class BowPath:
    def __init__(self, start, height, duration):
        self.start, self.height, self.duration = start, height, duration

    def sample(self, time):
        rows = np.zeros((len(time), 5, 3))
        rows[:, 0] = self.start
        tau = time / self.duration
        bump = np.polynomial.Polynomial([0, 1]) ** 6 * np.polynomial.Polynomial([1, -1]) ** 6
        for order in range(5):
            factor = 4**6 * self.height / self.duration**order
            rows[:, order, 2] += factor * (bump.deriv(order) if order else bump)(tau)
        return rows

BOW = SegmentKind("bow", Bow, lambda bow, start: BowPath(start, bow.height, bow.duration))
"""
EXPORTER = """\
from cranectl.log.export import Exporter

def write(table, path):
    path.write_text("highest " + str(max(c.values.max() for c in table.columns if c.name.endswith("load_z"))))

NOTE = Exporter("note", "a note", b"highest", write)
"""
SCENARIO = """\
name = "bow"
duration = 4.0
controller = "servo"
workspace.on_exit = "record"
[reference]
start = [1.0, 0.7, -0.9]
segments = [
    {kind = "bow", duration = 3.0, height = 0.3},
    {kind = "line", to = [1.2, 0.7, -0.9], duration = 1.0},
]
"""
CAMPAIGN = """\
name = "many"
scenario = "bow.toml"
controllers = ["servo", "lqr"]
plants = ["moon", "analytic"]
drive = "velocity"
runs = 8
[uncertain.rig.bridge_time_constant]
distribution = "uniform"
low = 0.01
high = 0.04
"""

ENTRIES = {
    "controllers": ("crane_controller", "SERVO", CONTROLLER),
    "plants": ("crane_plant", "MOON", PLANT),
    "metrics": ("crane_metric", "HIGHEST", METRIC),
    "segments": ("crane_segment", "BOW", SEGMENT),
    "exporters": ("crane_exporter", "NOTE", EXPORTER),
}
LOG = "logs/bow/servo-velocity.mcap"
LINES = (
    "run bow.toml --drive velocity --json run.json",
    f"info {LOG}",
    f"compare {LOG}",
    f"report {LOG} --out a.html",
    f"log export {LOG} --format note --out a.note",
    f"log export {LOG} --signals moon.controller.* --out a.csv",
    "campaign run many.toml --out many",
    "campaign report many",
)


@pytest.fixture(scope="module")
def output(folder: Path) -> str:
    """Run all commands in one process; return their output."""
    return run_all_beside(folder, *LINES)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the five installed packages, a scenario and a campaign."""
    directory = tmp_path_factory.mktemp("outside")
    for group, (module, name, code) in ENTRIES.items():
        entry_points = f"[cranectl.{group}]\n{name.lower()} = {module}:{name}\n"
        install(directory, module.replace("_", "-"), code, entry_points)
    (directory / "bow.toml").write_text(SCENARIO)
    (directory / "many.toml").write_text(CAMPAIGN)
    return directory


@pytest.mark.usefixtures("output")
def test_a_run_uses_all_extensions(folder: Path) -> None:
    """The controller follows the segment on each plant, and the metric measures it."""
    result = json.loads((folder / "run.json").read_text())
    by_plant = {run["plant"]: run for run in result["runs"]}
    assert list(by_plant) == ["analytic", "elastic", "mujoco", "moon"]
    for run in by_plant.values():
        assert run["controller"] == "servo"
        assert -0.95 < run["metrics"]["highest_load_m"] <= -0.8


def test_commands_handle_a_log_with_extensions(folder: Path, output: str) -> None:
    for text in ("bow", "servo, velocity drives", "crane-controller 1.0", "/moon/controller", " servo, moon"):
        assert text in output, text
    assert "load, highest" in (folder / "a.html").read_text(encoding="utf-8")
    assert float((folder / "a.note").read_text().removeprefix("highest ")) == pytest.approx(-0.6, abs=1e-9)
    with (folder / "a.csv").open(newline="") as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    errors = np.array([float(row["moon.controller.bridge_error"]) for row in rows])
    assert errors[0] == 0.0, "before the line begins, the set-point is the end of the bow"
    assert errors.max() == pytest.approx(0.2, abs=1e-6)


def test_a_campaign_runs_with_extensions(folder: Path, output: str) -> None:
    assert "many.html" in output
    assert "servo" in (folder / "many.html").read_text(encoding="utf-8")
    parts = sorted((folder / "many" / "parts").glob("*.parquet"))
    rows = [row for part in parts for row in parquet.read_table(part).to_pylist()]
    assert len(rows) == 8 * 4
    assert {row["status"] for row in rows} == {"completed"}
    assert all(-0.95 < row["highest_load_m"] < -0.55 for row in rows)
    for name in ("servo", "lqr"):
        errors = {row["rms_error_m"] for row in rows if row["controller"] == name}
        assert len(errors) >= 8, "the cranes differ: equal cranes would give one number per plant"
