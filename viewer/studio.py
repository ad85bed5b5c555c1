"""Operate Foxglove Studio in a browser: open a log, read the sidebar, seek, and read panels."""

import io
import math
import re
import time
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser, Locator, Page

from cranectl.scenario import NANOSECONDS
from tests.pace import HANG, slowness
from viewer.panels import Layout
from viewer.pictures import Picture
from viewer.serving import HERE

AXE = HERE / "node_modules" / "axe-core" / "axe.min.js"
OVERLAYS_HIDDEN = "[class*=rootFloating], .MuiTooltip-popper, canvas + div { opacity: 0 !important }"
TIME_OPCODE = 2  # of a message with the server's time, in the WebSocket protocol of Foxglove
T = TypeVar("T")


class Studio:
    """A browser page in which the viewer shows one data source."""

    def __init__(self, page: Page, origin: str) -> None:
        self.page, self.origin = page, origin
        self.exceptions: list[str] = []
        self.clock: list[int] = []  # times [ns] that a live server has sent
        page.set_default_timeout(1000 * HANG)
        page.on("pageerror", lambda error: self.exceptions.append(str(error)))
        page.on("websocket", lambda socket: socket.on("framereceived", self._received))
        page.goto(origin)

    def open_log(self, path: str, layout: Layout) -> None:
        """Open the log that is served at `path`; wait until topics or problems are listed."""
        self._open("remote-file", f"{self.origin}{path}", layout)

    def open_live(self, url: str, layout: Layout) -> None:
        """Connect to a live server."""
        self._open("foxglove-websocket", url, layout)

    def close(self) -> None:
        """Close the viewer. It would redraw endlessly after its live server has ended."""
        self.page.evaluate("() => hide()")

    def topics(self) -> dict[str, str]:
        """Return the number of messages that the sidebar shows for each topic, as text."""
        counts = self.page.locator("[data-topic-stat=count]")
        rows = counts.evaluate_all("all => all.map(e => [e.dataset.topic, e.textContent])")
        return {topic: count.replace(",", "") for topic, count in rows}

    def problems(self) -> list[str]:
        """Return the problems that the sidebar lists."""
        self.page.get_by_role("tab", name="Problems").click()
        listed = self.page.locator(".MuiListItem-root")
        listed.or_(self.page.get_by_text("No problems found")).first.wait_for()
        problems = listed.all_inner_texts()
        self.page.get_by_role("tab", name="Topics").click()
        return problems

    def clock_time(self) -> float:
        """Return the run's time [s] from the server's messages, because a busy viewer shows it late."""
        self.page.wait_for_timeout(10)  # messages of the server are received only during a call
        return self.clock[-1] / NANOSECONDS

    def start(self) -> float:
        """Return the start time of the data source [s]."""
        return float(self._sidebar_text("Start time").split()[-1])

    def duration(self) -> float:
        """Return the duration of the data source so far [s]."""
        hours, minutes, seconds = self._sidebar_text("Duration").split()[-1].split(":")
        return 3600.0 * float(hours) + 60.0 * float(minutes) + float(seconds)

    def time(self) -> float:
        """Return the playback time [s]."""
        return float(self.page.get_by_test_id("PlaybackTime-text").locator("input").input_value())

    def seek(self, fraction: float) -> None:
        """Click on the time line; wait until playback has reached that time."""
        track = self.page.locator("[class*=Slider-root]")
        box = track.bounding_box()
        assert box is not None
        track.click(position={"x": fraction * box["width"], "y": 0.5 * box["height"]})
        target, tolerance = self.start() + fraction * self.duration(), 0.01 * self.duration()
        time = poll_until(self.time, lambda value: abs(value - target) <= tolerance)
        assert abs(time - target) <= tolerance

    def panel(self, name: str) -> Locator:
        """Return the panel whose id in the layout is `name`."""
        return self.page.get_by_test_id(f"panel-mouseenter-container {name}")

    def legend(self, name: str) -> list[str]:
        """Return the values in the legend of a plot, one per path; a path without data has an empty text."""
        return self.panel(name).locator("[class*=plotValue]").all_inner_texts()

    def open_settings(self, name: str) -> None:
        """Show the settings of a panel in the sidebar."""
        self.panel(name).get_by_test_id("SettingsIcon").click()
        self.page.get_by_text("panel settings").wait_for()

    def settings_with_errors(self) -> list[str]:
        """Return the labels of the open settings that carry an error icon."""
        label = "xpath=ancestor::*[normalize-space()][1]"
        return self.page.get_by_test_id("ErrorIcon").locator(label).all_inner_texts()

    def hide(self, topic: str) -> None:
        """Make a topic invisible in the open settings of a 3-D panel."""
        row = self.page.locator("[class*=nodeHeaderVisible]", has=self.page.get_by_text(topic, exact=True))
        row.hover()  # shows its check box
        row.get_by_role("checkbox").uncheck()

    def parameters(self, name: str) -> dict[str, str]:
        """Return the names and values in a panel of parameters."""
        names = self.panel(name).locator("tbody [title]").all_inner_texts()
        values = self.panel(name).locator("tbody textarea").evaluate_all("all => all.map(e => e.value)")
        return dict(zip(names, values, strict=True))

    def set_parameter(self, name: str, parameter: str, value: str) -> None:
        """Type a value into a panel of parameters and confirm it."""
        row = self.panel(name).locator("tbody tr", has=self.page.get_by_title(parameter, exact=True))
        row.locator("textarea").fill(value)
        row.get_by_test_id("CheckIcon").click()

    def picture(self, name: str) -> Picture:
        """Return the pixels of a panel's canvas, without buttons and legends above it."""
        return self.pictures([name])[name]

    def pictures(self, names: Iterable[str]) -> dict[str, Picture]:
        """Return the pixels of several panels' canvases from one screenshot of the window."""
        data = self.page.screenshot(style=OVERLAYS_HIDDEN)
        window = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
        shown = {}
        for name in names:
            box = self.panel(name).locator("canvas").first.bounding_box()
            assert box is not None
            left, top = math.ceil(box["x"]), math.ceil(box["y"])
            right, bottom = math.floor(box["x"] + box["width"]), math.floor(box["y"] + box["height"])
            shown[name] = window[top:bottom, left:right]
        return shown

    def _received(self, frame: str | bytes) -> None:
        if isinstance(frame, bytes) and frame[0] == TIME_OPCODE:
            self.clock.append(int.from_bytes(frame[1:9], "little"))

    def _sidebar_text(self, label: str) -> str:
        """Return the text of the sidebar at `label`."""
        return self.page.get_by_text(label, exact=True).locator("xpath=..").inner_text()

    def _open(self, source: str, url: str, layout: Layout) -> None:
        self.exceptions.clear()
        self.clock.clear()
        query = f"?ds={source}&ds.url={url}"
        self.page.evaluate("([query, layout]) => show(query, layout)", [query, layout])
        listed = self.page.locator("[data-topic-stat=count]")
        problem = self.page.get_by_role("tab", name=re.compile(r"Problems\s*\d"))
        listed.or_(problem).first.wait_for(timeout=1000 * HANG)


def poll_until_stable(read: Callable[[], T]) -> T:
    """Call `read` until it has returned the same value for about a second; return the value.

    The viewer shows received data with a delay, which is longer on a slow machine. A value that never comes
    to rest is an error.
    """
    values = [read()]

    def is_stable(value: T) -> bool:
        values.append(value)
        time.sleep(0.4 * slowness(time.perf_counter))
        return len(values) > 3 and all(previous == value for previous in values[-4:])

    value = poll_until(read, is_stable)
    assert all(previous == value for previous in values[-4:]), values[-4:]
    return value


def poll_until(read: Callable[[], T], is_expected: Callable[[T], object]) -> T:
    """Call `read` until its value is as expected or `HANG` seconds have passed; return the last value."""
    end = time.monotonic() + HANG
    while not is_expected(value := read()) and time.monotonic() < end:
        time.sleep(0.1)
    return value


def open_page(chromium: Browser, **settings: Any) -> Page:
    """Open an empty page that may load files only, and whose scripts may not fail."""
    page = chromium.new_page(**settings)
    page.on("pageerror", lambda error: pytest.fail(str(error)))
    page.on("request", lambda request: request.url.startswith(("file:", "data:")) or pytest.fail(request.url))
    return page


def accessibility_violations(page: Page) -> list[str]:
    """Return the accessibility problems that axe finds on a page."""
    page.add_script_tag(path=AXE)

    def run_axe() -> list[str]:
        result = page.evaluate("axe.run()")
        return [f"{rule['id']}: {rule['nodes'][0]['html']}" for rule in result["violations"]]

    # The page makes scrolling tables reachable by keyboard a moment after its width has changed.
    return poll_until(run_axe, lambda problems: problems == [])
