"""`info` shows rigs and scenarios, and says of other files what they are."""

from functools import partial
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.scenario.load import RigFile
from cranectl.support.documents import TOML
from tests.cli.conftest import Command, json_of
from tests.cli.option_cases import MANY
from tests.loaders.controller_files import LAW
from tests.remedies import written

YARD = """\
bridge_range = [0.0, 60.0]
trolley_range = [0.0, 20.0]
rope_range = [2.0, 14.0]
load_mass = 40e3
trolley_time_constant = 0.25
[effects.friction]
coulomb = [9000.0, 3000.0, 2000.0]
"""
MINE = """extends = "yard.toml"
load_mass = 30e3
"""
MAP = 'rig = "mine.toml"\ntime = { column = "t" }\n[signals]\n'
FILES = {
    "yard.toml": YARD,
    "mine.toml": MINE,
    "campaign.toml": MANY,
    "map.toml": MAP,
    "law.py": LAW,
    "process.toml": 'program = ["python", "law.py"]\n',
    "other.toml": "colour = 'red'\n",
    "table.csv": "t,x\n0,1\n",
    "broken.mcap": "no log",
    "misspelt.toml": MINE.replace("load_mass", "loadmass"),
}


files = written(FILES)
info = partial(json_of, "info")


def test_the_numbers_of_a_rig_and_where_they_come_from(capsys: pytest.CaptureFixture[str]) -> None:
    """Ropes ten times as long and a load of 40 t: lengths by 10, times by √10, masses by 40 000."""
    facts = info("mine.toml", "--set", "rig.winch_time_constant=0.3")
    rig, origins = facts["rig"], facts["origins"]
    assert (facts["length_scale"], facts["mass_scale"]) == pytest.approx((10.0, 40e3))
    expected = {
        "bridge_range": ([0.0, 60.0], "yard.toml"),
        "load_mass": (30e3, "mine.toml"),
        "rated_load": (40e3, "load_mass"),
        "winch_time_constant": (0.3, "--set"),
        "trolley_time_constant": (0.25, "yard.toml"),
        "trolley_mass": (2.5 * 40e3, "scaled"),
        "bridge_time_constant": (0.0632, "scaled"),  # 0.02 s times the root of 10
        "gravity": (9.81, "assumed"),
    }
    assert {name: (rig[name], origins[name]) for name in expected} == expected
    assert origins["effects.friction.coulomb"] == "yard.toml"
    assert rig["effects"]["rope"]["stiffness"] == 5e4 * 40e3
    assert origins["effects.rope.stiffness"] == "scaled"
    assert origins["effects.limits.acceleration"] == "assumed"
    said = capsys.readouterr().out
    stated = [origin for origin in origins.values() if origin not in ("scaled", "assumed")]
    assert f"{len(stated)} stated" in said
    assert "lengths by 10, times by 3.16, masses and forces by 4e+04" in said
    (line,) = [line for line in said.splitlines() if line.strip().startswith("trolley_time_constant")]
    assert "assumed" not in line
    assert "yard.toml" in line


@pytest.mark.parametrize("name", [*RigFile.names(), "mine.toml"])
def test_what_is_shown_is_the_rig_that_runs(name: str) -> None:
    """The numbers, written into a file of their own, are the same rig."""
    facts = info(name)
    assert facts["kind"] == "rig"
    Path("whole.toml").write_text(TOML.text(facts["rig"]), encoding="utf-8")
    assert RigFile.load("whole.toml") == RigFile.load(name)
    assert set(info("whole.toml")["origins"].values()) == {"whole.toml"}


def test_a_scenario_of_a_file(output: Command) -> None:
    assert main(["new", "scenario", "own"]) == 0
    changed = ["own.toml", "--rig", "mine.toml", "--set", "limits.max_error_m=0.5"]
    assert info(*changed)["scenario"]["rig"]["load_mass"] == 30e3
    said = output("info", *changed)
    assert "max_error_m = 0.5" in said
    assert "rig.load_mass" in said


OTHERS = {
    "campaign.toml": ("is a campaign", "cranectl campaign show campaign.toml"),
    "map.toml": ("is a map of measured columns", "cranectl log import MEASURED --map map.toml"),
    "process.toml": ("is a controller", "cranectl run fast-diagonal --controller process.toml"),
    "law.py": ("is a controller", "cranectl run fast-diagonal --controller law.py:NAME"),
    "law.py:damper": ("is a controller", "cranectl run fast-diagonal --controller law.py:damper"),
    "other.toml": ("has the keys colour", "cranectl list --schema rig"),
    "table.csv": ("is another kind of file", "cranectl new map table.csv"),
    "broken.mcap": ("is not an MCAP file", "name a log that cranectl wrote"),
    "misspelt.toml": ("unknown key 'loadmass'", "did you mean 'load_mass'?"),
    "lost.toml": ("lost.toml", ""),
    "mine.toml --as-is": ("--as-is with mine.toml", "leave out --as-is"),
    "mine.toml --rig lab-rig": ("--rig lab-rig of the rig mine.toml", "leave out --rig"),
    "mine.toml --set duration=2": ("--set duration=2 of a rig", "leave this --set out"),
    "mine.toml --set rig.load_mass=9e9": ("load_mass", ""),
    "broken.mcap --rig lab-rig": ("--rig or --set with the log", "leave these options out"),
}


@pytest.mark.parametrize("words", OTHERS)
def test_what_is_not_shown_is_named(words: str, refusal: Command) -> None:
    found, remedy = OTHERS[words]
    error = refusal("info", *words.split())
    assert found in error
    assert remedy in error.split("remedy:")[1]
