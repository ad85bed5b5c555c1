"""Figures of runs: the curves of each family of figures, and how to draw them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle, zip_longest
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cranectl.plants import PLANTS
from cranectl.report.theme import Chart
from cranectl.signals import SignalGroup
from cranectl.simulate import Run
from cranectl.support import Array

Values = Callable[[Run], Array]

DEGREES = 180.0 / np.pi
# The least span of a curve, by unit, that is more than rounding. Rounding moves loads at rest by 1e-12 m, and
# inputs by 2e-12 m/s² and 4e-11 m/s⁴. Differences between plants begin at 1e-9 m.
MIN_SPAN = {"m": 1e-11, "mm": 1e-8, "°": 1e-9, "m/s²": 1e-11, "m/s⁴": 1e-10}


@dataclass(frozen=True)
class RunCurve:
    """One run in a figure. Runs of one label share a colour; wide curves lie pale under the others."""

    label: str
    colour: str  # a role of the theme
    run: Run
    wide: bool
    dash: Any = "-"  # line style of matplotlib, different for each wide curve


@dataclass(frozen=True)
class RunPanel:
    """One quantity."""

    label: str
    values: Values
    reference: Values | None = None
    limits: Callable[[Run], Array] | None = None  # (low, high)

    @property
    def unit(self) -> str:
        """The unit in the label."""
        return self.label.partition("[")[2].rstrip("]")


@dataclass(frozen=True)
class Family:
    """A kind of figure; sentences about the whole figure use the unit of its first panel."""

    name: str
    title: str
    panels: tuple[RunPanel, ...]
    draw: Callable[["Family", Sequence[RunCurve]], Figure]
    group: str = "state"  # of signals that a run must have for this figure

    ALL: ClassVar[dict[str, "Family"]]  # by name

    @staticmethod
    def of(runs: Sequence[Run]) -> "list[Family]":
        """Return the families of figures for which all `runs` have the signals; one residual is enough."""
        having = {family.name: [run.has(family.group) for run in runs] for family in Family.ALL.values()}
        return [f for f in Family.ALL.values() if (any if f.group == "residual" else all)(having[f.name])]

    def largest_difference(self, a: Run, b: Run) -> float:
        """Return the largest difference of the curves of two runs, in the figure's unit."""
        n = min(len(a.time_ns), len(b.time_ns))
        return max(float(np.abs(p.values(a)[:n] - p.values(b)[:n]).max()) for p in self.panels)


def distance_figure(pairs: Mapping[str, tuple[Run, Run]], limits: Mapping[str, float]) -> Figure:
    """Draw the distance between the loads of each pair of plants over time, and the named `limits` [m]."""
    figure, axes = Chart.canvas(Chart.WIDTH, 3.2)
    _mark_disturbances(axes, next(iter(pairs.values()))[0], named=True)
    for (label, (a, b)), role in zip(pairs.items(), cycle(Chart.SERIES), strict=False):
        n = min(len(a.time_ns), len(b.time_ns))
        distance = np.linalg.norm(b.load_position[:n] - a.load_position[:n], axis=1)
        axes.semilogy(a.time[:n], distance.clip(min=1e-16), color=Chart.STAND_IN[role], label=label)
    for whose, limit in limits.items():
        axes.axhline(limit, label=f"limit, {whose}", **_LIMIT)
    axes.set(xlabel="time [s]", ylabel="distance [m]", ylim=(1e-13, None))
    axes.margins(x=0.0)
    figure.legend(loc="outside upper center", ncols=3, columnspacing=Chart.spaced(axes.lines))
    return figure


def _over_time(family: Family, curves: Sequence[RunCurve]) -> Figure:
    """Draw panels one below the other."""
    rows = len(family.panels)
    figure, grid = Chart.canvas(Chart.WIDTH, 0.7 + 1.3 * rows, rows, 1, sharex=True, squeeze=False)
    stack = grid[:, 0]
    first, lines = curves[0].run, [*_lines(family, curves)]
    for k, (axes, panel) in enumerate(zip(stack, family.panels, strict=True)):
        _mark_disturbances(axes, first, named=axes is stack[0])
        if panel.limits is not None and _near_limits(panel, curves):
            for limit in panel.limits(first):
                axes.axhline(limit, **_LIMIT)
        for run, values, style in lines:
            axes.plot(run.time, values[k], **style)
        if panel.reference is not None and first.has_reference:
            axes.plot(first.time, panel.reference(first), **_REFERENCE)
        axes.set_ylabel(panel.label)
        axes.margins(x=0.0)
        if (constant := _constant_axis(axes.dataLim.intervaly, panel.unit)) is not None:
            axes.update_datalim([(0.0, end) for end in constant], updatex=False)
    stack[-1].set_xlabel("time [s]")
    _legend(figure, family, curves)
    return figure


def _constant_axis(interval: Array, unit: str) -> tuple[float, float] | None:
    """Return the range of an axis for values within `interval` (2,) that differ by rounding, else None."""
    (low, high), least = interval, MIN_SPAN[unit]
    if not 0.0 <= high - low < least:
        return None
    middle = 0.0 if abs(high) < least else high
    half = 0.05 * (abs(middle) or 1.0)  # as matplotlib draws a constant
    return middle - half, middle + half


def _in_the_plane(family: Family, curves: Sequence[RunCurve]) -> Figure:
    """Draw the second panel over the first, at equal scale, in the outline of the rig."""
    figure, axes = Chart.canvas(Chart.WIDTH, 0.78 * Chart.WIDTH)
    x, y = family.panels
    first = curves[0].run
    if x.limits is not None and y.limits is not None and any(_near_limits(p, curves) for p in (x, y)):
        (x0, x1), (y0, y1) = x.limits(first), y.limits(first)
        rig = [x0, x1, x1, x0, x0], [y0, y0, y1, y1, y0]
        axes.plot(*rig, **_LIMIT)
    _draw_paths(axes, family, curves)
    for curve in (curve for curve in curves if not curve.wide):
        end = x.values(curve.run)[-1:], y.values(curve.run)[-1:]
        axes.plot(*end, color=Chart.STAND_IN[curve.colour], marker="o", markersize=4, zorder=5)
    axes.set(xlabel=x.label, ylabel=y.label)
    across = _constant_axis(axes.dataLim.intervalx, x.unit)
    along = _constant_axis(axes.dataLim.intervaly, y.unit)
    if across is not None and along is not None:
        axes.update_datalim(list(zip(across, along, strict=True)))
    axes.set_aspect("equal", adjustable="datalim")
    _legend(figure, family, curves)
    return figure


def _in_space(family: Family, curves: Sequence[RunCurve]) -> Figure:
    """Draw three panels as a path in space, with the edges of the rig."""
    space = {"projection": "3d", "computed_zorder": False}
    figure, axes = Chart.canvas(Chart.WIDTH, 0.8 * Chart.WIDTH, subplot_kw=space)
    first = curves[0].run
    x, y, rope = first.scenario.rig.workspace
    low, high = np.array([x, y, -rope[::-1]]).T  # where the load can be with a hanging rope
    for k, (axis, panel) in enumerate(zip("xyz", family.panels, strict=True)):
        getattr(axes, f"set_{axis}lim")(low[k], high[k])
        getattr(axes, f"set_{axis}label")(panel.label, labelpad=5.0)
        getattr(axes, f"{axis}axis").set_pane_color((0.0, 0.0, 0.0, 0.0))
    axes.locator_params(nbins=4)
    axes.set_box_aspect(high - low, zoom=0.9)
    axes.view_init(elev=24, azim=-62)
    _draw_paths(axes, family, curves)
    _legend(figure, family, curves)
    return figure


def _draw_paths(axes: Any, family: Family, curves: Sequence[RunCurve]) -> None:
    """Draw panels as coordinates."""
    for _, values, style in _lines(family, curves):
        axes.plot(*values, **style)
    first = curves[0].run
    followed = [panel.reference for panel in family.panels if panel.reference is not None]
    if followed and first.has_reference:
        references = [values(first) for values in followed]
        axes.plot(*references, **_REFERENCE)
        axes.plot(*(values[-1:] for values in references), **_REFERENCE_END)


_LIMIT: dict[str, Any] = {"color": Chart.STAND_IN["limit"], "linewidth": 0.8, "linestyle": (0, (1, 2))}
_REFERENCE: dict[str, Any] = {
    "color": Chart.STAND_IN["reference"], "linewidth": 1.0, "linestyle": (0, (5, 3)), "zorder": 4,
    "label": "reference",
}  # fmt: skip
_REFERENCE_END: dict[str, Any] = {
    "color": Chart.STAND_IN["reference"], "marker": "x", "markersize": 6, "linestyle": "none", "zorder": 6,
}  # fmt: skip


def _lines(family: Family, curves: Sequence[RunCurve]) -> Iterator[tuple[Run, list[Array], dict[str, Any]]]:
    """Yield run, values by panel, and style of each curve, wide ones first."""
    for curve in sorted(curves, key=lambda curve: not curve.wide):
        width, opacity, layer = (4.0, 0.35, 2) if curve.wide else (1.1, 1.0, 3)
        style = {"color": Chart.STAND_IN[curve.colour], "linewidth": width, "alpha": opacity, "zorder": layer}
        style |= {"linestyle": curve.dash, "label": f"{curve.label}, {PLANTS.entry(curve.run.plant).label}"}
        yield curve.run, [panel.values(curve.run) for panel in family.panels], style


def _mark_disturbances(axes: Axes, run: Run, *, named: bool) -> None:
    symbols = {"alpha": "d_α", "beta": "d_β"}
    placement: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points"}
    for step in run.scenario.disturbances:
        for time in (step.start, step.end):
            if time is not None:
                axes.axvline(time, color=Chart.STAND_IN["muted"], linewidth=0.7, linestyle=(0, (2, 2)))
        if named:
            what = f"{symbols[step.joint]} = {step.magnitude:g} rad/s²" if step.joint else str(step)
            axes.annotate(
                what, (step.start, 1.0), (3, 2), color=Chart.STAND_IN["muted"], fontsize=7.5, **placement
            )


def _near_limits(panel: RunPanel, curves: Sequence[RunCurve]) -> bool:
    """Return True if the curves use half of the range between the limits, or leave it."""
    if panel.limits is None:
        return False
    low, high = panel.limits(curves[0].run)
    values = [panel.values(curve.run) for curve in curves]
    bottom, top = min(v.min() for v in values), max(v.max() for v in values)
    return bool(bottom < low or top > high or top - bottom > 0.5 * (high - low))


def _legend(figure: Figure, family: Family, curves: Sequence[RunCurve]) -> None:
    """Add a legend: the labels of colours in a first row, the meaning of lines in a second."""
    colours = [
        Line2D([], [], color=Chart.STAND_IN[colour], linewidth=2.2, label=label)
        for label, colour in {curve.label: curve.colour for curve in curves}.items()
    ]
    lines = []
    for plant, curve in {curve.run.plant: curve for curve in curves}.items():
        width, opacity = (5.0, 0.35) if curve.wide else (1.1, 1.0)
        style = {"linewidth": width, "alpha": opacity, "linestyle": curve.dash}
        lines.append(Line2D([], [], color=Chart.STAND_IN["ink"], label=PLANTS.entry(plant).label, **style))
    if any(panel.reference for panel in family.panels) and curves[0].run.has_reference:
        lines.append(Line2D([], [], **_REFERENCE))
    if any(_near_limits(panel, curves) for panel in family.panels):
        lines.append(Line2D([], [], label="end of the rig", **_LIMIT))
    columns = max(len(colours), len(lines))
    nothing = Line2D([], [], linestyle="none", label=" ")
    # A legend fills column by column.
    handles = [handle for pair in zip_longest(colours, lines, fillvalue=nothing) for handle in pair]
    figure.legend(
        handles=handles, loc="outside upper center", ncols=columns, columnspacing=Chart.spaced(handles)
    )


def _signal(name: str, *, scale: float = 1.0, unit: str = "", **more: Any) -> RunPanel:
    """Return a panel of one recorded signal; label and unit come from the table of signals."""
    group_name, _, signal_name = name.partition(".")
    measured = SignalGroup.measured("", angles=False, load=False)
    groups = (*SignalGroup.recorded(SignalGroup.of_flat_tracker(0)), *measured, SignalGroup.RESIDUAL)
    group = next(group for group in groups if group.name == group_name)
    signal = next(signal for signal in group.signals if signal.name == signal_name)
    label = f"{signal.symbol} [{unit or signal.unit}]"
    return RunPanel(label, lambda run: run.signal(name) * scale, **more)


def _range(axis: int) -> Callable[[Run], Array]:
    return lambda run: run.scenario.rig.workspace[axis]


def _desired(axis: int) -> Values:
    return lambda run: run.reference[:, axis]


def _beside_trolley(axis: int) -> Values:
    return lambda run: run.load_position[:, axis] - run.state.axes[:, axis]


_LOAD = tuple(_signal(f"load.load_{a}", reference=_desired(k)) for k, a in enumerate("xyz"))
_LOAD_ABOVE = tuple(replace(panel, limits=_range(k)) for k, panel in enumerate(_LOAD[:2]))
_AXES = ("bridge_position", "trolley_position", "rope_length")
_TROLLEY = tuple(_signal(f"state.{name}", limits=_range(k)) for k, name in enumerate(_AXES))
_RELATIVE = (RunPanel("z₁ − x_c [m]", _beside_trolley(0)), RunPanel("z₂ − y_c [m]", _beside_trolley(1)))
_ERRORS = tuple(_signal(f"error.error_{a}") for a in "xyz")
_LINEAR = tuple(_signal(f"virtual_input.virtual_input_{a}") for a in "xyz")
_INPUTS = tuple(_signal(f"input.{name}_acceleration") for name in ("bridge", "trolley", "rope"))
_ANGLES = tuple(_signal(f"state.{name}", scale=DEGREES, unit="°") for name in ("alpha", "beta"))
_RESIDUAL_LOAD = tuple(_signal(f"residual.load_{a}_residual", scale=1e3, unit="mm") for a in "xyz")
_RESIDUAL_ANGLES = tuple(
    _signal(f"residual.{a}_residual", scale=DEGREES, unit="°") for a in ("alpha", "beta")
)
_AXES_ALONE = tuple(_signal(f"axes.{name}", limits=_range(k)) for k, name in enumerate(_AXES))

Family.ALL = {
    family.name: family
    for family in (
        Family("space", "load in space", _LOAD, _in_space, "load"),
        Family("residual-load", "load, measured minus predicted", _RESIDUAL_LOAD, _over_time, "residual"),
        Family(
            "residual-angles", "angles, measured minus predicted", _RESIDUAL_ANGLES, _over_time, "residual"
        ),
        Family("error", "tracking error", _ERRORS, _over_time, "error"),
        Family("linear-input", "linear inputs v", _LINEAR, _over_time, "virtual_input"),
        Family("input", "nonlinear inputs u", _INPUTS, _over_time, "input"),
        Family("trolley", "bridge, trolley and rope", _TROLLEY, _over_time),
        Family("axes", "bridge, trolley and rope", _AXES_ALONE, _over_time, "axes"),
        Family("angles", "cardan angles", _ANGLES, _over_time),
        Family("load", "load position", _LOAD, _over_time, "load"),
        Family("trolley-path", "path of the trolley, seen from above", _TROLLEY[:2], _in_the_plane),
        Family("load-path", "path of the load, seen from above", _LOAD_ABOVE, _in_the_plane, "load"),
        Family("relative-path", "load beside the trolley, seen from above", _RELATIVE, _in_the_plane, "load"),
    )
}
