"""Damaged and forged logs are refused, or hold runs that make sense."""

import json
from pathlib import Path

import numpy as np
from hypothesis import strategies as st
from mcap.records import Message

from cranectl.log import describe_log, read_log
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support.errors import LogError
from tests.fuzz.oracle import SEED, check_command, fuzzed
from tests.fuzz.strategies import TEXTS, changed, damaged
from tests.log import test_fuzz as forgeries
from tests.log.forge import Parts, put_together, take_apart

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
    for chunk in parts.chunks:
        chunk[:] = [r for r in chunk if not isinstance(r, Message) or r.channel_id != lost]


def only_the_first(parts: Parts, _: st.DataObject) -> None:
    for chunk in parts.chunks:
        chunk[:] = [r for r in chunk if not isinstance(r, Message) or r.log_time == 0]
    for metadata in parts.metadata:
        metadata.metadata |= {"samples": "1"} if metadata.name.startswith("run/") else {}


LIES = [forgeries.number_gone, forgeries.sample_moved, forgeries.sample_gone, forgeries.times_scaled]
LIES += [forgeries.outcome_changed, forgeries.rate_changed, forgeries.design_changed]
CHANGES = [metadata_changed, attachment_changed, title_changed, topic_gone, only_the_first]


@fuzzed(60, data=st.data(), **CASES)
def test_forged_logs(template: Path, data: st.DataObject, reader: str, stream: str) -> None:
    parts = take_apart(template / "x.mcap")
    for lie in data.draw(st.lists(st.sampled_from(LIES), max_size=1)):
        lie(parts, np.random.default_rng(data.draw(st.integers(0, 2**32))))
    for change in data.draw(st.lists(st.sampled_from(CHANGES), min_size=1, max_size=2)):
        change(parts, data)
    check_log(template, put_together(parts), reader, stream)
