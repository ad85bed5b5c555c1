"""Logs that other tools have rewritten are read in any valid form; MCAP files without a run are refused."""

import io
import re
import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import foxglove
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from cranectl.cli.log import recover_log_command
from cranectl.log.description import LogDescription
from cranectl.log.reader import read_log, read_signal
from cranectl.log.recover import recover_log
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run
from cranectl.support.errors import InputError, LogError
from tests.log.test_log import assert_same
from tests.reference.recordings import scenario_of

PRIVATE = bytes([0x90]) + struct.pack("<Q", 3) + b"abc"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory, short_run: Any) -> Path:
    return write_log(tmp_path_factory.mktemp("foreign") / "run.mcap", [short_run])


@pytest.fixture(scope="module")
def short_run() -> Any:
    scenario = load_scenario("fixed-position", overrides=["duration=0.4", "disturbances=[]"])
    return simulate_run(scenario, plant="analytic", controller="lqr")


def rewrite_log(
    source: Path,
    path: Path,
    add: Callable[[Writer], Any] | None = None,
    keep: Callable[[str], bool] = lambda _: True,
    parts: str = "attachments metadata",
    **options: Any,
) -> Path:
    """Rewrite a log as another tool does, with attachments and metadata last; `add` may add records.

    Only topics for which `keep` is true, and only the named `parts` of attachments and metadata, are written;
    `twice` as a part writes them twice, as a tool that merges logs does.
    """
    with source.open("rb") as stream, path.open("wb") as out:
        reader = make_reader(stream)
        writer = Writer(out, **options)
        writer.start(profile="", library="another tool")
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if not keep(channel.topic):
                continue
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata
                )
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
            )
        if add:
            add(writer)
        for _ in range(1 + ("twice" in parts)):
            for attachment in reader.iter_attachments() if "attachments" in parts else ():
                writer.add_attachment(0, 0, attachment.name, attachment.media_type, attachment.data)
            for metadata in reader.iter_metadata() if "metadata" in parts else ():
                writer.add_metadata(metadata.name, metadata.metadata)
        writer.finish()
    return path


def other_topics(writer: Writer) -> None:
    """Add a topic in JSON, one in CDR, and one without a schema."""
    schema = writer.register_schema("Pose", "jsonschema", b'{"type": "object"}')
    pose = writer.register_channel("/pose", "json", schema)
    ros = writer.register_channel("/ros", "cdr", writer.register_schema("a/msg/X", "ros2msg", b"float64 x"))
    raw = writer.register_channel("/raw", "json", 0)
    for k, length in enumerate((0, 5, 7000)):
        writer.add_message(pose, k, b'{"x": 1}', k)
        writer.add_message(ros, k, b"\0\1\0\0" + bytes(8), k)
        writer.add_message(raw, k, bytes(length), k)


FORMS: dict[str, dict[str, Any]] = {
    "no chunks": {"use_chunking": False},
    "uncompressed": {"compression": CompressionType.NONE},
    "lz4": {"compression": CompressionType.LZ4},
    "one chunk": {"chunk_size": 8 * 2**20},
    "no statistics": {"use_statistics": False},
    "no indexes": {"index_types": IndexType.NONE},
    "no summary": {"use_statistics": False, "use_summary_offsets": False, "index_types": IndexType.NONE,
                   "repeat_channels": False, "repeat_schemas": False},
    "no checksums": {"enable_crcs": False, "enable_data_crcs": False},
    "other topics": {"add": other_topics},
    "other topics without chunks": {"add": other_topics, "use_chunking": False},
    "other attachments": {"add": lambda writer: writer.add_attachment(0, 0, "notes.txt", "text/plain", b"x")},
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_a_log_rewritten_by_another_tool_is_read_and_recovered(
    written: Path, short_run: Any, tmp_path: Path, form: str
) -> None:
    path, saved = rewrite_log(written, tmp_path / "again.mcap", **FORMS[form]), tmp_path / "saved.mcap"
    recovered = recover_log(path, saved)
    for log in (path, saved):
        assert_same(read_log(log)["analytic"], short_run.every(4))
    _, alpha = read_signal(path, "analytic/state.alpha")
    assert np.array_equal(alpha, short_run.every(4).signal("state.alpha"))
    assert LogDescription.of(path).versions == LogDescription.of(written).versions
    others = ("/pose", "/raw", "/ros") if "other topics" in form else ()
    assert {*others} <= {topic.topic for topic in LogDescription.of(path).topics}
    with pytest.raises(InputError, match=r"unknown signal 'pose\.x'"):
        read_signal(path, "pose.x")
    assert recovered.left_out == others
    assert {*others}.isdisjoint(topic.topic for topic in LogDescription.of(saved).topics)


def test_private_records_of_other_writers_are_ignored(written: Path, short_run: Any, tmp_path: Path) -> None:
    path = rewrite_log(
        written, tmp_path / "again.mcap", enable_crcs=False, enable_data_crcs=False, **FORMS["no summary"]
    )
    content = path.read_bytes()
    header = 8 + 9 + struct.unpack_from("<Q", content, 9)[0]
    path.write_bytes(content[:header] + PRIVATE + content[header:])
    assert_same(read_log(path)["analytic"], short_run.every(4))


def add_large_messages(writer: Writer, size: int = 17, count: int = 1) -> None:
    """Add messages of `size` MiB."""
    channel = writer.register_channel("/image", "json", writer.register_schema("Image", "jsonschema", b"{}"))
    for k in range(count):
        writer.add_message(channel, k, bytes(size * 2**20), k)


def add_notes(writer: Writer) -> None:
    """Add two attachments and two metadata records with the same name, as another tool may do."""
    for content in (b"x", b"y"):
        writer.add_attachment(0, 0, "notes.txt", "text/plain", content)
        writer.add_metadata("notes", {"a": content.decode()})


def test_recovery_tells_which_topics_it_leaves_out(
    written: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = rewrite_log(written, tmp_path / "again.mcap", partial(add_large_messages, size=0))
    recover_log_command.main([str(path)], standalone_mode=False)
    told = capsys.readouterr().out
    assert "1 topic is left out, of other tools or versions: /image" in told


def test_records_with_the_same_name_are_kept(written: Path, short_run: Any, tmp_path: Path) -> None:
    path = rewrite_log(written, tmp_path / "again.mcap", add_notes)
    assert_same(read_log(path)["analytic"], short_run.every(4))
    recover_log(path, tmp_path / "saved.mcap")
    with (tmp_path / "saved.mcap").open("rb") as stream:
        reader = make_reader(stream)
        contents = [record.data for record in reader.iter_attachments() if record.name == "notes.txt"]
        assert contents == [b"x", b"y"]
        values = [record.metadata["a"] for record in reader.iter_metadata() if "notes" in record.name]
        assert values == ["x", "y"]


UNREADABLE: dict[str, tuple[dict[str, Any], str]] = {
    "merged": ({"parts": "attachments metadata twice"}, "it has cranectl twice, as merged logs do"),
    "topics left out": (
        {"keep": lambda topic: topic != "/analytic/load"},
        "0 of 101 samples of analytic/load",
    ),
    "no reference": (
        {"keep": lambda topic: topic != "/reference/load"},
        "the reference has 0 of 101 samples",
    ),
    "topics only": ({"parts": ""}, "it has no metadata, like a filtered log"),
    "no attachments": ({"parts": "metadata"}, "'scenario.json' is missing"),
    "large chunks": ({"add": add_large_messages}, "a chunk claims to unpack to 17"),
    "a large record": (
        {"add": partial(add_large_messages, size=65), "use_chunking": False},
        "the message record at byte",
    ),
    "repetitive": (
        {"add": partial(add_large_messages, size=4, count=60), "chunk_size": 2**22},
        "unpack to more than 100 times its size",
    ),
}


@pytest.mark.parametrize("case", UNREADABLE)
def test_an_unreadable_log_of_another_tool_is_not_called_damaged(
    written: Path, tmp_path: Path, case: str
) -> None:
    options, reason = UNREADABLE[case]
    path = rewrite_log(written, tmp_path / "again.mcap", **options)
    for attempt in (lambda: read_log(path), lambda: recover_log(path, tmp_path / "out.mcap")):
        with pytest.raises(LogError, match="cannot be read") as error:
            attempt()
        assert "damaged" not in str(error.value)
    with pytest.raises(LogError, match=re.escape(reason)):
        read_log(path)


def messages(writer: Writer, size: int = 8, count: int = 20) -> None:
    schema = writer.register_schema("Pose", "jsonschema", b'{"type": "object"}')
    channel = writer.register_channel("/pose", "json", schema)
    for k in range(count):
        writer.add_message(channel, k * 10**7, bytes(size), k * 10**7)


def twice(writer: Writer) -> None:
    messages(writer)
    add_notes(writer)


OTHER_FILES: dict[str, tuple[Callable[[Writer], Any], dict[str, Any]]] = {
    "empty": (lambda _: None, {}),
    "JSON": (messages, {}),
    "no chunks": (messages, {"use_chunking": False}),
    "no summary": (messages, FORMS["no summary"]),
    "names twice": (twice, {}),
    "a message of 20 MiB": (lambda writer: messages(writer, 20 * 2**20, 1), {}),
    "other topics": (other_topics, {}),
}


@pytest.mark.parametrize("case", OTHER_FILES)
def test_a_file_of_another_program_is_called_foreign(tmp_path: Path, case: str) -> None:
    write, options = OTHER_FILES[case]
    out = io.BytesIO()
    writer = Writer(out, **options)
    writer.start(profile="ros2", library="another tool")
    write(writer)
    writer.finish()
    check_foreign(tmp_path, out.getvalue())
    check_foreign(tmp_path, out.getvalue()[:-20])


def test_a_file_of_foxglove_is_called_foreign(tmp_path: Path) -> None:
    context = foxglove.Context()
    with foxglove.open_mcap(tmp_path / "fox.mcap", context=context):
        context._create_channel("/x", message_encoding="json").log(b"{}", log_time=1)
    check_foreign(tmp_path, (tmp_path / "fox.mcap").read_bytes())


def check_foreign(directory: Path, content: bytes) -> None:
    path = directory / "teach.mcap"
    path.write_bytes(content)
    segment = "kind = 'samples'\nfile = 'teach.mcap'"
    for attempt in (
        lambda: read_log(path),
        lambda: LogDescription.of(path),
        lambda: recover_log(path, directory / "out.mcap"),
        lambda: scenario_of(directory, segment),
    ):
        with pytest.raises(InputError, match="is an MCAP file, but not of cranectl") as error:
            attempt()
        assert "damaged" not in str(error.value)
        assert "log recover" not in error.value.remedy


def test_a_damaged_log_is_called_damaged(written: Path, tmp_path: Path) -> None:
    content = bytearray(written.read_bytes())
    content[len(content) // 2] ^= 0xFF
    (tmp_path / "bad.mcap").write_bytes(content)
    with pytest.raises(LogError, match="is damaged"):
        read_log(tmp_path / "bad.mcap")
