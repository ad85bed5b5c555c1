"""Layouts: every panel shows something that logs have, titled with its unit."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from cranectl.cli.main import main
from cranectl.log.overlay import Layer, write_overlay
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.report.viewer_layouts import LAYOUTS, layout_json
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import simulate_run
from cranectl.support.errors import InputError
from cranectl.tools.live.hand import VELOCITY_TIMEOUT
from cranectl.tools.live.hand_limits import hand_limits
from cranectl.tools.live.viewers import VELOCITY_TOPIC
from cranectl.tools.robustness.levels import NAMES
from tests.conftest import PLANTS
from tests.scenario.test_drawing import similar

pytestmark = pytest.mark.usefixtures("in_empty_directory")

LABELS = ("lqr", "lqr+hinf", "pid_2")


def leaves(layout: Any) -> Iterator[str]:
    """Panel ids of a layout."""
    if isinstance(layout, str):
        yield layout
        return
    assert layout["direction"] in ("row", "column")
    assert 0.0 < layout["splitPercentage"] < 100.0
    yield from leaves(layout["first"])
    yield from leaves(layout["second"])


@pytest.fixture(scope="module")
def logged(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, str]]:
    """Topics of a log of all plants, and of a ladder, with the units of their fields."""
    scenario = load_scenario("fixed-position", overrides=["duration=0.1", "disturbances=[]"])
    runs = [simulate_run(scenario, plant=plant) for plant in PLANTS]
    folder = tmp_path_factory.mktemp("log")
    write_log(folder / "a.mcap", runs)
    for name, labels in (("b", NAMES), ("c", LABELS)):
        write_overlay(folder / f"{name}.mcap", dict.fromkeys(labels, Layer(runs[0].every(4), 4, {})))
    found = {}
    for path in folder.iterdir():
        with path.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        found |= {channel.topic: channel.metadata for channel in summary.channels.values()}
    return found


@pytest.mark.parametrize("plants", [PLANTS, *((plant,) for plant in PLANTS)])
@pytest.mark.parametrize("name", LAYOUTS)
def test_panels_show_what_logs_have_in_different_colours(
    name: str, plants: tuple[str, ...], logged: dict[str, dict[str, str]]
) -> None:
    layout = json.loads(layout_json(name, plants=plants, labels=LABELS))
    panels = layout["configById"]
    assert sorted(leaves(layout["layout"])) == sorted(panels)
    kinds = {panel.partition("!")[0] for panel in panels}
    steering = {"Parameters", "CallService", "Teleop"} if name == "live" else set()
    assert kinds == {"3D", "Plot", "StateTransitions", "RosOut", *steering}
    for panel, configuration in panels.items():
        title = configuration["foxglovePanelTitle"]
        assert configuration["lichtblickPanelTitle"] == title
        if panel.startswith("Plot"):
            for path in configuration["paths"]:
                topic, _, field = path["value"].replace('"', "").partition(".@")[0].partition(".")
                unit = logged[topic][field].partition("[")[2].partition("]")[0]
                assert title.endswith(f"[{unit}]"), path
                assert unit
            lines = [line["color"] for line in configuration["paths"] if "reference" not in line["value"]]
            assert len(lines) == len(set(lines)), title
        if panel.startswith("3D"):
            assert set(configuration["topics"]) <= set(logged)
            assert all(topic["visible"] for topic in configuration["topics"].values())
        if panel.startswith("StateTransitions"):
            values = [path["value"].replace('"', "") for path in configuration["paths"]]
            assert {value.partition(".")[0] for value in values} <= set(logged)


@pytest.mark.parametrize("crane", ["fixed-position", "workshop-move", "ship-to-shore"])
def test_pads_wish_what_may_be_wished(crane: str) -> None:
    scenario = load_scenario(crane)
    layout = json.loads(layout_json("live", rig=scenario.rig))
    pads = [panel for name, panel in layout["configById"].items() if name.startswith("Teleop")]
    wishes = [pad[f"{button}Button"] for pad in pads for button in ("up", "down", "left", "right")]
    most = dict(zip(("linear-x", "linear-y", "linear-z"), hand_limits(scenario).speed, strict=True))
    shares = {wish["field"]: abs(wish["value"]) / most[wish["field"]] for wish in wishes}
    assert shares == pytest.approx(dict.fromkeys(most, 0.4 / 0.475), rel=1e-3)
    assert {pad["topic"] for pad in pads} == {VELOCITY_TOPIC}
    assert all(1.0 / pad["publishRate"] < VELOCITY_TIMEOUT / 2.0 for pad in pads)


@pytest.mark.parametrize("plant", PLANTS)
def test_a_layout_of_one_run_asks_for_one_plant_only(plant: str) -> None:
    others = set(PLANTS) - {plant}
    for name in ("single", "controller"):
        assert f"/{plant}/state" in layout_json(name, plants=[plant]) or name == "controller"
        assert not any(f"/{other}/" in layout_json(name, plants=[plant]) for other in others)
    for each in PLANTS:
        assert f"/{each}/state.alpha" in layout_json("comparison")


@pytest.mark.parametrize("name", LAYOUTS)
def test_how_runs_stand_has_the_height_of_its_rows(name: str) -> None:
    """In the viewer of 1.48, 62 pixels a row and 30 for the title, of 824 in a window 900 pixels high."""
    for labels in (LABELS[:1], LABELS[:2], LABELS, ("a", "b", "c", "d")):
        plants = ["mujoco"] if len(labels) == 1 else ()
        content = json.loads(layout_json(name, plants=plants, labels=labels))
        (panel,) = (panel for panel in content["configById"] if panel.startswith("StateTransitions"))
        rows = len(content["configById"][panel]["paths"])
        share = height(content["layout"], panel)
        assert 824 * share > 30 + 62 * rows or plants
        left = content["layout"]["splitPercentage"] / 100.0
        assert (left * share < 0.15 and rows <= 3) or not plants, "of one run"


def height(layout: Any, panel: str) -> float:
    """Of a panel, over the window's; 0 if it is not in this part."""
    if isinstance(layout, str):
        return float(layout == panel)
    first, second = (height(layout[side], panel) for side in ("first", "second"))
    share = layout["splitPercentage"] / 100.0
    return max(first, second) if layout["direction"] == "row" else first * share + second * (1.0 - share)


def test_plots_of_constants_have_the_range_of_the_rig() -> None:
    rig = load_scenario("ship-to-shore").rig
    plots = {
        plot["foxglovePanelTitle"]: (plot.get("minYValue"), plot.get("maxYValue"))
        for name in ("single", "comparison")
        for panel, plot in json.loads(layout_json(name, rig=rig))["configById"].items()
        if panel.startswith("Plot")
    }
    assert plots["load x [m]"] == (-3.0, 33.0)
    assert plots["load y [m]"] == (-4.5, 49.5)
    assert plots["load z [m]"] == (-44.0, 4.0)
    assert plots["load [m]"] == (-44.5, 49.5)
    assert plots["rope tension [N]"] == (0.0, 2.0 * rig.weight)
    assert plots["tracking error [m]"] == (None, None), "of unknown size"


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_larger_rig_is_seen_from_as_much_farther(name: str) -> None:
    rigs = (RigParameters(), similar(2.5))
    filed, large = (camera_and_floor(layout_json(name, rig=rig, labels=["a", "b"])) for rig in rigs)
    for key in ("distance", "targetOffset", "near", "far"):
        assert np.array(large[0][key]) == pytest.approx(2.5 * np.array(filed[0][key]), abs=1e-3), key
    assert large[1]["size"] == 2.5 * filed[1]["size"]
    assert large[1]["position"] == pytest.approx([2.5, 1.925, -3.5])


def test_a_log_says_itself_what_it_is_shown_with(capsys: pytest.CaptureFixture[str]) -> None:
    wide = "rig.bridge_range=[0,40]"
    assert main(["run", "fixed-position", "--plant", "analytic", "--set", wide, "--out", "wide.mcap"]) == 0
    (command,) = re.findall(r"cranectl (log layout .*?);", capsys.readouterr().out)
    assert main(command.split()) == 0
    written = Path("view.json").read_text()
    assert "/analytic/load" in written
    assert "/mujoco/" not in written
    camera, _ = camera_and_floor(written)
    assert 10.0 < camera["targetOffset"][0] < 25.0
    assert camera["distance"] > 30.0


def camera_and_floor(layout: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Of the 3-D panel."""
    (scene,) = (p for name, p in json.loads(layout)["configById"].items() if name.startswith("3D"))
    return scene["cameraState"], scene["layers"]["floor"]


def test_unknown_names() -> None:
    with pytest.raises(InputError, match="unknown layout 'singel'"):
        layout_json("singel")
    with pytest.raises(InputError, match="unknown plant"):
        layout_json("single", plants=["both"])


def test_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["log", "layout", "comparison", "a.json"]) == 0
    assert "a.json" in capsys.readouterr().out
    assert Path("a.json").read_text() == layout_json("comparison")
    assert main(["log", "layout", "ladder", "b.json"]) == 0
    assert Path("b.json").read_text() == layout_json("ladder", labels=NAMES)
