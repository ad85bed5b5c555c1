"""Where nothing more can be written, each writer says so in one sentence, and leaves nothing half-written."""

import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from cranectl.cli.main import main

ROOM = 4096  # [bytes] that a file may have, less than what any of the commands writes
MAX_LINES = 8  # of progress, and of what was found, allowed and what to do

WRITERS = {
    "run": "run short.toml --plants analytic --every 1 --out own.mcap",
    "validate": "validate short.toml --plants analytic --controller lqr --drive ideal --jobs 1 --every 1",
    "merge": "compare one.mcap two.mcap --merge merged.mcap --despite-differences",
    "overlay": "log overlay one.mcap two.mcap --label a,b --out over.mcap",
    "recover": "log recover one.mcap --out recovered.mcap",
    "report": "report one.mcap --out page.html",
    "csv": "log export one.mcap --format csv --out csv",
    "parquet": "log export one.mcap --format parquet --out parquet",
    "matlab": "log export one.mcap --format mat --out mat",
    "campaign": "campaign run many.toml --out other",
    "campaign report": "campaign report result --out page.html",
    "picture": "render one.mcap one.png --size 160x120",
    "plot": "design lqr --plot design.svg",
    "export": "design lqr --scenario short.toml --fmu lqr.fmu",
}


@contextmanager
def full_disk() -> Iterator[None]:
    """Let no file of this process grow beyond ROOM, as on a disk that is full from then on."""
    before, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pytest.MonkeyPatch.context() as patch:
        # Python would leave compiled modules of the environment cut off, and nobody could load them again.
        # What draws is a process of its own, with the same limit.
        patch.setattr(sys, "dont_write_bytecode", True)
        patch.setenv("PYTHONDONTWRITEBYTECODE", "1")
        resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, most))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (before, most))


@pytest.mark.usefixtures("in_copy_of_files")
@pytest.mark.parametrize("writer", WRITERS)
def test_a_full_disk_is_told_in_one_sentence(writer: str, capfd: pytest.CaptureFixture[str]) -> None:
    before = {path for path in Path().rglob("*") if path.is_file()}
    with full_disk():
        code = main(WRITERS[writer].split())
    error = capfd.readouterr().err
    assert code == 2, error
    assert "error logging" not in error
    assert len(error.splitlines()) <= MAX_LINES, error
    assert error.count("found:") == 1
    assert "remedy:" in error
    left = [path for path in Path().rglob("*") if path.is_file() and path not in before]
    assert all(path.name.endswith((".part", ".json")) or path.stat().st_size < ROOM for path in left), left
