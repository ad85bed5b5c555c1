"""A plant of another package, known by its entry only, can be used wherever the others can."""

import importlib
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import cranectl
from cranectl.cli.main import main
from cranectl.compare import Agreement
from cranectl.log.overlay import Log
from cranectl.plants.entry import PlantEntry
from cranectl.plants.registry import PLANTS
from cranectl.support.colours import Palette
from cranectl.support.errors import InputError
from cranectl.support.units import Quantity
from cranectl.tools.render.caption import readings
from cranectl.tools.render.timeline import Timeline
from tests.packages import install, run_all_beside

SOURCE = """\
import cranectl
from cranectl.plants.analytic import AnalyticPlant
from cranectl.plants.registry import PLANTS

def heavier(rig):
    return rig.model_copy(update={"gravity": 1.01 * rig.gravity})

class HeavyPlant(AnalyticPlant):
    name = "heavy"
    description = "the analytic plant with 1 % more gravity"

    def __init__(self, rig, **options):
        super().__init__(heavier(rig), **options)

    def retune(self, rig, effects):
        return super().retune(heavier(rig), effects)

HEAVY = cranectl.PlantEntry(
    name="heavy",
    label="tons of bricks",
    colour="series-4",
    where="heavy_plant:HeavyPlant",
    batch=3,
    lacks=PLANTS["analytic"].lacks,
)
"""
REGISTERED = "cranectl.register_plant(HEAVY)\n"
CAMPAIGN = """\
name = "three-plants"
scenario = "fixed-position"
controllers = ["lqr"]
plants = ["heavy", "analytic", "mujoco"]
drive = "ideal"
runs = 8
set = ["duration=0.5", "disturbances=[]"]

[uncertain.rig.load_mass]
distribution = "uniform"
low = 0.5
high = 1.5
"""
MOVED = ["--set", "duration=3", "--set", "disturbances=[]", "--set", "initial.load_offset=[0.02, 0.0, 0.0]"]
RUN = ["run", "fixed-position", "--controller", "lqr", *MOVED]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the module of the plant, whose plant is registered."""
    made = tmp_path_factory.mktemp("third")
    (made / "heavy_plant.py").write_text(SOURCE + REGISTERED)
    (made / "mine.toml").write_text(CAMPAIGN)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(made)
        patch.chdir(made)
        importlib.import_module("heavy_plant")
        try:
            yield made
        finally:
            del PLANTS["heavy"], sys.modules["heavy_plant"]


@pytest.fixture(scope="module")
def log(folder: Path) -> Path:
    """Return a log of all three plants; the exit code is 1, since one of them has another gravity."""
    assert main([*RUN, "--out", "three.mcap", "--json", "run.json"]) == 1
    return folder / "three.mcap"


def by_plant(path: str | Path) -> dict[str, bool]:
    agreements = json.loads(Path(path).read_text())["agreements"]
    assert {agreement["reference"] for agreement in agreements} == {"mujoco"}
    return {agreement["plant"]: agreement["passed"] for agreement in agreements}


def test_each_is_judged_against_the_reference(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    verdicts = {"analytic": True, "elastic": True, "heavy": False}
    assert by_plant("run.json") == verdicts
    assert main(["compare", str(log), "--json", "compare.json"]) == 1
    shown = capsys.readouterr().out
    assert " lqr, heavy" in shown
    assert by_plant("compare.json") == verdicts
    assert main(["info", str(log), "--json", "info.json"]) == 0
    assert "heavy and mujoco at most" in capsys.readouterr().out
    assert by_plant("info.json") == verdicts
    for name in ("compare.json", "info.json"):
        assert json.loads(Path(name).read_text())["agreement"]["plant"] == "heavy", "the least good"


def test_a_log_has_the_differences_of_each_plant(log: Path) -> None:
    runs = cranectl.read_log(log)
    assert list(runs) == ["analytic", "elastic", "mujoco", "heavy"]
    assert runs["heavy"].model == "the analytic plant with 1 % more gravity"
    for plant, apart in (("analytic", 1e-7), ("heavy", 1.0)):
        _, difference = cranectl.read_signal(log, f"diff/{plant}/load.load_x")
        true = runs["mujoco"].load_position[:, 0] - runs[plant].load_position[:, 0]
        np.testing.assert_array_equal(difference, true)
        assert 0.0 < np.abs(difference).max() < apart
    _, heavy = cranectl.read_signal(log, "diff/heavy/distance.load_distance")
    assert heavy.max() > 1e-5
    with pytest.raises(cranectl.InputError, match="unknown signal"):
        cranectl.read_signal(log, "diff/load.load_x")


def test_pictures_and_pages_show_all(log: Path) -> None:
    runs = cranectl.read_log(log)
    timeline = Timeline.of(runs)
    assert [(track.label, track.is_ghost) for track in timeline.tracks] == [
        ("analytic", True), ("elastic", True), ("MuJoCo", True), ("tons of bricks", False),
    ]  # fmt: skip
    farthest = max(
        float(np.linalg.norm(a.load_position[-1] - b.load_position[-1]))
        for a, b in Agreement.pairs(list(runs.values()))
    )
    assert (f"plants apart by {Quantity(farthest, 'm')}", "muted") in readings(timeline, timeline.duration)
    assert main(["report", str(log), "--out", "three.html"]) == 0
    page = Path("three.html").read_text()
    for plant in ("analytic", "heavy"):
        assert f"three: mujoco minus {plant}" in page
    assert main(["log", "layout", "comparison", "three.json"]) == 0
    assert "/diff/heavy/distance.load_distance.@log10" in Path("three.json").read_text()


def test_workers_know_it_too(folder: Path) -> None:
    line = "validate fixed-position --drive ideal --jobs 2 --json val.json --plants heavy,mujoco"
    command = [*line.split(), *MOVED, "--controller", "lqr", "--controller", "pole-placement"]
    script = f"import heavy_plant, sys; from cranectl.cli.main import main; sys.exit(main({command!r}))"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1, done.stderr
    assert by_plant("val.json") == {"heavy": False}
    assert len(json.loads((folder / "val.json").read_text())["runs"]) == 4


@pytest.mark.parametrize("command", [RUN, ["validate"], ["live", "fixed-position"], ["campaign", "run", "x"]])
def test_an_unknown_plant_is_answered_with_the_known_ones(
    folder: Path, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert folder == Path.cwd()
    for option in ("--plants", "--plant"):
        assert main([*command, option, "hevy"]) == 2
        assert ", heavy\nremedy:  did you mean 'heavy'?" in capsys.readouterr().err


@pytest.mark.slow
def test_its_log_can_be_read_without_its_package(log: Path, tmp_path: Path) -> None:
    """It is shown with label and colour; only running it needs the package."""
    shutil.copy(log, tmp_path / "three.mcap")
    (tmp_path / "cut.mcap").write_bytes(log.read_bytes()[: log.stat().st_size * 2 // 3])
    output = run_all_beside(
        tmp_path,
        "info three.mcap",
        "report three.mcap --out three.html",
        "log export three.mcap --signals heavy.state.alpha --out three.csv",
        "log layout comparison three.json --log three.mcap",
        "log layout single one.json --log three.mcap --plants heavy",
        "log overlay three.mcap --plants mujoco,heavy --label light,heavier --out both.mcap",
        "log overlay three.mcap --plants all --out all.mcap",
        "render three.mcap three.png --time 1",
        "log recover cut.mcap --out whole.mcap",
        "info whole.mcap",
        codes={
            "run fixed-position --plants heavy": 2,  # before a log tells of it
            "compare three.mcap": 1,
            "log overlay three.mcap --plants hevy": 2,
            "log layout single a.json --log three.mcap --plants hevy": 2,
        },
    )
    assert "heavy        completed at 3 s" in output
    assert "lqr, heavy" in output
    assert output.count("unknown plant 'hevy'") == 2
    assert "unknown plant 'heavy'" in output
    page = (tmp_path / "three.html").read_text()
    assert ">tons of bricks<" in page
    assert "three: mujoco minus heavy" in page
    layout = (tmp_path / "three.json").read_text()
    assert "tons of bricks status" in layout
    assert Palette.VIEWER["series-5"] not in layout
    assert Palette.VIEWER["series-4"] in layout
    assert [*Log.read(tmp_path / "both.mcap").layers] == ["light", "heavier"]
    assert "heavy" in (tmp_path / "one.json").read_text()
    table = np.genfromtxt(tmp_path / "three.csv", delimiter=",", names=True)
    _, alpha = cranectl.read_signal(log, "heavy/state.alpha")
    np.testing.assert_array_equal(table["heavystatealpha"], alpha)


def test_a_plant_known_from_a_log_only_cannot_be_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """The error does not call its name unknown, also if an older log has no label for it."""
    monkeypatch.setattr(PLANTS, "_logged", {})
    PLANTS.remember(PlantEntry("absent", "absent", "series-4", "", batch=0))
    assert "absent" not in list(PLANTS)
    assert PLANTS.in_order(["absent", "analytic"]) == ("analytic", "absent")
    with pytest.raises(InputError, match="the absent plant, which no installed package brings"):
        PLANTS.to_run(["absent"])
    PLANTS.remember(PlantEntry("mujoco", "forged", "series-4", "", batch=0))
    assert PLANTS["mujoco"].label == "MuJoCo"


@pytest.mark.slow
def test_a_plant_of_an_installed_package_is_found_by_every_process(tmp_path: Path) -> None:
    """Nothing is imported or registered by hand; another version of the package is another software."""
    entry_points = "[cranectl.plants]\nheavy = heavy_plant:HEAVY"
    install(tmp_path, "heavy-plant", SOURCE, entry_points)
    (tmp_path / "mine.toml").write_text(CAMPAIGN.replace(', "analytic", "mujoco"', ""))
    run = "campaign run mine.toml --out"
    run_all_beside(tmp_path, f"{run} threads", f"{run} dask --cluster local --workers 1")
    parts = [path.relative_to(tmp_path / "dask") for path in (tmp_path / "dask").rglob("*.parquet")]
    assert len(parts) == 3
    for part in parts:
        assert (tmp_path / "dask" / part).read_bytes() == (tmp_path / "threads" / part).read_bytes()
    install(tmp_path, "heavy-plant", SOURCE.replace("1.01", "1.02"), entry_points, version="1.1")
    refused = run_all_beside(tmp_path, codes={f"{run} threads --resume": 2})
    assert "heavy-plant 1.0, now 1.1" in refused
    assert "sources of heavy_plant " in refused
