"""Colours that follow the reader's light or dark scheme, figures as inline SVG that use them, or as files.

A figure is drawn in stand-in colours, one for each role; in the SVG they become CSS variables of the page.
"""

import io
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from html import escape
from pathlib import Path
from typing import Any
from zlib import crc32

import matplotlib
from cycler import cycler
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from cranectl.report.time_axes import marked, name_parts, told
from cranectl.support.colours import COLOURS
from cranectl.support.errors import InputError
from cranectl.support.files import replacing

SERIES = tuple(role for role in COLOURS if role.startswith("series"))
STAND_IN = {role: f"#0f1e{k:02x}" for k, role in enumerate(COLOURS)}
UNDATED: dict[str, dict[str, Any]] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}

_STYLE: dict[Any, Any] = {
    "axes.edgecolor": STAND_IN["muted"],
    "axes.facecolor": "none",
    "axes.grid": True,
    "axes.labelcolor": STAND_IN["ink"],
    "axes.labelpad": 11.0,  # and wide legends: small pages have larger letters
    "axes.linewidth": 0.6,
    "axes.prop_cycle": cycler(color=[STAND_IN[role] for role in SERIES]),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 9,
    "figure.constrained_layout.w_pad": 0.1,
    "figure.facecolor": "none",
    "font.size": 8.5,
    "grid.color": STAND_IN["grid"],
    "grid.linewidth": 0.5,
    "legend.columnspacing": 3.0,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "path.simplify_threshold": 0.02,
    "savefig.transparent": True,
    "svg.fonttype": "none",
    "svg.hashsalt": "cranectl",
    "text.color": STAND_IN["ink"],
    "xtick.color": STAND_IN["muted"],
    "xtick.labelcolor": STAND_IN["ink"],
    "ytick.color": STAND_IN["muted"],
    "ytick.labelcolor": STAND_IN["ink"],
}


@contextmanager
def styled() -> Iterator[None]:
    """Draw in the page's style; everything from making a figure to `inline_svg` belongs inside."""
    with matplotlib.rc_context(_STYLE):
        yield


def spaced(handles: Iterable[Artist]) -> float:
    """Columns of a legend apart, in letters: on small pages labels are longer by three tenths."""
    return max(3.0, 1.0 + 0.17 * max(len(str(handle.get_label())) for handle in handles))


def css_variables(dark: bool) -> str:
    """The roles' values as CSS declarations."""
    return " ".join(f"--{role}: {pair[dark]};" for role, pair in COLOURS.items())


def inline_svg(figure: Figure) -> str:
    """`figure` as an `<svg>` element for a page, its ids kept apart from those of others."""
    file = io.StringIO()
    name_parts(figure)
    figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    text = marked(file.getvalue())
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r' (?:width|height)="[\d.]+pt"', "", text, count=2)
    text = re.sub(r'(id="|url\(#|href="#)', rf"\g<1>f{crc32(text.encode()):08x}-", text)
    text = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d\d)\d+", r"\1", path[0]), text)
    text = re.sub(
        r"font-size: ([\d.]+)px; font-family: [^;\"]*", r"font-size: calc(\1px * var(--text))", text
    )
    text = re.sub(r"<text.*?</text>", lambda words: SUBSCRIPT.sub(_LOWERED, words[0]), text)
    plots, width = told(figure), f"--wide: {72.0 * figure.get_figwidth():g}"
    data = f' data-plots="{escape(plots, quote=True)}"' if plots else ""
    text = text.replace("<svg", f'<svg style="{width}"{data}', 1)
    for role, colour in STAND_IN.items():
        text = text.replace(colour, f"var(--{role})")
    return text.strip()


SUBSCRIPT = re.compile(r"\b([^\W\d_])_([^\W\d_]{1,2}\d?)\b")  # of a symbol: x_c
_LOWERED = r'\1<tspan dy=".25em" font-size="75%">\2</tspan><tspan dy="-.19em">&#8203;</tspan>'


def save_figure(figure: Figure, path: Path) -> None:
    """Draw to `path`, format by its suffix; raises InputError if that cannot be done."""
    kind = path.suffix.lower()
    try:
        # No date and no random identifiers: the same figure, the same bytes.
        with matplotlib.rc_context({"svg.hashsalt": "cranectl"}), replacing(path) as part:
            figure.savefig(part, format=kind[1:] or None, metadata=UNDATED.get(kind))
    except (OSError, ValueError) as error:
        raise InputError(
            f"cannot draw to {path}: {error}",
            allowed="a .svg, .pdf or .png file in an existing directory",
            remedy="choose another file with --plot",
        ) from None
