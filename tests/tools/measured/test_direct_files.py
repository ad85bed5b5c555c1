"""`identify` and `validate` take measured files with a map, as `log import --each` and then they would."""

import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.log.writer import write_log
from cranectl.simulate import Run
from cranectl.tools.measured.experiment import CHANNELS
from cranectl.tools.measured.programme import Programme
from cranectl.tools.measured.verdict import COVERED
from tests.tools.measured.disguises import columns_of
from tests.tools.measured.test_many_logs import write_workbook

Table = dict[str, "np.ndarray[tuple[int], np.dtype[np.float64]]"]
FILES = ["one.csv", "two.csv", "three.csv"]
DIRECT = ["identify", *FILES, "--map", "week.toml", "--rig", "lab-rig"]
JUDGED = ["validate", "new.csv", "--map", "week.toml", "--rig", "identified.toml", "--tolerance", "5mm"]


def table(run: Run) -> Table:
    """The columns of a file from which a run was imported, with the names of `Programme.recording_map`."""
    columns = columns_of(run)
    return {"time": columns.pop("t"), **columns}


@pytest.fixture(scope="module")
def folder(runs: list[Run], clean: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four files of a crane and their map, and what `identify` makes of the first three."""
    folder = tmp_path_factory.mktemp("week")
    for name, run in zip([*FILES, "new.csv"], [*runs, clean], strict=True):
        columns = table(run)
        rows = [",".join(f"{value:.10g}" for value in row) for row in zip(*columns.values(), strict=True)]
        (folder / name).write_text("\n".join([",".join(columns), *rows, ""]))
    (folder / "week.toml").write_text(Programme.recording_map("week", "lab-rig"))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main([*DIRECT, "--json", "direct.json", "--report", "i.html"]) == 0
    return folder


@pytest.fixture
def here(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("here")
def test_files_are_identified_and_judged_as_their_logs_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert not [*Path().rglob("*.mcap")], "nothing is written that nobody asked for"
    direct = json.loads(Path("direct.json").read_text())
    assert [run["name"] for run in direct["imported"]] == FILES
    assert all(re.search(rf"\b{name}\b", Path("i.html").read_text()) for name in FILES)
    assert main([*JUDGED, "--junit", "v.xml", "--json", "v.json"]) == 0
    said = capsys.readouterr().out
    assert "new.csv: 2001 samples every 0.005 s for 10 s" in said
    assert 'name="new.csv"' in Path("v.xml").read_text()
    assert json.loads(Path("v.json").read_text())["verdicts"][0]["answer"] == COVERED

    (look,) = re.findall(r"look at them: cranectl (.*?--each)", " ".join(said.split("\n")))
    assert main(shlex.split(look)) == 0
    capsys.readouterr()
    assert main(["validate", "logs/week/new.mcap", "--rig", "identified.toml", "--json", "l.json"]) == 0
    of_file, of_log = (json.loads(Path(name).read_text())["verdicts"][0] for name in ("v.json", "l.json"))
    assert of_log.pop("name") == "logs/week/new.mcap"
    assert of_file.pop("name") == "new.csv"
    words = {name for name, value in of_log.items() if not isinstance(value, float)}
    assert {name: of_log[name] for name in words} == {name: of_file[name] for name in words}
    numbers = of_log.keys() - words
    assert "difference_m" in numbers
    assert {n: of_log[n] for n in numbers} == pytest.approx({n: of_file[n] for n in numbers}, rel=1e-6)


@pytest.mark.usefixtures("here")
def test_logs_and_files_may_be_judged_together(clean: Run, capsys: pytest.CaptureFixture[str]) -> None:
    write_log("log.mcap", [clean])
    assert main(["validate", "log.mcap", *JUDGED[1:], "--json", "v.json"]) == 0
    assert "new.csv has the readings of log.mcap, and is judged with it" in capsys.readouterr().out
    facts = json.loads(Path("v.json").read_text())
    assert [verdict["name"] for verdict in facts["verdicts"]] == ["log.mcap"]
    assert [run["name"] for run in facts["imported"]] == ["new.csv"], "a log stays as it is"


@pytest.mark.usefixtures("here")
def test_used_files_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy("two.csv", "new.csv")
    assert main(JUDGED) == 2
    assert "s of new.csv were used to identify the crane" in capsys.readouterr().err


@pytest.mark.usefixtures("here")
def test_physics_judges_the_files(capsys: pytest.CaptureFixture[str]) -> None:
    text = Path("week.toml").read_text()
    Path("week.toml").write_text(text.replace('"beta", unit = "rad"', '"beta", unit = "rad", sign = -1'))
    assert main(JUDGED) == 2
    assert "beta swings the wrong way for the motion of bridge_position" in capsys.readouterr().err


@pytest.mark.usefixtures("here")
def test_sheets_are_runs(runs: list[Run], clean: Run, capsys: pytest.CaptureFixture[str]) -> None:
    write_workbook(Path("week.xlsx"), [table(run) for run in (runs[0], clean)])
    given = ["validate", "week.xlsx", *JUDGED[2:], "--sheets"]
    assert main([*given, "Run 2", "--json", "v.json"]) == 0
    (verdict,) = json.loads(Path("v.json").read_text())["verdicts"]
    assert verdict["name"] == "week.xlsx, sheet Run 2"
    assert "--each --sheets 'Run 2'" in " ".join(capsys.readouterr().out.split())
    assert main([*given, "Run*"]) == 2
    assert "s of week.xlsx, sheet Run 1 were used to identify the crane" in capsys.readouterr().err


@pytest.mark.usefixtures("here")
def test_a_log_of_simulated_runs_is_a_measured_file(capsys: pytest.CaptureFixture[str]) -> None:
    """Its map names its topics; only logs of the plant `measured` need none."""
    assert main(["run", "fixed-position", "--plants", "analytic", "--every", "1", "--out", "other.mcap"]) == 0
    text = Path("week.toml").read_text().replace('column = "time"', 'column = "analytic/state.time"')
    text = text.partition("bridge_command")[0].replace('commands = "velocity"\n', "check_physics = false\n")
    for name in CHANNELS:
        text = text.replace(f'column = "{name}"', f'column = "analytic/state.{name}"')
    Path("other.toml").write_text(text)
    judged = ["validate", "other.mcap", "--map", "other.toml", "--rig", "identified.toml"]
    assert main(judged) == 2
    said = capsys.readouterr()
    assert "other.mcap: " in said.out
    assert "has no commands of the drives" in said.err


REFUSED = {
    "a file without its map": (
        ["validate", "new.csv", "--rig", "identified.toml"],
        "new.csv is no log of `cranectl log import`, and has no map",
        "add --map FILE; this command begins one: cranectl new map new.csv",
        ["validate", "new.csv", "--rig", "identified.toml", "--map", "week.toml"],
    ),
    "a map for logs": (
        ["validate", "log.mcap", "--rig", "identified.toml", "--map", "week.toml"],
        "--map week.toml for logs of `cranectl log import`",
        "leave --map out",
        ["validate", "log.mcap", "--rig", "identified.toml"],
    ),
    "sheets without a map": (
        ["validate", "new.csv", "--rig", "identified.toml", "--sheets", "Run*"],
        "is no log of `cranectl log import`",
        "add --map FILE",
        ["validate", "new.csv", "--rig", "identified.toml", "--sheets", "Run*", "--map", "week.toml"],
    ),
    "sheets for logs": (
        ["validate", "log.mcap", "--rig", "identified.toml", "--sheets", "Run*"],
        "--sheets without --map",
        "or leave --sheets out",
        ["validate", "log.mcap", "--rig", "identified.toml"],
    ),
    "a scenario beside files": (
        ["validate", "fixed-position", *JUDGED[1:]],
        "fixed-position beside measured runs",
        "judge scenarios and measured runs by two commands",
        JUDGED,
    ),
}


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("kind", REFUSED)
def test_what_does_not_fit_is_refused(kind: str, clean: Run, capsys: pytest.CaptureFixture[str]) -> None:
    given, found, remedy, remedied = REFUSED[kind]
    write_log("log.mcap", [clean])
    assert main(given) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert found in error
    assert remedy in error
    assert main(remedied) == 0


@pytest.mark.usefixtures("here")
def test_the_map_that_a_remedy_begins_is_a_map(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["identify", *FILES, "--rig", "lab-rig"]) == 2
    (line,) = re.findall(r"cranectl (new map \S+)", " ".join(capsys.readouterr().err.split()))
    assert main(line.split()) == 0
    assert Path("one-map.toml").is_file()


@pytest.mark.usefixtures("here")
def test_runs_in_several_files_become_logs_first(capsys: pytest.CaptureFixture[str]) -> None:
    text = Path("week.toml").read_text()
    Path("two.toml").write_text(text.replace('"beta", unit', '"beta", file = 2, unit'))
    judged = ["validate", "new.csv", "--map", "two.toml", "--rig", "identified.toml"]
    assert main(judged) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert "the map has signals of file 2" in error
    assert "name the logs: cranectl log import FILE FILE --map MAP --out RUN.mcap" in error
    shutil.copy("new.csv", "camera.csv")
    assert main(["log", "import", "new.csv", "camera.csv", "--map", "two.toml", "--out", "run.mcap"]) == 0
    assert main(["validate", "run.mcap", "--rig", "identified.toml"]) == 0
