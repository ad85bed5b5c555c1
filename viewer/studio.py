"""Foxglove Studio in a browser, as a person uses it: open a log, read the sidebar, seek, look at panels."""

import io
import re
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from PIL import Image
from playwright.sync_api import Locator, Page

from tests.pace import HANG, slowness
from viewer.panels import Layout
from viewer.pictures import Picture
from viewer.serving import HERE

AXE = HERE / "node_modules" / "axe-core" / "axe.min.js"
TIME = 2  # opcode of the protocol
T = TypeVar("T")


class Studio:
    """One page with one open source."""

    def __init__(self, page: Page, origin: str) -> None:
        self.page, self.origin = page, origin
        self.exceptions: list[str] = []
        self.clock: list[int] = []  # times [ns] that a live server has told
        page.set_default_timeout(1000 * HANG)
        page.on("pageerror", lambda error: self.exceptions.append(str(error)))
        page.on("websocket", lambda socket: socket.on("framereceived", self._received))
        page.goto(origin)

    def open_log(self, path: str, layout: Layout) -> None:
        """Open a log that is served at `path` and wait until its topics, or a problem, show."""
        self._open("remote-file", f"{self.origin}{path}", layout)

    def open_live(self, url: str, layout: Layout) -> None:
        """Connect to a live server."""
        self._open("foxglove-websocket", url, layout)

    def close(self) -> None:
        """Close the source and the viewer; a viewer whose server has gone would draw without end."""
        self.page.evaluate("() => hide()")

    def topics(self) -> dict[str, str]:
        """Number of messages of each topic in the sidebar, as text."""
        counts = self.page.locator("[data-topic-stat=count]")
        rows = counts.evaluate_all("all => all.map(e => [e.dataset.topic, e.textContent])")
        return {topic: count.replace(",", "") for topic, count in rows}

    def problems(self) -> list[str]:
        """What the sidebar reports as problems of the source."""
        self.page.get_by_role("tab", name="Problems").click()
        listed = self.page.locator(".MuiListItem-root")
        listed.or_(self.page.get_by_text("No problems found")).first.wait_for()
        found = listed.all_inner_texts()
        self.page.get_by_role("tab", name="Topics").click()
        return found

    def start(self) -> float:
        """When the source began [s]."""
        return float(self._told("Start time").split()[-1])

    def duration(self) -> float:
        """How long the source is so far [s]."""
        hours, minutes, seconds = self._told("Duration").split()[-1].split(":")
        return 3600.0 * float(hours) + 60.0 * float(minutes) + float(seconds)

    def time(self) -> float:
        """Where playback is [s]."""
        return float(self.page.get_by_test_id("PlaybackTime-text").locator("input").input_value())

    def seek(self, fraction: float) -> None:
        """Click on the time line and wait until playback is there."""
        track = self.page.locator("[class*=Slider-root]")
        box = track.bounding_box()
        assert box is not None
        track.click(position={"x": fraction * box["width"], "y": 0.5 * box["height"]})
        wanted, near = self.start() + fraction * self.duration(), 0.01 * self.duration()
        assert abs(eventually(self.time, lambda seen: abs(seen - wanted) <= near) - wanted) <= near

    def panel(self, name: str) -> Locator:
        """The panel with the layout's id `name`."""
        return self.page.get_by_test_id(f"panel-mouseenter-container {name}")

    def legend(self, name: str) -> list[str]:
        """Values in the legend of a plot, in the order of its paths; empty for a path without data."""
        return self.panel(name).locator("[class*=plotValue]").all_inner_texts()

    def open_settings(self, name: str) -> None:
        """The settings of a panel, in the place of the topics."""
        self.panel(name).get_by_test_id("SettingsIcon").click()
        self.page.get_by_text("panel settings").wait_for()

    def marked_wrong(self) -> list[str]:
        """Entries that the open settings mark as wrong."""
        labelled = "xpath=ancestor::*[normalize-space()][1]"
        return self.page.get_by_test_id("ErrorIcon").locator(labelled).all_inner_texts()

    def hide(self, topic: str) -> None:
        """Make a topic invisible in the open settings of a 3-D panel."""
        row = self.page.locator("[class*=nodeHeaderVisible]", has=self.page.get_by_text(topic, exact=True))
        row.hover()  # which brings its check box
        row.get_by_role("checkbox").uncheck()

    def parameters(self, name: str) -> dict[str, str]:
        """What a panel of parameters shows."""
        names = self.panel(name).locator("tbody [title]").all_inner_texts()
        values = self.panel(name).locator("tbody textarea").evaluate_all("all => all.map(e => e.value)")
        return dict(zip(names, values, strict=True))

    def set_parameter(self, name: str, parameter: str, value: str) -> None:
        """Type a value into a panel of parameters and confirm it."""
        row = self.panel(name).locator("tbody tr", has=self.page.get_by_title(parameter, exact=True))
        row.locator("textarea").fill(value)
        row.get_by_test_id("CheckIcon").click()

    def picture(self, name: str) -> Picture:
        """What the canvas of a panel shows, without what lies over it."""
        over = "[class*=rootFloating], .MuiTooltip-popper, canvas + div { opacity: 0 !important }"
        data = self.panel(name).locator("canvas").first.screenshot(style=over)
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))

    def _received(self, frame: str | bytes) -> None:
        if isinstance(frame, bytes) and frame[0] == TIME:
            self.clock.append(int.from_bytes(frame[1:9], "little"))

    def _told(self, label: str) -> str:
        """What the sidebar says of the source."""
        return self.page.get_by_text(label, exact=True).locator("xpath=..").inner_text()

    def _open(self, source: str, url: str, layout: Layout) -> None:
        self.exceptions.clear()
        self.clock.clear()
        query = f"?ds={source}&ds.url={url}"
        self.page.evaluate("([query, layout]) => show(query, layout)", [query, layout])
        listed = self.page.locator("[data-topic-stat=count]")
        problem = self.page.get_by_role("tab", name=re.compile(r"Problems\s*\d"))
        listed.or_(problem).first.wait_for(timeout=1000 * HANG)


def at_rest(look: Callable[[], T]) -> T:
    """What `look` gives once it has given the same for a second, on a slow machine for as much longer.

    A viewer shows late what has arrived.
    """
    seen = [look()]

    def same(new: T) -> bool:
        seen.append(new)
        time.sleep(0.4 * slowness(time.perf_counter))
        return len(seen) > 3 and all(old == new for old in seen[-4:])

    return eventually(look, same)


def eventually(look: Callable[[], T], good: Callable[[T], object]) -> T:
    """What `look` gives as soon as it is good, or once it hangs."""
    end = time.monotonic() + HANG
    while not good(seen := look()) and time.monotonic() < end:
        time.sleep(0.1)
    return seen


def violations(page: Page) -> list[str]:
    """What axe finds wrong with a page for people who use a keyboard or a screen reader."""
    page.add_script_tag(path=AXE)

    def found() -> list[str]:
        result = page.evaluate("axe.run()")
        return [f"{rule['id']}: {rule['nodes'][0]['html']}" for rule in result["violations"]]

    # A moment after its width changed, a page makes what scrolls reachable by the keyboard.
    return eventually(found, lambda seen: seen == [])
