"""A report page in a browser: first screen, values at the cursor, and figures that zoom together."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.main import main
from cranectl.log.reader import read_log
from viewer.studio import accessibility_violations, open_page, poll_until

COUNT_LABELS = """all => all.map(svg => [...svg.querySelectorAll("[data-part^=axes]")].at(-1)
    .querySelectorAll(".zoomed > g > text").length)"""
SHOWN_WINDOWS = "all => all.flatMap(svg => svg.plots.map(plot => plot.shown))"
FIND_CUT_TEXTS = """all => all.filter(text => {
    const box = text.getBoundingClientRect();
    return box.left < 0 || box.right > innerWidth;
}).map(text => text.textContent)"""
CAMPAIGN = """
name = "narrow"
scenario = "fixed-position"
controllers = ["lqr", "lqr+hinf"]
plants = ["analytic", "elastic"]
drive = "velocity"
sampling = "saltelli"
runs = 32
set = ["duration=2", "disturbances=[]"]

[uncertain.rig]
load_mass = { distribution = "uniform", low = 0.5, high = 1.5 }
bridge_time_constant = { distribution = "log-uniform", low = 0.01, high = 0.04 }
"""
PAGE_COMMANDS = {  # commands that write a page, by its name
    "campaign": ("campaign run narrow.toml --out narrow", "campaign report narrow --out campaign.html"),
    "ladder": ("ladder fixed-position --set duration=2 --set disturbances=[] --report ladder.html",),
}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a log, and its report beside it."""
    log = tmp_path_factory.mktemp("report") / "run.mcap"
    settings = ["--set", "duration=8", "--set", "disturbances=[{joint='beta', start=2.0, magnitude=1.0}]"]
    assert main(["run", "fixed-position", *settings, "--out", str(log)]) == ExitCode.GOOD
    assert main(["report", str(log), "--out", str(log.with_suffix(".html"))]) == ExitCode.GOOD
    return log


@pytest.fixture
def page(chromium: Browser, log: Path) -> Iterator[Page]:
    """Open the report of the log from the disk."""
    opened = open_page(chromium, viewport={"width": 1280, "height": 800})
    opened.goto(log.with_suffix(".html").as_uri())
    yield opened
    opened.close()


def value_at_cursor(page: Page, fraction: float) -> tuple[float, float]:
    """Move the cursor over the first figure; return the shown time [s] and first value."""
    figure = page.locator("svg[data-plots]").first
    figure.scroll_into_view_if_needed()
    box = figure.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + fraction * box["width"], box["y"] + 0.25 * box["height"])
    title, row = page.locator("#values").inner_text().split("\n")[:2]
    return float(title.removesuffix(" s")), float(row.split("\t")[-1].removesuffix(" m"))


def test_the_cursor_shows_logged_values_and_the_wheel_zooms_all_figures(page: Page, log: Path) -> None:
    run = read_log(log)["analytic"]
    error = run.signal("error.error_x")
    figures = page.locator("svg[data-plots]")
    home = figures.evaluate_all(SHOWN_WINDOWS)
    assert figures.count() == 7
    assert home == [[0.0, 8.0]] * len(home)
    for fraction in (0.3, 0.6, 0.8):
        time, value = value_at_cursor(page, fraction)
        assert value == pytest.approx(np.interp(time, run.time, error), abs=np.ptp(error) / 1000)

    page.keyboard.down("Control")
    page.mouse.wheel(0, -400)
    page.keyboard.up("Control")
    ((low, high),) = poll_until(
        lambda: {tuple(window) for window in figures.evaluate_all(SHOWN_WINDOWS)},
        lambda value: value != {(0.0, 8.0)},
    )
    assert 0.0 < low < time < high < 8.0
    assert high - low < 0.6 * 8.0
    assert min(figures.evaluate_all(COUNT_LABELS)) >= 3
    zoomed_time, value = value_at_cursor(page, 0.8)
    assert zoomed_time == pytest.approx(time, abs=0.02), "the zoom moved the point under the cursor"
    assert value == pytest.approx(np.interp(zoomed_time, run.time, error), abs=np.ptp(error) / 1000)

    figures.first.dblclick()
    assert poll_until(lambda: figures.evaluate_all(SHOWN_WINDOWS), lambda value: value == home) == home


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_first_screen_fits_and_is_accessible(page: Page, scheme: str) -> None:
    page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
    for width, height in ((1440, 900), (1024, 768), (390, 844)):
        page.set_viewport_size({"width": width, "height": height})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert accessibility_violations(page) == []
    page.set_viewport_size({"width": 1440, "height": 900})
    for part in (page.locator(".verdict"), page.locator(".facts"), page.get_by_role("img").first):
        box = part.bounding_box()
        assert box is not None
        assert box["y"] + box["height"] <= 900


@pytest.mark.parametrize("name", PAGE_COMMANDS)
def test_pages_of_campaigns_and_rigs_fit(
    name: str, chromium: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("narrow.toml").write_text(CAMPAIGN, encoding="utf-8")
    for command in PAGE_COMMANDS[name]:
        assert main(command.split()) == ExitCode.GOOD, command
    for scheme in ("light", "dark"):
        page = open_page(chromium, color_scheme=scheme)
        page.goto((tmp_path / f"{name}.html").as_uri())
        assert page.title()
        for width in (1440, 1024, 390):
            page.set_viewport_size({"width": width, "height": 900})
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert page.locator("figure:not(.alone) svg text").evaluate_all(FIND_CUT_TEXTS) == []
            assert accessibility_violations(page) == []
        page.close()
