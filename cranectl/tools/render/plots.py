"""Plots beside the picture: drawn once by Matplotlib, with a cursor that moves from picture to picture."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image, ImageDraw

from cranectl.metrics import NEARLY_SLACK
from cranectl.support import Array, Palette, Quantity
from cranectl.tools.render.timeline import Timeline, Track

DPI = 100.0
REFERENCE_SIZE = (480.0, 720.0)  # [px], at scale 1
MIN_LETTER_SCALE = 0.8  # at which letters are legible
PADDING = 0.09  # [in]
HEADROOM = 0.22  # of a panel's height, for two rows of names of disturbances
NAME_WIDTH = 0.3  # of the time axis, that the name of a disturbance takes
MIN_DISTANCE = 1e-14  # [m] on a logarithmic axis; smaller distances are rounding
_STYLE: dict[Any, Any] = {
    "axes.edgecolor": Palette.LIGHT["muted"],
    "axes.grid": True,
    "axes.labelcolor": Palette.LIGHT["ink"],
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlecolor": Palette.LIGHT["ink"],
    "axes.titlelocation": "left",
    "axes.titlesize": 9.5,
    "figure.constrained_layout.h_pad": PADDING,
    "figure.constrained_layout.w_pad": PADDING,
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "grid.color": Palette.LIGHT["grid"],
    "grid.linewidth": 0.6,
    "lines.solid_capstyle": "round",
    "xtick.color": Palette.LIGHT["muted"],
    "ytick.color": Palette.LIGHT["muted"],
    "xtick.labelcolor": Palette.LIGHT["muted"],
    "ytick.labelcolor": Palette.LIGHT["muted"],
}


@dataclass(frozen=True)
class Curve:
    """One line of times [s] and values, both (N,)."""

    colour: str
    time: Array
    values: Array
    is_wide: bool = False  # and pale, below the others: a ghost
    is_dashed: bool = False


@dataclass(frozen=True)
class Panel:
    """One diagram, which shows at least the range `shown`."""

    title: str
    curves: list[Curve]
    shown: tuple[float, float]
    limit: float | None = None
    is_logarithmic: bool = False


class Plots:
    """The strip of diagrams of one timeline, with a cursor."""

    def __init__(self, timeline: Timeline, width: int, height: int) -> None:
        scale = max(min(width / REFERENCE_SIZE[0], height / REFERENCE_SIZE[1]), MIN_LETTER_SCALE)
        self._dot, self._cursor = 4.0 * scale, max(1, round(scale))  # [px]
        with rc_context(_STYLE):
            size = (width / DPI / scale, height / DPI / scale)
            figure = Figure(size, dpi=DPI * scale, layout="constrained")
            canvas: Any = FigureCanvasAgg(figure)
            panels = _panels(timeline)
            self._drawn = list(zip(panels, figure.subplots(len(panels), 1, sharex=True), strict=True))
            for panel, axes in self._drawn:
                _draw(axes, panel)
                _mark_disturbances(axes, timeline, named=panel is panels[0])
                axes.set_xlim(0.0, timeline.duration or 1.0)
            self._drawn[-1][1].set_xlabel("time [s]")
            canvas.draw()
        # Matplotlib may round to another size.
        self._background = Image.new("RGB", (width, height), "white")
        self._background.paste(Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3]))

    def draw(self, picture: Image.Image, left: int, time: float) -> None:
        """Draw the strip into `picture`, from `left` on, at `time` [s]."""
        strip = self._background.copy()
        pen = ImageDraw.Draw(strip)
        for panel, axes in self._drawn:
            bottom, top = strip.height - axes.bbox.y0, strip.height - axes.bbox.y1
            x = round(float(axes.transData.transform((time, panel.shown[1]))[0]))
            pen.line((x, top, x, bottom), fill=Palette.LIGHT["ink"], width=self._cursor)
            for curve in panel.curves:
                if curve.is_wide:
                    continue
                row = int(np.argmin(np.abs(curve.time - time)))
                x_value, y_value = axes.transData.transform((curve.time[row], curve.values[row]))
                _dot(strip, (x_value, strip.height - y_value), self._dot, curve.colour)
        picture.paste(strip, (left, 0))


def _panels(timeline: Timeline) -> list[Panel]:
    weight = timeline.main.run.scenario.rig.weight
    alpha = _curves(timeline, lambda track: np.degrees(track.run.signal("state.alpha")))
    beta = _curves(timeline, lambda track: np.degrees(track.run.signal("state.beta")), is_dashed=True)
    panels = [Panel("rope angles α, β (dashed) [°]", alpha + beta, (-1.0, 1.0))]
    if all(track.run.has_reference for track in timeline.tracks):
        error = _curves(timeline, lambda track: track.error)
        panels.insert(0, _scaled_panel("load off its reference [{}]", "m", error, (0.0, 1e-3)))
    if all(track.run.has_tension for track in timeline.tracks):
        tension, range_n = _curves(timeline, lambda track: track.run.tension), (0.0, 1.1 * weight)
        title = "rope tension [{}], red: nearly slack"
        panels.append(_scaled_panel(title, "N", tension, range_n, NEARLY_SLACK * weight))
    if timeline.distances:
        ghosts = [track for track in timeline.tracks if track.is_ghost]
        one_colour_each = timeline.by_label or len(ghosts) > 1
        curves = [
            Curve(ghost.colour if one_colour_each else Palette.LIGHT["ink"], time, far.clip(MIN_DISTANCE))
            for ghost, (time, far) in zip(ghosts, timeline.distances, strict=True)
        ]
        title = f"distance from {timeline.main.label} [m]" if one_colour_each else "plants apart [m]"
        panels.append(Panel(title, curves, (MIN_DISTANCE, 1e-6), is_logarithmic=True))
    return panels


def _scaled_panel(
    title: str, unit: str, curves: list[Curve], shown: tuple[float, float], limit: float | None = None
) -> Panel:
    """Return a panel in the unit that suits its largest value."""
    largest = max(shown[1], *(float(curve.values.max()) for curve in curves))
    factor, prefixed = Quantity(largest, unit).scale()
    curves = [replace(curve, values=factor * curve.values) for curve in curves]
    low, high = shown
    return Panel(title.format(prefixed), curves, (factor * low, factor * high), limit and factor * limit)


def _curves(timeline: Timeline, values: Callable[[Track], Array], *, is_dashed: bool = False) -> list[Curve]:
    """Return one curve per run, ghosts first, which are wide except in overlays."""
    tracks = sorted(timeline.tracks, key=lambda track: not track.is_ghost)
    is_wide = not timeline.by_label
    return [
        Curve(track.colour, track.run.time, values(track), is_wide and track.is_ghost, is_dashed)
        for track in tracks
    ]


def _draw(axes: Axes, panel: Panel) -> None:
    if panel.is_logarithmic:
        axes.set_yscale("log")
    if panel.limit is not None:
        axes.axhline(panel.limit, color=Palette.LIGHT["limit"], linewidth=0.9, linestyle=(0, (2, 2)))
    for curve in panel.curves:
        width, opacity = (4.5, 0.35) if curve.is_wide else (1.3, 1.0)
        style: dict[str, Any] = {"linestyle": (0, (4, 2)) if curve.is_dashed else "-", "alpha": opacity}
        axes.plot(curve.time, curve.values, color=curve.colour, linewidth=width, **style)
    low, high = min(axes.get_ylim()[0], panel.shown[0]), max(axes.get_ylim()[1], panel.shown[1])
    axes.set_ylim(low, high if panel.is_logarithmic else high + HEADROOM * (high - low))
    axes.set_title(panel.title)


def _mark_disturbances(axes: Axes, timeline: Timeline, *, named: bool) -> None:
    line: dict[str, Any] = {"color": Palette.LIGHT["series-4"], "linewidth": 0.9}
    names, above = {"alpha": "disturbance on α", "beta": "disturbance on β"}, axes.get_xaxis_transform()
    ends = [-np.inf, -np.inf]  # of the last names in both rows [s]
    for disturbance in sorted(timeline.main.run.scenario.disturbances, key=lambda step: step.start):
        if disturbance.start > timeline.duration:  # a name outside the diagram would leave no room for it
            continue
        axes.axvline(disturbance.start, **line)
        if disturbance.end is not None:
            axes.axvline(disturbance.end, linestyle=(0, (2, 2)), **line)
        if named:
            name, anchor = names.get(disturbance.joint or "", "force on load"), (disturbance.start, 1.0)
            row = 0 if ends[0] <= disturbance.start else 1
            if ends[row] <= disturbance.start:  # a third name at one time has no room, but its line
                ends[row] = disturbance.start + NAME_WIDTH * timeline.duration
                place, colour = (3.0, -9.0 - 10.0 * row), Palette.LIGHT["series-4"]
                axes.annotate(name, anchor, place, above, "offset points", color=colour)


def _dot(strip: Image.Image, centre: tuple[float, float], radius: float, colour: str) -> None:
    """Draw a smooth dot with a white rim, since Pillow's own circles have hard edges."""
    half = int(radius) + 2
    large = Image.new("L", (8 * half, 8 * half))
    x, y = (round(value) for value in centre)
    for size, fill in ((radius + 1.5, "white"), (radius, colour)):
        large.paste(0, (0, 0, *large.size))
        ImageDraw.Draw(large).circle((4 * half, 4 * half), 4 * size, fill=255)
        mask = large.resize((2 * half, 2 * half), Image.Resampling.BOX)
        strip.paste(fill, (x - half, y - half), mask)
