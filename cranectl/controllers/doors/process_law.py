"""The door for laws in another process: at a UDP address, or a program that is started for each run.

Numbers are little-endian. The law is sent the number of the sample as an unsigned integer of 32 bits, 0 at
the start of each run, then what is measured and the row of the reference as float64; it answers with the same
number, three commands and what it wants logged. Datagrams hold one sample each; a program has them on its
standard input and output. In lock step the run waits for each answer. Free running it waits no longer than
the deadline: then the last command is held, and the missed one counted.
"""

import os
import select
import shutil
import socket
import struct
import subprocess
from collections.abc import Callable
from time import monotonic
from typing import Annotated, Literal, Protocol
from urllib.parse import urlsplit

import numpy as np
from pydantic import Field

from cranectl.controllers.controller import Controller, Logged, by_address
from cranectl.controllers.doors.called_back import called_back
from cranectl.controllers.doors.law_file import UDP, LawFile
from cranectl.scenario.settings import Settings, parse_settings
from cranectl.signals import Signal
from cranectl.support.arrays import Array
from cranectl.support.documents import parse_toml
from cranectl.support.errors import InputError
from cranectl.support.extensions import check_name

PATIENCE = 5.0  # [s] for an answer in lock step
STARTING = 5.0  # [s] for the first one of a run: a program has to start
NUMBERS = {"state": 12, "encoders": 5}
ROW = 15
SEQUENCE, MISSED, HELD, LOGGED = 0, 1, 2, 5  # places of the memory


class ProcessSettings(Settings):
    """A law in another process."""

    name: str = Field("remote", description="of the controller")
    address: str = Field("", description="where it listens, udp://HOST:PORT; or else:")
    program: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="started for each run, with its arguments; a path is relative to this file"
    )
    deadline: Annotated[float, Field(gt=0.0, le=PATIENCE)] | None = Field(
        None, description="free running: how long an answer is waited for [s]; by default in lock step"
    )
    command: Literal["acceleration", "velocity", "force"] = "acceleration"
    follows: Literal["path", "set-point"] = "path"
    measures: Literal["state", "encoders"] = "state"
    every: Annotated[int, Field(ge=1, le=10**6)] = Field(1, description="control periods between two samples")
    logged: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="names of the numbers that follow the command"
    )


def open_process(file: LawFile) -> Controller:
    """The law that a TOML file, or a UDP address, tells of; raises InputError."""
    at_address = file.reference.startswith(UDP)
    table = (
        {"address": file.reference}
        if at_address
        else parse_toml(file.content.decode("utf-8", "replace"), str(file.path))
    )
    settings = parse_settings(ProcessSettings, table, file.reference)
    check_name("controller", settings.name)
    connect = _connector(settings, file)
    answer = struct.Struct(f"<I{3 + len(settings.logged)}d")
    memory = np.zeros(LOGGED + len(settings.logged))
    missed = Signal("missed", "missed", "", "samples without an answer in time, so far")
    told = [Logged(LOGGED + k, Signal(name, name, "", "")) for k, name in enumerate(settings.logged)]
    return Controller(
        name=settings.name,
        title=f"in another process, {settings.address or ' '.join(settings.program)}",
        step=by_address,
        prepare=lambda _: (np.zeros(1), memory.copy()),
        command=settings.command,
        follows=settings.follows,
        measures=settings.measures,
        every=settings.every,
        logged=(Logged(MISSED, missed), *told),
        entry=lambda sizes, _: called_back(_step(settings, connect, answer), file.reference, sizes),
        alone=bool(settings.address),
    )


def _step(
    settings: ProcessSettings, connect: Callable[[], "Connection"], answer: struct.Struct
) -> Callable[..., int]:
    count = NUMBERS[settings.measures]
    question = struct.Struct(f"<I{count + ROW}d")
    connection: Connection | None = None

    def step(_: Array, measured: Array, reference: Array, memory: Array, command: Array) -> int:
        nonlocal connection
        sequence = int(memory[SEQUENCE])
        if sequence == 0:  # of a run
            if connection is not None:
                connection.close()
            connection = connect()
        assert connection is not None
        connection.send(question.pack(sequence, *measured[:count], *reference[:ROW]))
        free = settings.deadline if sequence > 0 else None
        patience = free or (PATIENCE if sequence > 0 else STARTING)
        deadline = monotonic() + patience
        found = None
        while found is None and (left := deadline - monotonic()) > 0.0:
            frame = connection.receive(answer.size, left)
            if frame is not None and len(frame) != answer.size:
                raise ValueError(f"an answer of {len(frame)} bytes, expected {answer.size}")
            if frame is not None and answer.unpack(frame)[0] == sequence:  # else of an earlier sample
                found = answer.unpack(frame)[1:]
        if found is not None:
            memory[HELD:] = found
        elif free is not None:
            memory[MISSED] += 1.0
        else:
            raise TimeoutError(f"no answer to sample {sequence} within {patience:g} s")
        command[:] = memory[HELD:LOGGED]
        memory[SEQUENCE] += 1.0
        return 0

    return step


class Connection(Protocol):
    """To the law of one run."""

    def send(self, frame: bytes) -> None: ...

    def receive(self, size: int, seconds: float) -> bytes | None:
        """A frame, or nothing within that time; raises OSError where there will be none."""

    def close(self) -> None: ...


def _connector(settings: ProcessSettings, file: LawFile) -> Callable[[], Connection]:
    if bool(settings.address) == bool(settings.program):
        raise InputError(
            f"{file.reference}: needs an address or a program",
            allowed="address = 'udp://HOST:PORT', or program = ['./law']",
            remedy="give one of the two",
        )
    if settings.program:
        first, *arguments = settings.program
        place = file.path.parent.absolute() / first
        found = str(place) if place.is_file() else shutil.which(first)
        if found is None:
            raise InputError(
                f"{file.reference}: there is no program '{first}'",
                allowed=f"a program on the path, or relative to {file.path.parent}",
                remedy="correct 'program'",
            )
        return lambda: _Program([found, *arguments], str(file.path.parent))
    try:
        where = urlsplit(settings.address)
        if where.scheme != "udp" or not where.hostname or not where.port or where.path or where.query:
            raise ValueError
    except ValueError:
        raise InputError(
            f"the address '{settings.address}'", allowed="udp://HOST:PORT", remedy="correct it"
        ) from None
    host, port = where.hostname, where.port
    return lambda: _Datagrams(host, port)


class _Datagrams:
    def __init__(self, host: str, port: int) -> None:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, kind)
        self._socket.connect(address)

    def send(self, frame: bytes) -> None:
        self._socket.send(frame)

    def receive(self, size: int, seconds: float) -> bytes | None:
        self._socket.settimeout(seconds)
        try:
            return self._socket.recv(size + 1)
        except TimeoutError:
            return None

    def close(self) -> None:
        self._socket.close()


class _Program:
    def __init__(self, command: list[str], directory: str) -> None:
        self._process = subprocess.Popen(
            command, cwd=directory, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._to, self._from = self._process.stdin.fileno(), self._process.stdout.fileno()
        self._begun = b""  # of a frame

    def send(self, frame: bytes) -> None:
        os.write(self._to, frame)

    def receive(self, size: int, seconds: float) -> bytes | None:
        deadline = monotonic() + seconds
        while len(self._begun) < size:
            if not select.select([self._from], [], [], max(deadline - monotonic(), 0.0))[0]:
                return None
            if not (part := os.read(self._from, size - len(self._begun))):
                raise ConnectionError(f"the program ended with exit code {self._process.wait()}")
            self._begun += part
        frame, self._begun = self._begun, b""
        return frame

    def close(self) -> None:
        self._process.kill()
        self._process.communicate()
