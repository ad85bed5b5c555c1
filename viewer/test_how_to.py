"""The how-to about Foxglove: its steps work, and its pictures show what the viewer shows."""

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import FloatRect

from cranectl.cli.main import main
from cranectl.scenario import NANOSECONDS
from tests.conftest import ROOT
from viewer import panels
from viewer.conftest import FAILURES, Live
from viewer.panels import Layout
from viewer.studio import Studio, eventually

PAGE = ROOT / "docs" / "how-to" / "foxglove.md"
SMALL = (160, 100)  # pixels to which pictures are shrunk, so that fonts and smoothing do not matter
CLOSE = 8.0  # mean difference of two small pictures, of 255
WORST = 5.24  # [s], on the page


def is_shown(name: str, screenshot: bytes) -> bool:
    """Return True if a picture of the page resembles a screenshot. If not, keep it in viewer/failures."""
    new = Image.open(io.BytesIO(screenshot)).convert("RGB")
    FAILURES.mkdir(exist_ok=True)
    new.quantize(128, dither=Image.Dither.NONE).save(FAILURES / name, optimize=True)
    old = Image.open(PAGE.parent.parent / "pictures" / name).convert("RGB")
    small = [np.asarray(picture.resize(SMALL), dtype=float) for picture in (old, new)]
    return float(np.abs(small[0] - small[1]).mean()) < CLOSE


@pytest.fixture(scope="module")
def commands(files: Path) -> dict[str, Layout]:
    """Run the commands of the page; return its layouts by name."""
    (block,) = re.findall(r"^```sh\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    for line in block.replace("\\\n", "").splitlines():
        words = [str(files / word) if re.search(r"\.(mcap|json)$", word) else word for word in line.split()]
        assert main(words[1:]) == 0
    return {name: json.loads((files / f"{name}.json").read_text()) for name in ("comparison", "single")}


def undisturbed(studio: Studio, height: int = 800) -> bytes:
    """Return a screenshot without what appears under the pointer and for newcomers."""
    studio.page.mouse.move(640.0, 790.0)
    clip: FloatRect = {"x": 0.0, "y": 0.0, "width": 1280.0, "height": height}
    return studio.page.screenshot(
        style=".MuiTooltip-popper, .MuiPopper-root { display: none !important }", clip=clip
    )


def test_the_plants_of_a_log_are_compared(studio: Studio, commands: dict[str, Layout]) -> None:
    studio.open_log("/files/run.mcap", commands["comparison"])
    studio.seek(0.5)
    assert eventually(lambda: is_shown("foxglove-several.png", undisturbed(studio)), bool)


def test_the_worst_moment_is_shown(studio: Studio, commands: dict[str, Layout]) -> None:
    studio.open_log("/files/run.mcap", panels.with_values(commands["single"]))
    studio.seek(WORST / 10.0)
    (error,) = (
        name for name, plot in panels.of_type(commands["single"], "Plot").items() if "error" in str(plot)
    )
    values = eventually(lambda: studio.legend(error), lambda seen: bool(seen) and all(seen))
    assert np.linalg.norm([float(value) for value in values]) == pytest.approx(0.010, abs=0.001)
    studio.open_log("/files/run.mcap", commands["single"])
    studio.seek(WORST / 10.0)
    assert eventually(lambda: is_shown("foxglove-worst.png", undisturbed(studio)), bool)


def test_a_live_session_is_shown(studio: Studio, live: Live, files: Path) -> None:
    studio.open_live(live.url, panels.shipped("live", files, "--plant", "mujoco"))

    def clock() -> float:
        studio.page.wait_for_timeout(10)  # frames are counted while the page is asked something
        return studio.clock[-1] / NANOSECONDS

    assert eventually(clock, lambda seconds: seconds > 5.0) > 5.0
    assert eventually(lambda: is_shown("foxglove-live.png", undisturbed(studio, 512)), bool)
