"""What a picture or video is to be, checked."""

import re
from dataclasses import dataclass
from pathlib import Path

from cranectl.support.errors import InputError, unknown_name

CAMERAS = ("overview", "side", "top")
LIMITS = {"fps": (1.0, 60.0), "speed": (0.01, 100.0)}
SMALLEST, SMALLEST_WITH_PLOTS, LARGEST = (400, 300), (720, 360), (3840, 2160)
LARGE, LARGE_WITH_PLOTS = (960, 720), (1440, 720)  # plots take a third of the width
SMALL, SMALL_WITH_PLOTS = (480, 360), (900, 450)  # of a GIF


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
    def ending(self) -> str:
        """Of the file: `.png` is one picture, `.gif` and `.mp4` show the whole run."""
        return self.out.suffix.lower()


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
    """Fill in the defaults; raises InputError for what cannot be drawn. `out` ends as one of VIDEOS."""
    ending = out.suffix.lower()
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
    if size:
        width, height = _parsed_size(size, SMALLEST_WITH_PLOTS if plots else SMALLEST)
    elif ending == ".gif":
        width, height = SMALL_WITH_PLOTS if plots else SMALL
    else:
        width, height = LARGE_WITH_PLOTS if plots else LARGE
    usual_fps = 10.0 if ending == ".gif" else 25.0
    return RenderSettings(out, width, height, camera, plots, time, fps or usual_fps, speed or 1.0)


def _parsed_size(text: str, smallest: tuple[int, int]) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,5})[xX×](\d{1,5})", text.strip())
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    fits = all(low <= side <= high for low, side, high in zip(smallest, size, LARGEST, strict=True))
    if not fits or size[0] % 2 or size[1] % 2:
        raise InputError(
            f"--size {text}",
            allowed="WIDTHxHEIGHT in pixels, even numbers from {}x{} to {}x{}".format(*smallest, *LARGEST),
            remedy="for example --size 1280x720",
        )
    return size
