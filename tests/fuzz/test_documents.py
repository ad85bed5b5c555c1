"""Odd settings files and odd records of campaigns are either read or refused."""

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import strategies as st

from cranectl.campaign import load_campaign
from cranectl.compare import Tolerances
from cranectl.planning import load_scenario
from cranectl.plants.steps import PhysicsStep
from cranectl.scenario import Scenario
from cranectl.support.errors import InputError
from cranectl.support.resources import Shipped
from tests.fuzz.oracle import MAX_MESSAGE_LENGTH, UNSAFE_CHARACTERS, call_within, check_command, fuzzed
from tests.fuzz.strategies import changed, damaged, toml_files

FULL_SCENARIO = """name = "f"
title = "all there is"
duration = 0.02
controller = "lqr"
reference.start = [1.0, 0.77, -0.7]
reference.segments = [
  {kind = "hold", duration = 0.005},
  {kind = "line", to = [1.01, 0.77, -0.7], duration = 0.01},
]
initial.alpha_offset = 0.01
disturbances = [{joint = "alpha", start = 0.01, magnitude = 1.0}]
rig = {load_mass = 1.5, rope_range = [0.05, 1.4]}
control = {period = 0.001, physics_step = 0.0005}
design = {poles = [-2.5, -2.5, -2.0, -3.0], input_weight = 0.2}
effects = {delay = {seconds = 0.002}, wind = {mean = [0.5, 0.0, 0.0]}}
log.every = 2
"""


def tables(*paths: Path) -> list[Any]:
    return [tomllib.loads(path.read_text(encoding="utf-8")) for path in paths]


SCENARIOS = [tomllib.loads(FULL_SCENARIO)] * 4 + tables(*Shipped.SCENARIOS.folder.glob("*.toml"))
CAMPAIGNS = tables(*Shipped.CAMPAIGNS.folder.glob("*.toml"))
TOLERANCES = tables(*Shipped.REGRESSIONS.folder.glob("*.toml"))
RIG = [{"load_mass": 2.0, "gravity": 9.81, "rope_range": [0.05, 1.4], "winch_time_constant": 0.02}]
MAX_STEPS = 200  # physics steps; longer scenarios are not run


def read(load: Callable[[Any], Any], directory: Path, content: bytes) -> Any:
    """Return what `load` reads from a file, or None if it refuses the file with a proper error."""
    path = directory / "f.toml"
    path.write_bytes(content)

    def load_or_error() -> Any:
        try:
            return load(path)
        except InputError as error:
            return error

    result = call_within(load_or_error, 1.0 + len(content) / 2**20)
    if not isinstance(result, InputError):
        return result
    assert len(str(result)) < MAX_MESSAGE_LENGTH
    assert not UNSAFE_CHARACTERS.search(str(result))
    return None


@fuzzed(60, content=toml_files(SCENARIOS), plant=st.sampled_from(["analytic", "both"]))
def test_odd_scenarios_are_run_or_refused(template: Path, tmp_path: Path, content: bytes, plant: str) -> None:
    scenario: Scenario | None = read(load_scenario, tmp_path, content)
    small = scenario is None or scenario.steps * PhysicsStep(scenario, "ideal").per_period <= MAX_STEPS
    line = ["run", "f.toml", "--out", "o.mcap", "--plant", plant if small else "no plant"]
    code, files = check_command(template, line, files={"f.toml": content})
    assert (code == 2) >= (scenario is None or not small)
    if "here/o.mcap" in files:
        assert check_command(template, ["info", "o.mcap"], files={"o.mcap": files["here/o.mcap"]})[0] == 0


@fuzzed(20, content=toml_files(RIG))
def test_odd_rigs_are_used_or_refused(template: Path, content: bytes) -> None:
    line = ["run", "s.toml", "--rig", "f.toml", "--plant", "analytic", "--json", "-"]
    check_command(template, line, files={"f.toml": content})


@fuzzed(30, content=toml_files(CAMPAIGNS))
def test_odd_campaigns_are_read_or_refused(tmp_path: Path, content: bytes) -> None:
    read(load_campaign, tmp_path, content)


@fuzzed(30, content=toml_files(TOLERANCES))
def test_odd_tolerances_are_used_or_refused(template: Path, tmp_path: Path, content: bytes) -> None:
    read(lambda path: Tolerances.load(str(path)), tmp_path, content)
    line = ["compare", "x.mcap", "copy.mcap", "--tolerances", "f.toml"]
    check_command(template, line, files={"f.toml": content})


@pytest.fixture(scope="module")
def record(template: Path) -> bytes:
    return (template / "r" / "campaign.json").read_bytes()


@fuzzed(30, data=st.data(), resume=st.booleans())
def test_odd_campaign_records_are_used_or_refused(
    template: Path, record: bytes, data: st.DataObject, resume: bool
) -> None:
    content = json.dumps(data.draw(changed(json.loads(record)))).encode()
    if data.draw(st.integers(0, 3)) == 0:
        content = data.draw(damaged(content))
    line = ["campaign", "run", "c.toml", "--out", "r", "--resume"]
    line = line if resume else ["campaign", "replay", "r", "--run", "0", "--plant", "analytic"]
    check_command(template, line, files={"r/campaign.json": content})
