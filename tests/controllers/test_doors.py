"""Laws from outside: what a file must have, that all doors give the same bits, what a broken law leaves."""

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.controllers.doors.c_law import HEADER
from cranectl.controllers.doors.opening import close_laws, open_law
from cranectl.controllers.registry import controller_design
from cranectl.log import read_log
from cranectl.scenario import Scenario, load_scenario
from cranectl.simulate import child, law_of, plan_scenario, simulate_run
from cranectl.support.errors import InputError

SHORT = ["duration=3.2", "disturbances=[]"]
LAW = '''
import numpy as np
from math import sin

def damper(parameters, measured, reference, memory, command):
    """Spring and damper on each drive."""
    for axis in range(3):
        target = -reference[2] if axis == 2 else reference[axis]
        rate = -reference[5] if axis == 2 else reference[3 + axis]
        memory[axis] = target - measured[2 * axis]
        command[axis] = 16.0 * memory[axis]
        command[axis] += 8.0 * (rate - measured[2 * axis + 1])
    return 0

class BridgeServo:
    """The same with parameters and a signal."""

    parameters = {"stiffness": 16.0, "damping": 8.0}
    memory = 3
    logged = {"bridge_error": 0}

    def step(parameters, measured, reference, memory, command):
        for axis in range(3):
            target = -reference[2] if axis == 2 else reference[axis]
            rate = -reference[5] if axis == 2 else reference[3 + axis]
            memory[axis] = target - measured[2 * axis]
            command[axis] = parameters[0] * memory[axis]
            command[axis] += parameters[1] * (rate - measured[2 * axis + 1])
        return 0

def interpreted(parameters, measured, reference, memory, command):
    """The same in what Numba does not know."""
    named = {"error": [t - q for t, q in zip([*reference[:2], -reference[2]], measured[0:6:2])]}
    rates = [*reference[3:5], -reference[5]]
    for axis in range(3):
        memory[axis] = named["error"][axis]
        command[axis] = 16.0 * named["error"][axis]
        command[axis] += 8.0 * (rates[axis] - measured[2 * axis + 1])
    return 0

def raising(parameters, measured, reference, memory, command):
    memory[0] += 1.0
    if memory[0] > 1200:
        raise RuntimeError("no more: " + str({}))
    return 0

def not_a_number(parameters, measured, reference, memory, command):
    memory[0] += 1.0
    command[0] = 0.0 * np.sqrt(1200.0 - memory[0])
    return 0

def endless(parameters, measured, reference, memory, command):
    memory[0] += 1.0
    x = 0.0
    while memory[0] > 1200.0 and x < 1.0:
        x = 0.5 * x
    return 0

def writing(parameters, measured, reference, memory, command):
    reference[0] = len(str({}))
    return 0

def greedy(parameters, measured, reference, memory, command):
    for axis in range(3):
        reference[axis] += 1.0
        parameters[0] += 1.0
        command[axis] = 1e-4 * (reference[axis] + parameters[0])
    return 0

def two(parameters, measured):
    return 0
'''
C_LAW = """
#include <stdlib.h>
#include "cranectl.h"
static const cranectl_parameter P[] = {
    {"stiffness", "1/s^2", "spring", 16.0, 0.0, 1e4}, {"damping", "1/s", "damper", 8.0, 0.0, 1e4}};
static const cranectl_signal S[] = {{"bridge_error", "m", "of the bridge", 0}};
static cranectl_declaration D = {
    .abi = CRANECTL_ABI, .size = sizeof D, .name = "c-servo", .title = "spring and damper in C",
    .command = CRANECTL_ACCELERATION, .every = 1, .memory = 4, .numbers = 3,
    .parameter_count = 2, .signal_count = 1, .parameters = P, .signals = S};
CRANECTL_EXPORT const cranectl_declaration *cranectl_controller(void) { DECLARED return &D; }
int64_t cranectl_prepare(const cranectl_nominal *nominal, double *parameters, double *memory) {
    (void)memory;
    parameters[2] = nominal->load_mass;
    return nominal->load_mass > 5.0;
}
static int steps = 0;
int64_t STEP(const double *p, const double *q, const double *r, double *m, double *u) {
    m[3] += 1.0;
    steps++;
    BROKEN
    for (int i = 0; i < 3; i++) {
        double target = i == 2 ? -r[2] : r[i], rate = i == 2 ? -r[5] : r[3 + i];
        m[i] = target - q[2 * i];
        u[i] = p[0] * m[i];
        u[i] += p[1] * (rate - q[2 * i + 1]);
    }
    return 0;
}
"""


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    yield
    close_laws()


@pytest.fixture
def law(tmp_path: Path) -> Path:
    path = tmp_path / "law.py"
    path.write_text(LAW)
    return path


def scenario(*overrides: str) -> Scenario:
    return load_scenario("fast-diagonal", overrides=[*SHORT, *overrides])


def built(folder: Path, *, declared: str = "", broken: str = "", step: str = "cranectl_step") -> Path:
    """A library, with `broken` in its step."""
    source, library = folder / "law.c", folder / f"law-{abs(hash((declared, broken, step)))}.so"
    source.write_text(C_LAW.replace("DECLARED", declared).replace("BROKEN", broken).replace("STEP", step))
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-shared", "-fPIC", "-ffp-contract=off"]
    subprocess.run(["cc", *flags, f"-I{HEADER.parent}", "-o", library, source], check=True)
    return library


# The doors


def test_every_door_gives_the_same_bits(law: Path, capfd: pytest.CaptureFixture[str]) -> None:
    references = [f"{law}:damper", f"{law}:BridgeServo", f"{law}:interpreted", str(built(law.parent))]
    names = [open_law(reference) for reference in references]
    assert names == ["damper", "bridge-servo", "interpreted", "c-servo"]
    assert "called back" in capfd.readouterr().err
    sensed = scenario("effects.sensing={}", "effects.delay.seconds=0.003")
    for crane in (scenario(), sensed):
        for plant in ("analytic", "mujoco"):
            runs = [simulate_run(crane, plant=plant, controller=name, drive="velocity") for name in names]
            width = runs[0].block("state").shape[0]
            assert width == 3201
            for run in runs[1:]:
                assert np.array_equal(run.block("state"), runs[0].block("state"))
                assert np.array_equal(run.block("load"), runs[0].block("load"))


def test_a_law_is_logged_with_its_file_its_signals_and_its_parameters(law: Path) -> None:
    log, asked = law.parent / "run.mcap", f"{law}:BridgeServo"
    short = [part for text in SHORT for part in ("--set", text)]
    stiff = ["--set", "controller.bridge-servo.stiffness=25", "--plants", "analytic,mujoco"]
    assert main(["run", "fast-diagonal", "--controller", asked, *short, *stiff, "--out", str(log)]) == 0
    close_laws()  # a log is read without its law
    run = read_log(log)["mujoco"]
    assert run.design.parameters == {"stiffness": 25.0, "damping": 8.0}
    assert run.design.origin.reference == asked
    assert run.design.origin.source == LAW
    assert np.abs(run.signal("controller.bridge_error")).max() > 1e-3
    assert main(["compare", str(log)]) == 0


def test_workers_know_what_their_parent_was_given(law: Path) -> None:
    verdict = law.parent / "verdict.json"
    asked = ["--controller", f"{law}:damper", "--controller", f"{law}:BridgeServo", "--keep", "none"]
    short = [part for text in SHORT for part in ("--set", text)]
    plants = ["--plants", "analytic,mujoco", "--drive", "ideal", "--jobs", "2"]
    main(["validate", "fast-diagonal", *asked, *short, *plants, "--json", str(verdict)])
    told = json.loads(verdict.read_text())
    assert {run["controller"] for run in told["runs"]} == {"damper", "bridge-servo"}
    assert all(agreement["passed"] for agreement in told["agreements"])


def test_prepared_for_the_crane_or_not_at_all(law: Path) -> None:
    name = open_law(str(built(law.parent)))
    with pytest.raises(InputError, match="cannot be prepared"):
        simulate_run(scenario("rig.load_mass=6.0"), plant="analytic", controller=name)


def test_a_scenario_runs_no_code(law: Path) -> None:
    named = scenario(f"controller='{law}:damper'")
    with pytest.raises(InputError, match="controller"):
        controller_design(named.controller.name, named)


def test_what_a_compiled_law_writes_where_it_must_not_harms_itself_only(law: Path) -> None:
    name, short = open_law(f"{law}:greedy"), scenario("workspace.on_exit='record'")
    design = controller_design(name, short)
    plan = plan_scenario(short)
    shared = {
        "design": design,
        "plan": plan,
        "law": law_of(short, design, "ideal", plan),
        "plant": "analytic",
    }
    first, second = (simulate_run(short, **shared) for _ in range(2))
    assert np.array_equal(first.block("state"), second.block("state"))
    assert np.array_equal(first.reference, plan_scenario(short).reference[: len(first.reference)])


# Broken ones


@pytest.mark.parametrize(
    ("text", "symbol", "found"),
    [
        (LAW, "two", "takes parameters, measured"),
        (LAW, "three", "has no law 'three'"),
        (LAW, "", "does not say which law"),
        ("import nothing_of_this_name", "x", "law.py:1: ModuleNotFoundError"),
        ("def x(:", "x", "law.py:1: SyntaxError"),
        ("raise SystemExit(3)", "x", "law.py:1: SystemExit"),
    ],
)
def test_what_is_no_law_is_refused(text: str, symbol: str, found: str, law: Path) -> None:
    law.write_text(text)
    with pytest.raises(InputError, match=found.replace(".", r"\.")):
        open_law(f"{law}:{symbol}" if symbol else str(law))


@pytest.mark.parametrize(
    ("declared", "broken", "step", "found"),
    [
        ("D.abi = 7;", "", "cranectl_step", "version 7 of the interface"),
        ("D.size = 8;", "", "cranectl_step", "8 bytes"),
        ("D.memory = -1;", "", "cranectl_step", "memory = -1"),
        ("abort();", "", "cranectl_step", "with SIGABRT"),
        ("for (volatile int k = 0;; k++) {}", "", "cranectl_step", "no answer within"),
        ("", "", "other", "no function cranectl_step"),
        ("", "if (steps > 3) return steps; u[0] = steps;", "cranectl_step", "outside of its memory"),
        ("", "((double *)r)[0] = 1.0;", "cranectl_step", "writes to reference"),
    ],
)
def test_a_library_that_breaks_the_rules_is_refused(
    declared: str, broken: str, step: str, found: str, law: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cranectl.controllers.doors.c_law.PATIENCE", 2.0)
    with pytest.raises(InputError, match=found):
        open_law(str(built(law.parent, declared=declared, broken=broken, step=step)))


def test_what_is_no_library_is_refused(law: Path) -> None:
    text = law.parent / "law.so"
    text.write_bytes(b"\x7fELF of another machine")
    with pytest.raises(InputError, match=r"law\.so"):
        open_law(str(text))
    with pytest.raises(InputError, match=r"absent\.so"):
        open_law(str(law.parent / "absent.so"))


@pytest.mark.parametrize(
    ("symbol", "said"),
    [
        ("raising", "failed in law.py:"),
        ("not_a_number", ""),
        ("endless", "took more than 2 s for a block"),
        ("writing", "read-only"),
        ("segfault", "ended its process with SIGSEGV"),
    ],
)
def test_a_law_that_fails_ends_its_run_only(
    symbol: str, said: str, law: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """With a sentence, exit code 3 and a closed log that has what came before."""
    monkeypatch.setattr("cranectl.simulate.runner.PATIENCE", 2.0)
    crash = "if (m[3] > 1200.0) *(volatile int *)0 = 1;"
    asked = f"{law}:{symbol}" if symbol != "segfault" else str(built(law.parent, broken=crash))
    short = [part for text in SHORT for part in ("--set", text)]
    log = law.parent / "run.mcap"
    assert child.CAN_FORK
    run = ["run", "fast-diagonal", "--controller", asked, "--plants", "analytic", *short, "--every", "1"]
    assert main([*run, "--out", str(log)]) == 3
    assert said in capfd.readouterr().err
    (found,) = read_log(log).values()
    assert found.status.label == "controller-failed"
    assert len(found.time_ns) == {"writing": 0, "endless": 1000, "segfault": 1000}.get(symbol, 1200)
