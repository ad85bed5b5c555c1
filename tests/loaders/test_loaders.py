"""Laws from outside: what a file must have, that all loaders give the same bits, what a broken law leaves."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cranectl.campaign.definition import Batch
from cranectl.campaign.worker import PreparedCampaign, Worker
from cranectl.campaign.workers import Children, ChildWorker, run_batches
from cranectl.cli.main import main
from cranectl.compare import Differences
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.loaders.opening import close_controllers, open_controller
from cranectl.log.reader import read_log
from cranectl.simulate import Plan, PreparedController, simulate_run
from cranectl.support.children import Child
from cranectl.support.errors import InputError
from tests.campaign.campaigns import campaign, choice, fixed
from tests.loaders.controller_files import (
    ASKED,
    LAW,
    SHORT,
    built,
    campaign_file,
    samples_before_failure,
    scenario,
)

# The loaders


def test_every_loader_gives_the_same_bits(law: Path, capfd: pytest.CaptureFixture[str]) -> None:
    references = [f"{law}:damper", f"{law}:BridgeServo", f"{law}:interpreted", str(built(law.parent))]
    names = [open_controller(reference) for reference in references]
    assert names == ["damper", "bridge-servo", "interpreted", "c-servo"]
    assert "called back" in capfd.readouterr().err
    sensed = scenario("effects.sensing={}", "effects.delay.seconds=0.003")
    for crane in (scenario(), sensed):
        for plant in ("analytic", "mujoco"):
            first, *others = [
                simulate_run(crane, plant=plant, controller=name, drive="velocity") for name in names
            ]
            assert len(first.time_ns) == 3201
            for run in others:
                assert np.array_equal(run.block("state"), first.block("state"))
                assert np.array_equal(run.block("load"), first.block("load"))


def test_a_law_is_logged_with_its_file_its_signals_and_its_parameters(law: Path) -> None:
    log, asked = law.parent / "run.mcap", f"{law}:BridgeServo"
    stiff = ["--set", "controller.bridge-servo.stiffness=25", "--plants", "analytic,mujoco"]
    assert main(["run", "fast-diagonal", "--controller", asked, *ASKED, *stiff, "--out", str(log)]) == 0
    close_controllers()  # a log is read without its law
    run = read_log(log)["mujoco"]
    assert run.design.parameters == {"stiffness": 25.0, "damping": 8.0}
    assert run.design.origin.reference == asked
    assert run.design.origin.source == LAW
    assert np.abs(run.signal("controller.bridge_error")).max() > 1e-3
    assert main(["compare", str(log)]) == 0
    law.write_text(LAW + "# edited\n")
    again = law.parent / "again.mcap"
    assert main(["run", "fast-diagonal", "--controller", asked, *ASKED, *stiff, "--out", str(again)]) == 0
    (told,) = Differences.of(read_log(log)["mujoco"], read_log(again)["mujoco"])
    assert re.fullmatch(r"controller\.origin\.sha256: \w{64} and \w{64}", told)
    view = law.parent / "view.json"
    assert main(["log", "layout", "controller", str(view), "--log", str(log)]) == 0
    drawn = [
        plot["paths"] for name, plot in json.loads(view.read_text())["configById"].items() if "Plot" in name
    ]
    values = [path["value"] for paths in drawn for path in paths]
    assert "/mujoco/controller.bridge_error" in values
    assert not any("zeta" in value or "virtual_input" in value for value in values)


def test_workers_know_what_their_parent_was_given(law: Path) -> None:
    verdict = law.parent / "verdict.json"
    asked = ["--controller", f"{law}:damper", "--controller", f"{law}:BridgeServo", "--keep", "none"]
    plants = ["--plants", "analytic,mujoco", "--drive", "ideal", "--jobs", "2"]
    main(["validate", "fast-diagonal", *asked, *ASKED, *plants, "--json", str(verdict)])
    told = json.loads(verdict.read_text())
    assert {run["controller"] for run in told["runs"]} == {"damper", "bridge-servo"}
    assert all(agreement["passed"] for agreement in told["agreements"])


def test_prepared_for_the_crane_or_not_at_all(law: Path) -> None:
    name = open_controller(str(built(law.parent)))
    with pytest.raises(InputError, match="cannot be prepared"):
        simulate_run(scenario("rig.load_mass=6.0"), plant="analytic", controller=name)


SCENARIO = """
name = "own"
duration = 1.0
[controller]
name = "law.py:BridgeServo"
bridge-servo = {stiffness = 25.0}
[reference]
start = [0.4, 0.4, -0.8]
"""


def test_a_scenario_runs_no_code_unless_it_is_trusted(
    law: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    law.write_text("open('it_ran', 'w').close()\n" + LAW)
    (law.parent / "own.toml").write_text(SCENARIO)
    (law.parent / "elsewhere").mkdir()
    monkeypatch.chdir(law.parent / "elsewhere")  # its file is named as seen from the scenario
    run = ["run", "../own.toml", "--plants", "analytic", "--out", "own.mcap"]
    assert main(run) == main(["ladder", "../own.toml"]) == 2
    assert "--trust" in capsys.readouterr().err
    assert not Path("it_ran").exists()
    assert main([*run, "--trust"]) == 0
    assert Path("it_ran").exists()
    Path("it_ran").unlink()
    close_controllers()
    assert main(["info", "own.mcap"]) == main(["report", "own.mcap"]) == 0
    assert not Path("it_ran").exists()
    described = "bridge-servo, ../law.py:BridgeServo, SHA-256 "
    assert described in capsys.readouterr().out
    assert described in Path("own.html").read_text()
    assert read_log("own.mcap")["analytic"].design.parameters["stiffness"] == 25.0


def test_a_result_of_a_campaign_is_read_without_its_laws_and_replayed_with_them(
    law: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(law.parent)
    campaign_file("law.py:damper")
    assert main(["campaign", "run", "own.toml", "--out", "result"]) == 2
    assert main(["campaign", "run", "own.toml", "--out", "result", "--trust"]) == 0
    close_controllers()
    capsys.readouterr()
    assert main(["campaign", "report", "result"]) == 0
    assert "other software" not in capsys.readouterr().out + Path("result.html").read_text()
    replay = ["campaign", "replay", "result", "--worst", "1"]
    capsys.readouterr()
    assert main(replay) == 2
    assert "law.py:NAME" in capsys.readouterr().err
    assert main([*replay, "--controller", "law.py:damper"]) == 0
    assert "law damper" not in capsys.readouterr().out
    close_controllers()
    law.write_text(LAW.replace("16.0 * memory[axis]", "15.0 * memory[axis]"))
    assert main([*replay, "--controller", "law.py:damper"]) == 1
    assert "law damper" in capsys.readouterr().out


def test_what_a_compiled_law_writes_where_it_must_not_harms_itself_only(law: Path) -> None:
    short = scenario("workspace.on_exit='record'")
    design, plan = ALL_CONTROLLERS.design(open_controller(f"{law}:greedy"), short), Plan.of(short)
    compiled = PreparedController.of(short, design, "ideal", plan)
    first, second = (
        simulate_run(short, design=design, plan=plan, compiled_controller=compiled, plant="analytic")
        for _ in range(2)
    )
    assert np.array_equal(first.block("state"), second.block("state"))
    assert np.array_equal(first.reference, Plan.of(short).reference[: len(first.reference)])


def test_a_law_that_ends_or_never_returns_costs_a_campaign_one_row(law: Path) -> None:
    """Where the rope starts on one side; runs before and after are simulated."""
    when = "(m[3] < 100.0 && q[6] > 0.01 && q[6] < 0.06)"
    crash, hang = f"if {when} *(volatile int *)0 = 1;", f"while {when} u[0] = 0.5 * (u[0] + m[3]);"
    for broken, found in (
        (crash, "ended its process with SIGSEGV"),
        (hang, "took more than 1 s for a block"),
    ):
        name = open_controller(str(built(law.parent, broken=broken)))
        side = {"initial.alpha_offset": choice(-0.03, 0.03)}
        made = campaign(side, controllers=[name], plants=["analytic"], runs=3, set=SHORT)
        with Children() as children:
            worker = ChildWorker(PreparedCampaign(made), children, timeout=1.0)
            rows = worker.run_batch(Batch("analytic", name, 0, 3))
            worker.close()
        failing = [row["initial.alpha_offset"] > 0.0 for row in rows]
        assert 0 < sum(failing) < 3
        assert [row["reason"] for row in rows] == [f"{name} {found}" if each else "" for each in failing]
        close_controllers()


def test_a_process_is_kept_for_the_next_campaign(law: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started, spawn = [], Child.spawn

    def counted(*given: Any) -> Any:
        started.append(given)
        return spawn(*given)

    monkeypatch.setattr(Child, "spawn", counted)
    name = open_controller(str(built(law.parent)))
    with Children() as children:
        for mass in (0.5, 0.9):
            made = campaign(
                {"rig.load_mass": fixed(mass)}, controllers=[name], plants=["analytic"], runs=2, set=SHORT
            )
            batch = Batch("analytic", name, 0, 2)
            ((_, rows),) = run_batches(made, [batch], children=children)
            assert rows == Worker(PreparedCampaign(made)).run_batch(batch)
        assert len(started) == 1


# Broken ones


@pytest.mark.parametrize(
    ("part", "text", "found"),
    [
        ("declared", "D.abi = 7;", "version 7 of the interface"),
        ("declared", "D.abi = 4;", "version 4 of the interface, this is 5"),
        ("declared", "D.size = 8;", "8 bytes"),
        ("declared", "D.memory = -1;", "memory = -1"),
        ("declared", "abort();", "with SIGABRT"),
        ("declared", "for (volatile int k = 0;; k++) {}", "no answer within"),
        ("step", "other", "no function cranectl_step"),
        ("broken", "if (steps > 3) return steps; u[0] = steps;", "cranectl new generated-controller"),
        ("broken", "if (steps > 300) return steps;", "outside of its memory"),
        ("broken", "((double *)r)[0] = 1.0;", "writes to reference"),
    ],
)
def test_a_library_that_breaks_the_rules_is_refused(
    part: str, text: str, found: str, law: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if found == "no answer within":
        monkeypatch.setattr("cranectl.loaders.declaration_process.DECLARATION_TIMEOUT", 2.0)
    with pytest.raises(InputError, match=found):
        open_controller(str(built(law.parent, **{part: text})))


def test_what_is_no_library_of_this_machine_is_refused(law: Path) -> None:
    library = built(law.parent)
    content = library.read_bytes()
    arm, intel = 0xB7, 0x3E
    for place, value in ((18, intel if content[18] == arm else arm), (4, 1)):  # the machine, and its bits
        other = law.parent / f"{place}.so"
        other.write_bytes(bytes([*content[:place], value, *content[place + 1 :]]))
        with pytest.raises(InputError, match=rf"{place}\.so"):
            open_controller(str(other))
    with pytest.raises(InputError, match=r"absent\.so"):
        open_controller(str(law.parent / "absent.so"))


FAILING = """
import numpy as np

def failing(parameters, measured, reference, memory, command):
    memory[0] += 1.0
    if memory[0] > 1200:
        DEED
    return 0
"""


@pytest.mark.parametrize(
    ("deed", "said", "samples"),
    [
        ("raise RuntimeError('no more: ' + str({}))", "failed in law.py:7: RuntimeError: no more: {}", 1200),
        ("raise ValueError('sensor lost', memory[0])", "failing failed in law.py:7: ValueError", 1200),
        ("raise SystemExit(f'{memory[0]:g} samples')", "SystemExit: 1201 samples", 1200),
        ("command[0] = np.nan", "", 1200),
        ("reference[0] = len(str({}))", "read-only", 1200),
        ("while parameters[0] == 0.0: pass", "took more than 2 s for a block", 1000),
        ("*(volatile int *)0 = 1;", "ended its process with SIGSEGV", 1000),
    ],
)
def test_a_law_that_fails_ends_its_run_only(
    deed: str, said: str, samples: int, law: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    law.write_text(FAILING.replace("DEED", deed))
    asked = f"{law}:failing"
    if "volatile" in deed:
        asked = str(built(law.parent, broken=f"if (m[3] > 1200.0) {deed}"))
    assert samples_before_failure(asked, law.parent / "run.mcap", "--timeout", "2") == samples
    assert said in capfd.readouterr().err
