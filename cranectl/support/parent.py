"""What a child process exchanges with its parent, the process that started it; see `Child`."""

import contextlib
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Final

from cranectl.support.errors import MachineError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


class Parent:
    """The parent of this process, at the other end of a pipe."""

    STARTING: Final = "starting"  # message before and after a program starts
    _informed: ClassVar[list["Parent"]] = []  # in a process that only runs controllers

    def __init__(self, connection: "Connection") -> None:
        """Hold this process's end of the pipe; messages are sent with `send`."""
        self.connection, self.send = connection, connection.send

    def requests(self) -> Iterator[Any]:
        """Yield the messages of the parent until it sends None or closes its end."""
        with contextlib.suppress(EOFError):
            yield from iter(self.connection.recv, None)

    def keep_informed(self) -> None:
        """Send the parent what `starting` and `report_machine_failure` say, from now on.

        Only a process does so that serves no other purpose than to run controllers.
        """
        self._informed[:] = [self]

    @classmethod
    @contextlib.contextmanager
    def starting(cls) -> Iterator[None]:
        """Say that a program starts in the block; no time limit applies while it starts."""
        for parent in cls._informed:
            parent.send(cls.STARTING)
        yield
        for parent in cls._informed:
            parent.send(cls.STARTING)

    @classmethod
    def report_machine_failure(cls, error: BaseException) -> None:
        """Tell an informed parent, and end this process, if `error` is a failure of the machine."""
        if MachineError.is_cause_of(error):
            for parent in cls._informed:
                parent.send(MachineError.of(f"a step: {MachineError.describe(error)}"))
                os._exit(1)
