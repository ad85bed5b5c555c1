"""Each of thousands of damaged logs is refused, or gives exactly the runs that were written."""

import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode

from cranectl.log.description import LogDescription
from cranectl.log.reader import read_log, read_signal
from cranectl.simulate import Run
from cranectl.support.errors import LogError
from tests.log.corruption import SIGNAL, correct_checksums, record_positions

Case = tuple[str, bytes]
Damage = Callable[[bytes, np.random.Generator, int], Iterator[Case]]
Judge = Callable[[dict[str, Run]], bool]


def check(cases: Iterator[Case], directory: Path, is_right: Judge) -> tuple[int, int]:
    """Return how many cases are refused and how many are read; fail with the name of a wrong result."""
    refused = accepted = 0
    path = directory / "case.mcap"
    for name, data in cases:
        path.write_bytes(data)
        try:
            runs = read_log(path)
            LogDescription.of(path)
            _, alpha = read_signal(path, SIGNAL)
        except LogError:
            refused += 1
            continue
        except Exception as error:
            raise AssertionError(name) from error
        assert is_right(runs), name
        assert alpha.tobytes() == runs["mujoco"].signal("state.alpha").tobytes()
        accepted += 1
    return refused, accepted


# Accidental damage, with the original checksums.


def flipped(data: bytes, rng: np.random.Generator, count: int) -> Iterator[Case]:
    for index, bit in zip(rng.integers(len(data), size=count), rng.integers(8, size=count), strict=True):
        damaged = bytearray(data)
        damaged[index] ^= 1 << bit
        yield f"bit {bit} of byte {index}", bytes(damaged)


def overwritten(data: bytes, rng: np.random.Generator, count: int) -> Iterator[Case]:
    for _ in range(count):
        start, length = int(rng.integers(len(data) - 1)), int(rng.integers(1, 4096))
        noise = rng.bytes(min(length, len(data) - start))
        yield f"{length} bytes at {start}", data[:start] + noise + data[start + len(noise) :]


def truncated(data: bytes, rng: np.random.Generator, count: int) -> Iterator[Case]:
    edges = [edge for _, *ends in record_positions(data) for edge in ends]
    near = {edge + step for edge in edges for step in (-1, 0, 1)} | set(range(40))
    for stop in sorted({*near, *rng.integers(len(data), size=count).tolist()} - {len(data)}):
        yield f"first {stop} bytes", data[:stop]


def noise(_: bytes, rng: np.random.Generator, count: int) -> Iterator[Case]:
    magic = b"\x89MCAP0\r\n"
    for number in range(count):
        inner = rng.bytes(int(rng.integers(1, 3000)))
        yield f"noise {number}", [inner, magic + inner, magic + inner + magic][number % 3]


@pytest.mark.parametrize(
    ("damage", "count"),
    [(flipped, 1500), (overwritten, 300), (truncated, 300), (noise, 600)],
    ids=["flipped", "overwritten", "truncated", "noise"],
)
def test_accidental_damage_is_always_detected(log: Path, tmp_path: Path, damage: Damage, count: int) -> None:
    """Checksums protect every byte of a log."""
    data = log.read_bytes()
    cases = ((name, case) for name, case in damage(data, np.random.default_rng(1), count) if case != data)
    refused, accepted = check(cases, tmp_path, lambda _: False)
    assert refused >= 0.9 * count
    assert accepted == 0


# Deliberate changes of lengths and numbers, with corrected checksums.

EXTREME_NUMBERS = [0, 1, 8, 2**16 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**63, 2**64 - 1]


def edited_lengths(data: bytes, rng: np.random.Generator, count: int) -> Iterator[Case]:
    """Yield logs in which the length of one record is extreme or slightly wrong."""
    records = record_positions(data)
    for _ in range(count):
        opcode, start, stop = records[rng.integers(len(records))]
        length = stop - start - 9
        near = [max(length + int(step), 0) for step in rng.integers(-20, 20, size=3)]
        new = [*EXTREME_NUMBERS, *near][rng.integers(len(EXTREME_NUMBERS) + 3)]
        edited = bytearray(data)
        struct.pack_into("<Q", edited, start + 1, new)
        if new != length:
            yield f"length of record {opcode} at {start}: {new}", correct_checksums(edited)


def edited_numbers(data: bytes, rng: np.random.Generator, count: int) -> Iterator[Case]:
    """Yield logs in which 1 to 8 bytes outside chunks and attachments have an extreme value."""
    kinds = [
        Opcode.METADATA, Opcode.ATTACHMENT, Opcode.CHUNK, Opcode.DATA_END, Opcode.STATISTICS, Opcode.FOOTER,
    ]  # fmt: skip
    heads = [(opcode, start, min(stop, start + 49)) for opcode, start, stop in record_positions(data)]
    for _ in range(count):
        kind = kinds[rng.integers(len(kinds))]
        opcode, start, stop = rng.choice([head for head in heads if head[0] == kind])
        index, width = int(rng.integers(start, stop)), int(rng.choice([1, 2, 4, 8]))
        number = EXTREME_NUMBERS[rng.integers(len(EXTREME_NUMBERS))] & (2 ** (8 * width) - 1)
        new = number.to_bytes(width, "little")
        edited = bytearray(data[:index] + new + data[index + width :])
        name = f"{width} bytes of record {opcode}, {index - start} from {start}: {new!r}"
        yield name, correct_checksums(edited)


def no_checksums(data: bytes, rng: np.random.Generator, count: int) -> Iterator[Case]:
    """Yield logs with one changed bit, in which only chunks and attachments have checksums."""
    bare = bytearray(data)
    start = struct.unpack_from("<Q", data, len(data) - 28)[0]
    bare[start - 4 : start] = bare[len(data) - 12 : len(data) - 8] = bytes(4)
    yield from flipped(bytes(bare), rng, count)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damage", "count", "expected"),
    [(edited_lengths, 500, 0.95), (edited_numbers, 500, 0.6), (no_checksums, 400, 0.45)],
    ids=["lengths", "numbers", "no-checksums"],
)
def test_edited_numbers_with_valid_checksums_change_no_signal(
    log: Path, tmp_path: Path, runs: dict[str, Run], damage: Damage, count: int, expected: float
) -> None:
    """A log with other consistent facts may be read, but never with other signals."""

    def signals_are_right(result: dict[str, Run]) -> bool:
        return all(run.table.tobytes() == runs[plant].table.tobytes() for plant, run in result.items())

    cases = damage(log.read_bytes(), np.random.default_rng(2), count)
    refused, accepted = check(cases, tmp_path, signals_are_right)
    assert refused >= expected * count
    assert accepted or damage is edited_lengths
