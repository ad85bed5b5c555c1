"""Logs as users make them, a server, a browser with the viewer."""

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

from cranectl.cli import exit_codes
from cranectl.cli.main import main
from viewer import tools
from viewer.logs import CUT_OFF, FOUR, KINDS, OVERLAYS, four_cranes, truncated
from viewer.serving import HERE, STUDIO, serve
from viewer.studio import Studio

# 3-D without a graphics card, and nothing that looks for the browser's own services.
FLAGS = (
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
LIVE = "-m cranectl live settled-trajectory --plant mujoco --port 0 --record"


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory that is served under /files/."""
    return tmp_path_factory.mktemp("files")


@pytest.fixture(scope="session")
def logs(files: Path) -> dict[str, Path]:
    """A log of every kind, made by the commands that users give."""
    paths = {kind: files / f"{kind}.mcap" for kind in (*KINDS, *OVERLAYS, CUT_OFF, FOUR)}
    for kind, arguments in {**KINDS, **OVERLAYS}.items():
        if CUT_OFF in arguments:
            truncated(paths["one-plant"], paths[CUT_OFF])
        code = main([argument.format_map(paths) for argument in arguments.split()])
        assert code == (exit_codes.RUN_STOPPED if kind == "stopped-early" else exit_codes.GOOD), kind
    four_cranes(paths[FOUR])
    return paths


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    """A browser without a network."""
    program = shutil.which("chromium")
    if program is None:
        pytest.exit("Chromium is not installed; run `make test-viewer`", returncode=2)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=FLAGS, env={**tools.environment()})
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def studio(files: Path, chromium: Browser) -> Iterator[Studio]:
    """The viewer in the browser."""
    if not STUDIO.is_dir():
        pytest.exit("the viewer is not installed; run `make test-viewer`", returncode=2)
    with serve(files) as origin:
        yield Studio(chromium.new_page(viewport={"width": 1280, "height": 800}), origin)


@dataclass(frozen=True)
class Live:
    """A running session."""

    process: subprocess.Popen[str]
    url: str
    record: Path


@pytest.fixture
def live(studio: Studio, tmp_path: Path) -> Iterator[Live]:
    """The command, as a user starts it."""
    record = tmp_path / "live.mcap"
    command = [sys.executable, *LIVE.split(), str(record)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        urls = (re.search(r"ws://\S+", line) for line in process.stdout)
        url = next((found[0] for found in urls if found), None)
        assert url is not None, "ended without saying where to connect"
        yield Live(process, url, record)
        process.kill()
    studio.close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Keep what the viewer showed when a test failed."""
    report: Any = yield
    studio = getattr(item, "funcargs", {}).get("studio")
    if report.failed and studio is not None:
        FAILURES.mkdir(exist_ok=True)
        name = re.sub(r"\W+", "-", item.name).strip("-")
        studio.page.screenshot(path=FAILURES / f"{name}.png")
    return report
