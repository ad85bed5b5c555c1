"""The pytest plugin: closed loops and golden runs in tests of other repositories, logs of what fails.

Every pytest run where cranectl is installed loads it, so it imports nothing before a test asks.
"""

import os
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from cranectl.cases import CaseRuns

MAX_NAME = 150  # [characters] of a file's name, without its ending

RAN: pytest.StashKey[list["CaseRuns"]] = pytest.StashKey()  # by the present test, fixtures of it too
LOGS: pytest.StashKey[Path] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the plugin."""
    group = parser.getgroup("cranectl", "crane controllers (cranectl)")
    group.addoption(
        "--cranectl-logs",
        metavar="DIR",
        type=Path,
        help="Where logs of failed tests are left. Default: the base of pytest's temporary directories.",
    )
    group.addoption(
        "--cranectl-update", action="store_true", help="Write golden runs anew instead of judging by them."
    )


@pytest.fixture(scope="module")
def closed_loop(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> "Callable[..., CaseRuns]":
    """Return a function that runs a scenario in closed loop and returns the runs by plant.

    `closed_loop(scenario, controller=None, *, plants, drive="ideal", rig=None, overrides=())`: scenario and
    rig by name or as TOML files relative to the file of the test; the controller, by default the scenario's,
    by name or as the file of a controller, `law.py:NAME` or `law.so`, so too; names of plants, by default
    all; `overrides` as "rig.load_mass=2.5". Raises InputError for what is wrong.
    """
    config, here = request.config, request.path.parent
    chosen = config.getoption("cranectl_logs")
    directory = config.invocation_params.dir / chosen if chosen else tmp_path_factory.getbasetemp() / "logs"
    config.stash[LOGS] = directory

    def run(
        scenario: str | Path,
        controller: str | None = None,
        *,
        plants: Iterable[str] | None = None,
        drive: str = "ideal",
        rig: str | Path | None = None,
        overrides: Iterable[str] = (),
    ) -> "CaseRuns":
        __tracebackhide__ = True
        from cranectl.cases import Case, CaseRuns
        from cranectl.cli.controller_options import ControllerName
        from cranectl.planning import load_scenario
        from cranectl.plants import DRIVES
        from cranectl.support import InputError

        try:
            case = Case.of(
                load_scenario(
                    _beside(here, scenario),
                    rig=None if rig is None else _beside(here, rig),
                    overrides=list(overrides),
                ),
                controller=controller and ControllerName.open(controller, here),
                drive=DRIVES.checked(drive),
                plants=plants or (),
            )
            runs = CaseRuns(case)
        except InputError as error:
            raise error.with_traceback(None) from None
        config.stash[RAN].append(runs)
        return runs

    return run


@pytest.fixture
def assert_golden(request: pytest.FixtureRequest) -> "Callable[..., None]":
    """Return a function that asserts that runs equal those of a golden log.

    The golden log lies below the file of the test, in golden/; `--cranectl-update` writes it. `tolerances`:
    "exact", "rounding", or a TOML file relative to the file of the test.
    """
    here, name = request.path.parent, request.node.nodeid.partition("::")[2]
    judged: list[Path] = []

    def judge(runs: "CaseRuns", *, tolerances: str | Path = "rounding") -> None:
        __tracebackhide__ = True
        from cranectl.support import LogError

        path = here / "golden" / request.path.stem / _file_name(name, len(judged))
        judged.append(path)
        if request.config.getoption("cranectl_update"):
            runs.write_golden(path)
        elif not path.is_file():
            raise LogError(
                f"no golden run {path}",
                allowed="a log that an earlier run of this test has written",
                remedy="write it with pytest --cranectl-update",
            )
        else:
            runs.assert_regression(path, _beside(here, tolerances))

    return judge


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Forget what the test before ran."""
    item.config.stash[RAN] = []


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[Any]) -> None:
    """Leave the logs of what a failed test ran, or had from a fixture, and name them in its message."""
    if call.excinfo is None or call.excinfo.errisinstance(pytest.skip.Exception):
        return
    if LOGS not in item.config.stash:  # nobody has asked for a closed loop
        return
    from cranectl.cases import CaseRuns
    from cranectl.support import LogError

    had = [value for value in getattr(item, "funcargs", {}).values() if isinstance(value, CaseRuns)]
    ran = {id(runs): runs for runs in (*had, *item.config.stash[RAN])}
    for k, runs in enumerate(ran.values()):
        path = item.config.stash[LOGS] / _file_name(item.nodeid, k)
        try:
            call.excinfo.value.add_note(f"log of {runs}: {runs.write(path)}")
        except LogError as error:
            call.excinfo.value.add_note(f"no log of {runs}: {error.found}")


def _beside(directory: Path, name: str | Path) -> str:
    """Return a path relative to `directory`, or a name unchanged."""
    is_path = "/" in str(name) or str(name).endswith(".toml")
    return os.path.normpath(directory / name) if is_path else str(name)


def _file_name(test: str, k: int) -> str:
    """Return the name of the log of a test's k-th closed loop."""
    plain = re.sub(r"[^\w.+]+", "-", test).strip("-")[-MAX_NAME:]
    return f"{plain}-{k + 1}.mcap" if k else f"{plain}.mcap"
