"""Damaged files, and files made to harm: a refusal, and never a traceback, a dead command or full memory.

Limits are counted in memory and processor time of the process that reads, not in time on a clock.
"""

import os
import random
import signal
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from cranectl.support.children import Child
from cranectl.support.errors import InputError, MachineError
from cranectl.tools.measured import isolated
from cranectl.tools.measured.isolated import read_isolated
from cranectl.tools.measured.suggestion import suggest_map
from cranectl.tools.measured.tables import read_head
from tests.tools.measured import bad_readers
from tests.tools.measured.test_files import write_parquet, write_ros_1
from tests.tools.measured.test_formats import excel, hdf5_table, json_messages, matlab_7_3, savemat_4

MIB = 2**20
WITHOUT_REMEDY = "a refusal without what is allowed, or without a remedy"
WRITERS: dict[str, Callable[[Path], None]] = {
    "MATLAB 4": savemat_4,
    "MATLAB 5": lambda path: savemat(path, {"t": np.arange(500.0), "s": {"x": np.arange(500.0)}}),
    "MATLAB 7.3": matlab_7_3,
    "HDF5": hdf5_table,
    "Excel": excel,
    "Parquet": write_parquet,
    "MCAP": json_messages,
    "ROS bag": write_ros_1,
}


def read_all(path: Path) -> str:
    """Read all columns; return the first refusal."""
    try:
        head = read_head(path)
        for k in range(len(head.names)):
            head.read(k)
    except InputError as error:
        return error.found if error.allowed and error.remedy else WITHOUT_REMEDY
    return ""


def damaged(content: bytes, seed: int) -> bytes:
    """Cut a file off, or change some of its bytes, by a seed."""
    source = random.Random(seed)
    if not seed % 2:
        return content[: source.randrange(16, len(content))]
    changed = bytearray(content)
    for _ in range(source.choice([1, 30])):
        place = source.randrange(8, min(len(changed), source.choice([400, len(changed)])))
        changed[place : place + 4] = source.choice(
            [b"\xff\xff\xff\xff", b"\0\0\0\0", b"\x7f\xff\xff\xff", source.randbytes(4)]
        )
    return bytes(changed)


@pytest.mark.parametrize("seed", [0, 1, 3])
@pytest.mark.parametrize("case", WRITERS)
def test_damaged_binary_files_are_read_or_refused(case: str, seed: int, tmp_path: Path) -> None:
    WRITERS[case](tmp_path / "whole")
    content = damaged((tmp_path / "whole").read_bytes(), seed)
    (tmp_path / "a.bag").write_bytes(content)
    found = read_all(tmp_path / "a.bag")
    assert found != WITHOUT_REMEDY
    if seed == 0:
        assert str(tmp_path / "a.bag") in found, "a file that was cut off is not read in part"


def nested_cells(depth: int) -> bytes:
    """Return a MATLAB file with cells in cells, which no library bounds."""
    size, elements = 0, []
    for k in range(depth):
        size += 40 if not k else 48
        named = k == depth - 1
        elements.append(
            struct.pack("<II", 14, size)
            + struct.pack("<4I", 6, 8, 1, 0)
            + struct.pack("<2I2i", 5, 8, min(k, 1), min(k, 1))
            + (struct.pack("<2H4s", 1, 1, b"c") if named else struct.pack("<2I", 1, 0))
        )
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    return header + b"".join(reversed(elements))


@pytest.fixture
def processes(monkeypatch: pytest.MonkeyPatch) -> list[Child]:
    """Return the processes that read files, as they start."""
    started: list[Child] = []
    start = Child.spawn

    def spawn(*inputs: Any) -> Child:
        started.append(start(*inputs))
        return started[-1]

    monkeypatch.setattr(Child, "spawn", spawn)
    return started


def peak_memory(process: Child) -> float:
    """Return the largest memory that a process has had [MiB]."""
    status = Path(f"/proc/{process.pid}/status").read_text()
    return float(status.partition("VmHWM:")[2].split()[0]) / 1024.0


def test_cells_60_000_deep_end_only_the_process_that_reads_them(tmp_path: Path) -> None:
    (tmp_path / "a.mat").write_bytes(nested_cells(60_000))
    found = read_all(tmp_path / "a.mat")
    assert "its reader ended its process with SIGSEGV" in found


def test_a_small_file_with_a_large_variable_is_read_within_1_gib(
    tmp_path: Path, processes: list[Child]
) -> None:
    large = np.zeros((15_000_000, 2))
    savemat(tmp_path / "a.mat", {"t": np.arange(12.0), "x": large}, do_compression=True)
    assert (tmp_path / "a.mat").stat().st_size < 300_000
    head = read_head(tmp_path / "a.mat")
    assert len(head.read(head.names.index("t")).values) == 12
    (process,) = processes
    assert peak_memory(process) < 400.0, "what is not mapped is not kept"
    assert len(head.read(head.names.index("x:2")).values) == len(large)
    assert 240.0 < peak_memory(process) < 1024.0


def test_a_variable_above_the_limit_is_refused_and_others_are_read(
    tmp_path: Path, processes: list[Child]
) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("x", (15_000_000, 20), "f8", chunks=(2**16, 1), compression="gzip")
        file["t"] = np.arange(12.0)
    head = read_head(tmp_path / "a.h5")
    with pytest.raises(InputError, match="its reader needs more than 1 GiB of memory"):
        head.read(head.names.index("x:1"))
    assert len(head.read(head.names.index("t")).values) == 12
    assert peak_memory(processes[0]) < 1024.0
    assert "needs more than 1 GiB" in suggest_map(tmp_path / "a.h5")


def test_a_text_in_a_workbook_that_unpacks_to_more_memory_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(isolated, "MAX_READER_BYTES", 300 * MIB)
    excel(tmp_path / "whole.xlsx")
    with (
        ZipFile(tmp_path / "whole.xlsx") as whole,
        ZipFile(tmp_path / "a.xlsx", "w", ZIP_DEFLATED, compresslevel=1) as archive,
    ):
        for name in whole.namelist():
            before, mark, after = whole.read(name).partition(b"<t>t</t>")
            with archive.open(name, "w") as stream:
                stream.write(before)
                if mark:
                    stream.write(b"<t>")
                    for _ in range(300):
                        stream.write(b"a" * MIB)
                    stream.write(b"</t>")
                stream.write(after)
    assert (tmp_path / "a.xlsx").stat().st_size < 3 * MIB
    assert "needs more than 0.293 GiB of memory" in read_all(tmp_path / "a.xlsx")


@pytest.mark.parametrize(
    ("reader", "found"),
    [
        (bad_readers.die, "its reader ended its process with SIGSEGV"),
        (bad_readers.abort, "its reader ended its process with SIGABRT"),
        (bad_readers.leave, "its reader ended its process with exit code 0"),
        (bad_readers.never_end, "its reader needs more than 1 s of processor time"),
        (bad_readers.sleep, "its reader needs more than 30 s of processor time"),
        (bad_readers.fill_memory, "its reader needs more than 1 GiB of memory"),
        (bad_readers.recurse, "RecursionError"),
    ],
)
def test_a_reader_that_ends_badly_is_a_refusal(
    reader: isolated.Reader, found: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(isolated, "MAX_PROCESSOR_TIME", 1 if reader is bad_readers.never_end else 30)
    monkeypatch.setattr(isolated, "MAX_SILENCE", 3.0 if reader is bad_readers.sleep else 600.0)
    (tmp_path / "a.mat").write_bytes(b"MATLAB 5.0")
    with pytest.raises(InputError) as error:
        read_isolated(reader, (), tmp_path / "a.mat", "the file")
    assert found in error.value.found
    assert "the file" in error.value.found


def test_a_process_that_was_killed_is_a_failure_of_the_machine(
    tmp_path: Path, processes: list[Child]
) -> None:
    (tmp_path / "a.mat").write_bytes(b"MATLAB 5.0")
    head = read_isolated(bad_readers.die_later, (), tmp_path / "a.mat", "the file")
    os.kill(processes[0].pid, signal.SIGKILL)
    with pytest.raises(MachineError, match="the process that reads the file was killed"):
        head.read(0)


def test_a_reader_may_die_at_a_column_and_ends_with_its_head(tmp_path: Path, processes: list[Child]) -> None:
    (tmp_path / "a.mat").write_bytes(b"MATLAB 5.0")
    head = read_isolated(bad_readers.die_later, (), tmp_path / "a.mat", "the file")
    with pytest.raises(InputError, match="ended its process with SIGBUS"):
        head.read(0)
    head = read_isolated(bad_readers.die_later, (), tmp_path / "a.mat", "the file")
    assert not processes[1].connection.closed
    del head
    assert processes[1].connection.closed
