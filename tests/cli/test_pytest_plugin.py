"""The pytest plugin in a user's repository: assertions, messages of failures, and files that it leaves."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from cranectl import Run, RunStatus, load_scenario, read_log
from cranectl.cases import case as cases
from cranectl.cases.assertions import CaseRuns, assert_agree
from cranectl.support.units import Quantity
from tests.conftest import PAIR, ROOT, closed_loop
from tests.docs.test_docs import blocks
from tests.packages import PLUGIN, run_pytest
from tests.test_architecture import HEAVY

LAW = """
import numpy as np
from cranectl import Controller, register_controller

def step(parameters, measured, reference, memory, command):
    for axis in range(3):
        target = -reference[2] if axis == 2 else reference[axis]
        command[axis] = 4.0 * (target - measured[2 * axis]) - 4.0 * measured[2 * axis + 1]
    return 0

SERVO = Controller("servo", "a spring and a damper", step, lambda nominal: (np.zeros(1), np.zeros(1)))
register_controller(SERVO)
"""
SCENARIO = """
name = "hop"
duration = 3.0
rig = "rig.toml"
log.every = 1
[reference]
start = [0.5, 0.4, -0.6]
segments = [{kind = "line", to = [0.8, 0.5, -0.8], duration = 2.0}]
[limits]
max_error_m = 0.05
"""
PASSING = """
import law
import pytest
from cranectl import InputError, assert_agree, assert_limits, register_controller

register_controller(law.SERVO)

@pytest.fixture(scope="module")
def runs(closed_loop):
    return closed_loop("../hop.toml", "lqr", drive="velocity")

def test_own_scenario(runs):
    assert_agree(runs)
    assert_limits(runs, max_sway_rad=0.2)
    assert runs["mujoco"].scenario.rig.load_mass == 3.0

def test_own_law(closed_loop):
    for drive in ("ideal", "force"):
        assert_agree(closed_loop("../hop.toml", "servo", drive=drive, rig="../rig.toml"))
    assert_agree(closed_loop("../hop.toml", "servo", drive="velocity"), load_m=0.01)

def test_golden_twice(runs, closed_loop, assert_golden):
    assert_golden(runs)
    assert_golden(closed_loop("../hop.toml", "servo", plants=["mujoco"]), tolerances="exact")

def test_wrong_questions(runs, closed_loop):
    short = ["duration=0.5", "disturbances=[]"]
    free = closed_loop("fixed-position", "servo", plants=["mujoco"], overrides=short)
    effects = ["effects={sensing={}, rope={}}"]
    two = ["elastic", "mujoco"]
    sensed = closed_loop("../hop.toml", "servo", plants=two, drive="velocity", overrides=effects)
    for ask, found in (
        (lambda: assert_agree(free), "a run of mujoco only"),
        (lambda: assert_limits(free), "no limit for the run of mujoco"),
        (lambda: assert_limits(free, max_errr_m=1.0), "unknown key 'max_errr_m'"),
        (lambda: assert_agree(sensed), "no limits of agreement are known"),
        (lambda: closed_loop("hop.toml"), "hop.toml"),
    ):
        with pytest.raises(InputError, match=found):
            ask()
"""
FAILING = """
import law
import pytest
from cranectl import assert_agree, assert_limits

def test_limits(closed_loop):
    closed_loop("hop.toml", "lqr")
    assert_limits(closed_loop("hop.toml", "servo", drive="velocity"))

def test_agree(closed_loop):
    assert_agree(closed_loop("hop.toml", "servo", drive="velocity"), load_m=1e-18, angle_rad=1e-18)

CHANGES = {"mass": {"overrides": ["rig.load_mass=3.001"]}, "end": {"overrides": ["duration=3.5"]}}
CHANGES["plants"] = {"plants": ["mujoco"]}

@pytest.mark.parametrize("changed", CHANGES)
def test_golden(closed_loop, assert_golden, request, changed):
    change = {} if request.config.getoption("cranectl_update") else CHANGES[changed]
    assert_golden(closed_loop("hop.toml", "lqr", drive="velocity", **change))

def test_no_golden(closed_loop, assert_golden):
    assert_golden(closed_loop("hop.toml", "lqr"))

@pytest.fixture
def stopped(closed_loop):
    return closed_loop("slack-rope", "lqr", overrides=["expected='completed'"])

def test_stopped_alike(stopped):
    assert_agree(stopped)

def test_stopped_within_limits(stopped):
    assert_limits(stopped, max_error_m=10.0)

def test_steps(closed_loop):
    steps = ["control.period=0.02", "control.physics_step=0.02"]
    assert_agree(closed_loop("fast-diagonal", "lqr", overrides=steps))

def test_anything_else(closed_loop):
    assert closed_loop("hop.toml")["mujoco"].angles.max() > 3.0
"""


def messages(directory: Path) -> dict[str, str]:
    """Return the failure message of each test, which is empty if the test passed."""
    tests = ElementTree.parse(directory / "junit.xml").iter("testcase")
    failures = {test.get("name", ""): test.findtext("failure", "") for test in tests}
    return {name: "\n".join(re.findall(r"^E +(.*)", text, re.MULTILINE)) for name, text in failures.items()}


@pytest.fixture(scope="module")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Create a repository, write its golden runs, and then run its tests with two workers.

    The folder `page` contains the example and the tests of the how-to about the plugin.
    """
    directory = tmp_path_factory.mktemp("repository")
    (directory / "sub").mkdir()
    (directory / "page").mkdir()
    page = dict(blocks(ROOT / "docs" / "how-to" / "ci.md"))  # the last of each language
    for name, text in (
        ("page/hoist-and-carry.toml", page["toml"]), ("page/test_page.py", page["python"]),
        ("law.py", LAW), ("rig.toml", "load_mass = 3.0\n"), ("hop.toml", SCENARIO),
        ("sub/test_passing.py", PASSING), ("test_failing.py", FAILING),
        ("pytest.ini", "[pytest]\npythonpath = .\nfilterwarnings = error\n"),
    ):  # fmt: skip
        (directory / name).write_text(text)
    assert "5 passed" in run_pytest(directory, "--cranectl-update", "-k", "test_golden or has_changed")
    options = ["-p", "xdist.plugin", "-n", "2", "--dist", "loadfile", "--junitxml", "junit.xml"]
    run_pytest(directory, *options, "--cranectl-logs", "kept", "--basetemp", str(directory / "base"))
    return directory


@pytest.mark.slow
def test_passing_tests_leave_only_golden_runs(repository: Path) -> None:
    failed = {name for name, message in messages(repository).items() if message}
    assert {name.partition("[")[0] for name in failed} == set(re.findall(r"def (test_\w+)", FAILING))
    documented = re.findall(r"def (test_\w+)", (repository / "page" / "test_page.py").read_text())
    assert len(documented) == 3
    assert {*documented} < messages(repository).keys() - failed
    logs = {str(path.relative_to(repository)) for path in repository.rglob("*.mcap")}
    kept = {f"kept/test_failing.py-{name.replace('[', '-').rstrip(']')}.mcap" for name in failed}
    golden = {f"sub/golden/test_passing/test_golden_twice{k}.mcap" for k in ("", "-2")}
    golden |= {"page/golden/test_page/test_nothing_has_changed.mcap"}
    golden |= {f"golden/test_failing/test_golden-{changed}.mcap" for changed in ("mass", "end", "plants")}
    assert logs == kept | golden | {"kept/test_failing.py-test_limits-2.mcap"}
    assert all((repository / path).stat().st_size < 250_000 for path in golden)


@pytest.mark.slow
def test_failures_report_signal_time_difference_limit_and_log(repository: Path) -> None:
    failures = messages(repository)

    def log(test: str, k: str = "") -> dict[str, Run]:
        path = repository / "kept" / f"test_failing.py-{test.replace('[', '-').rstrip(']')}{k}.mcap"
        assert re.search(rf"^log of hop, .*: {re.escape(str(path))}$", failures[test], re.MULTILINE)
        return read_log(path)

    for plant, run in log("test_limits", "-2").items():
        error = np.linalg.norm(run.reference[:, :3] - run.load_position, axis=1)
        since = run.time[np.argmax(error > 0.05)]
        line = f"{plant} breaks the limit 0.05 m of max_error_m: {error.max():.4g} m, from {since:g} s on"
        assert line in failures["test_limits"]
    analytic, _, mujoco = log("test_agree").values()
    difference = np.linalg.norm(analytic.load_position - mujoco.load_position, axis=1)
    amount = f"by {Quantity(difference.max(), 'm')} at {analytic.time[difference.argmax()]:g} s, limit "
    assert f"analytic and mujoco differ in load position {amount}" in failures["test_agree"]
    assert "differ in state.beta by " in failures["test_agree"]
    kept = repository / "golden/test_failing/test_golden-mass.mcap"
    golden, new = (runs["mujoco"] for runs in (read_log(kept), log("test_golden[mass]")))
    _, rows, _ = np.intersect1d(new.time_ns, golden.time_ns, return_indices=True)
    change = np.abs(new.signal("load.rope_tension")[rows] - golden.signal("load.rope_tension"))
    amount = f"by {Quantity(change.max(), 'N')} at {golden.time[change.argmax()]:g} s, limit "
    assert f"mujoco differs from golden in load.rope_tension {amount}" in failures["test_golden[mass]"]
    assert "golden and new differ in rig.load_mass: 3.0 and 3.001" in failures["test_golden[mass]"]
    assert f"golden: {kept}" in failures["test_golden[mass]"]
    ends = "mujoco ends with completed at 3.5 s, golden with completed at 3 s"
    assert ends in failures["test_golden[end]"]
    assert "only golden or only new: analytic" in failures["test_golden[plants]"]
    assert "pytest --cranectl-update" in failures["test_no_golden"]
    for test in ("test_stopped_alike", "test_stopped_within_limits"):
        assert "mujoco ends with slack-rope at 0.255 s, expected completed" in failures[test]
    assert "they agree with control.physics_step = 0.01" in failures["test_steps"]
    assert log("test_anything_else").keys() == {"analytic", "elastic", "mujoco"}


@pytest.mark.slow
def test_failures_point_to_the_line_of_the_test(repository: Path) -> None:
    selection = ["test_failing.py", "-k", "alike or test_no_golden"]
    out = run_pytest(repository, *selection, "--cranectl-logs", "law.py")
    assert "2 failed" in out
    assert "no log of hop, lqr, ideal drives: cannot write" in out
    assert set(re.findall(r"^(\S+\.py):\d+: ", out, re.MULTILINE)) == {"test_failing.py"}, out


def test_the_plugin_imports_nothing_until_it_is_used(tmp_path: Path) -> None:
    """Importing the plugin loads no other module, and takes about a millisecond."""
    script = (
        "import pytest, sys; before = set(sys.modules)\n"
        f"import {PLUGIN}; print(*sorted(set(sys.modules) - before))"
    )
    command = [sys.executable, "-c", script]
    modules = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert modules.split() == ["cranectl", "cranectl.cli", PLUGIN, "lazy_loader"]
    loaded = f"[name for name in ('numpy', *{HEAVY!r}) if name in sys.modules]"
    (tmp_path / "test_unrelated.py").write_text(f"import sys\n\ndef test(): assert not {loaded}")
    assert "1 passed" in run_pytest(tmp_path)


def test_an_interrupted_run_ends_the_test_session(monkeypatch: pytest.MonkeyPatch) -> None:
    run = replace(closed_loop("fixed-position", "lqr", "analytic"), status=RunStatus.INTERRUPTED)
    monkeypatch.setattr(cases, "simulate_run", lambda *_, **__: run)
    with pytest.raises(KeyboardInterrupt):
        CaseRuns(cases.Case.of(load_scenario("fixed-position")))


def test_runs_that_end_at_different_times_do_not_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    ends = {"analytic": 18_000_000_000, "mujoco": 18_021_000_000}  # differ by more than the drives' lag
    run = closed_loop("fixed-position", "lqr", "analytic")
    monkeypatch.setattr(
        cases, "simulate_run", lambda *_, plant, **__: replace(run, plant=plant, end_ns=ends[plant])
    )
    with pytest.raises(AssertionError, match=r"^analytic ends at 18 s, mujoco at 18\.021 s$"):
        assert_agree(CaseRuns(cases.Case.of(load_scenario("fixed-position"), plants=PAIR)), load_m=1.0)
