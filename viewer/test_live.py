"""`cranectl live` in the viewer: a session can be watched, steered and recorded."""

import re
import signal
from pathlib import Path

import pytest

import cranectl
from tests.pace import HANG
from viewer import panels, pictures
from viewer.conftest import Live
from viewer.panels import Layout
from viewer.studio import Studio, poll_until, poll_until_stable

# Version 1.48 looks for the schemas of services where an older version of the protocol had them.
SERVICES = r'could not find datatype "cranectl\.\w+_Request"'


@pytest.fixture
def layout(files: Path) -> Layout:
    """Return the shipped layout. Version 1.48 of the viewer lacks its buttons for services."""
    return panels.show_values(panels.load_shipped_layout("live", files, "--plant", "mujoco"))


def test_a_session_can_be_watched_steered_and_recorded(studio: Studio, live: Live, layout: Layout) -> None:
    studio.open_live(live.url, layout)
    (scene,) = panels.panels_of_type(layout, "3D")
    (steering,) = panels.panels_of_type(layout, "Parameters")
    picture = poll_until(lambda: studio.picture(scene), lambda image: pictures.bridge_mask(image).sum() > 300)
    # Viewers treat a step back in time as a seek, and discard what they have not shown yet.
    assert studio.clock == sorted(studio.clock)
    assert pictures.bridge_mask(picture).sum() > 300
    assert pictures.load_mask(picture).any()
    assert studio.start() < 60.0  # the run's time, not this machine's
    for name in panels.panels_of_type(layout, "Plot"):
        values = poll_until(lambda name=name: studio.legend(name), lambda texts: bool(texts) and all(texts))
        assert all(values), layout["configById"][name]["foxglovePanelTitle"]

    # Steering: pause, set another controller with other messages on the same topic, and resume.
    before = poll_until(lambda: studio.parameters(steering), lambda values: {"pause", "k0"} <= values.keys())
    assert before["pause"] == "false"
    studio.set_parameter(steering, "pause", "true")
    paused = poll_until_stable(studio.clock_time)  # the panel sends a value half a second after it was typed
    studio.set_parameter(steering, "controller", '"lqr+hinf"')
    after = poll_until(lambda: studio.parameters(steering), lambda values: values["k0"] != before["k0"])
    assert after["controller"] == '"lqr+hinf"'
    assert after["k0"] != before["k0"]
    assert poll_until_stable(studio.clock_time) == paused, "time passes while the session is paused"
    assert studio.parameters(steering)["pause"] == "true"
    duration = poll_until_stable(studio.duration)  # all messages from before the pause are shown now
    studio.set_parameter(steering, "pause", "false")
    assert poll_until(studio.clock_time, lambda seconds: seconds > paused + 2.0) > paused + 2.0
    assert poll_until(studio.duration, lambda seconds: seconds > duration) > duration
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
    assert second["mujoco"].time[0] - first["mujoco"].time[-1] < 0.05, (
        "time passes in the recording while the session is paused"
    )
