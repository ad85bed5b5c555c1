"""Each shipped layout with a log of its kind: topics are listed, lines are drawn, no problem is reported."""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import pytest
from mcap.reader import make_reader

from viewer import panels, pictures
from viewer.logs import rewrite
from viewer.panels import Layout
from viewer.studio import Studio, poll_until

CASES = [
    ("single", "one-plant"),
    ("comparison", "comparison"),
    ("comparison", "four"),
    ("controller", "robustified"),
    ("controller", "law"),
    ("ladder", "ladder"),
    ("overlay", "overlay"),
]
MIN_CURVE_PIXELS = 50  # pixels of a curve across a plot; a level line in the smallest plot has 85
MIN_BAR_HEIGHT = 6.0  # pixels of a bar's ten that must be visible: a low panel cuts the last bar off
EVENT_TEXT = "[ INFO]"


@dataclass(frozen=True)
class Shown:
    """A log that is open in the viewer, with playback in the middle of its duration."""

    studio: Studio
    name: str
    log: Path
    layout: Layout


@pytest.fixture(scope="module", params=CASES, ids=lambda case: case[1])
def shown(request: pytest.FixtureRequest, studio: Studio, files: Path, logs: dict[str, Path]) -> Shown:
    """Open the log of each case with its layout."""
    name, kind = request.param
    layout = panels.show_values(panels.load_shipped_layout(name, files, "--log", str(logs[kind])))
    studio.open_log(f"/files/{logs[kind].name}", layout)
    studio.seek(0.5)
    return Shown(studio, name, logs[kind], layout)


def message_counts(log: Path) -> dict[str, str]:
    """Return the number of messages of each topic in a log."""
    with log.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    counts = summary.statistics.channel_message_counts
    return {channel.topic: str(counts[channel.id]) for channel in summary.channels.values()}


def is_number(text: str) -> bool:
    """Return True if a legend's text is a finite number."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def count_curve_pixels(studio: Studio, plots: dict[str, Layout]) -> dict[str, int]:
    """Count the pixels of the most visible line of each plot; grey lines do not count, as axes are grey."""
    shown = studio.pictures(plots)
    counts = {}
    for name, plot in plots.items():
        colours = {path["color"] for path in plot["paths"] if not pictures.is_grey(path["color"])}
        counts[name] = max(pictures.count_coloured(shown[name], colour) for colour in colours)
    return counts


def bar_height(studio: Studio, name: str) -> float:
    """Return the total height [pixels] of the bright bars in a panel, each as wide as the panel."""
    picture = studio.picture(name)
    return float((picture.max(axis=2) > 150).sum() / picture.shape[1])


def test_all_topics_are_listed(shown: Shown) -> None:
    expected = message_counts(shown.log)
    assert poll_until(shown.studio.topics, lambda topics: topics == expected) == expected


def test_every_line_of_every_plot_has_a_value(shown: Shown) -> None:
    for name, plot in panels.panels_of_type(shown.layout, "Plot").items():
        paths = [path["value"] for path in plot["paths"]]
        values = poll_until(
            lambda name=name: shown.studio.legend(name),
            lambda texts: all(map(is_number, texts)) and bool(texts),
        )
        assert len(values) == len(paths)
        missing = [path for path, value in zip(paths, values, strict=True) if not is_number(value)]
        assert not missing, plot["foxglovePanelTitle"]


def test_every_plot_draws_curves(shown: Shown) -> None:
    plots = panels.panels_of_type(shown.layout, "Plot")
    counts = poll_until(
        lambda: count_curve_pixels(shown.studio, plots),
        lambda counts: min(counts.values()) >= MIN_CURVE_PIXELS,
    )
    for name, plot in plots.items():
        assert counts[name] >= MIN_CURVE_PIXELS, plot["foxglovePanelTitle"]


def test_the_comparison_layout_draws_the_distance_of_every_plant(shown: Shown) -> None:
    distances = {topic for topic in message_counts(shown.log) if re.fullmatch("/diff(/.*)?/distance", topic)}
    plots = panels.panels_of_type(shown.layout, "Plot").values()
    for signal in ("load_distance", "angle_distance"):
        values = [path["value"] for plot in plots for path in plot["paths"] if signal in path["value"]]
        drawn = {value.partition(".")[0] for value in values} & distances
        assert len(drawn) == {"comparison": 1, "four": 3}.get(shown.log.stem, 0)
        assert drawn == (distances if shown.name == "comparison" else set())


def test_the_3d_panel_has_room(shown: Shown) -> None:
    (name,) = panels.panels_of_type(shown.layout, "3D")
    box = shown.studio.panel(name).bounding_box()
    assert box is not None
    assert min(box["width"], box["height"]) > 280.0, "pixels of a window of 1280 by 800"


def test_status_is_drawn_as_bars(shown: Shown) -> None:
    ((name, panel),) = panels.panels_of_type(shown.layout, "StateTransitions").items()
    minimum = len(panel["paths"]) * MIN_BAR_HEIGHT
    assert poll_until(lambda: bar_height(shown.studio, name), lambda height: height > minimum) > minimum


def test_events_are_listed(shown: Shown) -> None:
    (name,) = panels.panels_of_type(shown.layout, "RosOut")
    text = poll_until(shown.studio.panel(name).inner_text, lambda text: EVENT_TEXT in text)
    assert EVENT_TEXT in text


def test_the_3d_panel_shows_the_crane(shown: Shown) -> None:
    (name,) = panels.panels_of_type(shown.layout, "3D")
    picture = poll_until(lambda: shown.studio.picture(name), lambda image: pictures.bridge_mask(image).any())
    assert pictures.bridge_mask(picture).sum() > 500
    assert pictures.hue_mask(picture, -12.0, 25.0).sum() > 50, (
        "the load is red, or tinted by a ghost in front of it"
    )


def test_the_viewer_reports_no_problem(shown: Shown) -> None:
    assert shown.studio.problems() == []
    assert shown.studio.exceptions == []
    (name,) = panels.panels_of_type(shown.layout, "3D")
    shown.studio.open_settings(name)
    assert shown.studio.settings_with_errors() == []


def test_the_checks_fail_without_the_topics_of_the_plant(
    studio: Studio, files: Path, logs: dict[str, Path]
) -> None:
    """Otherwise the tests above would prove nothing."""
    filtered = rewrite(
        logs["one-plant"],
        files / "filtered.mcap",
        keep=lambda topic: topic in ("/run/info", "/rig/workspace"),
    )
    layout = panels.show_values(panels.load_shipped_layout("single", files))
    studio.open_log(f"/files/{filtered.name}", layout)
    studio.seek(0.5)
    expected = {"/run/info", "/rig/workspace"}
    assert set(poll_until(studio.topics, lambda topics: set(topics) == expected)) == expected
    plots = panels.panels_of_type(layout, "Plot")
    assert not any(is_number(text) for name in plots for text in studio.legend(name))
    assert not any(count_curve_pixels(studio, plots).values())
    (name,) = panels.panels_of_type(layout, "StateTransitions")
    assert bar_height(studio, name) < MIN_BAR_HEIGHT
    (name,) = panels.panels_of_type(layout, "RosOut")
    assert EVENT_TEXT not in studio.panel(name).inner_text()
    (name,) = panels.panels_of_type(layout, "3D")
    picture = studio.picture(name)
    assert pictures.bridge_mask(picture).sum() == 0
    assert pictures.load_mask(picture).sum() == 0
