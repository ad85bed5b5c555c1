"""Fixtures: logs made by commands, a server, and a browser with the viewer."""

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, sync_playwright

from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.main import main
from viewer import tools
from viewer.logs import CUT_OFF, FOUR_CRANES, KINDS, OVERLAYS, truncate, write_four_cranes
from viewer.serving import HERE, STUDIO, serve
from viewer.studio import Studio

# Render 3-D without a graphics card, and switch off the browser's own network services.
BROWSER_FLAGS = (
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    *tools.CHROMIUM_FLAGS,
)
FAILURES = HERE / "failures"
LIVE_COMMAND = "-m cranectl live settled-trajectory --plant mujoco --port 0 --record"


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the directory that is served under /files/."""
    return tmp_path_factory.mktemp("files")


@pytest.fixture(scope="session")
def logs(files: Path) -> dict[str, Path]:
    """Make a log of every kind with the command line."""
    paths = {kind: files / f"{kind}.mcap" for kind in (*KINDS, *OVERLAYS, CUT_OFF, FOUR_CRANES)}
    for kind, arguments in {**KINDS, **OVERLAYS}.items():
        if CUT_OFF in arguments:
            truncate(paths["one-plant"], paths[CUT_OFF])
        code = main([argument.format_map(paths) for argument in arguments.split()])
        assert code == (ExitCode.RUN_STOPPED if kind == "stopped-early" else ExitCode.GOOD), kind
    write_four_cranes(paths[FOUR_CRANES])
    return paths


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    """Start a browser without a network."""
    program = shutil.which("chromium")
    if program is None:
        pytest.exit("Chromium is not installed; run `make test-viewer`", returncode=2)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=program, args=BROWSER_FLAGS, env={**tools.environment()}
        )
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def studio(files: Path, chromium: Browser) -> Iterator[Studio]:
    """Open the viewer in the browser."""
    if not STUDIO.is_dir():
        pytest.exit("the viewer is not installed; run `make test-viewer`", returncode=2)
    with serve(files) as origin:
        yield Studio(chromium.new_page(viewport={"width": 1280, "height": 800}), origin)


@dataclass(frozen=True)
class Live:
    """A running live session."""

    process: subprocess.Popen[str]
    url: str
    record: Path


@pytest.fixture
def live(studio: Studio, tmp_path: Path) -> Iterator[Live]:
    """Start `cranectl live` as a process."""
    record = tmp_path / "live.mcap"
    command = [sys.executable, *LIVE_COMMAND.split(), str(record)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        urls = (re.search(r"ws://\S+", line) for line in process.stdout)
        url = next((match[0] for match in urls if match), None)
        assert url is not None, "ended without printing the address of the server"
        yield Live(process, url, record)
        process.kill()
    studio.close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Save a screenshot of the viewer when a test has failed."""
    report: Any = yield
    studio = getattr(item, "funcargs", {}).get("studio")
    if report.failed and studio is not None:
        FAILURES.mkdir(exist_ok=True)
        name = re.sub(r"\W+", "-", item.name).strip("-")
        studio.page.screenshot(path=FAILURES / f"{name}.png")
    return report
