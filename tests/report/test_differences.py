"""What was run and what differs: of everything that is not the default, log by log."""

import re
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.report.run.differences import LogTables
from cranectl.report.table import Table
from cranectl.scenario.load import default_scenario
from cranectl.simulate import Run, simulate_run

pytestmark = pytest.mark.usefixtures("in_empty_directory")
OVERRIDES = ["duration=0.1", "disturbances=[]"]


def logs(*changes: str) -> dict[str, dict[str, Run]]:
    """Of `fixed-position`, and of that with changes."""
    found = {}
    for label, overrides in (("a", OVERRIDES), ("b", [*OVERRIDES, *changes])):
        run = simulate_run(load_scenario("fixed-position", overrides=overrides), plant="analytic")
        found[label] = {"analytic": run}
    return found


def rows(table: Table) -> dict[str, list[str]]:
    return {row[0].text: [cell.text for cell in row[1:]] for row in table.rows}


def test_every_setting_that_is_not_the_default_is_named() -> None:
    assert default_scenario().changed_from_default == {}
    overrides = ["rig.load_mass=3", "design.poles=[-1,-2,-3,-4]", "effects.delay={}"]
    overrides += ["control.period=0.002", "initial.load_offset=[0.1,0,0]"]
    changed = default_scenario(overrides=overrides)
    assert changed.changed_from_default == {
        "initial.load_offset": [0.1, 0.0, 0.0],
        "rig.load_mass": 3.0,
        "control.period": 0.002,
        "design.poles": [-1.0, -2.0, -3.0, -4.0],
        "effects.delay.seconds": changed.effects.delay.seconds,
    }


def test_what_differs_is_named_and_nothing_else() -> None:
    two = logs("rig.load_mass=3", "controller=lqr")
    table = LogTables.what_differs(two)
    assert table is not None
    assert table.headings == ("", "a", "b")
    assert rows(table) == {"rig.load_mass": ["1", "3"], "controller": ["pole-placement", "lqr"]}
    assert rows(LogTables.what_was_run(two))["controller"] == ["pole-placement", "lqr"]
    made = LogTables.versions(two, {"a": {"cranectl": "1"}, "b": {"cranectl": "2", "drake": "3"}})
    assert rows(made) == {"cranectl": ["1", "2"], "drake": ["–", "3"]}
    settings = LogTables.settings(two)
    assert not settings.folded
    assert rows(settings)["rig.load_mass"] == ["default", "3"]
    assert rows(settings)["workspace.on_exit"] == ["record", "record"], "not the default in either"
    assert LogTables.what_differs(logs()) is None
    assert LogTables.what_differs({"a": two["a"]}) is None
    crane = load_scenario("ship-to-shore", overrides=[*OVERRIDES, "reference.segments=[]"])
    settings = LogTables.settings({"crane": {"analytic": simulate_run(crane, plant="analytic")}})
    assert settings.folded, "the many numbers of a rig of its own"
    assert settings.title == f"Settings that are not the default: {len(settings.rows)}"


def test_numbers_that_nobody_stated_for_a_crane_are_marked() -> None:
    Path("own.toml").write_text("rope_range = [2.0, 15.0]\nload_mass = 10e3\nbridge_mass = 20e3\n")
    changes = [*OVERRIDES, "reference.segments=[]", "reference.start=[1.0,1.0,-5.0]", "effects.limits={}"]
    stated = "rig.effects.limits.velocity=[0.5,0.5,0.25]"
    logs = {}
    for label, overrides in (("a", changes), ("b", [*changes, stated])):
        scenario = load_scenario("fixed-position", rig="own.toml", overrides=overrides)
        logs[label] = {"mujoco": simulate_run(scenario, plant="mujoco", drive="velocity")}
    table = LogTables.settings(logs)
    settings = rows(table)
    assert settings["effects.limits.velocity"] == ["[3.27, 3.27, 1.96] (assumed)", "[0.5, 0.5, 0.25]"]
    assert settings["effects.limits.acceleration"] == ["[4, 4, 6] (assumed)"] * 2
    assert settings["rig.trolley_mass"] == ["25000 (assumed)"] * 2
    assert settings["rig.bridge_mass"] == ["20000"] * 2
    assert settings["rig.load_mass"] == ["10000"] * 2
    assert "scaled from the laboratory rig" in table.note
    laboratory = load_scenario("fixed-position", overrides=[*OVERRIDES, "effects.limits={}"])
    table = LogTables.settings({"": {"mujoco": simulate_run(laboratory, plant="mujoco", drive="velocity")}})
    assert "assumed" not in f"{rows(table)} {table.note}", "the laboratory rig has the defaults"


def test_parameters_of_one_law_are_told_like_settings() -> None:
    pid = "controller.name='pid'"
    two = logs() | {"b": logs(pid, "controller.pid.proportional=30")["b"], "c": logs(pid)["b"]}
    same = {label: two[label] for label in ("b", "c")}
    table = LogTables.what_differs(same)
    assert table is not None
    default = str(same["c"]["analytic"].design.to_json()["parameters"]["proportional"])
    assert rows(table) == {"controller.pid.proportional": ["30", default.removesuffix(".0")]}
    settings = LogTables.settings(same)
    assert rows(settings)["controller.pid.proportional"] == ["30", "default"]
    table = LogTables.what_differs(two)
    assert table is not None
    assert list(rows(table)) == ["controller"], "of different laws there is nothing to compare"


def test_page_info_and_compare_say_it(capsys: pytest.CaptureFixture[str]) -> None:
    for label, log in logs("rig.load_mass=3").items():
        write_log(Path(f"{label}.mcap"), list(log.values()))
    assert main(["report", "a.mcap", "b.mcap"]) == 0
    page = Path("a-and-b.html").read_text(encoding="utf-8")
    order = ["What differs", "rig.load_mass", "completed", ">Metrics", "<h2>Settings", "Made with"]
    assert [page.index(text) for text in order] == sorted(page.index(text) for text in order)
    Path("b.mcap").rename("c.mcap")
    assert main(["report", "a.mcap", "c.mcap"]) == 0
    assert main(["report", "a.mcap", "a.mcap"]) == 0
    assert {path.name for path in Path().glob("*.html")} == {
        "a-and-b.html", "a-and-c.html", "a-1-and-a-2.html"
    }  # fmt: skip
    Path("c.mcap").rename("b.mcap")
    capsys.readouterr()
    assert main(["info", "b.mcap"]) == 0
    assert re.search(r"rig\.load_mass +3 *\n", capsys.readouterr().out)
    assert main(["compare", "a.mcap", "b.mcap"]) == 0
    shown = capsys.readouterr().out
    assert "the runs differ in rig.load_mass: 1.0 and 3.0" in shown
    assert "analytic: b minus a" in shown, "the runs have one name"
