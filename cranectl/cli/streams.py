"""Standard output and error of any encoding, full or closed: none of that changes what a command does.

A command's own output goes to the standard output that it was given. Whatever else writes to that descriptor,
such as a C controller or a process that it starts, writes to standard error: it can break no JSON.
"""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

STANDARD_OUTPUT, STANDARD_ERROR = 1, 2


@contextmanager
def steady_streams() -> Iterator[None]:
    """Replace characters that cannot be encoded by `?`, and drop what cannot be written, in a command."""
    before = sys.stdout, sys.stderr
    own = _set_apart(sys.stdout)
    sys.stdout, sys.stderr = _steady(sys.stdout, own), _steady(sys.stderr)
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):  # ValueError: somebody closed it
                stream.flush()
        sys.stdout, sys.stderr = before
        if own is not None:
            os.dup2(own, STANDARD_OUTPUT)
            os.close(own)


def _set_apart(stream: Any) -> int | None:
    """Lead the number of standard output to standard error; return its new descriptor, or None if closed."""
    try:
        if stream.fileno() != STANDARD_OUTPUT:  # a test's
            return None
        stream.flush()
        own = os.dup(STANDARD_OUTPUT)
    except (AttributeError, OSError, ValueError):
        return None
    try:
        os.dup2(STANDARD_ERROR, STANDARD_OUTPUT)
    except OSError:
        os.close(own)
        return None
    return own


def _steady(stream: Any, descriptor: int | None = None) -> Any:
    """Return a stream that writes to `descriptor`, by default that of `stream`, and never fails."""
    if stream is None:  # its descriptor was closed before we began
        return io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="replace")
    buffer = getattr(stream, "buffer", None)
    raw = getattr(buffer, "raw", buffer)
    if type(raw) is not io.FileIO:  # a test's, or a console of Windows
        return stream
    with suppress(OSError):
        stream.flush()
    number = raw.fileno() if descriptor is None else descriptor
    binary = io.BufferedWriter(_SteadyFile(number, "wb", closefd=False))
    at_once = stream.line_buffering or stream.write_through
    return io.TextIOWrapper(binary, encoding=stream.encoding, errors="replace", line_buffering=at_once)


class _SteadyFile(io.FileIO):
    """A file whose first failure sends all that follows to nowhere, the interpreter's own last flush too."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            seen_enough = isinstance(error, BrokenPipeError)
            if not seen_enough and self.fileno() != STANDARD_ERROR:
                print(f"cranectl: output cannot be written: {error.strerror}", file=sys.stderr)
            return len(data)
