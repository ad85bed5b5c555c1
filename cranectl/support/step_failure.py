"""Report an exception of a controller's step, wherever it was raised, on one line of standard error."""

import os
import traceback
from contextlib import suppress
from types import TracebackType

from cranectl.support.environment import tell_of_machine
from cranectl.support.errors import MAX_PHRASE, describe_error, printable

FAILED = -1  # returned by a step that raised


def report_failure(name: str, error: BaseException, raised: TracebackType | None = None) -> None:
    """Write which step failed, in which line, and why.

    A forked process may not wait for the lock of `sys.stderr`, so the text goes to the file descriptor.
    An error of the machine is no failure of the step: a process of runs ends with it instead.
    """
    frames = traceback.extract_tb(raised or error.__traceback__)
    where = f" in {frames[-1].filename.rpartition('/')[2]}:{frames[-1].lineno}" if frames else ""
    if isinstance(error, OSError):  # its line is one of ours, such as the one that reads a socket
        where = ""
    text = printable(f"{name} failed{where}: {describe_error(error)}", longest=MAX_PHRASE)
    with suppress(OSError):  # the step may have closed it
        os.write(2, f"cranectl: {text}\n".encode())
    tell_of_machine(error)


def report_compiled_failure(
    name: str, kind: type[BaseException], value: object = None, raised: TracebackType | None = None
) -> None:
    """Report the exception that a compiled step has set: C code calls this with its three parts."""
    if isinstance(value, BaseException):
        error = value
    else:  # C code may set an exception without making it
        arguments = value if isinstance(value, tuple) else () if value is None else (value,)
        error = kind(*arguments)
    report_failure(name, error, raised)
