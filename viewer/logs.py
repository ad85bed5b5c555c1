"""The logs that the viewer tests open: one of every kind, and broken ones."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import Writer

from cranectl import load_scenario, simulate_run, write_log

SHORT = "--set duration=3 --set disturbances.0.start=0.5 --set disturbances.1.start=1"
SHORTER = "--set duration=1.5 --set disturbances.0.start=0.3 --set disturbances.1.start=0.6"
# Arguments of `cranectl` that make a log of each kind; a name in braces stands for that log's file.
KINDS = {
    "one-plant": f"run fixed-position --plant mujoco {SHORT} --out {{one-plant}}",
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
# Logs whose runs are named by labels instead of plants.
OVERLAYS = {
    "ladder": f"ladder fixed-position {SHORTER} --out {{ladder}}",
    "overlay": "log overlay {one-plant} {robustified} --label one,lqr+hinf --out {overlay}",
}
FOUR_CRANES = "four"  # a log of four plants whose cranes stand apart
CUT_OFF = "cut-off"  # the first half of the log of one plant, as a killed process leaves it


def write_four_cranes(target: Path) -> None:
    """Write a log of four plants that move apart, because each has another weight of the input.

    The elastic plant stands in for Drake.
    """
    weights = {"analytic": 0.1, "elastic": 1.0, "mujoco": 0.03, "drake": 10.0}
    runs = [
        simulate_run(
            load_scenario("off-reference", overrides=[f"design.input_weight={weight}"]),
            plant="elastic" if plant == "drake" else plant,
            controller="lqr",
        )
        for plant, weight in weights.items()
    ]
    shared = {"scenario": runs[0].scenario, "design": runs[0].design}
    renamed = [replace(run, plant=plant, **shared) for plant, run in zip(weights, runs, strict=True)]
    write_log(target, renamed, every=20)


def rewrite(
    source: Path,
    target: Path,
    *,
    keep: Callable[[str], bool] = lambda _: True,
    edit: Callable[[str, bytes], bytes] = lambda _, data: data,
) -> Path:
    """Copy a log: keep only topics for which `keep` is true, and pass each message through `edit`."""
    with source.open("rb") as read, target.open("wb") as write:
        writer = Writer(write)
        writer.start()
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(read).iter_messages():
            if not keep(channel.topic):
                continue
            if channel.id not in channels:
                assert schema is not None
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schema_id
                )
            data = edit(channel.topic, message.data)
            writer.add_message(channels[channel.id], message.log_time, data, message.publish_time)
        writer.finish()
    return target


def truncate(source: Path, target: Path) -> Path:
    """Copy the first half of a file, as an aborted copy does."""
    data = source.read_bytes()
    target.write_bytes(data[: len(data) // 2])
    return target


def damage(source: Path, target: Path) -> Path:
    """Copy a log and invert 64 bytes of its middle chunk."""
    with source.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[len(summary.chunk_indexes) // 2]
    middle = chunk.chunk_start_offset + chunk.chunk_length // 2
    data = bytearray(source.read_bytes())
    data[middle : middle + 64] = bytes(byte ^ 0xFF for byte in data[middle : middle + 64])
    target.write_bytes(data)
    return target


def garble(source: Path, target: Path) -> Path:
    """Copy a log and make the messages of one topic invalid protobuf; the file itself stays valid."""
    return rewrite(source, target, edit=lambda topic, data: b"\xff" * 3 if topic == "/mujoco/load" else data)


def write_csv(_: Path, target: Path) -> Path:
    """Write a file of another kind."""
    target.write_bytes(b"time,alpha\n0.0,0.1\n" * 100)
    return target


def write_empty(_: Path, target: Path) -> Path:
    """Write an empty file."""
    target.touch()
    return target


BROKEN = {
    "truncated": truncate,
    "damaged": damage,
    "garbled": garble,
    "foreign": write_csv,
    "empty": write_empty,
}
