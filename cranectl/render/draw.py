"""From the runs of a log to a file of whole pictures: the scene, its caption, the plots beside it.

PNG and GIF by Pillow, MP4 by PyAV.
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

from cranectl.render.caption import Caption
from cranectl.render.opengl import check_engine
from cranectl.render.plots import Plots
from cranectl.render.timeline import Timeline, timeline_of
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.support.colours import LIGHT, SLACK_ROPE, rgb
from cranectl.support.errors import InputError, unknown_name
from cranectl.support.files import replacing, writing

CAMERAS = ("overview", "side", "top")
LIMITS = {"fps": (1.0, 60.0), "speed": (0.01, 100.0)}
SMALLEST, LARGEST = {False: (400, 300), True: (720, 360)}, (3840, 2160)  # by whether there are plots
USUAL = {  # sizes by whether it is a GIF and whether there are plots
    (False, False): (960, 720),
    (False, True): (1440, 720),
    (True, False): (480, 360),
    (True, True): (900, 450),
}
PLOTS_SHARE = 3  # plots take the third part of the width
LONGEST_GIF = 3000  # pictures, which are held in memory
PALETTE_SAMPLES = 6  # pictures from which a GIF takes its colours

Paint = Callable[[float], Image.Image]
Progress = Callable[[float], None]
# Small enough to send, no loss that is seen; 4:2:0 pixels and this profile play everywhere.
H264 = {"crf": "20", "preset": "veryfast", "profile": "high"}
PIXELS = "yuv420p"
BT709 = 1  # the colours of high definition, in FFmpeg's numbering of matrices, primaries and curves
LIMITED = 1  # luma from 16 to 235, as players expect
COLOURS = 256
HUNDREDTHS = 100  # of a second, in which GIF counts time


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
            raise InputError(
                f"--{name} {value:g}", allowed=f"{low:g} to {high:g}", remedy=f"choose another --{name}"
            )
    usual_fps = 10.0 if ending == ".gif" else 25.0
    width, height = _parsed_size(size, SMALLEST[plots]) if size else USUAL[ending == ".gif", plots]
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


def draw_runs(runs: Mapping[str, Run], settings: RenderSettings, progress: Progress | None = None) -> float:
    """Draw the runs of a log into `settings.out`; returns the time [s] of a still, or how much a video shows.

    `progress` gets the simulated seconds that each picture adds. Raises InputError for a time outside the
    run, a GIF too long, no OpenGL, no encoder, or a place that cannot be written.
    """
    timeline = timeline_of(runs)
    times = _times(timeline, settings)
    if settings.ending == ".mp4":
        check_encoder()
    with writing(settings.out), _painter(timeline, settings) as paint, replacing(settings.out) as part:
        pictures = _pictures(paint, times, progress)
        if settings.ending == ".png":
            next(pictures).save(part, format="png", optimize=True)
        elif settings.ending == ".gif":
            samples = [paint(time) for time in np.linspace(0.0, timeline.duration, PALETTE_SAMPLES)]
            write_gif(part, pictures, len(times), settings.fps, samples)
        else:
            write_mp4(part, pictures, settings.fps, (settings.width, settings.height))
    return float(times[-1])


def draw_worst_moment(runs: Mapping[str, Run]) -> tuple[float, Image.Image]:
    """Return when the load is farthest from its reference [s], and a picture of that moment."""
    timeline = timeline_of(runs)
    with _painter(timeline, render_settings(Path("worst.png"))) as paint:
        return timeline.worst_time, paint(timeline.worst_time)


@contextmanager
def _painter(timeline: Timeline, settings: RenderSettings) -> Iterator[Paint]:
    """Yield a function that paints the picture at a time [s], with plots at its right."""
    check_engine()
    from cranectl.render.scene import renderer  # imports the engine

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
        caption = Caption(timeline, width, height, scene.scale_label)
        yield paint


def _times(timeline: Timeline, settings: RenderSettings) -> Array:
    """Return when the pictures are [s]."""
    if settings.ending != ".png":
        times = timeline.times(settings.fps, settings.speed)
        if settings.ending == ".gif" and len(times) > LONGEST_GIF:
            raise InputError(
                f"a GIF of {len(times)} pictures",
                allowed=f"up to {LONGEST_GIF}",
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
    """Write an endless loop of `count` pictures with the palette of `samples`, so that nothing flickers."""
    montage = Image.new("RGB", (samples[0].width, samples[0].height * len(samples)))
    for k, sample in enumerate(samples):
        montage.paste(sample, (0, k * sample.height))
    # Thin lines are too few pixels to get colours of their own, but a legend says what they mean.
    accents = [round(255 * part) for colour in (*LIGHT.values(), SLACK_ROPE) for part in rgb(colour)]
    palette = Image.new("P", (1, 1))
    palette.putpalette((montage.quantize(COLOURS - len(accents) // 3).getpalette() or []) + accents)
    reduced = (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures)
    ends = [round(HUNDREDTHS * (k + 1) / fps) for k in range(count)]
    milliseconds = [1000 // HUNDREDTHS * (end - start) for start, end in zip([0, *ends], ends, strict=False)]
    first = next(reduced)
    with path.open("wb") as stream:  # Pillow would leave a file of its own open if it is interrupted
        first.save(stream, format="gif", save_all=True, append_images=reduced, duration=milliseconds, loop=0)


def check_encoder() -> None:
    """Raise InputError if there is no PyAV to encode a video with."""
    try:
        import av  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"no encoder for .mp4: {error}",
            allowed=".gif and .png without it",
            remedy="pip install 'cranectl[video]' (PyAV, which brings FFmpeg)",
        ) from None


def write_mp4(path: Path, pictures: Iterable[Image.Image], fps: float, size: tuple[int, int]) -> None:
    """Write a video in H.264 that plays while it loads."""
    import av
    from av.video.reformatter import ColorRange, Colorspace

    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001), options=H264)
        stream.width, stream.height = size
        stream.pix_fmt = PIXELS
        stream.color_range, stream.colorspace = LIMITED, BT709
        stream.color_primaries, stream.color_trc = BT709, BT709

        def encode(picture: Image.Image) -> None:
            frame = av.VideoFrame.from_ndarray(np.asarray(picture), format="rgb24").reformat(
                format=PIXELS, dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG
            )
            container.mux(stream.encode(frame))

        # One picture is encoded while the next is drawn.
        with ThreadPoolExecutor(max_workers=1) as encoder:
            encoded: Future[None] = encoder.submit(lambda: None)
            for picture in pictures:
                encoded.result()
                encoded = encoder.submit(encode, picture)
            encoded.result()
        container.mux(stream.encode())
