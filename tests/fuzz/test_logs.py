"""Damaged and corrupted logs are refused, or contain consistent runs."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st
from mcap.records import Message

from cranectl.log.description import LogDescription
from cranectl.log.reader import read_log
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support.errors import LogError
from tests.fuzz.oracle import SEED, check_command, fuzzed
from tests.fuzz.strategies import TEXTS, changed, damaged
from tests.log.corruption import (
    Parts,
    change_number,
    change_outcomes,
    every_message,
    put_together,
    take_apart,
)

READERS = ["info", "compare", "log export", "log recover"] * 5
READERS += ["report"] * bool(SEED)  # a page takes seconds


def check_runs(runs: dict[str, Run], every: int) -> None:
    """Check what holds for every completed run, independently of cranectl's own checks."""
    for run in (run for run in runs.values() if run.status is RunStatus.COMPLETED):
        duration = round(run.scenario.duration * 1e9)
        expected = {*range(0, duration, every * run.scenario.period_ns), duration}
        assert run.time_ns.tolist() == sorted(expected)
        assert run.end_ns == duration
        assert np.isfinite(run.table).all()
        assert np.isfinite(run.reference).all()
        assert np.all(np.real(run.design.closed_loop_poles) < 0.0)
        flat, error = run.block("flat_output")[:, :3], run.block("error")[:, :3]
        assert np.abs(run.reference[:, :3] - flat - error).max() < 1e-9


def check_log(template: Path, content: bytes, reader: str, stream: str) -> None:
    line = [*reader.split(), "f.mcap", *(["--out", "new.mcap"] if reader == "log recover" else [])]
    code, files = check_command(template, line, files={"f.mcap": content}, stream=stream)
    path = template / "f.mcap"
    for log in (content, files.get("here/new.mcap", b"")):
        path.write_bytes(log)
        try:
            runs = read_log(path)
        except LogError:
            assert log is not content or code == 2 or reader == "log recover"
        else:
            check_runs(runs, LogDescription.of(path).every)
        finally:
            path.unlink()


CASES = {"reader": st.sampled_from(READERS), "stream": st.sampled_from(["utf-8", "ascii"])}


@fuzzed(40, data=st.data(), **CASES)
def test_damaged_logs_are_read_or_refused(
    template: Path, data: st.DataObject, reader: str, stream: str
) -> None:
    content = (template / data.draw(st.sampled_from(["x.mcap", "cut.mcap"]))).read_bytes()
    check_log(template, data.draw(damaged(content)), reader, stream)


def change_metadata(parts: Parts, data: st.DataObject) -> None:
    metadata = data.draw(st.sampled_from(parts.metadata)).metadata
    key = data.draw(st.sampled_from(sorted(metadata)))
    numbers = [str(int(metadata[key]) + data.draw(st.integers(-10, 10)))] if metadata[key].isdecimal() else []
    metadata[key] = data.draw(
        st.one_of(TEXTS.map(encodable), st.sampled_from([*numbers, "0", "-1", "1", "9" * 400]))
    )


def encodable(text: str) -> str:
    return text.encode(errors="replace").decode()


def change_attachment(parts: Parts, data: st.DataObject) -> None:
    attachment = data.draw(
        st.sampled_from([item for item in parts.attachments if item.name.endswith(".json")])
    )
    attachment.data = json.dumps(data.draw(changed(json.loads(attachment.data)))).encode()


def change_title(parts: Parts, data: st.DataObject) -> None:
    scenario = json.loads(parts.attachment("scenario.json").data)
    parts.attachment("scenario.json").data = json.dumps({**scenario, "title": data.draw(TEXTS)}).encode()


def remove_topic(parts: Parts, data: st.DataObject) -> None:
    channels = sorted({r.channel_id for chunk in parts.chunks for r in chunk if isinstance(r, Message)})
    removed = data.draw(st.sampled_from(channels or [0]))  # an earlier change may have removed all messages
    every_message(lambda m: None if m.channel_id == removed else m)(parts)


def keep_only_the_first_sample(parts: Parts, _: st.DataObject) -> None:
    every_message(lambda m: m if m.log_time == 0 else None)(parts)
    for metadata in parts.metadata:
        metadata.metadata |= {"samples": "1"} if metadata.name.startswith("run/") else {}


# After each of these changes, a log's samples and its description contradict each other.


def sample_times(parts: Parts) -> list[int]:
    return sorted({message.log_time for message in parts.messages("/mujoco/state")})


def replace_number(parts: Parts, data: st.DataObject) -> None:
    topic = data.draw(st.sampled_from(["/mujoco/state", "/analytic/input", "/reference/load"]))
    nth = data.draw(st.integers(0, len(parts.messages(topic)) - 1))
    value = data.draw(st.sampled_from([np.nan, np.inf, -np.inf]))
    change_number(topic, nth, data.draw(st.integers(0, 5)), lambda _: value)(parts)


def move_sample(parts: Parts, data: st.DataObject) -> None:
    """Move one sample of all topics to another time between its neighbours."""
    times = sample_times(parts)
    k = data.draw(st.integers(1, len(times) - 2))
    new = data.draw(st.integers(times[k - 1] + 1, times[k + 1] - 1).filter(lambda time: time != times[k]))
    every_message(lambda m: replace(m, log_time=new) if m.log_time == times[k] else m)(parts)


def remove_sample(parts: Parts, data: st.DataObject) -> None:
    """Remove one sample of all topics, and correct the recorded number of samples."""
    times = sample_times(parts)
    removed = data.draw(st.sampled_from(times))
    every_message(lambda m: None if m.log_time == removed else m)(parts)
    change_outcomes(samples=str(len(times) - 1))(parts)


def scale_times(parts: Parts, data: st.DataObject) -> None:
    """Scale the times of all samples, and the recorded end times."""
    top, bottom = data.draw(st.sampled_from([(1, 2), (2, 1), (1, 4), (3, 1), (1001, 1000)]))
    every_message(lambda m: replace(m, log_time=m.log_time * top // bottom))(parts)
    change_outcomes(end_ns=str(sample_times(parts)[-1]))(parts)


def change_outcome(parts: Parts, data: st.DataObject) -> None:
    outcome = parts.meta(data.draw(st.sampled_from(["run/analytic", "run/mujoco"]))).metadata
    name = data.draw(st.sampled_from(["end_ns", "samples"]))
    more = int(outcome[name]) + data.draw(st.integers(1, 10**9))
    outcome[name] = str(data.draw(st.sampled_from([more, 0, 2**62, 10**400])))


def change_rate(parts: Parts, data: st.DataObject) -> None:
    every = data.draw(st.sampled_from([2, 3, 5, 8, 10**9, 10**400]))
    parts.meta("cranectl").metadata["every"] = str(every)


CONTRADICTIONS = [replace_number, move_sample, remove_sample, scale_times, change_outcome, change_rate]
CHANGES = [change_metadata, change_attachment, change_title, remove_topic, keep_only_the_first_sample]


@fuzzed(60, data=st.data(), **CASES)
def test_corrupted_logs_are_read_or_refused(
    template: Path, data: st.DataObject, reader: str, stream: str
) -> None:
    parts = take_apart(template / "x.mcap")
    for contradict in data.draw(st.lists(st.sampled_from(CONTRADICTIONS), max_size=1)):
        contradict(parts, data)
    for change in data.draw(st.lists(st.sampled_from(CHANGES), min_size=1, max_size=2)):
        change(parts, data)
    check_log(template, put_together(parts), reader, stream)


@fuzzed(60, data=st.data())
def test_contradictory_logs_are_refused(template: Path, tmp_path: Path, data: st.DataObject) -> None:
    parts = take_apart(template / "x.mcap")
    data.draw(st.sampled_from(CONTRADICTIONS))(parts, data)
    path = tmp_path / "corrupted.mcap"
    path.write_bytes(put_together(parts))
    with pytest.raises(LogError):
        read_log(path)
