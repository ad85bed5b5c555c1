"""The shipped layouts, each with a log that it is for: everything listed, every line drawn, no complaint."""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import pytest
from mcap.reader import make_reader

from viewer import panels, pictures
from viewer.logs import rewrite
from viewer.panels import Layout
from viewer.studio import Studio, eventually

CASES = [
    ("single", "one-plant"),
    ("comparison", "comparison"),
    ("comparison", "four"),
    ("controller", "robustified"),
    ("controller", "law"),
    ("ladder", "ladder"),
    ("overlay", "overlay"),
]
CURVE = 50  # pixels at least of a curve across a plot; a level line in the smallest plot has 85
BAR = 6.0  # pixels of a bar's ten that must be seen: a low panel cuts the last one off
EVENT = "[ INFO]"


@dataclass(frozen=True)
class Shown:
    """A log that is open in the viewer, in the middle of its time."""

    studio: Studio
    name: str
    log: Path
    layout: Layout


@pytest.fixture(scope="module", params=CASES, ids=lambda case: case[1])
def shown(request: pytest.FixtureRequest, studio: Studio, files: Path, logs: dict[str, Path]) -> Shown:
    """Each shipped layout in turn."""
    name, kind = request.param
    layout = panels.with_values(panels.shipped(name, files, "--log", str(logs[kind])))
    studio.open_log(f"/files/{logs[kind].name}", layout)
    studio.seek(0.5)
    return Shown(studio, name, logs[kind], layout)


def counts(log: Path) -> dict[str, str]:
    """Number of messages of each topic."""
    with log.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    numbers = summary.statistics.channel_message_counts
    return {channel.topic: str(numbers[channel.id]) for channel in summary.channels.values()}


def is_number(text: str) -> bool:
    """Whether a legend's text is a finite number."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def curve_pixels(studio: Studio, name: str, plot: Layout) -> int:
    """How much of a plot has the colour of one of its lines; grey ones are left out, as the axes are grey."""
    picture = studio.picture(name)
    colours = {path["color"] for path in plot["paths"] if not pictures.is_grey(path["color"])}
    return max(pictures.coloured(picture, colour) for colour in colours)


def bar_share(studio: Studio, name: str) -> float:
    """Height [pixels] of all that is bright in a panel, were it as wide as the panel."""
    picture = studio.picture(name)
    return float((picture.max(axis=2) > 150).sum() / picture.shape[1])


def test_all_topics_are_listed(shown: Shown) -> None:
    assert eventually(shown.studio.topics, lambda seen: seen == counts(shown.log)) == counts(shown.log)


def test_every_line_of_every_plot_has_a_value(shown: Shown) -> None:
    for name, plot in panels.of_type(shown.layout, "Plot").items():
        wanted = [path["value"] for path in plot["paths"]]
        values = eventually(
            lambda name=name: shown.studio.legend(name), lambda seen: all(map(is_number, seen)) and bool(seen)
        )
        assert len(values) == len(wanted)
        missing = [path for path, value in zip(wanted, values, strict=True) if not is_number(value)]
        assert not missing, plot["foxglovePanelTitle"]


def test_every_plot_draws_curves(shown: Shown) -> None:
    for name, plot in panels.of_type(shown.layout, "Plot").items():
        drawn = eventually(
            lambda name=name, plot=plot: curve_pixels(shown.studio, name, plot), lambda n: n >= CURVE
        )
        assert drawn >= CURVE, plot["foxglovePanelTitle"]


def test_the_distance_of_every_crane_from_the_one_compared_against_is_drawn(shown: Shown) -> None:
    distances = {topic for topic in counts(shown.log) if re.fullmatch("/diff(/.*)?/distance", topic)}
    plots = panels.of_type(shown.layout, "Plot").values()
    for what in ("load_distance", "angle_distance"):
        values = [path["value"] for plot in plots for path in plot["paths"] if what in path["value"]]
        drawn = {value.partition(".")[0] for value in values} & distances
        assert len(drawn) == {"comparison": 1, "four": 3}.get(shown.log.stem, 0)
        assert drawn == (distances if shown.name == "comparison" else set())


def test_the_3d_panel_has_room(shown: Shown) -> None:
    (name,) = panels.of_type(shown.layout, "3D")
    box = shown.studio.panel(name).bounding_box()
    assert box is not None
    assert min(box["width"], box["height"]) > 280.0, "pixels of a window of 1280 by 800"


def test_status_is_drawn_as_bars(shown: Shown) -> None:
    ((name, panel),) = panels.of_type(shown.layout, "StateTransitions").items()
    needed = len(panel["paths"]) * BAR
    assert eventually(lambda: bar_share(shown.studio, name), lambda share: share > needed) > needed


def test_events_are_told(shown: Shown) -> None:
    (name,) = panels.of_type(shown.layout, "RosOut")
    text = eventually(shown.studio.panel(name).inner_text, lambda seen: EVENT in seen)
    assert EVENT in text


def test_the_3d_panel_shows_the_crane(shown: Shown) -> None:
    (name,) = panels.of_type(shown.layout, "3D")
    picture = eventually(lambda: shown.studio.picture(name), lambda seen: pictures.bridge(seen).any())
    assert pictures.bridge(picture).sum() > 500
    assert pictures.hue(picture, -12.0, 25.0).sum() > 50, "the load, red, or dyed by a ghost before it"


def test_no_complaint(shown: Shown) -> None:
    assert shown.studio.problems() == []
    assert shown.studio.exceptions == []
    (name,) = panels.of_type(shown.layout, "3D")
    shown.studio.open_settings(name)
    assert shown.studio.marked_wrong() == []


def test_without_the_plants_topics_nothing_is_drawn(
    studio: Studio, files: Path, logs: dict[str, Path]
) -> None:
    """Otherwise the tests above would prove nothing."""
    bare = rewrite(
        logs["one-plant"], files / "bare.mcap", keep=lambda topic: topic in ("/run/info", "/rig/workspace")
    )
    layout = panels.with_values(panels.shipped("single", files))
    studio.open_log(f"/files/{bare.name}", layout)
    studio.seek(0.5)
    expected = {"/run/info", "/rig/workspace"}
    assert set(eventually(studio.topics, lambda topics: set(topics) == expected)) == expected
    for name, plot in panels.of_type(layout, "Plot").items():
        assert not any(map(is_number, studio.legend(name)))
        assert curve_pixels(studio, name, plot) == 0
    (name,) = panels.of_type(layout, "StateTransitions")
    assert bar_share(studio, name) < BAR
    (name,) = panels.of_type(layout, "RosOut")
    assert EVENT not in studio.panel(name).inner_text()
    (name,) = panels.of_type(layout, "3D")
    picture = studio.picture(name)
    assert pictures.bridge(picture).sum() == 0
    assert pictures.load(picture).sum() == 0
