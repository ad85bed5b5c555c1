"""From the runs of a log to a file of whole pictures: the scene, its caption, the plots beside it."""

import contextlib
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from cranectl.render.caption import Caption
from cranectl.render.opengl import check_engine
from cranectl.render.plots import Plots
from cranectl.render.scene import stage
from cranectl.render.settings import RenderSettings
from cranectl.render.timeline import Array, Film, film_of
from cranectl.render.video import check_encoder, write_gif, write_mp4, write_png
from cranectl.simulate import Run
from cranectl.support.errors import InputError
from cranectl.support.files import replacing, writing

PLOTS_SHARE = 3  # plots take the third part of the width


@contextlib.contextmanager
def painter(film: Film, settings: RenderSettings) -> Iterator[Callable[[float], Image.Image]]:
    """What paints the picture at a time [s] of a film; raises InputError without OpenGL."""
    strip = settings.width // PLOTS_SHARE if settings.plots else 0
    width, height = settings.width - strip, settings.height
    with stage(film, settings.camera, width, height) as scene:
        caption = Caption(film, width, height)
        plots = Plots(film, strip, height) if settings.plots else None

        def paint(time: float) -> Image.Image:
            picture = Image.fromarray(scene.draw(time))
            caption.draw(picture, time)
            if plots is None:
                return picture
            whole = Image.new("RGB", (settings.width, height))
            whole.paste(picture)
            plots.draw(whole, width, time)
            return whole

        yield paint


if TYPE_CHECKING:
    from PIL import Image

LONGEST_GIF = 3000  # pictures, which are held in memory
PALETTE_SAMPLES = 6  # pictures from which a GIF takes its colours

Progress = Callable[[float], None]
Paint = Callable[[float], "Image.Image"]


def draw_runs(runs: Mapping[str, Run], settings: RenderSettings, progress: Progress | None = None) -> float:
    """Draw the runs of a log into `settings.out`; returns the time [s] of a still, or how much a video shows.

    `progress` gets the simulated seconds that each picture adds. Raises InputError for a time outside the
    run, a GIF too long, no OpenGL, no encoder, or a place that cannot be written.
    """
    film = film_of(runs)
    times = _times(film, settings)
    if settings.out.suffix.lower() == ".mp4":
        check_encoder()
    check_engine()
    from cranectl.render.draw import painter

    with writing(settings.out), painter(film, settings) as paint, replacing(settings.out) as part:
        pictures = _pictures(paint, times, progress)
        if settings.still:
            write_png(part, next(pictures))
        elif settings.out.suffix.lower() == ".gif":
            samples = [paint(film.duration * k / (PALETTE_SAMPLES - 1)) for k in range(PALETTE_SAMPLES)]
            write_gif(part, pictures, len(times), settings.fps, samples)
        else:
            write_mp4(part, pictures, settings.fps, (settings.width, settings.height))
    return float(times[-1])


def _times(film: Film, settings: RenderSettings) -> Array:
    """When the pictures are [s]."""
    if not settings.still:
        times = film.times(settings.fps, settings.speed)
        if settings.out.suffix.lower() == ".gif" and len(times) > LONGEST_GIF:
            raise InputError(
                f"a GIF of {len(times)} pictures",
                allowed=f"up to {LONGEST_GIF}",
                remedy="choose a higher --speed or a lower --fps, or an .mp4",
            )
        return times
    time = film.worst_time if settings.time is None else settings.time
    if not 0.0 <= time <= film.duration:
        raise InputError(
            f"--time {time:g} is outside the run",
            allowed=f"0 to {film.duration:g} s",
            remedy="leave out --time to see the load farthest from its reference",
        )
    return np.array([time])


def _pictures(paint: Paint, times: Array, progress: Progress | None) -> Iterator["Image.Image"]:
    shown = 0.0
    for time in times.tolist():
        yield paint(time)
        if progress is not None:
            progress(time - shown)
        shown = time
