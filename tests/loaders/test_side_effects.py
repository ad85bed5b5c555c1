"""What a law does besides its step: it prints, and changes how numbers are rounded. Nothing else notices."""

import json
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers, open_controller
from cranectl.simulate import simulate_run
from tests.loaders.controller_files import ASKED, LAW, built, scenario


@pytest.mark.parametrize(
    ("symbol", "said"),
    [("talking", ["loading", "stepping 5"]), ("Talking", ["preparing", "stepping 5.0"]), ("", ["in C"])],
)
def test_what_a_law_prints_goes_to_standard_error(
    symbol: str, said: list[str], law: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Without an end of the line, too; standard output has the JSON alone."""
    declared, broken = 'printf("declaring");', 'if (m[3] == 5.0) printf("in C");'
    asked = f"{law}:{symbol}" if symbol else str(built(law.parent, declared=declared, broken=broken))
    run = ["run", "fast-diagonal", "--controller", asked, "--plants", "analytic", *ASKED]
    assert main([*run, "--out", str(law.parent / "run.mcap"), "--json", "-"]) == 0
    told = capfd.readouterr()
    assert json.loads(told.out)["runs"][0]["status"] == "completed"
    assert all(text in told.err for text in said)


ROUNDING = f"""
import ctypes, platform
LIBRARY = ctypes.CDLL("libm.so.6")
UPWARD = {{"x86_64": 0x800, "aarch64": 0x400000}}[platform.machine()]
{LAW}
def rounding(parameters, measured, reference, memory, command):
    interpreted(parameters, measured, reference, memory, command)
    LIBRARY.fesetround(UPWARD)
    return 0

LIBRARY.fesetround(UPWARD)
"""


def test_code_that_changes_how_numbers_are_rounded_changes_no_plant(law: Path) -> None:
    """A library or a module may do so when it is loaded, and a step may do so before it returns."""
    law.write_text(ROUNDING)
    states = []
    for asked in (
        str(built(law.parent)),
        str(built(law.parent, loaded="fesetround(FE_UPWARD);")),
        f"{law}:interpreted",
        f"{law}:rounding",
    ):
        name = open_controller(asked)
        states.append(simulate_run(scenario(), plant="analytic", controller=name).block("state"))
        close_controllers()
    assert len(states[0]) == 3201
    assert all(np.array_equal(state, states[0]) for state in states)


def test_a_file_that_takes_long_to_load_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("cranectl.support.interrupts.SLOW", 0.01)
    path = tmp_path / "law.py"
    path.write_text("import os\nwhile not os.fstat(2).st_size:\n    pass\n" + LAW)  # until it is told
    open_controller(f"{path}:damper")
    assert "law.py:damper has been loading for 0.01 s" in capfd.readouterr().err
