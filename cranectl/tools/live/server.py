"""Serve a session to viewers in real time, let them steer it, and record it.

The websocket library sends each message only once. So this module sends a new subscriber the messages again
that it would have missed.
"""

import threading
import time
from collections.abc import Callable
from pathlib import Path

from cranectl.log import Channels, LiveMessages
from cranectl.scenario import NANOSECONDS
from cranectl.support import InputError
from cranectl.tools.live.child_session import ChildSession
from cranectl.tools.live.commands import (
    Command,
    Controls,
    LogText,
    Pulse,
    Reset,
    UseController,
    Value,
    refusal_line,
    tunable_values,
)
from cranectl.tools.live.hand import RELEASED, HandRequest
from cranectl.tools.live.recorder import Recorder
from cranectl.tools.live.session import Session
from cranectl.tools.live.viewers import Address, Listener, as_parameters, listen

MAX_LAG = 0.5  # [s] that a run may fall behind and still catch up


class Pace:
    """Computes the waiting time after each block, so that the run keeps pace with real time."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._due = clock()

    def restart(self) -> None:
        """Count time from now on, after a pause."""
        self._due = self._clock()

    def wait(self, seconds: float) -> tuple[float, float]:
        """Return (time to wait, lag that is not caught up) after a block of `seconds`; one of them is 0."""
        self._due += seconds
        late = self._clock() - self._due
        if late > MAX_LAG:
            self.restart()
            return 0.0, late
        return max(-late, 0.0), 0.0


COMMAND_INTERVAL = 0.02  # [s] of real time between two executions of commands
IDLE_INTERVAL = 0.05  # [s] the same while nothing moves


class LiveServer:
    """A session, its viewers and its recording."""

    def __init__(
        self, session: Session | ChildSession, controls: Controls, address: Address, record: Path
    ) -> None:
        """Start to listen, or raise InputError; record at `record`, which `reserve_recording` has locked."""
        session.prepare()
        self._session, self._controls = session, controls
        self._channels = Channels()
        self._runs = session.advance(0)
        self._recorded: set[str] = set()  # plants in the file that is open
        self._driven = False  # whether a user has driven by hand since the start
        self._told: OSError | None = None  # error of the recording that viewers were told
        plants = [run.plant for run in self._runs]
        self._messages = LiveMessages(session.scenario, session.plan, plants)
        self._listener = Listener(controls)
        self._server, self._guard = listen(address, session.scenario.name, self._listener, self._channels)
        self._recorder = Recorder(record, self._channels)
        self.recorded = self._recorder.files  # that are closed
        self.port = self._guard.port

    def serve(self, stop: threading.Event) -> None:
        """Run until `stop` is set, then close the recording and the server; raises LogError."""
        try:
            self._begin_recording("start")
            self._loop(stop)
        finally:
            try:
                self._finish_recording()
            finally:
                self._server.stop()
                self._guard.stop()

    def _loop(self, stop: threading.Event) -> None:
        pace, idle, slow, values = Pace(), True, False, self._controls.values()
        while not stop.is_set():
            for command in self._controls.commands():
                self._execute(command)
            if self._controls.values() != values:
                values, slow = self._controls.values(), False
                self._server.publish_parameter_values(as_parameters(values))
            missed = self._listener.subscribed()
            if missed:
                self._server.broadcast_time(self._session.now_ns - self._session.scenario.period_ns)
                self._channels.resend(missed)
            if self._controls.paused or not self._session.moving:
                idle = True
                stop.wait(IDLE_INTERVAL)
                continue
            if idle:
                pace.restart()
                idle = False
            speed, period = self._controls.speed, self._session.scenario.period_ns / NANOSECONDS
            samples = max(1, round(COMMAND_INTERVAL * speed / period))
            self._advance(samples)
            wait, lost = pace.wait(samples * period / speed)
            if lost and not slow:
                slow = True
                text = f"this machine is too slow for speed {speed:g}: {lost:.1f} s behind"
                self._say(f"{text}; the run goes on as fast as it can", warning=True)
            stop.wait(wait)

    def _advance(self, samples: int) -> None:
        self._runs = self._session.advance(samples)
        # Send the clock first: open viewers take it as the time of the messages that follow.
        self._server.broadcast_time(self._session.now_ns - self._session.scenario.period_ns)
        self._channels.send(self._messages.messages(self._runs, self._session.origin_ns))
        if (error := self._recorder.error) and error is not self._told:
            self._told = error
            self._say(f"the recording has ended: {error.strerror or error}", warning=True)

    def _execute(self, command: Command) -> None:
        if isinstance(command, LogText):
            self._say(command.message, warning=command.warning)
        elif isinstance(command, Pulse):
            self._pulse(command)
        elif isinstance(command, HandRequest):
            self._drive(command)
        elif isinstance(command, UseController):
            self._finish_recording()
            self._session.use(command.design)
            numbers = ", ".join(map(_short, tunable_values(command.design).values()))
            self._begin_recording(f"controller {command.design.name}: {numbers}")
        elif isinstance(command, Reset):
            self._finish_recording()
            self._session.reset()
            self._driven = False
            self._messages.start()
            self._begin_recording("reset")
            self._advance(1)  # shows the start even if the session is paused

    def _pulse(self, command: Pulse) -> None:
        alpha, beta = command.acceleration
        text = f"pulse of {alpha:g} rad/s² on alpha and {beta:g} rad/s² on beta for {command.seconds:g} s"
        if self._session.moving:
            self._session.pulse(command.acceleration, command.seconds)
            self._say(text)
        else:
            self._say(f"{text} refused: the run has stopped; call /reset", warning=True)

    def _drive(self, request: HandRequest) -> None:
        try:
            if not self._session.moving:
                raise InputError("the run has stopped", remedy="call /reset")
            self._session.steer(request)
            if request.is_point:
                self._say(f"drives to ({', '.join(map(_short, request[1:]))}) m")
            elif request != RELEASED and not self._driven:
                self._say("driven by hand")
            if request != RELEASED and not self._driven:
                self._messages.begin_hand_driving(self._session.now_ns - self._session.origin_ns)
                self._driven = True
        except InputError as error:
            self._say(refusal_line("driving by hand", error), warning=True)

    def _say(self, message: str, *, warning: bool = False) -> None:
        """Write a line to `/log` with the time of the newest message."""
        self._channels.send(self._messages.said(self._channels.time_ns, message, warning=warning))

    def _begin_recording(self, reason: str) -> None:
        """Begin a new recording if any plant moves, and send the messages that a recording starts with."""
        runs = self._session.advance(0)
        moving = [run for run in runs if not run.status.stopped]
        self._recorded = {run.plant for run in moving}
        if moving:
            self._recorder.begin(moving, self._session.now_ns, reason)
        self._channels.send(self._messages.opening_messages(runs, self._session.now_ns))
        self._say(reason)

    def _finish_recording(self) -> None:
        """Send the remaining messages and close the recording."""
        self._channels.send(self._messages.unsent_samples())
        session = self._session
        duration_ns = session.scenario.steps * session.scenario.period_ns
        completed = session.now_ns - session.origin_ns > duration_ns
        runs = [run for run in self._runs if run.plant in self._recorded]
        self._recorder.finish(runs, completed, session.driven_scenario())


def _short(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
