"""Which logs are opened: one of every kind, and some with parts missing or broken."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import Writer

from cranectl import load_scenario, simulate_run, write_log

# What `cranectl` is called with for a log of every kind; a name in braces is that log's file.
KINDS = {
    "one-plant": "run fixed-position --plant mujoco --set duration=13 --out {one-plant}",
    "comparison": "run fixed-position --plants analytic,mujoco --every 20 --out {comparison}",
    "harbour": "run ship-to-shore --plants analytic,mujoco --every 20 --out {harbour}",
    "robustified": "run settled-trajectory --plant mujoco --controller lqr+hinf --drive velocity --every 20"
    " --out {robustified}",
    "law": "run fast-diagonal --plants analytic,elastic,mujoco --controller pid --drive velocity --every 20"
    " --out {law}",
    "stopped-early": "run slack-rope --plants analytic,mujoco --every 20 --out {stopped-early}",
    "analytic": "run near-slack --plant analytic --every 20 --out {analytic}",
    "mujoco": "run near-slack --plant mujoco --every 20 --out {mujoco}",
    "merged": "compare {analytic} {mujoco} --merge {merged}",
    "recovered": "log recover {cut-off} --out {recovered}",
}
# Logs of runs by label.
OVERLAYS = {
    "ladder": "ladder fixed-position --set duration=3 --set disturbances.0.start=0.5"
    " --set disturbances.1.start=1 --out {ladder}",
    "overlay": "log overlay {one-plant} {robustified} --label one,lqr+hinf --out {overlay}",
}
FOUR = "four"  # cranes, apart
CUT_OFF = "cut-off"  # half of the log of one plant, as a process that is killed leaves it


def four_cranes(target: Path) -> None:
    """A log of four plants that move apart, each by other weights; `elastic` stands in for Drake."""
    weights = {"analytic": 0.1, "elastic": 1.0, "mujoco": 0.03, "drake": 10.0}
    runs = [
        simulate_run(
            load_scenario("off-reference", overrides=[f"design.input_weight={weight}"]),
            plant="elastic" if plant == "drake" else plant,
            controller="lqr",
        )
        for plant, weight in weights.items()
    ]
    told = {"scenario": runs[0].scenario, "design": runs[0].design}
    apart = [replace(run, plant=plant, **told) for plant, run in zip(weights, runs, strict=True)]
    write_log(target, apart, every=20)


def rewrite(
    source: Path,
    target: Path,
    *,
    keep: Callable[[str], bool] = lambda _: True,
    edit: Callable[[str, bytes], bytes] = lambda _, data: data,
) -> Path:
    """Copy the messages of the topics to `keep`, their bytes edited."""
    with source.open("rb") as read, target.open("wb") as write:
        writer = Writer(write)
        writer.start()
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(read).iter_messages():
            if not keep(channel.topic):
                continue
            if channel.id not in channels:
                assert schema is not None
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, known)
            data = edit(channel.topic, message.data)
            writer.add_message(channels[channel.id], message.log_time, data, message.publish_time)
        writer.finish()
    return target


def truncated(source: Path, target: Path) -> Path:
    """The first half of a file, as after a copy that broke off."""
    data = source.read_bytes()
    target.write_bytes(data[: len(data) // 2])
    return target


def damaged(source: Path, target: Path) -> Path:
    """Some bytes of the chunk in the middle inverted."""
    with source.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[len(summary.chunk_indexes) // 2]
    middle = chunk.chunk_start_offset + chunk.chunk_length // 2
    data = bytearray(source.read_bytes())
    data[middle : middle + 64] = bytes(byte ^ 0xFF for byte in data[middle : middle + 64])
    target.write_bytes(data)
    return target


def garbled(source: Path, target: Path) -> Path:
    """A sound file, in which the messages of one topic are no protobuf."""
    return rewrite(source, target, edit=lambda topic, data: b"\xff" * 3 if topic == "/mujoco/load" else data)


def foreign(_: Path, target: Path) -> Path:
    """Another kind of file."""
    target.write_bytes(b"time,alpha\n0.0,0.1\n" * 100)
    return target


def empty(_: Path, target: Path) -> Path:
    """Nothing."""
    target.touch()
    return target


BROKEN = {make.__name__: make for make in (truncated, damaged, garbled, foreign, empty)}
