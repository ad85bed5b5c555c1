"""The formats of logs that can be read: each number has its reader, and keeps it.

The rule, docs/reference/logs.md: the number of what is written rises with each change that would make an
older reader misread or refuse a log. A change that only adds what old readers pass over does not raise it.
"""

from collections.abc import Callable, Mapping

from cranectl.log import format_2
from cranectl.log.header import LogHeader
from cranectl.support.errors import InputError, LogError

WRITTEN = "2"

# Reads metadata and attachments.
READERS: Mapping[str, Callable[[Mapping[str, Mapping[str, str]], Mapping[str, bytes]], LogHeader]] = {
    "2": format_2.read_header,
}


def parse_header(
    path: str, metadata: Mapping[str, Mapping[str, str]], attachments: Mapping[str, bytes]
) -> LogHeader:
    """The header of the log at `path`; raises LogError for a foreign log and one of another version."""
    if "cranectl" not in metadata:
        raise LogError(
            f"{path} is an MCAP file, but not of cranectl",
            allowed="logs that cranectl wrote",
            remedy="name such a log, or open the file in a viewer",
        )
    version = str(metadata["cranectl"].get("format"))
    if version not in READERS:
        raise LogError(
            f"{path} has log format {version}",
            allowed=f"format {' or '.join(READERS)}",
            remedy="write the log again, or read it with the version of cranectl that wrote it",
        )
    try:
        return READERS[version](metadata, attachments)
    except InputError as error:
        raise LogError(
            f"{path}: {error.found}", allowed=error.allowed, remedy="write the log again"
        ) from None
    except (KeyError, TypeError, ValueError, IndexError, OverflowError, RecursionError) as error:
        reason = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise LogError(
            f"{path} is not a log this version understands: {reason[:200]}",
            allowed=f"logs of cranectl, format {' or '.join(READERS)}",
            remedy="write the log again with this version",
        ) from None
