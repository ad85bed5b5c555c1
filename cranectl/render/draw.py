"""From the runs of a log to a file of whole pictures: the scene, its caption, the plots beside it."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cranectl.render.caption import Caption
from cranectl.render.opengl import check_engine
from cranectl.render.plots import Plots
from cranectl.render.settings import RenderSettings
from cranectl.render.timeline import Array, Timeline, timeline_of
from cranectl.render.video import check_encoder, write_gif, write_mp4, write_png
from cranectl.simulate import Run
from cranectl.support.errors import InputError
from cranectl.support.files import replacing, writing

PLOTS_SHARE = 3  # plots take the third part of the width
LONGEST_GIF = 3000  # pictures, which are held in memory
PALETTE_SAMPLES = 6  # pictures from which a GIF takes its colours

Pixels = NDArray[np.uint8]
Paint = Callable[[float], Image.Image]
Progress = Callable[[float], None]


def draw_runs(runs: Mapping[str, Run], settings: RenderSettings, progress: Progress | None = None) -> float:
    """Draw the runs of a log into `settings.out`; returns the time [s] of a still, or how much a video shows.

    `progress` gets the simulated seconds that each picture adds. Raises InputError for a time outside the
    run, a GIF too long, no OpenGL, no encoder, or a place that cannot be written.
    """
    timeline = timeline_of(runs)
    times = _times(timeline, settings)
    if settings.ending == ".mp4":
        check_encoder()
    check_engine()
    from cranectl.render.scene import renderer  # imports the engine

    strip = settings.width // PLOTS_SHARE if settings.plots else 0
    with (
        writing(settings.out),
        renderer(timeline, settings.camera, settings.width - strip, settings.height) as scene,
        replacing(settings.out) as part,
    ):
        paint = _painted(timeline, scene.draw, settings, strip)
        pictures = _pictures(paint, times, progress)
        if settings.ending == ".png":
            write_png(part, next(pictures))
        elif settings.ending == ".gif":
            samples = [paint(time) for time in np.linspace(0.0, timeline.duration, PALETTE_SAMPLES)]
            write_gif(part, pictures, len(times), settings.fps, samples)
        else:
            write_mp4(part, pictures, settings.fps, (settings.width, settings.height))
    return float(times[-1])


def _painted(
    timeline: Timeline, draw: Callable[[float], Pixels], settings: RenderSettings, strip: int
) -> Paint:
    """What paints the picture at a time [s]; plots take `strip` pixels at its right."""
    width, height = settings.width - strip, settings.height
    caption = Caption(timeline, width, height)
    plots = Plots(timeline, strip, height) if strip else None

    def paint(time: float) -> Image.Image:
        picture = Image.fromarray(draw(time))
        caption.draw(picture, time)
        if plots is None:
            return picture
        whole = Image.new("RGB", (settings.width, height))
        whole.paste(picture)
        plots.draw(whole, width, time)
        return whole

    return paint


def _times(timeline: Timeline, settings: RenderSettings) -> Array:
    """When the pictures are [s]."""
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
