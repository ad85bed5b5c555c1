"""The how-to about Foxglove: its commands work, and its pictures show what the viewer shows."""

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import FloatRect

from cranectl.cli.main import main
from tests.conftest import ROOT
from viewer import panels
from viewer.conftest import FAILURES, Live
from viewer.panels import Layout
from viewer.studio import Studio, poll_until

PAGE = ROOT / "docs" / "how-to" / "foxglove.md"
COMPARED_SIZE = (160, 100)  # pixels to which pictures are shrunk, so that fonts and smoothing do not matter
MAX_MEAN_DIFFERENCE = 8.0  # mean difference of two small pictures, of 255
WORST_TIME = 5.24  # [s] of the largest error, which the page names


def matches_picture(name: str, screenshot: bytes) -> bool:
    """Return True if a picture of the page resembles a screenshot, which is saved in viewer/failures."""
    new = Image.open(io.BytesIO(screenshot)).convert("RGB")
    FAILURES.mkdir(exist_ok=True)
    new.quantize(128, dither=Image.Dither.NONE).save(FAILURES / name, optimize=True)
    old = Image.open(PAGE.parent.parent / "pictures" / name).convert("RGB")
    small = [np.asarray(picture.resize(COMPARED_SIZE), dtype=float) for picture in (old, new)]
    return float(np.abs(small[0] - small[1]).mean()) < MAX_MEAN_DIFFERENCE


@pytest.fixture(scope="module")
def commands(files: Path) -> dict[str, Layout]:
    """Run the commands of the page; return its layouts by name."""
    (block,) = re.findall(r"^```sh\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    for line in block.replace("\\\n", "").splitlines():
        words = [str(files / word) if re.search(r"\.(mcap|json)$", word) else word for word in line.split()]
        assert main(words[1:]) == 0
    return {name: json.loads((files / f"{name}.json").read_text()) for name in ("comparison", "single")}


def screenshot_without_popups(studio: Studio, height: int = 800) -> bytes:
    """Take a screenshot without tooltips and hints for new users."""
    studio.page.mouse.move(640.0, 790.0)
    clip: FloatRect = {"x": 0.0, "y": 0.0, "width": 1280.0, "height": height}
    return studio.page.screenshot(
        style=".MuiTooltip-popper, .MuiPopper-root { display: none !important }", clip=clip
    )


def test_the_comparison_picture_is_current(studio: Studio, commands: dict[str, Layout]) -> None:
    studio.open_log("/files/run.mcap", commands["comparison"])
    studio.seek(0.5)
    assert poll_until(
        lambda: matches_picture("foxglove-several.png", screenshot_without_popups(studio)), bool
    )


def test_the_picture_of_the_largest_error_is_current(studio: Studio, commands: dict[str, Layout]) -> None:
    studio.open_log("/files/run.mcap", panels.show_values(commands["single"]))
    studio.seek(WORST_TIME / 10.0)
    (error,) = (
        name
        for name, plot in panels.panels_of_type(commands["single"], "Plot").items()
        if "error" in str(plot)
    )
    values = poll_until(lambda: studio.legend(error), lambda texts: bool(texts) and all(texts))
    assert np.linalg.norm([float(value) for value in values]) == pytest.approx(0.010, abs=0.001)
    studio.open_log("/files/run.mcap", commands["single"])
    studio.seek(WORST_TIME / 10.0)
    assert poll_until(lambda: matches_picture("foxglove-worst.png", screenshot_without_popups(studio)), bool)


def test_the_live_picture_is_current(studio: Studio, live: Live, files: Path) -> None:
    studio.open_live(live.url, panels.load_shipped_layout("live", files, "--plant", "mujoco"))
    assert poll_until(studio.clock_time, lambda seconds: seconds > 5.0) > 5.0
    assert poll_until(
        lambda: matches_picture("foxglove-live.png", screenshot_without_popups(studio, 512)), bool
    )
