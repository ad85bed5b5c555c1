"""Designs stored between processes have the same bits as computed ones.

`tests/support/test_kept.py` proves that they are never outdated or damaged.
"""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from cranectl.design import CONTROLLERS, Design, controllers, design_controller
from cranectl.scenario import DesignSettings
from cranectl.support.errors import InputError

# Faces of rooms have functions of these names.
kept = importlib.import_module("cranectl.support.kept")


@pytest.fixture(autouse=True)
def own_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "cache_directory", lambda: tmp_path)


def fresh(name: str, settings: DesignSettings | None = None) -> Design:
    return design_controller.__wrapped__.__wrapped__(name, settings)


def compute_never(monkeypatch: pytest.MonkeyPatch) -> None:
    def computed(*_: object) -> Design:
        raise AssertionError("computed again")

    monkeypatch.setattr(controllers, "_computed", computed)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_what_is_kept_is_what_was_computed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    computed = fresh(name)
    compute_never(monkeypatch)
    again = fresh(name)
    assert again.to_json() == computed.to_json()
    for one, other in ((again.gain, computed.gain), (again.robustifier.a, computed.robustifier.a)):
        assert one.tobytes("A") == other.tobytes("A")
        assert one.flags.c_contiguous == other.flags.c_contiguous


def test_other_settings_are_another_design() -> None:
    fresh("lqr")
    other = fresh("lqr", DesignSettings(input_weight=1.0))
    assert not (other.gain == fresh("lqr").gain).all()


def test_settings_that_nothing_can_meet_are_kept_nowhere(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        fresh("lqr+hinf", DesignSettings.model_validate({"hinf": {"gamma": 1e-3}}))
    assert not list(tmp_path.glob("designs/*.json"))


def test_a_run_loads_no_library_of_control_theory(tmp_path: Path) -> None:
    """Importing them would take half of the time of a short command."""
    script = (
        "import sys\n"
        "from cranectl.cli.main import main\n"
        "assert main(['run', 'fixed-position', '--set', 'duration=0.1', '--set', 'disturbances=[]', "
        "'--out', sys.argv[1]]) == 0\n"
        "assert 'mujoco' in sys.modules\n"
        "print([name for name in ('control', 'matplotlib', 'scipy.signal') if name in sys.modules])"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "run.mcap")]
    for _ in range(2):  # the first one may have to compute the design
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        if done.stdout.splitlines()[-1] == "[]":
            break
    assert done.stdout.splitlines()[-1] == "[]", done.stdout
