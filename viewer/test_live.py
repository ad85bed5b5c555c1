"""`cranectl live` in the viewer: what runs is seen, and can be steered, and was recorded."""

import re
import signal
from pathlib import Path

import pytest

import cranectl
from cranectl.scenario import NANOSECONDS
from tests.pace import HANG
from viewer import panels, pictures
from viewer.conftest import Live
from viewer.panels import Layout
from viewer.studio import Studio, at_rest, eventually

# 1.48 expects the schemas of services where the protocol of its time had them.
SERVICES = r'could not find datatype "cranectl\.\w+_Request"'


@pytest.fixture
def layout(files: Path) -> Layout:
    """The shipped one; of its panels the viewer of 1.48 lacks the buttons for services."""
    return panels.with_values(panels.shipped("live", files, "--plant", "mujoco"))


def test_a_session(studio: Studio, live: Live, layout: Layout) -> None:
    def told() -> float:
        """The run's clock [s], as the server tells it: a busy viewer shows it late."""
        studio.page.wait_for_timeout(10)  # frames are counted while the page is asked something
        return studio.clock[-1] / NANOSECONDS

    studio.open_live(live.url, layout)
    (scene,) = panels.of_type(layout, "3D")
    (steering,) = panels.of_type(layout, "Parameters")
    picture = eventually(lambda: studio.picture(scene), lambda seen: pictures.bridge(seen).sum() > 300)
    # A viewer takes a step back as a seek and throws away what it has not shown yet.
    assert studio.clock == sorted(studio.clock)
    assert pictures.bridge(picture).sum() > 300
    assert pictures.load(picture).any()
    assert studio.start() < 60.0  # the run's clock, not this machine's
    for name in panels.of_type(layout, "Plot"):
        values = eventually(lambda name=name: studio.legend(name), lambda seen: bool(seen) and all(seen))
        assert all(values), layout["configById"][name]["foxglovePanelTitle"]

    # Steering: a stop, another controller with other messages on the same topic, and on again.
    before = eventually(lambda: studio.parameters(steering), lambda seen: {"pause", "k0"} <= seen.keys())
    assert before["pause"] == "false"
    studio.set_parameter(steering, "pause", "true")
    paused = at_rest(told)  # the panel shows what was typed half a second before it sends it
    studio.set_parameter(steering, "controller", '"lqr+hinf"')
    after = eventually(lambda: studio.parameters(steering), lambda seen: seen["k0"] != before["k0"])
    assert after["controller"] == '"lqr+hinf"'
    assert after["k0"] != before["k0"]
    assert at_rest(told) == paused, "whatever is set meanwhile"
    assert studio.parameters(steering)["pause"] == "true"
    studio.set_parameter(steering, "pause", "false")
    shown = at_rest(studio.duration)  # what was on its way has been shown by now
    assert eventually(told, lambda seconds: seconds > paused + 2.0) > paused + 2.0
    assert eventually(studio.duration, lambda seconds: seconds > shown) > shown
    assert studio.problems() == []
    assert [text for text in studio.exceptions if not re.search(SERVICES, text)] == []

    assert studio.clock == sorted(studio.clock)

    live.process.send_signal(signal.SIGINT)
    assert live.process.wait(timeout=HANG) == 0
    first, second = (
        cranectl.read_log(live.record),
        cranectl.read_log(live.record.with_suffix(".segment2.mcap")),
    )
    assert first["mujoco"].design.name != second["mujoco"].design.name == "lqr+hinf"
    assert second["mujoco"].time[0] - first["mujoco"].time[-1] < 0.05, "no time passes while it is paused"
