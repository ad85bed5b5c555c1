"""Processes that work for this one: start them, talk with them, notice their death and end them.

A child is forked, or a new Python process. It leaves signals to its parent, ends with it, and leads a group
of processes, so that what it starts ends with it. A program of somebody else only answers one question.
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
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import inf
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, TypeVar

from cranectl.support.errors import (
    MAX_PHRASE,
    STARTING,
    InputError,
    describe_error,
    printable,
    report_to_parent,
    tell_of_machine,
    was_killed,
)
from cranectl.support.interrupts import SIGNALS, in_background

LONGEST_WAIT = 3600.0  # [s] at once
ASK_INTERVAL = 0.1  # [s] between two looks at what else may end a wait
EXIT_INTERVAL = 0.01  # [s] between two looks whether a forked child has ended
SAFE_PATH = "PYTHONSAFEPATH"  # any text keeps the working directory out of the search path
MARK = "cranectl"  # the text that says that it was set here, and not by the user
T = TypeVar("T")
_lock = threading.Lock()
_blocks = 0  # of `safe_path` that are open, in any thread


class Timeout:
    """A limit of the time that a process takes. Time in which it waits for a processor does not count."""

    def __init__(self, pid: int, seconds: float, clock: Callable[[], float] = time.monotonic) -> None:
        """Start now; `seconds` may be infinite."""
        self._pid, self._seconds, self._clock = pid, seconds, clock
        self._start, self._waited = clock(), processor_wait(pid)

    @property
    def left(self) -> float:
        """Return the time that is left [s], at least zero."""
        waited = max(0.0, processor_wait(self._pid) - self._waited)
        return max(0.0, self._seconds - (self._clock() - self._start - waited))

    def wait_for(self, poll: Callable[[float], T], longest: float = LONGEST_WAIT) -> T | None:
        """Return what `poll`, called with seconds to wait, returns once it is true; None if time is over."""
        while left := self.left:
            if result := poll(min(left, longest)):
                return result
        return None


def processor_wait(pid: int) -> float:
    """Return how long [s] a process has been ready and had no processor; zero where nothing tells."""
    try:
        fields = Path(f"/proc/{pid or os.getpid()}/schedstat").read_text("ascii").split()
        return 1e-9 * int(fields[1])
    except (OSError, IndexError, ValueError):
        return 0.0


def describe_exit(code: int) -> str:
    """Return in words the exit code of a process, -N after signal N."""
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


class ChildError(Exception):
    """A child has ended before it answered, or has not answered in time and was ended."""

    def __init__(self, exit_code: int | None, timeout: float) -> None:
        """Describe how a child ended; `exit_code` is None if it did not answer within `timeout` [s]."""
        silent = f"took more than {timeout:g} s for a block"
        super().__init__(
            silent if exit_code is None else f"ended its process with {describe_exit(exit_code)}"
        )
        self.is_silent, self.is_killed = exit_code is None, exit_code is not None and was_killed(exit_code)


class Child:
    """A process that works for this one, and this end of the pipe between them."""

    def __init__(self, pid: int, connection: Connection, process: BaseProcess | None = None) -> None:
        """Hold a child process; `process` is None if it was forked here."""
        self.pid, self.connection, self._process = pid, connection, process
        self._exit_code: int | None = None
        self._is_starting = False  # a program, which no timeout bounds

    def send(self, message: Any) -> None:
        """Send a message; raise ChildError if the process has ended."""
        try:
            self.connection.send(message)
        except OSError:
            raise self._lost(LONGEST_WAIT) from None

    def receive(self, timeout: float, look: Callable[[], None] | None = None) -> Any:
        """Return the next message of the process.

        `timeout`: [s], without the time in which a program starts. `look` is called every `ASK_INTERVAL`.
        Raises ChildError if there will be no message, and an InputError that is received.
        """

        def is_there(seconds: float) -> bool:
            if self.connection.poll(seconds):
                return True
            if look is not None:
                look()
            return False

        while True:
            limit, longest = inf if self._is_starting else timeout, ASK_INTERVAL if look else LONGEST_WAIT
            try:
                if not Timeout(self.pid, limit).wait_for(is_there, longest):
                    self.end()
                    raise ChildError(None, timeout)
                message = self.connection.recv()
            except (EOFError, OSError):
                raise self._lost(timeout) from None
            if isinstance(message, InputError):
                raise message
            if message != STARTING:
                return message
            self._is_starting = not self._is_starting

    def end(self) -> None:
        """End the process, whatever it does, and what it has started."""
        if self.connection.closed:
            return
        with contextlib.suppress(ProcessLookupError, PermissionError, AttributeError):
            os.killpg(self.pid, signal.SIGKILL)
        if self._process is not None:
            self._process.kill()  # if it does not lead its group yet
        while not self._has_ended(LONGEST_WAIT):
            pass
        self.connection.close()

    def _lost(self, timeout: float) -> ChildError:
        """Return how the process ended, which has closed its pipe; end it if it goes on."""
        Timeout(self.pid, timeout).wait_for(self._has_ended)
        code = self._exit_code  # which a kill from here would change
        self.end()
        return ChildError(code, timeout)

    def _has_ended(self, seconds: float) -> bool:
        """Wait for the end of the process for some seconds."""
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


@contextlib.contextmanager
def safe_path() -> Iterator[None]:
    """Keep the working directory out of the search path of the processes that the block starts.

    `python -c`, by which `multiprocessing` starts them, puts it first: a `struct.py` there would run in place
    of the module of that name. They call `forget_safe_path`, so that a script that they start finds its own.
    """
    global _blocks
    with _lock:
        _blocks += 1
        if not os.environ.get(SAFE_PATH):
            os.environ[SAFE_PATH] = MARK
    try:
        yield
    finally:
        with _lock:
            _blocks -= 1
            if not _blocks:
                forget_safe_path()


def forget_safe_path() -> None:
    """Let scripts that start from now on import from their own folder, unless the user forbids it."""
    if os.environ.get(SAFE_PATH) == MARK:
        del os.environ[SAFE_PATH]


def users_environment() -> dict[str, str]:
    """Return the environment for a program of the user, without what `safe_path` adds."""
    return {name: value for name, value in os.environ.items() if (name, value) != (SAFE_PATH, MARK)}


def spawn_child(
    work: Callable[..., None], *inputs: Any, context: BaseContext | None = None, daemon: bool = True
) -> Child:
    """Start a Python process that calls `work` with its end of the pipe and `inputs`.

    `context`: how it starts, by default anew. `daemon`: it ends with this process, and `multiprocessing` lets
    it start none of its own.
    """
    context = context or multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(work, there, *inputs), daemon=daemon)  # type: ignore[attr-defined]
    with safe_path():
        process.start()
    there.close()
    return Child(process.pid, here, process)


def _serve(work: Callable[..., None], connection: Connection, *inputs: Any) -> None:
    """Do the work of a process that is not forked from its parent."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    forget_safe_path()  # so that it starts scripts as its parent does
    _follow_parent(lambda: wait([parent.sentinel]))
    work(connection, *inputs)


def _follow_parent(wait_for_end: Callable[[], object]) -> None:
    """Leave signals to the parent, which `wait_for_end` waits for, end with it, and lead a group."""
    if hasattr(os, "setpgid"):
        os.setpgid(0, 0)
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)

    def end() -> None:
        wait_for_end()
        os._exit(1)

    in_background(end)


def requests(connection: Connection) -> Iterator[Any]:
    """Yield what the parent sends, until it sends None or closes its end."""
    with contextlib.suppress(EOFError):
        yield from iter(connection.recv, None)


def fork_child(work: Callable[[Connection], None]) -> Child:
    """Fork a process that calls `work` with its end of the pipe; whatever goes wrong there only ends it."""
    here, there = multiprocessing.Pipe(duplex=False)
    with warnings.catch_warnings():  # of threads, none of which the child needs
        warnings.simplefilter("ignore", DeprecationWarning)
        pid = os.fork()
    if pid == 0:
        here.close()
        _serve_forked(work, there)
    there.close()
    with contextlib.suppress(PermissionError, ProcessLookupError):
        os.setpgid(pid, pid)  # as the child does: whoever is first
    return Child(pid, here)


def _serve_forked(work: Callable[[Connection], None], connection: Connection) -> None:
    parent = os.getppid()

    def wait_for_end() -> None:
        while os.getppid() == parent:
            threading.Event().wait(1.0)

    _follow_parent(wait_for_end)
    faulthandler.disable()  # the parent says how it ended
    with contextlib.suppress(OSError):  # standard error may be closed
        os.dup2(2, 1)  # standard output is the command's own
        sys.stdout = os.fdopen(2, "w", buffering=1, closefd=False)
    report_to_parent(connection.send)
    code = 1
    try:
        work(connection)
        code = 0
    except Exception as error:
        os.write(2, f"cranectl: {printable(describe_error(error), longest=MAX_PHRASE)}\n".encode())
        tell_of_machine(error)
    finally:
        os._exit(code)


def answer_of_program(
    command: Sequence[str],
    timeout: float,
    *,
    question: str = "",
    environment: Mapping[str, str] | None = None,
) -> tuple[int, str, str]:
    """Return exit code, output and errors of a program that gets `question` as its input.

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
                unsent = None
                return None

        said = Timeout(process.pid, timeout).wait_for(talk)
        if said is None:
            process.kill()
            raise TimeoutError
        return process.returncode, *said
