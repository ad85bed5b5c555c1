"""What a controller's code may do to the process that runs it, and what is left of it."""

import json
import os
import sys
import threading
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.loaders.opening import open_controller
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run
from cranectl.support.errors import InputError, MachineError
from cranectl.support.foreign_code import ForeignCode
from tests.pace import HANG

SHORT = ["duration=0.05", "disturbances=[]", "reference.segments=[]"]
LAW = """
import errno, os, sys, threading
import numpy as np
{top}
class Odd:
    memory = 1
    {declared}
    def prepare(nominal):
        {preparing}
        return np.zeros(1), np.zeros(1)
    def step(parameters, measured, reference, memory, command):
        memory[0] += 1.0
        if memory[0] == 9.0:
            str({{}})
            {stepping}
        return 0
"""
MUTE = "raise type('Mute', (Exception,), dict(__str__=lambda self: 1 / 0))()"


def opened(folder: Path, **parts: str) -> str:
    path = folder / "law.py"
    usual = {"top": "", "declared": "", "preparing": "pass", "stepping": "pass"}
    path.write_text(LAW.format(**usual | parts))
    return open_controller(f"{path}:Odd")


def ended(controller: str) -> str:
    scenario = load_scenario("fast-diagonal", overrides=SHORT)
    return simulate_run(scenario, plant="analytic", controller=controller).status.label


def ran(folder: Path, **parts: str) -> str:
    return ended(opened(folder, **parts))


def compiled(folder: Path, body: str) -> str:
    path = folder / "law.py"
    path.write_text(f"import math\ndef law(parameters, measured, reference, memory, command):\n    {body}\n")
    return ended(open_controller(f"{path}:law"))


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (MUTE, "failed in law.py:15: Mute: its text cannot be made: ZeroDivisionError"),
        ("return 2**70", "OverflowError: the step returns 1180591620717411303424"),
        ("return np.nan", "TypeError: the step returns nan, which is no whole number"),
        ("return 0.5", "TypeError: the step returns 0.5, which is no whole number"),
        ("return None", "TypeError: the step returns None, which is no whole number"),
        ("os.close(2); raise ValueError", ""),
        ("os._exit(75)", "odd ended its process with exit code 75"),
        ("os.closerange(3, 64)", "odd ended its process with exit code 1"),
    ],
)
def test_a_step_that_fails_in_an_odd_way_ends_its_run(
    step: str, said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert ran(tmp_path, stepping=step) == "controller-failed"
    told = capfd.readouterr().err
    assert said in told
    assert "Traceback" not in told


@pytest.mark.parametrize("returned", ["math.nan", "measured[0] * math.nan", "memory[0] + 0.5"])
def test_a_compiled_step_that_returns_no_whole_number_ends_its_run(
    returned: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """In compiled code the status that is made of NaN would be 0."""
    assert compiled(tmp_path, f"return {returned}") == "controller-failed"
    told = capfd.readouterr().err
    assert "Numba cannot compile it" in told
    assert "the step returns float64, which is no whole number" in told
    assert "law.py:law failed in " in told


@pytest.mark.parametrize(
    ("expression", "said"),
    [
        ("1 // n", "ZeroDivisionError: integer division by zero"),
        ("1 % n", "ZeroDivisionError: integer modulo by zero"),
        ("divmod(1, n)[0]", "ZeroDivisionError: integer divmod by zero"),
        ("1 // max(n, 1)", ""),
        ("math.atan(1.0 / memory[0])", ""),  # as NumPy: infinite, which this function takes
        ("1 / n", ""),  # as NumPy too, but the command is infinite
    ],
)
def test_a_compiled_step_that_divides_whole_numbers_by_zero_fails_as_in_python(
    expression: str, said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    ends = "controller-failed" if said or expression == "1 / n" else "completed"
    assert compiled(tmp_path, f"n = int(memory[0]); command[0] = {expression}; return 0") == ends
    told = capfd.readouterr().err
    assert said in told
    assert "cannot compile" not in told


@pytest.mark.parametrize("place", ["top", "preparing"])
@pytest.mark.parametrize(
    ("deed", "said"),
    [
        (MUTE, "Mute: its text cannot be made: ZeroDivisionError"),
        ("raise GeneratorExit", "GeneratorExit"),
        ("raise BaseExceptionGroup('two', [KeyboardInterrupt()])", "BaseExceptionGroup: two"),
        ("os._exit(5)", "SystemExit: 5"),
        ("raise SystemExit(3)", "SystemExit: 3"),
    ],
)
def test_what_fails_before_the_run_is_told(deed: str, said: str, place: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        ran(tmp_path, **{place: deed})
    assert said in error.value.found


def test_the_working_directory_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert ran(tmp_path, top="os.chdir('/')", preparing="os.chdir('/')") == "completed"
    assert Path.cwd() == tmp_path


def test_an_empty_text_about_itself_is_no_title(tmp_path: Path) -> None:
    assert ALL_CONTROLLERS[opened(tmp_path, declared="__doc__ = ''")].title == "odd"
    with pytest.raises(InputError, match="a controller named ''"):
        opened(tmp_path, declared="name = ''")


@pytest.mark.parametrize("error", ["MemoryError('for a list')", "OSError(errno.EFBIG, 'too large')"])
def test_a_step_that_lacks_memory_or_disk_is_no_failed_controller(error: str, tmp_path: Path) -> None:
    with pytest.raises(MachineError, match="the run with odd lacks memory, disk space or file handles"):
        ran(tmp_path, stepping=f"raise {error}")


def test_threads_that_run_foreign_code_at_once_leave_standard_output_as_it_was() -> None:
    """The first that enters leaves first."""
    before = (sys.stdout, os._exit)
    entered, second, left = threading.Event(), threading.Event(), threading.Event()

    def first() -> None:
        with ForeignCode.contained("a test has been running"):
            entered.set()
            assert second.wait(HANG)
        left.set()

    thread = threading.Thread(target=first)
    thread.start()
    assert entered.wait(HANG)
    with ForeignCode.contained("a test has been running"):
        second.set()
        assert left.wait(HANG)
        assert sys.stdout is sys.stderr
    thread.join()
    assert (sys.stdout, os._exit) == before


def test_escapes_that_a_controller_prints_stay_out_of_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """It runs with the user's rights, so that its own output to the terminal is its own affair."""
    monkeypatch.chdir(tmp_path)
    escape = "\\x1b[2J\\x07"
    parts = {"top": f"print('{escape}')", "stepping": f"print('{escape}'); raise ValueError('{escape}')"}
    opened(tmp_path, **parts)
    line = ["run", "fast-diagonal", "--controller", "law.py:Odd", "--plants", "analytic"]
    line += [part for text in SHORT for part in ("--set", text)]
    assert main([*line, "--out", "o.mcap", "--json", "-"]) == 3
    told = capfd.readouterr()
    assert json.loads(told.out)["runs"][0]["status"] == "controller-failed"
    assert "\x1b" not in told.out
    assert f":Odd failed in law.py:15: ValueError: {escape}\n" in told.err
    assert main(["report", "o.mcap", "--out", "page.html"]) == 0
    assert "\x1b" not in Path("page.html").read_text(encoding="utf-8")
