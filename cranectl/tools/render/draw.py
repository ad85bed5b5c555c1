"""Draw the runs of a log into a picture or video: the scene with its caption, and plots beside it.

Pillow writes PNG and GIF, PyAV writes MP4.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
from PIL import Image

from cranectl.simulate import Run
from cranectl.support import Array, File, InputError, Palette
from cranectl.tools.render.caption import Caption
from cranectl.tools.render.opengl import check_engine
from cranectl.tools.render.plots import Plots
from cranectl.tools.render.timeline import Timeline

OPTION_RANGES = {"fps": (1.0, 60.0), "speed": (0.01, 100.0)}
MIN_SIZES, MAX_SIZE = {False: (400, 300), True: (720, 360)}, (3840, 2160)  # keys: with plots
DEFAULT_SIZES = {  # keys: (GIF, with plots)
    (False, False): (960, 720),
    (False, True): (1440, 720),
    (True, False): (480, 360),
    (True, True): (900, 450),
}
PLOTS_SHARE = 3  # plots take a third of the width
MAX_GIF_PICTURES = 3000  # which are kept in memory
PALETTE_SAMPLES = 6  # pictures that determine the palette of a GIF

Paint = Callable[[float], Image.Image]
Progress = Callable[[float], None]
# Small files without visible loss; 4:2:0 pixels and this profile play everywhere.
H264 = {"crf": "20", "preset": "veryfast", "profile": "high"}
PIXEL_FORMAT = "yuv420p"
BT709 = 1  # FFmpeg's number of HD colours, for matrix, primaries and transfer curve
LIMITED_RANGE = 1  # FFmpeg's number of luma from 16 to 235, as players expect
MAX_GIF_COLOURS = 256
TICKS_PER_SECOND = 100  # in which GIF counts time


@dataclass(frozen=True)
class RenderSettings:
    """What to draw into which file."""

    out: Path
    width: int
    height: int
    camera: str | None  # of the user's or of the shipped model; None: the overview of the latter
    plots: bool
    time: float | None  # of a still [s]; None: when the load is farthest from its reference
    fps: float
    speed: float  # simulated seconds per second of video

    @property
    def suffix(self) -> str:
        """Suffix of the file: `.png` is one picture, `.gif` and `.mp4` show the whole run."""
        return self.out.suffix.lower()


def render_settings(
    out: Path,
    *,
    size: str | None = None,
    camera: str | None = None,
    plots: bool = False,
    time: float | None = None,
    fps: float | None = None,
    speed: float | None = None,
) -> RenderSettings:
    """Return settings for a .png, .gif or .mp4, with defaults; raise InputError for impossible ones."""
    suffix = out.suffix.lower()
    if suffix == ".png" and (fps is not None or speed is not None):
        raise InputError(
            f"{out} is a still, which has no --fps or --speed",
            allowed="--fps and --speed with .mp4 and .gif",
            remedy="choose a moment with --time",
        )
    if suffix != ".png" and time is not None:
        raise InputError(
            f"{out} shows the whole run, not --time {time:g}",
            allowed="--time with .png",
            remedy="leave out --time, or name a .png",
        )
    for name, value in (("fps", fps), ("speed", speed)):
        low, high = OPTION_RANGES[name]
        if value is not None and not low <= value <= high:
            allowed, remedy = f"{low:g} to {high:g}", f"choose another --{name}"
            raise InputError(f"--{name} {value:g}", allowed=allowed, remedy=remedy)
    default_fps = 10.0 if suffix == ".gif" else 25.0
    width, height = _parse_size(size, MIN_SIZES[plots]) if size else DEFAULT_SIZES[suffix == ".gif", plots]
    return RenderSettings(out, width, height, camera, plots, time, fps or default_fps, speed or 1.0)


def _parse_size(text: str, smallest: tuple[int, int]) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,5})[xX×](\d{1,5})", text.strip())
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    fits = all(low <= side <= high for low, side, high in zip(smallest, size, MAX_SIZE, strict=True))
    if not fits or size[0] % 2 or size[1] % 2:
        raise InputError(
            f"--size {text}",
            allowed="WIDTHxHEIGHT in pixels, even numbers from {}x{} to {}x{}".format(*smallest, *MAX_SIZE),
            remedy="for example --size 1280x720",
        )
    return size


def draw_runs(runs: Mapping[str, Run], settings: RenderSettings, progress: Progress | None = None) -> float:
    """Draw runs by plant or label into `settings.out`, and return the time of the last picture [s].

    `progress` is called with the simulated seconds that each picture adds. Raises InputError for a time
    outside the run, an unknown camera, a GIF that is too long, no OpenGL, no encoder, or a file that cannot
    be written.
    """
    timeline = Timeline.of(runs)
    times = _times(timeline, settings)
    if settings.suffix == ".mp4":
        check_encoder()
    file = File(settings.out)
    with file.writing(), _painter(timeline, settings, times) as paint, file.replacing() as part:
        pictures = _pictures(paint, times, progress)
        if settings.suffix == ".png":
            next(pictures).save(part, format="png", optimize=True)
        elif settings.suffix == ".gif":
            samples = [paint(time) for time in np.linspace(0.0, timeline.duration, PALETTE_SAMPLES)]
            write_gif(part, pictures, len(times), settings.fps, samples)
        else:
            write_mp4(part, pictures, settings.fps, (settings.width, settings.height))
    return float(times[-1])


def draw_worst_moment(runs: Mapping[str, Run]) -> tuple[float, Image.Image]:
    """Return the time at which the load is farthest from its reference [s], and its picture."""
    timeline = Timeline.of(runs)
    time = timeline.worst_time
    with _painter(timeline, render_settings(Path("worst.png")), np.array([time])) as paint:
        return time, paint(time)


@contextmanager
def _painter(timeline: Timeline, settings: RenderSettings, times: Array) -> Iterator[Paint]:
    """Yield a function that paints the picture at one of `times` [s], with plots on the right."""
    check_engine()
    from cranectl.tools.render.scene import renderer  # imports the engine

    strip = settings.width // PLOTS_SHARE if settings.plots else 0
    width, height = settings.width - strip, settings.height
    plots = Plots(timeline, strip, height) if strip else None

    def paint(time: float) -> Image.Image:
        picture = Image.fromarray(scene.draw(time))
        caption.draw(picture, time)
        if plots is None:
            return picture
        whole = Image.new("RGB", (settings.width, height))
        whole.paste(picture)
        plots.draw(whole, width, time)
        return whole

    with renderer(timeline, settings.camera, width, height) as scene:
        caption = Caption(timeline, times, (width, height), scene.scale_label)
        yield paint


def _times(timeline: Timeline, settings: RenderSettings) -> Array:
    """Return the times of the pictures [s]."""
    if settings.suffix != ".png":
        times = timeline.times(settings.fps, settings.speed)
        if settings.suffix == ".gif" and len(times) > MAX_GIF_PICTURES:
            raise InputError(
                f"a GIF of {len(times)} pictures",
                allowed=f"up to {MAX_GIF_PICTURES}",
                remedy="choose a higher --speed or a lower --fps, or an .mp4",
            )
        return times
    time = timeline.worst_time if settings.time is None else settings.time
    if not 0.0 <= time <= timeline.duration:
        raise InputError(
            f"--time {time:g} is outside the run",
            allowed=f"0 to {timeline.duration:g} s",
            remedy="leave out --time to see the load farthest from its reference",
        )
    return np.array([time])


def _pictures(paint: Paint, times: Array, progress: Progress | None) -> Iterator[Image.Image]:
    for time, step in zip(times.tolist(), np.diff(times, prepend=0.0).tolist(), strict=True):
        yield paint(time)
        if progress is not None:
            progress(step)


def write_gif(
    path: Path, pictures: Iterable[Image.Image], count: int, fps: float, samples: Sequence[Image.Image]
) -> None:
    """Write an endless loop of `count` pictures, with one palette from `samples` so that nothing flickers."""
    montage = Image.new("RGB", (samples[0].width, samples[0].height * len(samples)))
    for k, sample in enumerate(samples):
        montage.paste(sample, (0, k * sample.height))
    # Thin lines have too few pixels to get palette entries, but the legend needs their colours.
    accents = [round(255 * part) for role in Palette.LIGHT for part in Palette.LIGHT.rgb(role)]
    accents += [round(255 * part) for part in Palette.VIEWER.rgb("slack-rope")]
    palette = Image.new("P", (1, 1))
    palette.putpalette((montage.quantize(MAX_GIF_COLOURS - len(accents) // 3).getpalette() or []) + accents)
    reduced = (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures)
    ticks = np.diff([round(TICKS_PER_SECOND * k / fps) for k in range(count + 1)])
    milliseconds = (1000 // TICKS_PER_SECOND * ticks).tolist()
    first = next(reduced)
    with path.open("wb") as stream:  # an interrupt would leave a file open that Pillow opened
        first.save(stream, format="gif", save_all=True, append_images=reduced, duration=milliseconds, loop=0)


def check_encoder() -> None:
    """Raise InputError if PyAV, which encodes videos, is missing."""
    try:
        import av  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"no encoder for .mp4: {error}",
            allowed=".gif and .png without an encoder",
            remedy="pip install 'cranectl[video]' (PyAV, which brings FFmpeg)",
        ) from None


def write_mp4(path: Path, pictures: Iterable[Image.Image], fps: float, size: tuple[int, int]) -> None:
    """Write an H.264 video that plays while it loads."""
    import av
    from av.video.reformatter import ColorRange, Colorspace

    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001), options=H264)
        stream.width, stream.height = size
        stream.pix_fmt = PIXEL_FORMAT
        stream.color_range, stream.colorspace = LIMITED_RANGE, BT709
        stream.color_primaries, stream.color_trc = BT709, BT709

        def encode(picture: Image.Image) -> None:
            frame = av.VideoFrame.from_ndarray(np.asarray(picture), format="rgb24")
            colours = {"dst_colorspace": Colorspace.ITU709, "dst_color_range": ColorRange.MPEG}
            container.mux(stream.encode(frame.reformat(format=PIXEL_FORMAT, **colours)))

        # One picture is encoded while the next is drawn.
        with ThreadPoolExecutor(max_workers=1) as encoder:
            encoded: Future[None] = encoder.submit(lambda: None)
            for picture in pictures:
                encoded.result()
                encoded = encoder.submit(encode, picture)
            encoded.result()
        container.mux(stream.encode())
