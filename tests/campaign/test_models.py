"""Campaigns run on model files of a user, and their results are read where the files are not."""

import json
import re
import shutil
from pathlib import Path

import pytest

from cranectl.campaign.results import read_results
from cranectl.cli.main import main
from tests.packages import run_all_beside
from tests.plants.own_models import MODELS, changed, write_hall

pytestmark = pytest.mark.usefixtures("no_model_afterwards")

RUN = ["campaign", "run", "many.toml", "--workers", "2", "--out"]
REPLAY = ["campaign", "replay", "result", "--worst", "1"]
PUSHED = """
[uncertain.disturbances.0.magnitude]
distribution = "uniform"
low = 0.0
high = 0.02
"""
MANY = f"""\
name = "many"
scenario = "hall.toml"
controllers = ["lqr"]
plants = ["models/hall.xml", "mujoco"]
runs = 3
set = ["duration=4", "reference.segments=[]"]
{PUSHED}
[uncertain.effects.wind.drag_area]
distribution = "uniform"
low = 0.0
high = 20.0
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A campaign of the hall's crane, on its model and on the shipped one."""
    write_hall(tmp_path)
    shutil.copytree(MODELS, tmp_path / "models")
    (tmp_path / "many.toml").write_text(MANY)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_rows_are_those_of_the_shipped_model_on_threads_and_on_a_cluster(folder: Path) -> None:
    assert main([*RUN, "threads"]) == 0
    results = read_results("threads")
    errors = {p: results.column("max_error_m")[results.rows(p, "lqr")] for p in ("hall", "mujoco")}
    assert errors["hall"] == pytest.approx(errors["mujoco"], abs=1e-7)
    assert len(set(errors["hall"])) == 3, "each run has another disturbance"
    run_all_beside(folder, "campaign run many.toml --out dask --cluster local --workers 1")
    parts = sorted(path.name for path in Path("threads/parts").iterdir())
    assert parts == ["part-hall-lqr-0000000.parquet", "part-mujoco-lqr-0000000.parquet"]
    for part in parts:
        assert (Path("dask/parts") / part).read_bytes() == (Path("threads/parts") / part).read_bytes()


def test_a_result_is_read_without_the_file_and_repeated_with_it(folder: Path) -> None:
    assert main([*RUN, "result"]) == 0
    for plants in ("hall", "models/hall.xml", "hall,mujoco"):
        assert main([*REPLAY, "--plants", plants]) == 0
    Path("models").rename("moved")
    output = run_all_beside(
        folder,
        "campaign report result --out page.html",
        "campaign replay result --worst 1 --plants moved/hall.xml --out again",
        codes={"campaign replay result --run 0": 2},
    )
    assert "or name its model file" in output
    assert "hall and mujoco" in Path("page.html").read_text().lower()


def test_another_model_is_another_software(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*RUN, "result"]) == 0
    changed(
        MODELS / "hall.xml",
        folder / "models",
        ('name="sway_along"', 'name="sway_along" damping="9"'),
        name="hall",
    )
    assert main([*RUN, "result", "--resume"]) == 2
    assert "made by other software: model hall" in capsys.readouterr().err
    assert main([*REPLAY, "--plants", "mujoco"]) == 0
    capsys.readouterr()
    assert main([*REPLAY, "--plants", "models/hall.xml"]) == 2
    was = json.loads(Path("result/campaign.json").read_text())["versions"]["model hall"]
    found, _, remedy = capsys.readouterr().err.splitlines()[1:]
    assert re.search(rf"models/hall\.xml has changed: its digest is \w+, that of the result is {was}$", found)
    assert remedy.endswith("restore the file, or run the campaign again with --overwrite")
    shutil.copy(MODELS / "hall.xml", "models")
    assert main([*REPLAY, "--plants", "models/hall.xml"]) == 0


def test_what_a_model_has_is_not_uncertain(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "many.toml").write_text(MANY.replace("disturbances.0.magnitude", "rig.load_mass"))
    assert main([*RUN, "result"]) == 2
    assert "uncertain.rig.load_mass changes nothing on the hall plant" in capsys.readouterr().err


def test_a_rig_brings_its_model_unless_plants_are_named(folder: Path) -> None:
    rig = folder / "rigs" / "hall.toml"
    rig.write_text(f'model = "../models/hall.xml"\n{rig.read_text()}')
    (folder / "many.toml").write_text(MANY.replace('plants = ["models/hall.xml", "mujoco"]\n', ""))
    assert main([*RUN, "both"]) == 0
    assert main([*RUN, "one", "--plants", "mujoco"]) == 0
    plants = [json.loads(Path(f"{name}/campaign.json").read_text()) for name in ("both", "one")]
    assert [manifest["campaign"]["plants"] for manifest in plants] == [["mujoco", "hall"], ["mujoco"]]
    assert "models" not in plants[1]
