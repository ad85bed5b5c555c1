"""What a page says to its script of figures over time: where axes are, what they measure, their curves."""

import json
import re
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

TIME = "time [s]"  # label of an axis that pages enlarge


def time_axes(figure: Figure) -> list[Axes]:
    """The axes of `figure` over time."""

    def label(axes: Axes) -> str:
        return next(filter(None, (each.get_xlabel() for each in _beside(axes))), "")

    return [axes for axes in figure.axes if label(axes) == TIME]


def _beside(axes: Axes) -> list[Axes]:
    """The axes that share the x-axis of these."""
    siblings: list[Axes] = axes.get_shared_x_axes().get_siblings(axes)
    return siblings


def name_parts(figure: Figure) -> None:
    """Give ids to what the script moves, by which the SVG's groups become `data-part`s; before drawing."""
    for k, axes in enumerate(time_axes(figure)):
        axes.set_gid(f"part-axes{k}")
        axes.xaxis.set_gid("part-x")
        axes.yaxis.set_gid("part-y")
        axes.yaxis.get_offset_text().set_gid("part-offset")
        for line in _named(axes):
            line.set_gid("part-curve")
        for text in axes.texts:
            text.set_gid("part-event")


def marked(svg: str) -> str:
    """The groups of an SVG by part and as ticks, without all other ids."""
    svg = re.sub(r'<g id="[xy]tick_\d+">', '<g class="tick">', svg)
    svg = re.sub(r'<g id="part-(\w+)">', r'<g data-part="\1">', svg)
    return re.sub(r'<g id="[^"]*">', "<g>", svg)


def told(figure: Figure) -> str:
    """Of each axes over time its box [points from the top left], ranges, scale, unit, labels; once drawn."""
    width, height = (72.0 * inches for inches in figure.get_size_inches())
    plots = []
    for axes in time_axes(figure):
        left, bottom, right, top = axes.get_position().extents
        box = (left * width, (1.0 - top) * height, right * width, (1.0 - bottom) * height)
        plots.append(
            {
                "box": [round(side, 3) for side in box],
                "x": axes.get_xlim(),
                "y": axes.get_ylim(),
                "log": axes.get_yscale() == "log",
                "unit": axes.get_ylabel().partition("[")[2].rstrip("]"),
                "labels": [line.get_label() for line in _named(axes)],
            }
        )
    return json.dumps(plots, ensure_ascii=False) if plots else ""


def _named(axes: Axes) -> list[Any]:
    """The curves that have a label, as they are drawn, those below first."""
    return sorted(
        (line for line in axes.lines if not str(line.get_label()).startswith("_")),
        key=lambda line: line.zorder,
    )
