"""How the gallery looks: the style of its figures, and the part of a figure that its thumbnail shows.

Sphinx calls both; docs/conf.py names them, and docs/build.py lets it find this file.
"""

from pathlib import Path
from typing import Any

import matplotlib
from cycler import cycler
from PIL import Image

from cranectl.support import Palette

THUMBNAIL = (400, 280)  # [pixels]
# What a thumbnail shows of its figure, as shares of width and height: left, top, right, bottom. Cranes and
# curves fill it, since no label can be read at its size.
SHOWN = {
    "01_own_crane": (0.02, 0.15, 0.64, 0.92),
    "02_ship_to_shore": (0.01, 0.14, 0.46, 0.94),
    "03_cart_pendulum": (0.02, 0.17, 0.64, 0.97),
    "04_thesis": (0.0, 0.0, 1.0, 0.54),
    "05_over_a_wall": (0.24, 0.04, 0.76, 0.94),
    "06_python_controller": (0.04, 0.0, 0.8, 1.0),
    "07_c_controller": (0.04, 0.0, 0.8, 1.0),
    "08_campaign": (0.0, 0.0, 0.62, 1.0),
    "09_certificate": (0.0, 0.16, 0.5, 0.8),
    "10_ladder": (0.0, 0.0, 0.76, 1.0),
    "11_benchmark": (0.0, 0.08, 0.52, 1.0),
    "12_live": (0.04, 0.0, 0.8, 1.0),
}
STYLE: dict[str, Any] = {
    "axes.edgecolor": Palette.LIGHT["muted"],
    "axes.grid": True,
    "axes.labelcolor": Palette.LIGHT["ink"],
    "axes.axisbelow": True,
    "axes.prop_cycle": cycler(color=Palette.LIGHT.series),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 12,
    "figure.titlesize": 13,
    "font.size": 11.5,
    "grid.color": Palette.LIGHT["grid"],
    "legend.frameon": False,
    "lines.linewidth": 2.0,
    "text.color": Palette.LIGHT["ink"],
    "xtick.color": Palette.LIGHT["muted"],
    "xtick.labelcolor": Palette.LIGHT["ink"],
    "ytick.color": Palette.LIGHT["muted"],
    "ytick.labelcolor": Palette.LIGHT["ink"],
}


def set_style(_gallery: dict[str, Any], _example: str) -> None:
    """Draw the figures of the next example in the style of cranectl's reports."""
    matplotlib.rcParams.update(STYLE)


def crop_thumbnails(app: Any) -> None:
    """Draw the thumbnails anew from the part of each example's first figure that tells most."""
    pictures = Path(app.srcdir) / "examples" / "images"
    for path in sorted((pictures / "thumb").glob("sphx_glr_*_thumb.png")):
        example = path.stem.removeprefix("sphx_glr_").removesuffix("_thumb")
        figure = pictures / f"sphx_glr_{example}_001.png"
        if figure.exists():  # not if the examples are not run
            thumbnail(Image.open(figure).convert("RGB"), SHOWN.get(example)).save(path, optimize=True)


def thumbnail(figure: Image.Image, shown: tuple[float, float, float, float] | None = None) -> Image.Image:
    """Return the part `shown` of a figure, by default all of it, as large as fits into a thumbnail."""
    (width, height), (left, top, right, bottom) = figure.size, shown or (0.0, 0.0, 1.0, 1.0)
    box = round(left * width), round(top * height), round(right * width), round(bottom * height)
    part = figure.crop(box)
    part.thumbnail(THUMBNAIL, Image.Resampling.LANCZOS)
    whole = Image.new("RGB", THUMBNAIL, "white")
    whole.paste(part, ((THUMBNAIL[0] - part.width) // 2, (THUMBNAIL[1] - part.height) // 2))
    return whole
