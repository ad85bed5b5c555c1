"""What every test assumes of the process that it runs in."""

import signal
from collections.abc import Iterator

import pytest

from tests import read_files

# Tests send these to themselves and to what they start. A script's background job ignores Ctrl-C, `nohup` the
# hang-up, and who is started by them inherits that.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGTERM, signal.SIG_DFL)
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

if read_files.LISTED:
    read_files.watch()

    @pytest.fixture(scope="session", autouse=True)
    def _only_listed_files_are_read() -> Iterator[None]:
        """Fail if a test reads a file that `.ci/proven.py` does not check for changes."""
        yield
        unlisted = sorted(read_files.unlisted())
        assert not unlisted, f"name these in SETS of .ci/proven.py: {', '.join(unlisted)}"
