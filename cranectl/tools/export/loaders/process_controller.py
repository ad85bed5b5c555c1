"""Run controllers in another process: at a UDP address, or in a program that is started for each run.

All numbers are little-endian. At each sample the controller receives three items: the number of the sample as
an unsigned integer of 32 bits, the measured values, and the row of the reference as float64. The sample
number is 0 at the start of each run. The controller answers with the same number, three commands and its
logged values. Each UDP datagram holds one sample. A program uses its standard input and output. In lock step
the run waits for each answer. In free running it waits only until the deadline. If no answer comes in time,
the run holds the last command and counts a missed sample.
"""

import os
import shutil
import socket
import struct
import subprocess
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Annotated, Any, Literal
from urllib.parse import urlsplit

import numpy as np
from pydantic import Field

from cranectl.controllers import ALL_CONTROLLERS, Controller, Slots
from cranectl.loaders import ControllerFile, callback_address, complete_copy_of
from cranectl.scenario import Settings
from cranectl.signals import Signal
from cranectl.support import TOML, Array, InputError, Parent, Program, SafePath, in_background

ANSWER_TIMEOUT = 600.0  # [s] for an answer in lock step, if the run has no shorter time limit
START_TIMEOUT = 3600.0  # [s] for the first answer of a run, because a program may import and compile
UNKNOWN = -1  # id of an unknown process; the time in which it waits for a processor counts too
MAX_DEADLINE = 5.0  # [s] for an answer in free running
MEASURED_WIDTH = {"state": 12, "encoders": 5}
REFERENCE_WIDTH = 15
PIPE_BYTES = 65536  # largest number of bytes in one read
MEMORY = Slots(sequence=1, missed=1, last_command=3, reported=0)


class ProcessSettings(Settings):
    """A controller in another process."""

    name: str = Field("remote", description="of the controller")
    address: str = Field("", description="where it listens, udp://HOST:PORT; or else:")
    program: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="started for each run, with its arguments; a path is relative to this file"
    )
    files: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="what else the program reads, as patterns relative to this file: gains.py, data/*.csv"
    )
    deadline: Annotated[float, Field(gt=0.0, le=MAX_DEADLINE)] | None = Field(
        None, description="free running: how long an answer is waited for [s]; by default in lock step"
    )
    command: Literal["acceleration", "velocity", "force"] = "acceleration"
    follows: Literal["path", "set-point"] = "path"
    measures: Literal["state", "encoders"] = "state"
    every: Annotated[int, Field(ge=1, le=10**6)] = Field(1, description="control periods between two samples")
    period: float | None = Field(
        None, description="between two samples [s], if no other fits; by default any"
    )
    logged: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="names of the numbers that follow the command"
    )


def open_process(file: ControllerFile) -> tuple[Controller, ControllerFile]:
    """Return the controller that a TOML file or a UDP address describes; raise InputError."""
    table = {"address": file.reference}
    if not file.reference.startswith(ALL_CONTROLLERS.UDP):
        table = TOML.parse(file.content.decode("utf-8", "replace"), str(file.path))
    settings = ProcessSettings.from_table(table, file.reference)
    if not file.companions:  # a worker process already has these files
        file = _with_named_files(settings, file)
    InputError.check_name("controller", settings.name)
    connect = _connector(settings, file)
    memory = MEMORY.array(reported=np.zeros(len(settings.logged)))
    missed = Signal("missed", "missed", "", "samples without an answer in time, so far")
    controller = Controller(
        name=settings.name,
        title=f"in another process, {settings.address or ' '.join(settings.program)}",
        step=Controller.called_by_address,
        prepare=lambda _: (np.zeros(1), memory.copy()),
        command=settings.command,
        follows=settings.follows,
        measures=settings.measures,
        every=settings.every,
        period=settings.period,
        reads=(),
        logged=MEMORY.logged(
            missed=[missed], reported=[Signal(name, name, "", "") for name in settings.logged]
        ),
        entry=lambda sizes, _: callback_address(_step(settings, connect), file.reference, sizes),
        alone=bool(settings.address),
    )
    return controller, file


def _with_named_files(settings: ProcessSettings, file: ControllerFile) -> ControllerFile:
    """Add the files that `program` and `files` name to `file`; raise InputError for missing files."""
    folder = file.folder
    named = {word for word in settings.program if _is_file(folder / word)}
    for pattern in settings.files:
        files = [path for path in folder.glob(pattern) if path.is_file()] if pattern else []
        if not files:
            raise InputError(
                f"{file.reference}: no file matches files = '{pattern}'",
                allowed=f"files below {folder}, or patterns of them such as data/*.csv",
                remedy="correct 'files'",
            )
        named |= {path.relative_to(folder).as_posix() for path in files}
    try:
        return file.with_companions(folder, named)
    except OSError as error:
        raise InputError(
            f"{file.reference}: {error.filename}: {error.strerror}",
            allowed="files that can be read",
            remedy="correct 'program' or 'files'",
        ) from None


def _is_file(path: Path) -> bool:
    """Return True if `path` is a file; False also for an invalid file name, such as a long `-c CODE`."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _step(settings: ProcessSettings, connect: "Callable[[], _Program | _Datagrams]") -> Callable[..., int]:
    count = MEASURED_WIDTH[settings.measures]
    request = struct.Struct(f"<I{count + REFERENCE_WIDTH}d")
    answer = struct.Struct(f"<I{3 + len(settings.logged)}d")
    connection: _Program | _Datagrams | None = None

    def step(_: Array, measured: Array, reference: Array, memory: Array, command: Array) -> int:
        nonlocal connection
        sequence = int(memory[MEMORY.sequence])
        if sequence == 0:  # the first sample of a run
            if connection is not None:
                connection.close()
            connection = connect()
        assert connection is not None
        connection.send(request.pack(sequence, *measured[:count], *reference[:REFERENCE_WIDTH]))
        deadline = settings.deadline if sequence > 0 else None
        limit = deadline or (ANSWER_TIMEOUT if sequence > 0 else START_TIMEOUT)
        pid = UNKNOWN if deadline else connection.process
        with Parent.starting() if sequence == 0 else nullcontext():
            received = Program.wait_for(pid, limit, partial(_answer, connection, answer, sequence))
        if received is not None:
            memory[MEMORY.last_command :] = received
        elif deadline is not None:
            memory[MEMORY.missed] += 1.0
        else:
            raise TimeoutError(f"no answer to sample {sequence} within {limit:g} s")
        command[:] = memory[MEMORY.last_command : MEMORY.reported]
        memory[MEMORY.sequence] += 1.0
        return 0

    return step


def _answer(connection: "_Program | _Datagrams", answer: struct.Struct, sequence: int, seconds: float) -> Any:
    """Return the numbers of the next answer, or None if no answer to this sample comes in time."""
    frame = connection.receive(answer.size, seconds)
    if frame is None:
        return None
    if len(frame) != answer.size:
        raise ValueError(f"an answer of {len(frame)} bytes, expected {answer.size}")
    number, *values = answer.unpack(frame)
    return values if number == sequence else None


def _connector(settings: ProcessSettings, file: ControllerFile) -> "Callable[[], _Program | _Datagrams]":
    """Return a function that connects to the controller for one run; raise InputError if it cannot."""
    if bool(settings.address) == bool(settings.program):
        raise InputError(
            f"{file.reference}: needs an address or a program",
            allowed="address = 'udp://HOST:PORT', or program = ['./controller']",
            remedy="give one of the two",
        )
    if settings.program:
        _check_program(settings.program[0], file)
        return partial(_Program, settings.program, file)
    try:
        url = urlsplit(settings.address)
        if url.scheme != "udp" or not url.hostname or not url.port or url.path or url.query:
            raise ValueError
    except ValueError:
        raise InputError(
            f"the address '{settings.address}'", allowed="udp://HOST:PORT", remedy="correct it"
        ) from None
    return partial(_Datagrams, url.hostname, url.port)


def _check_program(first: str, file: ControllerFile) -> None:
    """Raise InputError if the program is missing, or differs from that where the file was opened."""
    known = first in dict(file.companions) or _is_file(file.folder / first)
    if not known and shutil.which(first) is None:
        raise InputError(
            f"{file.reference}: there is no program '{first}'",
            allowed=f"a program on the path, or relative to {file.path.parent}",
            remedy="correct 'program'",
        )
    here = dict(file.read_again().companions)
    for name, digest in file.companions:
        if Path(name).is_absolute() and here[name] != digest:
            raise InputError(
                f"{file.reference}: {name} differs from the file on the machine that opened the controller",
                allowed="the same program on all machines",
                remedy="install it here, or name it without a folder to take that of the search path",
            )


class _Datagrams:
    """A UDP socket for one run."""

    process = UNKNOWN

    def __init__(self, host: str, port: int) -> None:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, kind)
        self._socket.connect(address)
        self.send, self.close = self._socket.send, self._socket.close

    def receive(self, size: int, seconds: float) -> bytes | None:
        """Return a datagram, or None if none comes within `seconds`."""
        self._socket.settimeout(seconds)
        try:
            return self._socket.recv(size + 1)  # one byte more shows a datagram that is too long
        except TimeoutError:
            return None


class _Program:
    """A program for one run, started in the folder that holds its files; raises OSError."""

    def __init__(self, program: tuple[str, ...], file: ControllerFile) -> None:
        folder = complete_copy_of(file).parent
        first, *arguments = program
        own_program = folder / first
        self._process = subprocess.Popen(
            [str(own_program) if _is_file(own_program) else str(shutil.which(first)), *arguments],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env=SafePath.users_environment(),
        )
        self.process = self._process.pid
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self.send = self._process.stdin.write
        self._parts: SimpleQueue[bytes] = SimpleQueue()
        self._incomplete_frame = b""
        in_background(partial(self._read, self._process.stdout.fileno()))

    def _read(self, descriptor: int) -> None:
        """Read the output in a thread, because some systems can only wait for sockets."""
        while part := os.read(descriptor, PIPE_BYTES):
            self._parts.put(part)
        self._parts.put(b"")

    def receive(self, size: int, seconds: float) -> bytes | None:
        """Return a frame, or None if none comes in time; raise ConnectionError if the program ended."""
        deadline = monotonic() + seconds
        while len(self._incomplete_frame) < size:
            try:
                part = self._parts.get(timeout=max(deadline - monotonic(), 0.0))
            except Empty:
                return None
            if not part:
                self._parts.put(part)  # for `close`
                raise ConnectionError(f"the program ended with exit code {self._process.wait()}")
            self._incomplete_frame += part
        frame, self._incomplete_frame = self._incomplete_frame[:size], self._incomplete_frame[size:]
        return frame

    def close(self) -> None:
        self._process.kill()
        while self._parts.get():  # the last part is empty
            pass
        self._process.communicate()
