"""The style of figures: drawn for a page in light or dark colours, or saved as files.

A figure is drawn in stand-in colours, one for each role. In the SVG they become CSS variables of the page.
The SVG also tells the page's script where the axes over time are, what they measure and their curves.
"""

import io
import json
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from html import escape
from pathlib import Path
from typing import Any, ClassVar
from zlib import crc32

import matplotlib
from cycler import cycler
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from cranectl.support import File, InputError, Palette


class Chart:
    """How figures are drawn: sizes, colours, canvas, and how they become elements of a page or files."""

    WIDTH = 6.4  # [in] of most figures
    LETTER = 5.2  # [pt], mean width of the letters of labels
    SERIES = Palette.LIGHT.series_roles
    STAND_IN: ClassVar = {role: f"#0f1e{k:02x}" for k, role in enumerate(Palette.LIGHT)}
    SUBSCRIPT = re.compile(r"\b([^\W\d_])_([^\W\d_]{1,2}\d?)\b")  # a symbol with its subscript: x_c
    TIME = "time [s]"  # label of the axes that readers can enlarge

    @staticmethod
    def canvas(width: float, height: float, *shape: int, **more: Any) -> tuple[Figure, Any]:
        """Return a figure of this size [in] and its axes, as `Figure.subplots` makes them."""
        figure = Figure(figsize=(width, height), layout="constrained")
        return figure, figure.subplots(*shape, **more)

    @staticmethod
    @contextmanager
    def styled() -> Iterator[None]:
        """Draw in the page's style: make the figure and its `inline_svg` inside this context."""
        with matplotlib.rc_context(_STYLE):
            yield

    @staticmethod
    def spaced(handles: Iterable[Artist]) -> float:
        """Return the space between columns of a legend, in letters; labels of small pages are 30 % longer."""
        return max(3.0, 1.0 + 0.17 * max(len(str(handle.get_label())) for handle in handles))

    @staticmethod
    def make_room(figure: Figure, labels: Iterable[str]) -> None:
        """Leave room on the left for labels of rows; those of small pages are 30 % longer."""
        engine, longest = figure.get_layout_engine(), max(map(len, labels), default=0)
        if isinstance(engine, ConstrainedLayoutEngine):
            left = 0.3 * longest * Chart.LETTER / (72.0 * figure.get_figwidth())
            engine.set(rect=(left, 0.0, 1.0 - left, 1.0))

    @staticmethod
    def label_log_axis(axes: Axes) -> None:
        """Label few places of a logarithmic x-axis, also where it spans less than a decade."""
        low, high = axes.get_xlim()
        subs = (1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)
        short = high < 10.0 * low
        axes.xaxis.set_major_locator(MaxNLocator(3) if short else LogLocator(subs=subs, numticks=6))
        axes.xaxis.set_major_formatter("{x:.3g}")
        axes.xaxis.set_minor_formatter(NullFormatter())

    @staticmethod
    def css_variables(dark: bool) -> str:
        """Return the values of the roles as CSS declarations."""
        palette = Palette.DARK if dark else Palette.LIGHT
        return " ".join(f"--{role}: {colour};" for role, colour in palette.items())

    @staticmethod
    def inline_svg(figure: Figure) -> str:
        """Return `figure` as an `<svg>` element for a page, with ids that no other figure has."""
        file = io.StringIO()
        _name_parts(figure)
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
        text = re.sub(r'<g id="[xy]tick_\d+">', '<g class="tick">', file.getvalue())
        text = re.sub(r'<g id="part-(\w+)">', r'<g data-part="\1">', text)
        text = re.sub(r'<g id="[^"]*">', "<g>", text)
        text = text[text.index("<svg") :]
        text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
        text = re.sub(r' (?:width|height)="[\d.]+pt"', "", text, count=2)
        text = re.sub(r'(id="|url\(#|href="#)', rf"\g<1>f{crc32(text.encode()):08x}-", text)
        text = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d\d)\d+", r"\1", path[0]), text)
        size = r"font-size: calc(\1px * var(--text))"
        text = re.sub(r"font-size: ([\d.]+)px; font-family: [^;\"]*", size, text)
        text = re.sub(r"<text.*?</text>", lambda words: Chart.SUBSCRIPT.sub(_LOWERED, words[0]), text)
        plots, width = _describe_axes(figure), f"--wide: {72.0 * figure.get_figwidth():g}"
        data = f' data-plots="{escape(plots, quote=True)}"' if plots else ""
        text = text.replace("<svg", f'<svg style="{width}"{data}', 1)
        for role, colour in Chart.STAND_IN.items():
            text = text.replace(colour, f"var(--{role})")
        return text.strip()

    @staticmethod
    def standalone_svg(svg: str) -> str:
        """Return the `<svg>` element of a page as the text of a file, in the colours of light pages."""
        text = re.sub(r"calc\(([\d.]+px) \* var\(--text\)\)", r"\1", svg)
        while _VARIABLE.search(text):  # one may be the fallback of another
            text = _VARIABLE.sub(lambda found: Palette.LIGHT.get(found[1]) or found[2] or "none", text)
        text = re.sub(r' data-(?:plots|part)="[^"]*"', "", text)
        root, *rest = re.split("(?<=>)", text, maxsplit=1)
        width, height = re.findall(r"[-\d.]+", root.partition("viewBox=")[2])[2:4]
        style = (
            f"color: {Palette.LIGHT['ink']}; background: #ffffff; "
            "font-family: 'DejaVu Sans', Verdana, sans-serif"
        )
        root = re.sub(r' style="[^"]*"', "", root)
        root = root.replace("<svg", f'<svg width="{width}" height="{height}" style="{style}"', 1)
        return f"{root}{''.join(rest)}\n"

    @staticmethod
    def save(figure: Figure, path: Path) -> None:
        """Draw to `path` in the format of its suffix; raise InputError if that fails."""
        kind = path.suffix.lower()
        try:
            # No date and no random identifiers: the same figure, the same bytes.
            with matplotlib.rc_context({"svg.hashsalt": "cranectl"}), File(path).replacing() as part:
                figure.savefig(part, format=kind[1:] or None, metadata=UNDATED.get(kind))
        except (OSError, ValueError) as error:
            raise InputError(
                f"cannot draw to {path}: {error}",
                allowed="a .svg, .pdf or .png file in an existing directory",
                remedy="choose another file with --plot",
            ) from None


UNDATED: dict[str, dict[str, Any]] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}

_STYLE: dict[Any, Any] = {
    "axes.edgecolor": Chart.STAND_IN["muted"],
    "axes.facecolor": "none",
    "axes.grid": True,
    "axes.labelcolor": Chart.STAND_IN["ink"],
    "axes.labelpad": 11.0,  # room for the larger letters of small pages
    "axes.linewidth": 0.6,
    "axes.prop_cycle": cycler(color=[Chart.STAND_IN[role] for role in Chart.SERIES]),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 9,
    "figure.constrained_layout.w_pad": 0.1,
    "figure.facecolor": "none",
    "font.size": 8.5,
    "grid.color": Chart.STAND_IN["grid"],
    "grid.linewidth": 0.5,
    "legend.columnspacing": 3.0,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "path.simplify_threshold": 0.02,
    "savefig.transparent": True,
    "svg.fonttype": "none",
    "svg.hashsalt": "cranectl",
    "text.color": Chart.STAND_IN["ink"],
    "xtick.color": Chart.STAND_IN["muted"],
    "xtick.labelcolor": Chart.STAND_IN["ink"],
    "ytick.color": Chart.STAND_IN["muted"],
    "ytick.labelcolor": Chart.STAND_IN["ink"],
}


_VARIABLE = re.compile(r"var\(--([\w-]+)(?:, ([^()]*))?\)")


_LOWERED = r'\1<tspan dy=".25em" font-size="75%">\2</tspan><tspan dy="-.19em">&#8203;</tspan>'


def _time_axes(figure: Figure) -> list[Axes]:
    """Return the axes of `figure` over time; of axes that share an x-axis only one has its label."""
    shared = ((axes, axes.get_shared_x_axes().get_siblings(axes)) for axes in figure.axes)
    labels = ((axes, [sibling.get_xlabel() for sibling in siblings]) for axes, siblings in shared)
    return [axes for axes, texts in labels if next(filter(None, texts), "") == Chart.TIME]


def _name_parts(figure: Figure) -> None:
    """Give ids to what the page's script moves, before drawing; `inline_svg` makes them `data-part`s."""
    for k, axes in enumerate(_time_axes(figure)):
        axes.set_gid(f"part-axes{k}")
        axes.xaxis.set_gid("part-x")
        axes.yaxis.set_gid("part-y")
        axes.yaxis.get_offset_text().set_gid("part-offset")
        for line in _named(axes):
            line.set_gid("part-curve")
        for text in axes.texts:
            text.set_gid("part-event")


def _describe_axes(figure: Figure) -> str:
    """Describe the axes over time, once drawn, as JSON: box [points], ranges, scale, unit, labels."""
    width, height = (72.0 * inches for inches in figure.get_size_inches())
    plots = []
    for axes in _time_axes(figure):
        left, bottom, right, top = axes.get_position().extents
        box = (left * width, (1.0 - top) * height, right * width, (1.0 - bottom) * height)
        plot: dict[str, Any] = {"box": [round(side, 3) for side in box]}
        plot |= {"x": axes.get_xlim(), "y": axes.get_ylim(), "log": axes.get_yscale() == "log"}
        plot["unit"] = axes.get_ylabel().partition("[")[2].rstrip("]")
        plots.append(plot | {"labels": [line.get_label() for line in _named(axes)]})
    return json.dumps(plots, ensure_ascii=False) if plots else ""


def _named(axes: Axes) -> list[Any]:
    """Return the curves that have a label, in the order in which they are drawn."""
    lines = [line for line in axes.lines if not str(line.get_label()).startswith("_")]
    return sorted(lines, key=lambda line: line.zorder)
