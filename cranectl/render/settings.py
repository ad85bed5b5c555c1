"""What a picture or video is to be, checked."""

import re
from dataclasses import dataclass
from pathlib import Path

from cranectl.support.errors import InputError, unknown_name
from cranectl.support.places import BY_ENDING, check_place

ENDINGS = (".mp4", ".gif", ".png")
CAMERAS = ("overview", "side", "top")
LIMITS = {"fps": (1.0, 60.0), "speed": (0.01, 100.0)}
SMALLEST, SMALLEST_WITH_PLOTS, LARGEST = (400, 300), (720, 360), (3840, 2160)
# Plots take a third of the width.
_SIZES = {".mp4": (960, 720), ".gif": (480, 360), ".png": (960, 720)}
_SIZES_WITH_PLOTS = {".mp4": (1440, 720), ".gif": (900, 450), ".png": (1440, 720)}
_FPS = {".mp4": 25.0, ".gif": 10.0, ".png": 25.0}


@dataclass(frozen=True)
class RenderSettings:
    """What to draw into which file."""

    out: Path
    width: int
    height: int
    camera: str
    plots: bool
    time: float | None  # [s] of a still; None: when the load is farthest from its reference
    fps: float
    speed: float  # simulated seconds in a second of video

    @property
    def still(self) -> bool:
        """Whether this is one picture."""
        return self.out.suffix.lower() == ".png"


def render_settings(
    out: Path,
    *,
    size: str | None = None,
    camera: str = "overview",
    plots: bool = False,
    time: float | None = None,
    fps: float | None = None,
    speed: float | None = None,
) -> RenderSettings:
    """Fill in the defaults; raises InputError for what cannot be drawn, or not written there."""
    ending = out.suffix.lower()
    if ending not in ENDINGS:
        raise InputError(
            f"{out} ends in '{out.suffix}'",
            allowed=".mp4 (video), .gif (video without a player), .png (still)",
            remedy="name the file by what it is to be",
        )
    if camera not in CAMERAS:
        raise unknown_name("camera", camera, CAMERAS)
    if ending == ".png" and (fps is not None or speed is not None):
        raise InputError(
            f"{out} is a still, it has no --fps or --speed",
            allowed="--fps and --speed with .mp4 and .gif",
            remedy="choose a moment with --time",
        )
    if ending != ".png" and time is not None:
        raise InputError(
            f"{out} shows the whole run, not --time {time:g}",
            allowed="--time with .png",
            remedy="leave out --time, or name a .png",
        )
    for name, value in (("fps", fps), ("speed", speed)):
        low, high = LIMITS[name]
        if value is not None and not low <= value <= high:
            raise InputError(f"--{name} {value:g}", allowed=f"{low:g} to {high:g}")
    width, height = (
        _parsed_size(size, SMALLEST_WITH_PLOTS if plots else SMALLEST)
        if size
        else (_SIZES_WITH_PLOTS if plots else _SIZES)[ending]
    )
    check_place(out, BY_ENDING[ending], option="OUT")
    return RenderSettings(
        out,
        width,
        height,
        camera,
        plots,
        time,
        _FPS[ending] if fps is None else fps,
        1.0 if speed is None else speed,
    )


def _parsed_size(text: str, smallest: tuple[int, int]) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,5})[xX×](\d{1,5})", text.strip())
    size = (int(found[1]), int(found[2])) if found else (0, 0)
    fits = all(low <= side <= high for low, side, high in zip(smallest, size, LARGEST, strict=True))
    if not fits or size[0] % 2 or size[1] % 2:
        raise InputError(
            f"--size {text}",
            allowed="WIDTHxHEIGHT in pixels, even numbers from {}x{} to {}x{}".format(*smallest, *LARGEST),
            remedy="for example --size 1280x720",
        )
    return size
