"""A command that judges has something to judge, or says so: that nothing happened is no pass."""

import ast
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cranectl
from cranectl.cli.main import ELSEWHERE
from cranectl.compare import Tolerances
from cranectl.log.reader import read_log
from cranectl.support.errors import InputError
from tests.cli.conftest import Command
from tests.cli.test_key_remedies_rules import BENCHMARK
from tests.remedies import prepared
from tests.tools.benchmark.conftest import SHORT

pytestmark = pytest.mark.usefixtures("in_copy_of_files")

SCENARIO = """name = "still"
duration = 0.02
reference.start = [1.0, 0.77, -0.7]
"""
CAMPAIGN = """name = "c"
scenario = "./still.toml"
controllers = ["lqr"]
plants = ["analytic", "elastic"]
runs = 2
uncertain.rig.load_mass = {distribution = "uniform", low = 0.5, high = 2.0}
"""
RUN = "run still.toml --every 1 --out"
prepared_files = prepared(
    {"still.toml": SCENARIO, "c.toml": CAMPAIGN, "short.toml": SHORT, "small.toml": BENCHMARK},
    [
        f"{RUN} two.mcap",
        *(f"{RUN} {plant}.mcap --plants {plant}" for plant in ("analytic", "mujoco")),
        "campaign run c.toml --out r",
    ],
)


@pytest.fixture(autouse=True)
def files(in_copy_of_files: None) -> None:  # noqa: ARG001
    """Make a result without runs, one with the runs of one plant, and directories without logs."""
    for name, parts in (("none", "*"), ("half", "*elastic*")):
        shutil.copytree("r", name)
        for part in Path(name, "parts").glob(parts):
            part.unlink()
    Path("empty").mkdir()
    Path("logs").mkdir()
    shutil.copy("two.mcap", "logs")


# By command: command lines with nothing to judge, and what each says. All end with exit code 2.
NOTHING: dict[str, list[tuple[str, str]]] = {
    "validate": [
        ("validate empty", "empty: a directory without scenarios"),
        ("validate --tolerance 5mm", "options for measured runs, and no runs"),
        ("validate two.mcap --rig lab-rig", "cannot read lab-rig-fit.json"),
    ],
    "compare": [
        ("compare mujoco.mcap", "mujoco.mcap holds the run of one plant only"),
        ("compare analytic.mcap mujoco.mcap --tolerances exact", "share no plant"),
        ("compare two.mcap ./two.mcap --tolerances exact", "are one file, which agrees with itself"),
        ("compare logs ./logs --tolerances exact", "are one file, which agrees with itself"),
        ("compare logs empty --tolerances exact", "empty: a directory without logs"),
    ],
    "plan": [("plan still.toml --plot p.svg", "nothing to draw")],
    "campaign": [
        ("campaign replay none", "none has no such run yet"),
        ("campaign replay none --run 0", "none has no such run yet"),
        ("campaign replay half --plants elastic", "half has no such run yet"),
        ("campaign replay r --run 7", "has no run 7"),
        ("campaign report none", "none is not finished"),
    ],
    "benchmark": [
        ("benchmark report empty --benchmark small.toml", "empty"),
        ("benchmark run small.toml --scenario no --out b", "scenario"),
    ],
    "identify": [("identify two.mcap two.mcap two.mcap --rig lab-rig", "two.mcap has no measured run")],
}
# Commands that judge, and always have something to judge.
ALWAYS = {
    "certify": "its operating points are never none",
    "info": "it examines one model",
    "ladder": "its levels begin with two",
    "run": "it judges how its run ended",
    "thesis": "it runs all of the chapter",
    "verdict": "the part of `validate` for measured runs; tests/tools/measured/test_verdict.py",
}


def test_every_command_that_judges_is_listed() -> None:
    """They are the commands whose source has a code for what failed."""
    codes = {"LIMIT_EXCEEDED", "RUN_STOPPED"}
    package = Path(cranectl.__file__).parent
    names = {module: name for name, module in ELSEWHERE.items()}
    judging = set()
    files = [path for folder in ("cli", "campaign", "tools") for path in (package / folder).rglob("*.py")]
    for path in files:
        own = {node.attr for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Attribute)}
        if own & codes and path.name not in ("exit_codes.py", "pytest_plugin.py"):
            parts = path.relative_to(package).with_suffix("").parts
            judging.add("campaign" if parts[0] == "campaign" else names.get(".".join(parts), parts[-1]))
    assert judging <= {*NOTHING, *ALWAYS}
    assert ALWAYS.keys() <= judging
    assert not NOTHING.keys() & ALWAYS.keys()


@pytest.mark.parametrize(
    ("line", "said"), [pytest.param(*case, id=case[0]) for cases in NOTHING.values() for case in cases]
)
def test_nothing_to_judge_is_bad_input(line: str, said: str, refusal: Command) -> None:
    assert said in refusal(*line.split())


def test_a_plan_without_a_proof_says_so(output: Command) -> None:
    """It shows when segments begin, and judges nothing."""
    assert "nothing is proven" in output("plan", "still.toml")


def test_signals_without_a_number_are_no_pass() -> None:
    """A difference of two NaN is zero, so that a run agrees with itself."""
    (run,) = read_log("mujoco.mcap").values()
    limits = Tolerances.load("exact")
    assert limits.judge(run, run).without_numbers == ()
    table = run.table.copy()
    table[:, 3] = np.nan
    verdict = limits.judge(replace(run, table=table), replace(run, table=table))
    assert len(verdict.without_numbers) == 1
    assert verdict.without_numbers[0] not in [signal.signal for signal in verdict.signals]
    assert not limits.judge(replace(run, table=table), run).passed
    empty = replace(run, table=np.full_like(run.table, np.nan), reference=np.full_like(run.reference, np.nan))
    with pytest.raises(InputError, match="no signal of mujoco has a finite number in either log"):
        limits.judge(empty, empty)
