"""Whole pictures: the scene, its caption, the plots beside it."""

import contextlib
from collections.abc import Callable, Iterator

from PIL import Image

from cranectl.render.caption import Caption
from cranectl.render.film import Film
from cranectl.render.plots import Plots
from cranectl.render.scene import stage
from cranectl.render.settings import RenderSettings

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
