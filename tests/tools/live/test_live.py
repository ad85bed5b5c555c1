"""Live sessions as viewers see them, and the files that they write."""

import contextlib
import itertools
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from websockets.exceptions import InvalidStatus, WebSocketException
from websockets.sync.client import connect

from cranectl.compare.agreement import judge
from cranectl.design import design_controller
from cranectl.log.description import LogDescription
from cranectl.log.events import Phase
from cranectl.log.live_messages import LiveMessages
from cranectl.log.messages import streams
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.signals import SignalGroup
from cranectl.simulate import simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import InputError, LogError
from cranectl.tools.live.command import live_command
from cranectl.tools.live.commands import Controls
from cranectl.tools.live.server import COMMAND_INTERVAL, MAX_LAG, LiveServer, Pace
from cranectl.tools.live.session import Session
from cranectl.tools.live.viewers import Address
from tests.conftest import PAIR, ROOT
from tests.log.viewer import Viewer, decode_rows
from tests.pace import HANG

NO_DISTURBANCES = ["disturbances=[]"]
STOP = ["disturbances=[{joint='alpha', start=0.1, magnitude=200.0}]", "duration=2"]
STATIC_TOPICS = (
    *("/analytic/model", "/mujoco/model", "/reference/path", "/rig/workspace"),
    *("/run/info", "/controller/design", "/analytic/status", "/mujoco/status", "/mujoco/disturbance_arrow"),
)


SHORT = (
    "duration=2.0",
    "reference.segments.0.duration=1.2",
    "reference.segments.1.duration=0.5",
    "reference.segments.0.to=[0.4,0.3,-0.3]",
    "reference.segments.1.angle=-0.1",
    "disturbances=[{joint='alpha',start=0.5,magnitude=1.0},{joint='beta',start=0.7,end=1.1,magnitude=-2.0}]",
)
# Moves the load past the end of a short bridge.
DISTURBANCE_AT_LIMIT = "disturbances=[{joint='beta',start=0.1,end=0.4,magnitude=1.0}]"


PYGAME_STUB = """
def init(): pass
class joystick:
    def __init__(self, number): pass
    def get_axis(self, axis): return (-1.0, 0.0, 0.5)[axis]
joystick.Joystick = joystick
class event:
    def pump(): pass
"""


class ServedSession:
    """A session start_live in a thread."""

    def __init__(
        self, scenario: Scenario, record: Path, controller: str, speed: float, plants: list[str]
    ) -> None:
        design = design_controller(controller, scenario.design)
        self.session = Session(scenario, design, plants=plants)
        controls = Controls(scenario, design, speed=speed)
        self.server = LiveServer(self.session, controls, Address(port=0), record)
        self.stop = threading.Event()
        self._thread = threading.Thread(target=self.server.serve, args=[self.stop])
        self._thread.start()

    def end(self) -> list[Path]:
        """End the session; return the files that it has written."""
        self.stop.set()
        self._thread.join()
        return list(self.server.recorded)


@contextlib.contextmanager
def live_session(
    record: Path,
    *overrides: str,
    name: str = "fixed-position",
    controller: str = "lqr",
    speed: float = 1.0,
    plants: tuple[str, ...] = ("analytic", "mujoco"),
) -> Iterator[tuple[ServedSession, Viewer]]:
    scenario = load_scenario(name, overrides=overrides)
    running = ServedSession(scenario, record, controller, speed, list(plants))
    try:
        with Viewer(running.server.port) as viewer:
            viewer.until(lambda: "/tf" in viewer.channels)
            yield running, viewer
    finally:
        running.end()


def states(viewer: Viewer, plant: str = "mujoco") -> np.ndarray:
    return decode_rows([data for _, data in viewer.of(f"/{plant}/state")], len(SignalGroup.STATE))


def test_topics_services_and_parameters_are_advertised(tmp_path: Path, short: Scenario) -> None:
    log = write_log(tmp_path / "a.mcap", [simulate_run(short, plant=p) for p in ("analytic", "mujoco")])
    with live_session(tmp_path / "live.mcap") as (_, viewer):
        assert set(viewer.info["capabilities"]) >= {
            "parameters",
            "parametersSubscribe",
            "services",
            "time",
            "clientPublish",
        }
        assert viewer.info["supportedEncodings"] == ["json"]
        expected = {topic.topic: topic.schema for topic in LogDescription.of(log).topics}
        del expected["/diff/verdict"]
        viewer.until(lambda: len(viewer.channels) >= len(expected))
        assert {topic: c["schemaName"] for topic, c in viewer.channels.items()} == expected
        assert set(viewer.services) == {"/pulse", "/reset", "/pause", "/resume", "/go"}
        for service in viewer.services.values():
            assert service["request"]["encoding"] == "json"
            assert service["request"]["schemaEncoding"] == "jsonschema"
        assert list(viewer.get()) == [
            "pause", "speed", "controller", "k0", "k1", "k2", "k3", "pulse_alpha", "pulse_beta",
        ]  # fmt: skip
        assert viewer.get("speed", "controller") == {"speed": 1.0, "controller": "lqr"}


def test_a_late_viewer_gets_the_whole_scene(tmp_path: Path) -> None:
    with live_session(tmp_path / "live.mcap") as (running, early):
        early.subscribe("/tf")
        early.wait_for("/tf")
        early.call("/pause")
        early.until(lambda: early.get("pause")["pause"])
        early.rest(0.2)
        with Viewer(running.server.port) as late:
            late.subscribe(*STATIC_TOPICS, "/tf", "/mujoco/rope", "/mujoco/trail", "/log", "/mujoco/state")
            for topic in (*STATIC_TOPICS, "/tf", "/mujoco/rope", "/mujoco/trail"):
                late.wait_for(topic)
            late.until(lambda: late.clock_ns)
            assert late.clock_ns[-1] >= early.of("/tf")[-1][0]
            assert late.of("/tf")[-1][1] == early.of("/tf")[-1][1], (
                "a late viewer must see the pose of the pause"
            )
            assert len(late.decoded("/mujoco/model")[0].entities) == 4
            assert len(late.decoded("/analytic/model")[0].entities) == 3
            assert len(late.decoded("/reference/path")[0].entities[0].lines[0].points) > 1
            assert late.decoded("/run/info")[0].controller == "lqr"
            late.rest(0.2)
            assert late.of("/mujoco/state") == late.of("/log") == [], "samples must be sent only once"


def test_pause_stops_time_and_resume_continues_it(tmp_path: Path) -> None:
    with live_session(tmp_path / "live.mcap") as (_, viewer):
        viewer.subscribe("/mujoco/state", "/log")
        viewer.watch("pause")
        viewer.wait_for("/mujoco/state")
        viewer.call("/pause")
        viewer.wait_for_event("paused")
        viewer.until(lambda: viewer.parameters.get("pause") is True)
        viewer.rest(0.1)
        count = len(viewer.of("/mujoco/state"))
        viewer.rest(0.4)
        assert len(viewer.of("/mujoco/state")) == count
        viewer.set(pause=False)
        assert viewer.parameters["pause"] is False
        viewer.until(lambda: len(viewer.of("/mujoco/state")) > count + 20)
        times = [time_ns for time_ns, _ in viewer.of("/mujoco/state")]
        assert set(np.diff(times)) == {4_000_000}, "a sample is missing"


def test_time_passes_at_the_set_speed(tmp_path: Path) -> None:
    """A busy machine may be late, or catch up MAX_LAG, as may this process, but not three times in a row.

    The duration of a block depends only on the speed.
    """
    with live_session(tmp_path / "live.mcap", speed=0.5) as (_, viewer):
        viewer.subscribe("/reference/load")
        for speed in (0.5, 5.0, 0.25):
            viewer.set(speed=speed)
            viewer.until(
                lambda speed=speed: viewer.clock_ns[-1:] and step(viewer) == COMMAND_INTERVAL * speed
            )
            assert any(seconds_of(viewer, (0.6 + MAX_LAG) * speed) > 0.5 for _ in range(3))
            assert step(viewer) == COMMAND_INTERVAL * speed


def seconds_of(viewer: Viewer, simulated: float) -> float:
    """Return how long `simulated` seconds take to arrive; less if this process had messages to catch up."""
    viewer.clear_messages()
    start, passed = time.monotonic(), 0.0
    while passed < simulated:
        viewer.rest(0.02)
        times = [time_ns for time_ns, _ in viewer.of("/reference/load")]
        passed = (times[-1] - times[0]) / 1e9 if times else 0.0
    return time.monotonic() - start


def step(viewer: Viewer) -> float:
    """Return the simulated time [s] between the two newest blocks."""
    return float(np.diff(viewer.clock_ns[-2:]).sum()) / 1e9


def test_a_slow_machine_is_reported_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    advance = Session.advance

    def slowly(self: Session, samples: int) -> list:
        time.sleep(0.3)
        return advance(self, samples)

    monkeypatch.setattr(Session, "advance", slowly)
    with live_session(tmp_path / "live.mcap") as (_, viewer):
        viewer.subscribe("/log")
        viewer.wait_for_event("too slow for speed 1:")
        viewer.rest(1.0)
        assert sum("too slow" in line for line in viewer.events()) == 1


def test_other_gains_begin_a_new_segment_of_the_recording(tmp_path: Path) -> None:
    record = tmp_path / "live.mcap"
    old = tmp_path / "live.segment9.mcap"
    old.touch()
    with live_session(record, *NO_DISTURBANCES) as (running, viewer):
        viewer.subscribe("/controller/design", "/log", "/mujoco/controller")
        viewer.rest(0.2)
        gain = np.poly([-2.0, -2.5, -3.0, -3.5])[:0:-1].tolist()
        viewer.set(**dict(zip(("k0", "k1", "k2", "k3"), gain, strict=True)))
        viewer.wait_for("/controller/design", lambda message: "by hand" in message.name)
        viewer.set(controller="pole-placement+loop-shaping")
        viewer.wait_for("/controller/design", lambda message: "loop-shaping" in message.name)
        assert viewer.parameters["k3"] == pytest.approx(10.0)
        order = design_controller("pole-placement+loop-shaping").robustifier.sampled_order
        name = f"cranectl.Controller{order}"
        viewer.until(lambda: viewer.channels.get("/mujoco/controller", {}).get("schemaName") == name)
        viewer.clear_messages()
        shaped = viewer.wait_for("/mujoco/controller")
        assert len(shaped.DESCRIPTOR.fields) == 2 + 3 * order > 2
        viewer.rest(0.1)
        files = running.end()
    assert files == [record, tmp_path / "live.segment2.mcap", tmp_path / "live.segment3.mcap"]
    assert sorted(tmp_path.iterdir()) == sorted([*files, old]), "an incomplete file is left"
    runs = [read_log(file)["mujoco"] for file in files]
    assert [run.design.name for run in runs] == [
        "lqr", "lqr, gains by hand", "pole-placement+loop-shaping",
    ]  # fmt: skip
    assert runs[1].design.gain.tolist() == gain
    for run, following in itertools.pairwise(runs):
        assert run.status == RunStatus.INTERRUPTED
        assert following.time_ns[0] - run.time_ns[-1] <= 4_000_000, "there is a gap in time between segments"
    # The load hangs still, and the change of the controller does not move it.
    assert max(np.abs(run.block("input")).max() for run in runs) < 1e-6


def test_a_pulse_moves_the_load_and_a_reset_returns_it(tmp_path: Path) -> None:
    record = tmp_path / "live.mcap"
    with live_session(record, *NO_DISTURBANCES, speed=2.0) as (running, viewer):
        topics = ("state", "disturbance", "disturbance_arrow", "status")
        viewer.subscribe("/log", *(f"/mujoco/{topic}" for topic in topics))
        viewer.wait_for("/mujoco/disturbance")
        viewer.set(pulse_alpha=3.0, pulse_beta=-2.0)
        assert viewer.call("/pulse")["message"]
        viewer.wait_for("/mujoco/status", lambda message: message.disturbed == 3)
        viewer.wait_for("/mujoco/status", lambda message: message.disturbed == 0)
        disturbances = decode_rows(
            [data for _, data in viewer.of("/mujoco/disturbance")], len(SignalGroup.DISTURBANCE)
        )
        assert set(map(tuple, disturbances.tolist())) == {(0.0, 0.0), (3.0, -2.0)}
        assert (disturbances[:, 0] > 0.0).sum() == 50, "expected 0.2 s at 250 Hz"
        updates = viewer.decoded("/mujoco/disturbance_arrow")
        assert max(len(update.entities[0].arrows) for update in updates if update.entities) == 2
        swinging = states(viewer)[-1]
        assert swinging[6] > 0.03
        assert swinging[8] < -0.02
        viewer.call("/pause")
        viewer.wait_for_event("paused")
        viewer.rest(0.1)
        for _ in range(3):  # only the last reset begins a file
            viewer.call("/reset")
        viewer.until(lambda: viewer.events().count("reset") == 3)
        viewer.until(lambda: abs(states(viewer)[-1][6]) < 1e-12)
        assert states(viewer)[-1] == pytest.approx([1.0, 0, 0.77, 0, 0.7, 0, 0, 0, 0, 0], abs=1e-12)
        times = [time_ns for _, time_ns, _ in viewer.messages]
        assert (np.diff(times) >= 0).all(), "viewers clear their plots when time goes back"
        viewer.clear_messages()
        viewer.set(pause=False)
        viewer.until(lambda: len(viewer.of("/mujoco/state")) > 5)
        files = running.end()
    first, second = (read_log(file)["mujoco"] for file in files)
    assert first.time_ns[0] == 0
    assert second.time_ns[0] > first.time_ns[-1]
    assert np.abs(first.signal("state.alpha")).max() > 0.03
    assert np.abs(second.signal("state.alpha")).max() < 1e-9


def test_a_stopped_run_is_reported_and_a_reset_restarts_it(tmp_path: Path) -> None:
    record = tmp_path / "live.mcap"
    with live_session(record, *STOP) as (running, viewer):
        viewer.subscribe("/mujoco/status", "/analytic/status", "/log", "/mujoco/state")
        stopped = viewer.wait_for("/mujoco/status", lambda message: message.status > 1)
        expected = simulate_run(running.session.scenario, plant="mujoco", controller="lqr")
        assert stopped.status == expected.status
        viewer.wait_for_event(expected.status.explanation)
        viewer.rest(0.2)
        count = len(viewer.of("/mujoco/state"))
        viewer.call("/pulse")
        viewer.wait_for_event("refused: the run has stopped; call /reset")
        viewer.set(controller="pole-placement")
        viewer.rest(0.2)
        assert len(viewer.of("/mujoco/state")) == count
        viewer.call("/reset")
        viewer.wait_for("/mujoco/status", lambda message: message.status == RunStatus.RUNNING)
        viewer.wait_for("/mujoco/status", lambda message: message.status > 1)
        files = running.end()
    first, second = (read_log(file) for file in files)
    assert (first["mujoco"].status, first["mujoco"].end_ns) == (expected.status, expected.end_ns)
    assert np.array_equal(first["mujoco"].table, expected.every(4).table)
    assert second["mujoco"].design.name == "pole-placement"
    assert second["analytic"].status.stopped


def test_a_session_without_commands_records_a_run_bit_for_bit(tmp_path: Path) -> None:
    """The session runs for 2.5 s, which is longer than its scenario of 2 s."""
    overrides = [
        "duration=2.0",
        "disturbances=[{joint='beta', start=1.0, magnitude=1.0}]",
        "reference.segments=[]",
    ]
    record = tmp_path / "live.mcap"
    with live_session(record, *overrides, speed=5.0, controller="lqr+hinf") as (running, viewer):
        viewer.subscribe("/mujoco/state")
        viewer.until(lambda: viewer.of("/mujoco/state") and viewer.of("/mujoco/state")[-1][0] > 2_500_000_000)
        assert running.end() == [record]
    recorded = read_log(record)
    assert judge(*recorded.values()).passed
    for plant, run in recorded.items():
        alone = simulate_run(running.session.scenario, plant=plant, controller="lqr+hinf").every(4)
        rows = len(alone.time_ns)
        assert run.status == RunStatus.COMPLETED
        assert run.end_ns == run.time_ns[-1] > 2_500_000_000
        assert run.model == alone.model
        assert np.array_equal(run.table[:rows], alone.table)
        assert np.array_equal(run.reference[:rows], alone.reference)
        assert np.array_equal(run.time_ns[:rows], alone.time_ns)


@pytest.mark.parametrize(
    ("name", "overrides", "block"),
    [
        ("settled-trajectory", (*SHORT, "log.every=3"), 7),
        ("settled-trajectory", (*SHORT, "log.every=1"), 1001),
        (
            "fixed-position",
            ("duration=2", "log.every=1", "rig.bridge_range=[0.0,1.00001]", DISTURBANCE_AT_LIMIT),
            20,
        ),
        ("fixed-position", STOP, 20),
    ],
)
def test_parts_give_the_messages_of_a_log(name: str, overrides: tuple[str, ...], block: int) -> None:
    """Exceptions are the messages on the end of the run, and a last pose between two regular ones."""
    scenario = load_scenario(name, overrides=overrides)
    design = design_controller("lqr", scenario.design)
    running = Session(scenario, design, plants=PAIR)
    parts = LiveMessages(scenario, running.plan, PAIR)
    sent: dict[str, list[tuple[int, bytes]]] = {}

    def collect(new_streams: list) -> None:
        for stream in new_streams:
            sent.setdefault(stream.topic, []).extend(
                zip(stream.time_ns.tolist(), stream.messages, strict=True)
            )

    collect(parts.opening_messages(running.advance(0), 0))
    remaining = scenario.steps + 1
    while remaining > 0 and running.moving:
        collect(parts.messages(running.advance(min(block, remaining)), running.origin_ns))
        remaining -= block
    collect(parts.unsent_samples())
    runs = [
        simulate_run(scenario, plant=p, design=design).every(scenario.log.every)
        for p in ("analytic", "mujoco")
    ]
    logged = {
        stream.topic: list(zip(stream.time_ns.tolist(), stream.messages, strict=True))
        for stream in streams(runs)
    }
    del logged["/diff/verdict"], logged["/run/info"]
    sent.pop("/run/info")
    assert sent.keys() == logged.keys()
    stopped = runs[0].status.stopped
    for topic, messages in logged.items():
        if topic == "/reference/path" and stopped:
            continue  # a log shows the completed path, a session the planned path
        if topic == "/log" and any("bridge_range" in override for override in overrides):
            assert any(b"leaves the workspace" in line for _, line in messages)
        if topic == "/log":
            assert sorted(sent[topic]) == sorted(messages if stopped else messages[:-2])
        elif topic.endswith("/status"):
            assert sent[topic] == (messages if stopped else messages[:-1])
        elif topic == "/tf" or topic.endswith(("/rope", "/trail")):
            assert messages[: len(sent[topic])] == sent[topic]
            assert len(messages) - len(sent[topic]) <= 1
        else:
            assert sent[topic] == messages, topic


def test_the_reference_is_sent_once_when_one_plant_stops() -> None:
    """It stops at a sample that is not logged otherwise. A time that occurs twice would be an invalid log."""
    scenario = load_scenario("fixed-position", overrides=["duration=0.1", "disturbances=[]"])
    design = design_controller("lqr", scenario.design)
    running = Session(scenario, design, plants=PAIR)
    parts = LiveMessages(scenario, running.plan, PAIR)
    first, second = running.advance(22)
    stopped = replace(first, status=RunStatus.WORKSPACE_LEFT, end_ns=21_000_000)
    sent = [*parts.messages([stopped, second], 0), *parts.unsent_samples()]
    times = {topic: [] for topic in ("/reference/load", "/analytic/state", "/mujoco/state")}
    for stream in sent:
        if stream.topic in times:
            times[stream.topic] += stream.time_ns.tolist()
    assert set(map(tuple, times.values())) == {
        (0, 4_000_000, 8_000_000, 12_000_000, 16_000_000, 20_000_000, 21_000_000)
    }


def start_live(directory: Path, *options: str) -> subprocess.Popen[str]:
    """Start `cranectl live` in a child process."""
    command = [sys.executable, "-m", "cranectl", "live", "fixed-position", "--port=0", *options]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=directory)


def test_ctrl_c_completes_the_recording_of_all_sent_messages(tmp_path: Path) -> None:
    process = start_live(tmp_path, "--plant=mujoco", "--host=0.0.0.0")
    assert process.stdout is not None
    assert "fixed-position, pole-placement, ideal drives, mujoco" in process.stdout.readline()
    line = process.stdout.readline()
    assert "ws://" in line
    with Viewer(int(line.rpartition(":")[2])) as viewer:
        viewer.until(lambda: "/tf" in viewer.channels)
        viewer.send_nonsense(100)
        viewer.call("/pause")
        viewer.subscribe()
        viewer.rest(0.3)
        viewer.clear_messages()
        viewer.call("/resume")
        viewer.wait_for_event("resumed")
        viewer.rest(0.3)
        viewer.call("/pulse")
        viewer.wait_for_event("pulse of")
        viewer.until(lambda: len(viewer.messages) > 1500)
        viewer.call("/pause")
        viewer.wait_for_event("paused")
        viewer.rest(0.2)
        received = list(viewer.messages)
        process.send_signal(signal.SIGINT)
        viewer.until_closed()
    out, err = process.communicate(timeout=HANG)
    assert process.returncode == 0
    record = tmp_path / "logs/fixed-position/pole-placement-ideal-live.mcap"
    assert f"recorded: {record.relative_to(tmp_path)}" in out
    assert "warning: listening on 0.0.0.0: anyone" in err
    assert "Traceback" not in err
    assert err.count("Invalid message") == 1
    assert "100 warnings about clients in total" in err
    assert list(record.parent.iterdir()) == [record]
    with record.open("rb") as stream:
        recorded = [(c.topic, m.log_time, m.data) for _, c, m in make_reader(stream).iter_messages()]
    begin = next(k for k, (topic, _, data) in enumerate(recorded) if topic == "/log" and b"resumed" in data)
    for topic in {topic for topic, _, _ in received}:
        received_messages = [message for message in received if message[0] == topic]
        messages = [message for message in recorded[begin:] if message[0] == topic]
        assert messages[: len(received_messages)] == received_messages, topic
        assert len(messages) - len(received_messages) <= 1, "only the last sample may be additional"
    assert len(received) > 1000
    run = read_log(record)["mujoco"]
    assert run.status == RunStatus.INTERRUPTED
    assert np.abs(run.block("disturbance")).max() == 2.0


def test_two_sessions_write_all_files_that_they_print(tmp_path: Path) -> None:
    """Sessions without --record run in parallel and share a directory."""
    recordings: list[Path] = []
    sessions = [(start_live(tmp_path, "--plant=analytic"), end) for end in (signal.SIGHUP, signal.SIGTERM)]
    for session, _ in sessions:
        head = list(itertools.islice(session.stdout or [], 5))
        move_and_reset(int(head[1].rpartition(":")[2]))
    for session, end in sessions:
        session.send_signal(end)
        out, err = session.communicate(timeout=HANG)
        assert (session.returncode, err) == (0, "")
        printed = [tmp_path / line.removeprefix("recorded: ") for line in out.splitlines()]
        assert len(printed) == 2
        assert not set(recordings) & set(printed)
        recordings += printed
    assert sorted((tmp_path / "logs/fixed-position").iterdir()) == sorted(recordings)
    existing = str(sorted(recordings)[0])
    with pytest.raises(LogError, match="exists already"):
        live_command.main(["fixed-position", "--port", "0", "--record", existing], standalone_mode=False)


def move_and_reset(port: int) -> None:
    """Make a session write two files."""
    with Viewer(port) as viewer:
        viewer.until(lambda: "/tf" in viewer.channels)
        viewer.subscribe("/analytic/state", "/log")
        viewer.until(lambda: len(viewer.of("/analytic/state")) > 5)
        viewer.call("/reset")
        viewer.wait_for_event("reset")
        viewer.clear_messages()
        viewer.until(lambda: len(viewer.of("/analytic/state")) > 5)


def test_web_pages_of_other_origins_cannot_connect(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with live_session(tmp_path / "live.mcap") as (running, _):
        port = running.server.port

        def connect_from(origin: str) -> contextlib.AbstractContextManager[object]:
            protocols = ["foxglove.sdk.v1"]
            return connect(f"ws://127.0.0.1:{port}", origin=origin, subprotocols=protocols)  # type: ignore[arg-type]

        with connect_from("https://app.foxglove.dev"):
            pass
        with pytest.raises(InvalidStatus, match="403"), connect_from("https://evil.example"):
            pass
        assert len(caplog.messages) == 1
        # The library's own server listens on a hidden address, not on 127.0.0.1.
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", running.server._server.port))


def test_invalid_requests_are_disconnected(tmp_path: Path) -> None:
    with live_session(tmp_path / "live.mcap") as (running, viewer):
        for head in (b"GET / HTTP/1.1\r\n" + b"x: y\r\n" * 10_000, b"\0\r\n\r\n", b""):
            with socket.create_connection(("127.0.0.1", running.server.port)) as client:
                client.settimeout(HANG)
                with contextlib.suppress(ConnectionError):
                    client.sendall(head)
                    client.shutdown(socket.SHUT_WR)
                    assert client.recv(1000)[:12] in (b"", b"HTTP/1.1 400")
        viewer.subscribe("/log")
        viewer.advertise("/elsewhere")
        viewer.wait_for_event("messages on /elsewhere in json refused: nothing receives them")
        assert viewer.get("speed") == {"speed": 1.0}


def test_a_port_in_use_is_explained(tmp_path: Path) -> None:
    with live_session(tmp_path / "live.mcap") as (running, _):
        port, record = f"--port={running.server.port}", f"--record={tmp_path / 'b.mcap'}"
        with pytest.raises(InputError, match="Address already in use") as caught:
            live_command.main(["fixed-position", port, record], standalone_mode=False)
        assert "--port" in caught.value.remedy
    assert not (tmp_path / "b.mcap").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--port", "99999"], "port 99999"),
        (["--host", "203.0.113.9", "--port", "0"], "203.0.113.9"),
        (["--speed", "0"], "speed = 0.0"),
        (["--allow-origin", "*"], "--allow-origin *"),
    ],
)
def test_bad_input_is_explained(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(InputError) as caught:
        live_command.main(["fixed-position", *arguments], standalone_mode=False)
    assert message in caught.value.found
    assert signal.getsignal(signal.SIGINT) is before


def test_an_incomplete_recording_is_an_error(tmp_path: Path) -> None:
    """The files of the recording disappear; the server is closed all the same."""
    scenario = load_scenario("fixed-position")
    design = design_controller("lqr", scenario.design)
    folder = tmp_path / "there"
    folder.mkdir()
    session = Session(scenario, design, plants=["analytic"])
    server = LiveServer(session, Controls(scenario, design), Address(port=0), folder / "live.mcap")
    stop = threading.Event()
    timer = threading.Timer(0.5, lambda: ([file.unlink() for file in folder.iterdir()], stop.set()))
    timer.start()
    with pytest.raises(LogError, match="cannot write"):
        server.serve(stop)
    with pytest.raises((OSError, WebSocketException)), Viewer(server.port):
        pass


def test_the_pace_catches_up_after_a_short_delay() -> None:
    now = 100.0
    pace = Pace(lambda: now)
    for k in range(500):
        now += 0.3 if k % 100 == 50 else 0.0137  # sometimes a block takes too long
        wait, lost = pace.wait(0.02)
        assert lost == 0.0
        now += wait
    assert now == pytest.approx(100.0 + 500 * 0.02)


def test_the_pace_drops_a_long_delay() -> None:
    now = 100.0
    pace = Pace(lambda: now)
    now += 0.02 + MAX_LAG + 0.1
    assert pace.wait(0.02) == (0.0, pytest.approx(MAX_LAG + 0.1))
    assert pace.wait(0.02) == (pytest.approx(0.02), 0.0), "the pace does not continue after the lost time"
    now += 5.0
    pace.restart()
    assert pace.wait(0.02) == (pytest.approx(0.02), 0.0)


def twist(x: float, y: float = 0.0, z: float = 0.0) -> dict:
    return {"linear": {"x": x, "y": y, "z": z}, "angular": {"x": 0.0, "y": 0.0, "z": 1.0}}


def test_a_run_repeats_a_drive_by_velocity_commands(tmp_path: Path) -> None:
    record = tmp_path / "live.mcap"
    move = "reference.segments=[{kind='line', to=[0.9, 0.7, -0.6], duration=1.5}]"
    with live_session(record, *NO_DISTURBANCES, move) as (running, viewer):
        viewer.subscribe("/reference/load", "/log", "/mujoco/status")
        viewer.call("/go", {"x": 1.0, "y": 1.0, "z": -1.0})
        viewer.wait_for_event("the scenario's reference moves the load until 1.5 s")
        viewer.until(lambda: running.session.now_ns > 1_500_000_000)
        viewer.advertise("/wish")
        viewer.publish(twist(5.0))
        viewer.wait_for_event("linear.x = 5.0; allowed: a number from -0.475 to 0.475")
        for _ in range(8):
            viewer.publish(twist(-0.4, 0.1))
            viewer.rest(0.1)
        viewer.until(lambda: running.session._hand._request == (0.0,) * 4)  # after the timeout of the command
        assert viewer.events().count("driven by hand") == 1
        viewer.wait_for("/mujoco/status", lambda message: message.phase == Phase.DRIVEN)
        viewer.publish(b"nonsense")
        viewer.wait_for_event("the message is not valid JSON")
        assert viewer.call("/go", {"x": 0.6, "y": 0.6, "z": -0.9})["message"]
        viewer.wait_for_event("drives to (0.6, 0.6, -0.9) m")
        viewer.set(speed=10.0)
        end = np.array([0.6, 0.6, -0.9])
        load = [0.0]
        while np.abs(load - end).max() > 1e-6:
            viewer.clear_messages()
            viewer.until(lambda: viewer.of("/reference/load"))
            load = decode_rows([viewer.of("/reference/load")[-1][1]], 15)[0, :3]
        (file,) = running.end()
    driven_file = tmp_path / "live.driven.toml"
    scenario = load_scenario(driven_file)
    first, second, last = scenario.reference.segments[-1].wishes
    assert (first[1:], second[1:], last[1:]) == ((-0.4, 0.1, 0.0), (0.0,) * 3, (0.0,) * 3)
    assert first[0] < second[0] < last[0]  # the exact times depend on the load of the machine
    with file.open("rb") as stream:
        attachments = {item.name: item.data for item in make_reader(stream).iter_attachments()}
    assert attachments["driven.toml"] == driven_file.read_bytes()
    for plant, run in read_log(file).items():
        repeated = simulate_run(scenario, plant=plant).every(4)
        rows = len(run.time_ns) - 1  # the log also has its last sample, which may lie between regular ones
        assert np.array_equal(run.time_ns[:rows], repeated.time_ns[:rows])
        assert np.array_equal(run.reference[:rows], repeated.reference[:rows])
        assert np.array_equal(run.table[:rows], repeated.table[:rows])
        assert scenario.controller.name == run.design.name


def test_the_documented_joystick_program_drives(tmp_path: Path) -> None:
    """A stub of pygame simulates a stick that is held to the left and up."""
    page = (ROOT / "docs" / "how-to" / "live.md").read_text(encoding="utf-8")
    code = page[page.index("# joystick.py") :].partition("```")[0]
    (tmp_path / "pygame.py").write_text(PYGAME_STUB)
    with live_session(tmp_path / "live.mcap", *NO_DISTURBANCES) as (running, viewer):
        (tmp_path / "joystick.py").write_text(code.replace("8765", str(running.server.port)))
        viewer.subscribe("/reference/load")
        with subprocess.Popen([sys.executable, "joystick.py"], cwd=tmp_path) as program:
            viewer.until(lambda: running.session._hand is not None)
            assert running.session._hand._request == (0.0, -0.4, 0.0, 0.1)
            program.terminate()
        viewer.until(lambda: running.session._hand._request == (0.0,) * 4)
