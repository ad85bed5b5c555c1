"""Files of other tools with changed content are either used or refused with a proper error."""

import io
import tempfile
import tomllib
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from cranectl.planning import load_scenario
from cranectl.simulate.plan import Plan
from tests.fuzz.child_process import check, run_in_child
from tests.fuzz.conftest import CAMPAIGN, SCENARIO, TEXTS, NewDirectory
from tests.fuzz.oracle import PROCESS_FUZZ_FACTOR, check_command, fuzzed
from tests.fuzz.strategies import changed, damaged, toml
from tests.fuzz.test_documents import read
from tests.log.test_foreign import FORMS, OTHER_FILES, rewrite_log
from tests.reference.recordings import scenario_text
from tests.reference.test_foreign_tables import READ, REFUSED
from tests.tools.export.loaders.fmu_files import fmu
from tests.tools.measured.test_formats import TEXTS as MEASURED
from tests.tools.measured.test_harmful_files import WITHOUT_REMEDY, WRITERS, read_all

# The same text in other encodings and formats.
ENCODINGS: dict[str, Any] = {
    "UTF-8": lambda text: text.encode(),
    "lines of Windows": lambda text: text.replace("\n", "\r\n").encode(),
    "no last line": lambda text: text.rstrip("\n").encode(),
    "byte-order mark": lambda text: text.encode("utf-8-sig"),
    "UTF-16": lambda text: text.encode("utf-16"),
    "UTF-16 without mark": lambda text: text.encode("utf-16-le"),
    "UTF-32": lambda text: text.encode("utf-32"),
    "lines of old Macs": lambda text: text.replace("\n", "\r").encode(),
    "Windows-1252": lambda text: text.replace('"', '"ö', 1).encode("cp1252"),
    "EBCDIC": lambda text: text.encode("cp500"),
    "gzip": lambda text: b"\x1f\x8b\x08\0\0\0\0\0\0\3" + text.encode(),
    "zip": lambda text: b"PK\3\4" + text.encode(),
    "XML": lambda text: f"<?xml version='1.0'?><mujoco>{text}</mujoco>".encode(),
    "YAML": lambda text: text.replace(" = ", ": ").encode(),
    "JSON": lambda _: b'{"name": "s", "duration": 0.02}',
}
ALWAYS_ACCEPTED = ("UTF-8", "lines of Windows", "no last line")
COMMANDS = {
    "scenario": (SCENARIO, ["run", "f.toml", "--plants", "analytic", "--out", "o.mcap"]),
    "rig": (TEXTS["rig.toml"], ["run", "s.toml", "--rig", "f.toml", "--plants", "analytic"]),
    "campaign": (CAMPAIGN, ["campaign", "show", "f.toml", "--no-estimate"]),
    "tolerances": (
        'end_s = 0.0\n[[limits]]\nsignals = "*"\nabsolute = 0.0\n',
        ["compare", "x.mcap", "copy.mcap", "--tolerances", "f.toml"],
    ),
}  # fmt: skip


@fuzzed(20, kind=st.sampled_from(sorted(COMMANDS)), encoding=st.sampled_from(sorted(ENCODINGS)))
def test_settings_in_other_encodings_are_read_or_refused(template: Path, kind: str, encoding: str) -> None:
    text, line = COMMANDS[kind]
    code, _ = check_command(template, line, files={"f.toml": ENCODINGS[encoding](text)})
    assert code == 0 or encoding not in ALWAYS_ACCEPTED


def table_bytes(content: str | bytes) -> bytes:
    return content.encode() if isinstance(content, str) else content


TABLES = {name: (table_bytes(content), text) for name, (content, text) in READ.items()}
TABLES |= {name: (content, READ["Excel"][1]) for name, (content, *_) in REFUSED.items()}


@fuzzed(70, name=st.sampled_from(sorted(TABLES)), other=st.sampled_from(sorted(READ)), data=st.data())
def test_damaged_tables_of_other_tools_are_used_or_refused(
    tmp_path: Path, name: str, other: str, data: st.DataObject
) -> None:
    """Read a table that is damaged, or with the settings that another table needs."""
    content, own_settings = TABLES[name]
    (tmp_path / "teach.csv").write_bytes(data.draw(st.one_of(st.just(content), damaged(content))))
    text = scenario_text(data.draw(st.sampled_from([own_settings, READ[other][1]])))
    text = text.replace("samples", data.draw(st.sampled_from(["samples", "waypoints"])))
    plan: Plan | None = read(lambda path: Plan.of(load_scenario(path)), tmp_path, text.encode())
    assert plan is None or np.isfinite(plan.reference).all()


@fuzzed(150, name=st.sampled_from(sorted(MEASURED)), data=st.data())
def test_damaged_texts_of_measuring_systems_are_read_or_refused(
    tmp_path: Path, name: str, data: st.DataObject
) -> None:
    file = tmp_path / "a.csv"
    MEASURED[name][0](file)
    file.write_bytes(data.draw(damaged(file.read_bytes()[:2000])))
    assert read_all(file) != WITHOUT_REMEDY


@cache
def content_of(name: str) -> bytes:
    """Return the bytes of a file, always the same ones: some libraries write the time into it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "a.bag")
        WRITERS[name](file)
        return file.read_bytes()


@fuzzed(4, name=st.sampled_from(sorted(WRITERS)), data=st.data())
def test_damaged_binary_files_of_measuring_systems_are_read_or_refused(
    tmp_path: Path, name: str, data: st.DataObject
) -> None:
    file = tmp_path / "a.bag"
    file.write_bytes(data.draw(damaged(content_of(name))))
    assert read_all(file) != WITHOUT_REMEDY


@pytest.fixture(scope="module")
def written(template: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return MCAP files of our runs and of other tools' messages, all written by another library."""
    from mcap.writer import Writer

    directory, files = tmp_path_factory.mktemp("written"), {}
    for form, options in FORMS.items():
        files[form] = rewrite_log(template / "x.mcap", directory / "f.mcap", **options).read_bytes()
    for name, (write, options) in OTHER_FILES.items():
        if "MiB" in name:
            continue
        out = io.BytesIO()
        writer = Writer(out, **options)
        writer.start(profile="ros2", library="another tool")
        write(writer)
        writer.finish()
        files[f"theirs: {name}"] = out.getvalue()
    return files


LINES = ["info f.mcap", "compare x.mcap f.mcap", "log export f.mcap", "log recover f.mcap --out new.mcap"]
FORM_NAMES = sorted({*FORMS, *(f"theirs: {name}" for name in OTHER_FILES if "MiB" not in name)})


@fuzzed(
    30, form=st.sampled_from(FORM_NAMES), line=st.sampled_from(LINES), undamaged=st.booleans(), data=st.data()
)
def test_damaged_logs_of_other_tools_are_read_or_refused(
    template: Path, written: dict[str, bytes], form: str, line: str, undamaged: bool, data: st.DataObject
) -> None:
    content = written[form] if undamaged else data.draw(damaged(written[form]))
    code, _ = check_command(template, line.split(), files={"f.mcap": content})
    assert not undamaged or code == (2 if form.startswith("theirs") else 0)


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> dict[int, dict[str, bytes]]:
    """Return the files in an FMU for each version of FMI."""
    contents = {}
    for fmi in (2, 3):
        with zipfile.ZipFile(fmu(tmp_path_factory.mktemp("fmu") / "law.fmu", fmi)) as archive:
            contents[fmi] = {name: archive.read(name) for name in archive.namelist()}
    return contents


DESCRIPTION_CHANGES = {
    b'causality="input"': [b'causality="local"', b'causality="output"', b'causality="parameter"', b""],
    b'causality="output"': [b'causality="calculatedParameter"', b'causality="input"', b""],
    b'start="0"': [b'start="nan"', b'start="1e400"', b'start=""', b'start="x"', b""],
    b"valueReference=": [b"valueReference=\"-1\" x=", b"valueReference=\"99999999999\" x=", b"x="],
    b"Real": [b"Integer", b"Boolean", b"String", b"Enumeration"],
    b"Float64": [b"Int32", b"Float32", b"Boolean", b"Binary"],
    b"fmiVersion=": [b'fmiVersion="1.0" x=', b'fmiVersion="3.1" x=', b"x="],
    b"modelIdentifier=": [b'modelIdentifier="../law" x=', b'modelIdentifier="" x=',
                          b'modelIdentifier="l\xc3\xa4w" x='],
    b"name=": [b'name="" x=', b'name="a" x=', b'name="&#27;[2J" x=',
               b'unit="m" name=', b'declaredType="T" name='],
    b"<CoSimulation": [b"<ModelExchange", b'<CoSimulation needsExecutionTool="true"',
                       b'<CoSimulation canBeInstantiatedOnlyOncePerProcess="true"'],
    b"<ModelVariables>": [b"<UnitDefinitions/><ModelVariables>", b"",
                          b'<!DOCTYPE a [<!ENTITY b "c">]><ModelVariables>'],
    b"guid=": [b'guid="&b;" x='], b"state.": [b"state_", b"State."], b"reference.": [b"x."],
}  # fmt: skip


@st.composite
def description(draw: st.DrawFn, content: bytes) -> bytes:
    """Draw a modelDescription.xml in which words of the format are changed, or bytes are damaged."""
    for _ in range(draw(st.integers(1, 2))):
        word = draw(st.sampled_from(sorted(DESCRIPTION_CHANGES)))
        pieces = content.split(word)
        if len(pieces) > 1:
            k = draw(st.integers(1, len(pieces) - 1))
            new = draw(st.sampled_from(DESCRIPTION_CHANGES[word]))
            content = word.join(pieces[:k]) + new + word.join(pieces[k:])
    return draw(damaged(content)) if draw(st.integers(0, 4)) == 0 else content


FMU_SETTINGS = """name = "f"
every = 2
[inputs]
"state.rope_length" = "state.rope_length"
[outputs]
"command.rope" = "held"
"""


@fuzzed(6, factor=PROCESS_FUZZ_FACTOR, fmi=st.sampled_from([2, 3]), data=st.data())
def test_damaged_fmus_are_run_or_refused(
    new_directory: NewDirectory, units: dict[int, dict[str, bytes]], fmi: int, data: st.DataObject
) -> None:
    directory = new_directory()
    with zipfile.ZipFile(directory / "f.fmu", "w") as archive:
        for name, content in units[fmi].items():
            archive.writestr(name, data.draw(description(content)) if name.endswith(".xml") else content)
    if data.draw(st.booleans()):
        table = data.draw(changed(tomllib.loads(FMU_SETTINGS)))
        lines = [f"{key!r} = {toml(value)}" for key, value in table.items() if isinstance(key, str)]
        (directory / "f.toml").write_text("\n".join(lines), encoding="utf-8", errors="surrogateescape")
    line = ["run", "s.toml", "--controller", "f.fmu", "--plants", "analytic", "--out", "o.mcap"]
    check(run_in_child(directory, line), line)


PROGRAM = """import struct, sys
while frame := sys.stdin.buffer.read(4 + 27 * 8):
    sys.stdout.buffer.write(frame[:4] + struct.pack("<3d", 0.0, 0.0, 0.0))
    sys.stdout.buffer.flush()
"""
REMOTE_SETTINGS = {"name": "remote", "program": ["python3", "p.py"], "files": ["p.py"]}
REMOTE_SETTINGS |= {"every": 5, "measures": "state", "logged": []}


@fuzzed(6, factor=PROCESS_FUZZ_FACTOR, data=st.data())
def test_odd_settings_of_process_controllers_are_used_or_refused(
    new_directory: NewDirectory, data: st.DataObject
) -> None:
    table, directory = data.draw(changed(REMOTE_SETTINGS)), new_directory()
    (directory / "p.py").write_text(PROGRAM)
    words = table.get("program")
    if isinstance(words, list) and words != REMOTE_SETTINGS["program"]:  # never run a random program
        table["program"] = ["python3", "-c", "pass", *map(str, words)]
    lines = [f"{key} = {toml(value)}" for key, value in table.items() if key in REMOTE_SETTINGS]
    (directory / "law.toml").write_text("\n".join(lines), encoding="utf-8", errors="surrogateescape")
    line = ["run", "s.toml", "--controller", "law.toml", "--plants", "analytic", "--out", "o.mcap"]
    check(run_in_child(directory, line), line)
