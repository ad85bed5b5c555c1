"""Figures of a campaign's outcome: distributions, effort against error, one plant against the other."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cranectl.campaign.evaluation import Pair
from cranectl.campaign.statistics import empirical_distribution, quantiles
from cranectl.campaign.summary import EFFORT, MAIN_METRICS, MEASURE, Group
from cranectl.metrics import low_is_bad
from cranectl.report.campaign.wording import METRIC_LABELS
from cranectl.report.theme import SERIES, STAND_IN

Array = NDArray[np.float64]

WIDTH = 6.4  # [in]
MOST_POINTS = 600  # of a scatter, all series together
DECADES = 30.0  # ratio of quantiles from which an axis is logarithmic
MIDDLE = (0.05, 0.5, 0.95)


def series_style(k: int) -> dict[str, Any]:
    """Colour and dashes of the k-th controller."""
    return {
        "color": STAND_IN[SERIES[k % len(SERIES)]],
        "linestyle": ("-", (0, (5, 2)), (0, (1, 1.5)))[k // len(SERIES) % 3],
    }


def distributions(groups: Sequence[Group], limits: dict[str, float]) -> Figure:
    """Empirical distribution functions of all metrics, a curve for each controller on one plant."""
    lines = -(-len(MAIN_METRICS) // 3)
    figure = Figure(figsize=(1.35 * WIDTH, 2.4 * lines), layout="constrained")
    panels = figure.subplots(lines, 3, sharey=True, squeeze=False)
    for axes in panels.flat[len(MAIN_METRICS) :]:
        axes.set_visible(False)
    for axes, metric in zip(panels.flat, MAIN_METRICS, strict=False):
        for k, group in enumerate(groups):
            values = group.metrics[metric][group.there]
            x, share = empirical_distribution(values)
            if low_is_bad(metric):
                share = share + np.isnan(values).sum() / max(1, values.size)
            label = group.controller if metric == MEASURE else None
            axes.step(x, share, where="post", label=label, **series_style(k))
        if metric in limits:
            axes.axvline(limits[metric], color=STAND_IN["limit"], linewidth=0.8, linestyle=(0, (1, 2)))
        axes.set(xlabel=METRIC_LABELS[metric], ylim=(0.0, 1.02))
        if all(np.isnan(group.metrics[metric]).all() for group in groups):
            axes.set_xticks([])
            axes.text(0.5, 0.5, "no run has it", ha="center", transform=axes.transAxes)
        _spread_axis(axes, "x", [group.metrics[metric] for group in groups])
    for axes in panels[:, 0]:
        axes.set_ylabel("share of runs")
    figure.legend(loc="outside upper center", ncols=len(SERIES))
    return figure


def effort_and_error(groups: Sequence[Group]) -> Figure:
    """RMS error against effort, a point a run; crosses span 90 % of each controller's runs."""
    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    axes = figure.subplots()
    each = MOST_POINTS // max(1, len(groups))
    for k, group in enumerate(groups):
        x, y = group.metrics[EFFORT], group.metrics["rms_error_m"]
        rows = np.flatnonzero(group.completed)
        rows = rows[:: max(1, -(-rows.size // each))]
        colour = series_style(k)["color"]
        axes.plot(x[rows], y[rows], ".", markersize=3, alpha=0.45, color=colour)
        low, middle, high = np.transpose([quantiles(x, MIDDLE), quantiles(y, MIDDLE)])
        if group.completed.any():
            axes.plot([low[0], high[0]], [middle[1]] * 2, color=colour, linewidth=2.2)
            axes.plot([middle[0]] * 2, [low[1], high[1]], color=colour, linewidth=2.2)
        marker = ("o", "s", "^", "D")[k % 4]
        axes.plot(*middle, marker, color=colour, markeredgecolor=STAND_IN["ink"], label=group.controller)
    axes.set(xlabel="effort: RMS of the commanded accelerations [m/s²]", ylabel="RMS error [m]")
    _spread_axis(axes, "x", [group.metrics[EFFORT] for group in groups])
    _spread_axis(axes, "y", [group.metrics["rms_error_m"] for group in groups])
    figure.legend(loc="outside upper center", ncols=len(SERIES))
    return figure


def two_plants(pairs: Sequence[Pair]) -> Figure:
    """The largest error on one plant over that on the other, for each controller; then all distances."""
    columns = min(3, len(pairs) + 1)
    rows = -(-(len(pairs) + 1) // columns)
    figure = Figure(figsize=(1.35 * WIDTH, 0.4 + 2.7 * rows), layout="constrained")
    *scatters, last = list(figure.subplots(rows, columns, squeeze=False).flat)[: len(pairs) + 1]
    for axes in figure.axes[len(pairs) + 1 :]:
        axes.set_visible(False)
    for k, (axes, pair) in enumerate(zip(scatters, pairs, strict=True)):
        colour = series_style(k)["color"]
        a, b = pair.first.metrics[MEASURE], pair.second.metrics[MEASURE]
        _cloud(axes, a, b, colour)
        axes.set_title(pair.first.controller)
        axes.set(
            xlabel=f"largest error on {pair.first.plant} [m]",
            ylabel=f"largest error on {pair.second.plant} [m]",
        )
    for k, pair in enumerate(pairs):
        difference = np.abs(pair.second.metrics[MEASURE] - pair.first.metrics[MEASURE])
        x, share = empirical_distribution(difference[~np.isnan(difference)])
        last.step(x[x > 0.0], share[x > 0.0], where="post", label=pair.first.controller, **series_style(k))
    last.set(xscale="log", ylim=(0.0, 1.02), xlabel="|difference| [m]", ylabel="share of samples")
    last.legend()
    return figure


def _cloud(axes: Axes, x: Array, y: Array, colour: str) -> None:
    """Points, or where there are many, hexagons that are darker the more points they hold."""
    both = ~np.isnan(x) & ~np.isnan(y)
    x, y = x[both], y[both]
    if not x.size:
        axes.text(0.5, 0.5, "no sample completed on both", ha="center", transform=axes.transAxes)
        return
    ends = [min(x.min(), y.min()), max(x.max(), y.max())]
    scale: Literal["log", "linear"] = "log" if 0.0 < ends[0] * 5.0 < ends[1] else "linear"
    if x.size <= MOST_POINTS:
        axes.plot(x, y, ".", markersize=4, alpha=0.6, color=colour)
    else:
        cells = axes.hexbin(x, y, gridsize=40, xscale=scale, yscale=scale, mincnt=1, linewidths=0.0)
        counts = np.log1p(np.asarray(cells.get_array()))
        cells.set_array(None)
        cells.set_facecolor(colour)
        cells.set_alpha(0.15 + 0.85 * counts / counts.max())
    axes.set_axisbelow(True)
    axes.plot(ends, ends, color=STAND_IN["reference"], linewidth=0.8, linestyle=(0, (5, 3)), zorder=0)
    axes.set(xscale=scale, yscale=scale)


def _spread_axis(axes: Axes, which: str, values: Sequence[Array]) -> None:
    """Logarithmic where the values that are there span decades and none is 0."""
    finite = np.concatenate(values)
    finite = finite[np.isfinite(finite)]
    if finite.size and finite.min() > 0.0 and finite.max() > DECADES * finite.min():
        getattr(axes, f"set_{which}scale")("log")
