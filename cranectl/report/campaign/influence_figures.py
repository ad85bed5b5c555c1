"""Figures of what parameters do: correlations, bands over a parameter, Sobol indices, tornado, failures."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from cranectl.campaign.distributions import LogUniform
from cranectl.campaign.evaluation import Analysis, GroupAnalysis
from cranectl.campaign.sensitivity import Correlations, OneAtATimeEffect
from cranectl.campaign.statistics import equal_bins, quantiles
from cranectl.campaign.summary import INDEPENDENT, MAIN_METRICS, MEASURE, Group, failure_interval
from cranectl.report.campaign.figures import WIDTH, series_style
from cranectl.report.campaign.wording import METRIC_LABELS, metric_name, number, parameter_label
from cranectl.report.theme import SERIES, STAND_IN

Array = NDArray[np.float64]

Rows = NDArray[np.intp]
Runs = Callable[[Group], NDArray[np.bool_]]  # which runs of a group count

BANDS = 12  # ranges of a parameter, at least 8 runs each
RATES = 8
RISES, FALLS, BENT = SERIES[1], SERIES[0], SERIES[2]


def correlation_fields(found: Correlations, order: Sequence[int]) -> Figure:
    """A field for each parameter and metric, filled where chance is no reason; rows as `order` says."""
    rho, strength = found.rho[list(order)], found.strength[list(order)]
    bent, eta = found.bent[list(order)], found.eta[list(order)]
    figure = Figure(figsize=(WIDTH, 1.1 + 0.24 * len(order)), layout="constrained")
    axes = figure.subplots()
    for (row, column), value in np.ndenumerate(rho):
        role = BENT if bent[row, column] else RISES if value > 0.0 else FALLS
        text = "–" if np.isnan(value) else f"{value:+.2f}"
        shown = strength[row, column]
        if bent[row, column]:
            text = f"∪ {eta[row, column]:.2f}"
        if shown:
            box = Rectangle(
                (column - 0.48, row - 0.46),
                0.96,
                0.92,
                facecolor=STAND_IN[role],
                alpha=0.1 + 0.55 * shown,
            )
            axes.add_patch(box)
        colour = STAND_IN["ink" if shown else "muted"]
        axes.text(column, row, text, ha="center", va="center", fontsize=7.5, color=colour)
    axes.set(xlim=(-0.5, len(found.metrics) - 0.5), ylim=(len(order) - 0.5, -0.5))
    axes.set_xticks(range(len(found.metrics)), [metric_name(m).replace(" ", "\n") for m in found.metrics])
    axes.set_yticks(range(len(order)), [found.parameters[k].removeprefix("effects.") for k in order])
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    labels = {RISES: "rises, ρ", FALLS: "falls, ρ", BENT: "∪ neither, but differs, η"}
    handles = [Patch(facecolor=STAND_IN[r], alpha=0.5, label=text) for r, text in labels.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def error_bands(analysis: Analysis, parts: Sequence[GroupAnalysis], columns: Sequence[int]) -> Figure:
    """Median and 5 to 95 % of the largest error over ranges of parameters, for each controller."""

    def band(group: Group, rows: Rows) -> Array:
        return quantiles(group.metrics[MEASURE][rows], (0.05, 0.5, 0.95))

    return _over_parameters(
        analysis, parts, columns, lambda group: group.completed, band, BANDS, METRIC_LABELS[MEASURE]
    )


def failure_rates(analysis: Analysis, parts: Sequence[GroupAnalysis], columns: Sequence[int]) -> Figure:
    """Share of failed runs over ranges of parameters, for each controller, with 95 % intervals."""
    random = analysis.results.campaign.settings.sampling in INDEPENDENT

    def band(group: Group, rows: Rows) -> Array:
        failures = int(group.failed[rows].sum())
        low, high = failure_interval(failures, rows.size) if random else (np.nan, np.nan)
        return np.array([low, failures / rows.size, high])

    figure = _over_parameters(
        analysis, parts, columns, lambda group: group.there, band, RATES, "failure rate"
    )
    figure.axes[0].set_ylim(-0.02, 1.02)  # of all, which share it
    return figure


def sobol_bars(parts: Sequence[GroupAnalysis], parameters: Sequence[str], metric: str) -> Figure:
    """First-order and total indices of one metric with intervals, a panel for each controller."""
    figure, panels = _rows_figure(len(parts), len(parameters))
    place = np.arange(len(parameters))
    for axes, part in zip(panels, parts, strict=True):
        found = part.sobol[metric]
        first, total = (found.first, found.first_interval), (found.total, found.total_interval)
        for offset, role, label, (values, interval) in zip(
            (-0.2, 0.2), SERIES[:2], ("first order", "total"), (first, total), strict=True
        ):
            label = label if axes is panels[0] else ""
            axes.barh(place + offset, values, height=0.36, color=STAND_IN[role], alpha=0.75, label=label)
            axes.hlines(place + offset, *interval, color=STAND_IN["ink"], linewidth=0.9)
        axes.set_title(part.group.controller)
        axes.set_xlim(min(-0.02, float(first[1][0].min())), None)
        axes.set_xlabel(f"share of the variance, {metric_name(metric)}")
    _name_rows(panels, parameters)
    figure.legend(loc="outside upper center", ncols=2)
    return figure


def tornado(parts: Sequence[GroupAnalysis], parameters: Sequence[str]) -> Figure:
    """How far each parameter's ends move the largest error from that of the nominal run."""
    figure, panels = _rows_figure(len(parts), len(parameters))
    for axes, part in zip(panels, parts, strict=True):
        nominal = float(part.group.metrics[MEASURE][0])
        for row, parameter in enumerate(parameters):
            _bars(axes, row, nominal, [each for each in part.one_at_a_time if each.parameter == parameter])
        axes.axvline(0.0, color=STAND_IN["ink"], linewidth=0.8)
        axes.set_title(f"{part.group.controller}, nominal {number(nominal)} m")
        axes.set_xlabel("change of the largest error [m]")
        axes.xaxis.set_major_locator(MaxNLocator(4))
    _name_rows(panels, parameters)
    handles = [Patch(facecolor=STAND_IN[r], label=text) for r, text in _ENDS.items()]
    figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


_ENDS = {SERIES[0]: "lowest value", SERIES[1]: "highest value", "muted": "between"}


def _bars(axes: Axes, row: int, nominal: float, effects: Sequence[OneAtATimeEffect]) -> None:
    values = [effect.value for effect in effects]
    for effect in effects:
        change = float(effect.metrics[MAIN_METRICS.index(MEASURE)]) - nominal
        if np.isnan(change):
            continue
        if min(values) < effect.value < max(values):
            axes.plot(change, row, "|", color=STAND_IN["muted"], markersize=10)
            continue
        low = effect.value == min(values)
        colour = STAND_IN[SERIES[0] if low else SERIES[1]]
        axes.barh(row + (-0.2 if low else 0.2), change, height=0.38, color=colour)


def _over_parameters(
    analysis: Analysis,
    parts: Sequence[GroupAnalysis],
    columns: Sequence[int],
    runs: Runs,
    band: Callable[[Group, Rows], Array],
    ranges: int,
    label: str,
) -> Figure:
    """A panel for each parameter: low, middle, high of `band` over ranges with as many of its runs."""
    campaign = analysis.results.campaign
    lines = -(-len(columns) // 2)
    figure = Figure(figsize=(WIDTH, 0.5 + 2.1 * lines), layout="constrained")
    panels = list(figure.subplots(lines, 2, sharey=True, squeeze=False).flat)
    for axes, column in zip(panels, columns, strict=False):
        x = analysis.values[:, column]
        for k, group in enumerate(part.group for part in parts):
            bins = equal_bins(np.where(runs(group), x, np.nan), ranges)
            if not bins:
                continue
            places = [float(np.median(x[rows])) for rows in bins]
            low, middle, high = np.transpose([band(group, rows) for rows in bins])
            style = series_style(k)
            axes.fill_between(places, low, high, color=style["color"], alpha=0.16, linewidth=0.0)
            axes.plot(places, middle, marker=".", markersize=4, label=group.controller, **style)
        axes.set_xlabel(parameter_label(campaign, campaign.names[column]))
        axes.margins(x=0.02)
        if isinstance(campaign.parameters[column].distribution, LogUniform):
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter(NullFormatter())
    for axes in panels[len(columns) :]:
        axes.set_visible(False)
    for axes in panels[::2]:
        axes.set_ylabel(label)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(SERIES))
    return figure


def _rows_figure(panels: int, rows: int) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(1.2 * WIDTH, 1.2 + 0.34 * rows), layout="constrained")
    return figure, list(figure.subplots(1, panels, sharey=True, squeeze=False).flat)


def _name_rows(panels: Sequence[Axes], parameters: Sequence[str]) -> None:
    panels[0].set_yticks(range(len(parameters)), [name.removeprefix("effects.") for name in parameters])
    panels[0].set_ylim(len(parameters) - 0.5, -0.5)
    for axes in panels:
        axes.grid(visible=False, axis="y")
        axes.set_axisbelow(True)
        axes.tick_params(axis="y", length=0)
