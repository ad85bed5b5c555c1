"""Standard output and error of any encoding, full or closed: none of that changes what a command does."""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

STANDARD_ERROR = 2


@contextmanager
def steady_streams() -> Iterator[None]:
    """For the length of a command: what cannot be encoded becomes `?`, what cannot be written is dropped."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = _steady(sys.stdout), _steady(sys.stderr)
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):  # ValueError: somebody closed it
                stream.flush()
        sys.stdout, sys.stderr = before


def _steady(stream: Any) -> Any:
    if stream is None:  # its descriptor was closed before we began
        return io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="replace")
    buffer = getattr(stream, "buffer", None)
    raw = getattr(buffer, "raw", buffer)
    if type(raw) is not io.FileIO:  # a test's, or a console of Windows
        return stream
    with suppress(OSError):
        stream.flush()
    binary = io.BufferedWriter(_SteadyFile(raw.fileno(), "wb", closefd=False))
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
