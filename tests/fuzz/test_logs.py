"""Damaged and corrupted logs are refused, or hold runs that make sense."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st
from mcap.records import Message

from cranectl.log.reader import describe_log, read_log
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support.errors import LogError
from tests.fuzz.oracle import SEED, check_command, fuzzed
from tests.fuzz.strategies import TEXTS, changed, damaged
from tests.log.corruption import Parts, both, every_message, number, put, put_together, take_apart

READERS = ["info", "compare", "log export", "log recover"] * 5
READERS += ["report"] * bool(SEED)  # a page takes seconds


def check_runs(runs: dict[str, Run], every: int) -> None:
    """What holds for every run that has completed, said in other words than in cranectl."""
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
            check_runs(runs, describe_log(path).every)
        finally:
            path.unlink()


CASES = {"reader": st.sampled_from(READERS), "stream": st.sampled_from(["utf-8", "ascii"])}


@fuzzed(40, data=st.data(), **CASES)
def test_damaged_logs(template: Path, data: st.DataObject, reader: str, stream: str) -> None:
    content = (template / data.draw(st.sampled_from(["x.mcap", "cut.mcap"]))).read_bytes()
    check_log(template, data.draw(damaged(content)), reader, stream)


def metadata_changed(parts: Parts, data: st.DataObject) -> None:
    metadata = data.draw(st.sampled_from(parts.metadata)).metadata
    key = data.draw(st.sampled_from(sorted(metadata)))
    numbers = [str(int(metadata[key]) + data.draw(st.integers(-10, 10)))] if metadata[key].isdecimal() else []
    metadata[key] = data.draw(
        st.one_of(TEXTS.map(printed), st.sampled_from([*numbers, "0", "-1", "1", "9" * 400]))
    )


def printed(text: str) -> str:
    return text.encode(errors="replace").decode()


def attachment_changed(parts: Parts, data: st.DataObject) -> None:
    attachment = data.draw(
        st.sampled_from([each for each in parts.attachments if each.name.endswith(".json")])
    )
    attachment.data = json.dumps(data.draw(changed(json.loads(attachment.data)))).encode()


def title_changed(parts: Parts, data: st.DataObject) -> None:
    scenario = json.loads(parts.attachment("scenario.json").data)
    parts.attachment("scenario.json").data = json.dumps({**scenario, "title": data.draw(TEXTS)}).encode()


def topic_gone(parts: Parts, data: st.DataObject) -> None:
    channels = sorted({r.channel_id for chunk in parts.chunks for r in chunk if isinstance(r, Message)})
    lost = data.draw(st.sampled_from(channels or [0]))  # no message may be left of another change
    every_message(lambda m: None if m.channel_id == lost else m)(parts)


def only_the_first(parts: Parts, _: st.DataObject) -> None:
    every_message(lambda m: m if m.log_time == 0 else None)(parts)
    for metadata in parts.metadata:
        metadata.metadata |= {"samples": "1"} if metadata.name.startswith("run/") else {}


# Of a whole log: what runs say and what is said of them then contradict each other.


def sample_times(parts: Parts) -> list[int]:
    return sorted({message.log_time for message in parts.messages("/mujoco/state")})


def number_gone(parts: Parts, data: st.DataObject) -> None:
    topic = data.draw(st.sampled_from(["/mujoco/state", "/analytic/input", "/reference/load"]))
    nth = data.draw(st.integers(0, len(parts.messages(topic)) - 1))
    value = data.draw(st.sampled_from([np.nan, np.inf, -np.inf]))
    number(topic, nth, data.draw(st.integers(0, 5)), lambda _: value)(parts)


def sample_moved(parts: Parts, data: st.DataObject) -> None:
    """In all topics, between its neighbours."""
    times = sample_times(parts)
    k = data.draw(st.integers(1, len(times) - 2))
    new = data.draw(st.integers(times[k - 1] + 1, times[k + 1] - 1).filter(lambda time: time != times[k]))
    every_message(lambda m: replace(m, log_time=new) if m.log_time == times[k] else m)(parts)


def sample_gone(parts: Parts, data: st.DataObject) -> None:
    """In all topics, and the runs are said to have one less."""
    times = sample_times(parts)
    lost = data.draw(st.sampled_from(times))
    every_message(lambda m: None if m.log_time == lost else m)(parts)
    both(samples=str(len(times) - 1))(parts)


def times_scaled(parts: Parts, data: st.DataObject) -> None:
    """All times, and the ends with them."""
    top, bottom = data.draw(st.sampled_from([(1, 2), (2, 1), (1, 4), (3, 1), (1001, 1000)]))
    every_message(lambda m: replace(m, log_time=m.log_time * top // bottom))(parts)
    both(end_ns=str(sample_times(parts)[-1]))(parts)


def outcome_changed(parts: Parts, data: st.DataObject) -> None:
    outcome = parts.meta(data.draw(st.sampled_from(["run/analytic", "run/mujoco"]))).metadata
    name = data.draw(st.sampled_from(["end_ns", "samples"]))
    more = int(outcome[name]) + data.draw(st.integers(1, 10**9))
    outcome[name] = str(data.draw(st.sampled_from([more, 0, 2**62, 10**400])))


def rate_changed(parts: Parts, data: st.DataObject) -> None:
    every = data.draw(st.sampled_from([2, 3, 5, 8, 10**9, 10**400]))
    parts.meta("cranectl").metadata["every"] = str(every)


def gain_changed(parts: Parts, data: st.DataObject) -> None:
    gain = json.loads(parts.attachment("design.json").data)["gain"]
    gain[data.draw(st.integers(0, 3))] *= data.draw(st.floats(-2.0, 0.99))
    put("design.json", gain=gain)(parts)


CONTRADICTIONS = [number_gone, sample_moved, sample_gone, times_scaled]
CONTRADICTIONS += [outcome_changed, rate_changed, gain_changed]
CHANGES = [metadata_changed, attachment_changed, title_changed, topic_gone, only_the_first]


@fuzzed(60, data=st.data(), **CASES)
def test_corrupted_logs(template: Path, data: st.DataObject, reader: str, stream: str) -> None:
    parts = take_apart(template / "x.mcap")
    for contradict in data.draw(st.lists(st.sampled_from(CONTRADICTIONS), max_size=1)):
        contradict(parts, data)
    for change in data.draw(st.lists(st.sampled_from(CHANGES), min_size=1, max_size=2)):
        change(parts, data)
    check_log(template, put_together(parts), reader, stream)


@fuzzed(60, data=st.data())
def test_logs_that_contradict_themselves_are_refused(
    template: Path, tmp_path: Path, data: st.DataObject
) -> None:
    parts = take_apart(template / "x.mcap")
    data.draw(st.sampled_from(CONTRADICTIONS))(parts, data)
    path = tmp_path / "corrupted.mcap"
    path.write_bytes(put_together(parts))
    with pytest.raises(LogError):
        read_log(path)
