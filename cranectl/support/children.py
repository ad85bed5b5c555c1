"""Start child processes, exchange messages with them, notice when they end, and end them.

A child is a forked process or a new Python process. It ignores the signals that stop a command, because its
parent handles them. It ends when its parent ends. It leads a group of processes, so that all processes that
it starts end with it. A foreign program only answers one question: see `Program`.
"""

import contextlib
import faulthandler
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from math import inf
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

from cranectl.support.errors import MAX_PHRASE, InputError, printable
from cranectl.support.interrupts import Interruption, in_background
from cranectl.support.parent import Parent
from cranectl.support.search_path import SafePath

MAX_WAIT = 3600.0  # [s] the longest single wait
ASK_INTERVAL = 0.1  # [s] between two checks for other reasons to end a wait
EXIT_INTERVAL = 0.01  # [s] between two checks whether a forked child has ended
_KILLED = {-signal.SIGTERM, -getattr(signal, "SIGKILL", 9)}  # exit codes of a process killed from outside
T = TypeVar("T")


class Timeout:
    """A time limit for a process. Time in which the process waits for a processor does not count."""

    def __init__(self, pid: int, seconds: float, clock: Callable[[], float] = time.monotonic) -> None:
        """Start now; `seconds` may be infinite."""
        self._pid, self._seconds, self._clock = pid, seconds, clock
        self._start, self._waited = clock(), processor_wait(pid)

    @property
    def left(self) -> float:
        """Return the time that is left [s], at least zero."""
        waited = max(0.0, processor_wait(self._pid) - self._waited)
        return max(0.0, self._seconds - (self._clock() - self._start - waited))

    def wait_for(self, poll: Callable[[float], T], longest: float = MAX_WAIT) -> T | None:
        """Return what `poll`, called with seconds to wait, returns once it is true; None if time is over."""
        while left := self.left:
            if result := poll(min(left, longest)):
                return result
        return None


def processor_wait(pid: int) -> float:
    """Return how long [s] a process was ready but had no processor; zero if the system does not report it."""
    try:
        fields = Path(f"/proc/{pid or os.getpid()}/schedstat").read_text("ascii").split()
        return 1e-9 * int(fields[1])
    except (OSError, IndexError, ValueError):
        return 0.0


class Child:
    """A child process and this process's end of the pipe between them."""

    class Error(Exception):
        """A child process ended before it answered, or was ended because it did not answer in time."""

        def __init__(self, exit_code: int | None, timeout: float) -> None:
            """Describe how a child ended; `exit_code` is None if it did not answer within `timeout` [s]."""
            silent = f"took more than {timeout:g} s for a block"
            super().__init__(
                silent if exit_code is None else f"ended its process with {_in_words(exit_code)}"
            )
            self.is_silent, self.is_killed = exit_code is None, exit_code in _KILLED

    def __init__(self, pid: int, connection: Connection, process: BaseProcess | None = None) -> None:
        """Hold a child process; `process` is None if it was forked here."""
        self.pid, self.connection, self._process = pid, connection, process
        self._exit_code: int | None = None
        self._is_starting = False  # whether a program is starting, which has no time limit

    @classmethod
    def spawn(
        cls, work: Callable[..., None], *inputs: Any, context: BaseContext | None = None, daemon: bool = True
    ) -> Self:
        """Start a Python process that calls `work` with its `Parent` and `inputs`.

        `context` says how the process starts, by default as a new Python process. A `daemon` ends with this
        process, and `multiprocessing` does not let it start processes of its own.
        """
        context = context or multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(target=_serve, args=(work, there, *inputs), daemon=daemon)  # type: ignore[attr-defined]
        with SafePath():
            process.start()
        there.close()
        return cls(process.pid, here, process)

    @classmethod
    def fork(cls, work: Callable[[Parent], None]) -> Self:
        """Fork a process that calls `work` with its `Parent`; any error there only ends that process."""
        here, there = multiprocessing.Pipe(duplex=False)
        with warnings.catch_warnings():  # Python warns of other threads; the child needs none
            warnings.simplefilter("ignore", DeprecationWarning)
            pid = os.fork()
        if pid == 0:
            here.close()
            _serve_forked(work, there)
        there.close()
        with contextlib.suppress(PermissionError, ProcessLookupError):
            os.setpgid(pid, pid)  # parent and child both do this, because either may run first
        return cls(pid, here)

    def send(self, message: Any) -> None:
        """Send a message; raise Child.Error if the process has ended."""
        try:
            self.connection.send(message)
        except OSError:
            raise self._lost(MAX_WAIT) from None

    def receive(self, timeout: float, look: Callable[[], None] | None = None) -> Any:
        """Return the next message of the process.

        `timeout` is in seconds and excludes the time in which a program starts. `look` is called about every
        `ASK_INTERVAL`. Raises Child.Error if no message comes, and raises an InputError that the child sends.
        """

        def is_there(seconds: float) -> bool:
            if self.connection.poll(seconds):
                return True
            if look is not None:
                look()
            return False

        while True:
            limit, longest = inf if self._is_starting else timeout, ASK_INTERVAL if look else MAX_WAIT
            try:
                if not Timeout(self.pid, limit).wait_for(is_there, longest):
                    self.end()
                    raise Child.Error(None, timeout)
                message = self.connection.recv()
            except (EOFError, OSError):
                raise self._lost(timeout) from None
            if isinstance(message, InputError):
                raise message
            if message != Parent.STARTING:
                return message
            self._is_starting = not self._is_starting

    def end(self) -> None:
        """Kill the process and all processes that it has started."""
        if self.connection.closed:
            return
        with contextlib.suppress(ProcessLookupError, PermissionError, AttributeError):  # the last on Windows
            os.killpg(self.pid, signal.SIGKILL)
        if self._process is not None:
            self._process.kill()  # it may not lead its group yet
        while not self._has_ended(MAX_WAIT):
            pass
        self.connection.close()

    def _lost(self, timeout: float) -> Error:
        """Return how a process ended that has closed its pipe; kill it if it still runs."""
        Timeout(self.pid, timeout).wait_for(self._has_ended)
        code = self._exit_code  # read before `end`, which would change it
        self.end()
        return Child.Error(code, timeout)

    def _has_ended(self, seconds: float) -> bool:
        """Wait for some seconds for the process to end; return True once it has ended."""
        if self._process is not None:
            self._process.join(seconds)
            self._exit_code = self._process.exitcode
        elif self._exit_code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self._exit_code = os.waitstatus_to_exitcode(status)
            else:
                threading.Event().wait(min(seconds, EXIT_INTERVAL))
        return self._exit_code is not None


def _serve(work: Callable[..., None], connection: Connection, *inputs: Any) -> None:
    """Run `work` in a process that was started by `multiprocessing`."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    SafePath.forget()  # so that it starts scripts as its parent would
    _follow_parent(lambda: wait([parent.sentinel]))
    work(Parent(connection), *inputs)


def _follow_parent(wait_for_end: Callable[[], object]) -> None:
    """Ignore signals, lead a process group, and end when `wait_for_end` returns."""
    if hasattr(os, "setpgid"):
        os.setpgid(0, 0)
    for number in Interruption.SIGNALS:
        signal.signal(number, signal.SIG_IGN)

    def end() -> None:
        wait_for_end()
        os._exit(1)

    in_background(end)


def _serve_forked(work: Callable[[Parent], None], connection: Connection) -> None:
    number = os.getppid()

    def wait_for_end() -> None:
        while os.getppid() == number:  # once its parent has ended, it gets another one
            threading.Event().wait(1.0)

    _follow_parent(wait_for_end)
    faulthandler.disable()  # the parent reports how the child ended
    with contextlib.suppress(OSError):  # standard error may be closed
        os.dup2(2, 1)  # standard output is reserved for results of the command
        sys.stdout = os.fdopen(2, "w", buffering=1, closefd=False)
    parent = Parent(connection)
    parent.keep_informed()
    code = 1
    try:
        work(parent)
        code = 0
    except Exception as error:
        os.write(2, f"cranectl: {printable(InputError.describe(error), longest=MAX_PHRASE)}\n".encode())
        Parent.report_machine_failure(error)
    finally:
        os._exit(code)  # without the exit handlers and buffers that it has from its parent


def _in_words(code: int) -> str:
    """Return in words the exit code of a process, -N after signal N."""
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


class Program(NamedTuple):
    """What a foreign program said that has ended."""

    exit_code: int  # -N after signal N
    output: str  # what it wrote to standard output
    errors: str  # what it wrote to standard error

    @property
    def end(self) -> str:
        """Return in words how it ended."""
        return _in_words(self.exit_code)

    @classmethod
    def ask(
        cls,
        command: Sequence[str],
        timeout: float,
        *,
        question: str = "",
        environment: Mapping[str, str] | None = None,
    ) -> Self:
        """Return how a program ended that gets `question` as its input, and what it said.

        Raises TimeoutError, and ends the program, if it takes more than `timeout` [s].
        """
        pipe = subprocess.PIPE
        with subprocess.Popen(
            command, text=True, stdin=pipe, stdout=pipe, stderr=pipe, env=environment
        ) as process:
            unsent: str | None = question

            def talk(seconds: float) -> tuple[str, str] | None:
                nonlocal unsent
                try:
                    return process.communicate(unsent, timeout=seconds)
                except subprocess.TimeoutExpired:
                    unsent = None  # `communicate` can be called again, but takes its input only once
                    return None

            said = Timeout(process.pid, timeout).wait_for(talk)
            if said is None:
                process.kill()
                raise TimeoutError
            return cls(process.returncode, *said)

    @staticmethod
    def wait_for(pid: int, seconds: float, poll: Callable[[float], T]) -> T | None:
        """Return what `poll` returns once it is true; None if the `Timeout` of the program is over."""
        return Timeout(pid, seconds).wait_for(poll)
