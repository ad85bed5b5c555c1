"""Figures of a campaign's page: the outcome, one plant against the other, and what parameters do.

That is correlations, bands over a parameter, failures, Sobol indices and tornados.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from cranectl.campaign.distributions import LogUniform
from cranectl.campaign.evaluation import Analysis, GroupAnalysis, Pair
from cranectl.campaign.report.metric_text import METRIC_LABELS, MetricText
from cranectl.campaign.report.panels import CampaignPanel
from cranectl.campaign.report.tables import CampaignTables
from cranectl.campaign.sensitivity import Correlations
from cranectl.campaign.settings import INDEPENDENT
from cranectl.campaign.statistics import empirical_distribution, equal_bins, quantiles
from cranectl.campaign.summary import EFFORT, MEASURE, Group, failure_interval
from cranectl.metrics import Metric
from cranectl.report import Chart
from cranectl.support import Array, Mask

_OTHERS = {"marker": "o", "markersize": 3.5, "color": Chart.STAND_IN["reference"], "label": "other runs"}
_FAILED = {"marker": "X", "markersize": 5.5, "color": Chart.STAND_IN["limit"], "label": "failed runs"}
Rows = NDArray[np.intp]
BANDS = 12  # ranges of a parameter, at least 8 runs each
RATES = 8
MAX_MARKS = 150  # failed runs of a panel, and others
RISES, FALLS, BENT = Chart.SERIES[1], Chart.SERIES[0], Chart.SERIES[2]


class CampaignFigures:
    """Figures of a campaign."""

    @staticmethod
    def style(k: int) -> dict[str, Any]:
        """Return colour and dashes of the k-th controller."""
        return {
            "color": Chart.STAND_IN[Chart.SERIES[k % len(Chart.SERIES)]],
            "linestyle": ("-", (0, (5, 2)), (0, (1, 1.5)))[k // len(Chart.SERIES) % 3],
        }

    @staticmethod
    def distributions(groups: Sequence[Group], limits: dict[str, float]) -> Figure:
        """Draw the distribution functions of all metrics, a curve for each controller on one plant."""
        metrics = [metric for metric in groups[0].metrics if metric != EFFORT]
        lines = -(-len(metrics) // 3)
        figure, panels = Chart.canvas(1.35 * Chart.WIDTH, 2.4 * lines, lines, 3, sharey=True, squeeze=False)
        for axes in panels.flat[len(metrics) :]:
            axes.set_visible(False)
        for axes, metric in zip(panels.flat, metrics, strict=False):
            for k, group in enumerate(groups):
                values = MetricText.shown(metric, group.metrics[metric][group.has_run])
                x, share = empirical_distribution(values)
                if Metric.low_is_bad(metric):
                    share = share + np.isnan(values).sum() / max(1, values.size)
                label = group.controller if metric == metrics[0] else None
                axes.step(x, share, where="post", label=label, **CampaignFigures.style(k))
            if metric in limits:
                limit = MetricText.shown(metric, limits[metric])
                axes.axvline(limit, color=Chart.STAND_IN["limit"], linewidth=0.8, linestyle=(0, (1, 2)))
            axes.set(xlabel=METRIC_LABELS[metric], ylim=(0.0, 1.02))
            axes.xaxis.set_major_locator(MaxNLocator(4))
            if all(np.isnan(group.metrics[metric]).all() for group in groups):
                axes.set_xticks([])
                axes.text(0.5, 0.5, "no run has it", ha="center", transform=axes.transAxes)
            CampaignPanel.spread(axes, "x", [group.metrics[metric] for group in groups])
        for axes in panels[:, 0]:
            axes.set_ylabel("share of runs")
        figure.legend(loc="outside upper center", ncols=len(Chart.SERIES))
        return figure

    @staticmethod
    def failed_runs(analysis: Analysis, parts: Sequence[GroupAnalysis], columns: Sequence[int]) -> Figure:
        """Draw failed and other runs over two parameters, a panel for each controller on one plant.

        Of a single parameter they are drawn over it, by the first metric of the page.
        """
        campaign, lines = analysis.results.campaign, -(-len(parts) // 2)
        names = [campaign.names[column] for column in columns]
        figure, grid = Chart.canvas(
            Chart.WIDTH, 0.5 + 2.6 * lines, lines, min(2, len(parts)), sharex=True, sharey=True, squeeze=False
        )
        metric = next(iter(parts[0].group.metrics))
        for axes, part in zip(grid.flat, parts, strict=False):
            group, values = part.group, analysis.values
            x = values[:, columns[0]]
            y = values[:, columns[1]] if columns[1:] else MetricText.shown(metric, group.metrics[metric])
            for bad, style in ((False, _OTHERS), (True, _FAILED)):
                rows = np.flatnonzero(group.has_run & (group.failed == bad))
                rows = rows[:: max(1, -(-rows.size // MAX_MARKS))]
                axes.plot(x[rows], y[rows], linestyle="none", **style)
            axes.set_title(group.controller)
            for which, name in zip("xy", names, strict=False):
                if isinstance(campaign.parameters[campaign.names.index(name)].distribution, LogUniform):
                    getattr(axes, f"set_{which}scale")("log")
        for axes in grid.flat[len(parts) :]:
            axes.set_visible(False)
        labels = [CampaignTables.parameter_label(campaign, name) for name in names]
        for axes in grid[-1]:
            axes.set_xlabel(labels[0])
            if axes.get_xscale() == "log":
                Chart.label_log_axis(axes)
        for axes in grid[:, 0]:
            axes.set_ylabel(labels[1] if columns[1:] else METRIC_LABELS[metric])
        handles, texts = grid.flat[0].get_legend_handles_labels()
        figure.legend(handles, texts, loc="outside upper center", ncols=2)
        return figure

    @staticmethod
    def effort_and_error(groups: Sequence[Group]) -> Figure:
        """Draw RMS error against effort, a point for each run; crosses span 90 % of a controller's runs."""
        figure, axes = Chart.canvas(Chart.WIDTH, 3.6)
        points_each = CampaignPanel.MAX_POINTS // max(1, len(groups))
        for k, group in enumerate(groups):
            x, y = group.metrics[EFFORT], group.metrics["rms_error_m"]
            rows = np.flatnonzero(group.completed)
            rows = rows[:: max(1, -(-rows.size // points_each))]
            colour = CampaignFigures.style(k)["color"]
            axes.plot(x[rows], y[rows], ".", markersize=3, alpha=0.45, color=colour)
            low, middle, high = np.transpose([quantiles(x), quantiles(y)])
            if group.completed.any():
                axes.plot([low[0], high[0]], [middle[1]] * 2, color=colour, linewidth=2.2)
                axes.plot([middle[0]] * 2, [low[1], high[1]], color=colour, linewidth=2.2)
            marker = ("o", "s", "^", "D")[k % 4]
            axes.plot(
                *middle, marker, color=colour, markeredgecolor=Chart.STAND_IN["ink"], label=group.controller
            )
        axes.set(xlabel="effort: RMS of the commanded accelerations [m/s²]", ylabel="RMS error [m]")
        CampaignPanel.spread(axes, "x", [group.metrics[EFFORT] for group in groups])
        CampaignPanel.spread(axes, "y", [group.metrics["rms_error_m"] for group in groups])
        figure.legend(loc="outside upper center", ncols=len(Chart.SERIES))
        return figure

    @staticmethod
    def two_plants(pairs: Sequence[Pair]) -> Figure:
        """Draw the largest error on one plant over that on the other, by controller, and all differences."""
        columns = min(3, len(pairs) + 1)
        rows = -(-(len(pairs) + 1) // columns)
        figure, panels = Chart.canvas(1.35 * Chart.WIDTH, 0.4 + 2.7 * rows, rows, columns, squeeze=False)
        *scatters, last = list(panels.flat)[: len(pairs) + 1]
        for axes in figure.axes[len(pairs) + 1 :]:
            axes.set_visible(False)
        for k, (axes, pair) in enumerate(zip(scatters, pairs, strict=True)):
            colour = CampaignFigures.style(k)["color"]
            a, b = pair.first.metrics[MEASURE], pair.second.metrics[MEASURE]
            CampaignPanel.cloud(axes, a, b, colour)
            axes.set_title(pair.first.controller)
            x_label, y_label = (f"largest error on {group.plant} [m]" for group in (pair.first, pair.second))
            axes.set(xlabel=x_label, ylabel=y_label)
            difference = np.abs(b - a)
            x, share = empirical_distribution(difference[~np.isnan(difference)])
            last.step(
                x[x > 0.0],
                share[x > 0.0],
                where="post",
                label=pair.first.controller,
                **CampaignFigures.style(k),
            )
        last.set(xscale="log", ylim=(0.0, 1.02), xlabel="|difference| [m]", ylabel="share of samples")
        Chart.label_log_axis(last)
        last.legend()
        return figure

    @staticmethod
    def correlations(correlations: Correlations, order: Sequence[int]) -> Figure:
        """Draw a field for each parameter and metric, filled beyond chance, with rows in this `order`."""
        rho, strength = correlations.rho[list(order)], correlations.strength[list(order)]
        bent, eta = correlations.bent[list(order)], correlations.eta[list(order)]
        figure, axes = Chart.canvas(Chart.WIDTH, 1.1 + 0.24 * len(order))
        for (row, column), value in np.ndenumerate(rho):
            role, text = RISES if value > 0.0 else FALLS, "–" if np.isnan(value) else f"{value:+.2f}"
            if bent[row, column]:
                role, text = BENT, f"∪ {eta[row, column]:.2f}"
            if shown := strength[row, column]:
                corner, alpha = (column - 0.48, row - 0.46), 0.1 + 0.55 * shown
                axes.add_patch(Rectangle(corner, 0.96, 0.92, facecolor=Chart.STAND_IN[role], alpha=alpha))
            colour = Chart.STAND_IN["ink" if shown else "muted"]
            axes.text(column, row, text, ha="center", va="center", fontsize=7.5, color=colour)
        axes.set(xlim=(-0.5, len(correlations.metrics) - 0.5), ylim=(len(order) - 0.5, -0.5))
        labels = [MetricText.name(metric).replace(" ", "\n") for metric in correlations.metrics]
        axes.set_xticks(range(len(labels)), labels)
        names = [correlations.parameters[k].removeprefix("effects.") for k in order]
        axes.set_yticks(range(len(order)), names)
        Chart.make_room(figure, names)
        axes.xaxis.tick_top()
        axes.tick_params(length=0)
        axes.tick_params(axis="x", labelsize=7.5)
        axes.grid(visible=False)
        axes.spines[:].set_visible(False)
        meanings = {RISES: "rises, ρ", FALLS: "falls, ρ", BENT: "∪ neither, but differs, η"}
        handles = [Patch(facecolor=Chart.STAND_IN[r], alpha=0.5, label=text) for r, text in meanings.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
        return figure

    @staticmethod
    def error_bands(analysis: Analysis, parts: Sequence[GroupAnalysis], columns: Sequence[int]) -> Figure:
        """Draw median and 5 to 95 % of the largest error over ranges of parameters, for each controller."""

        def band(group: Group, rows: Rows) -> Array:
            return quantiles(group.metrics[MEASURE][rows])

        groups = [(part.group, part.group.completed) for part in parts]
        return _over_parameters(analysis, groups, columns, BANDS, METRIC_LABELS[MEASURE], band=band)

    @staticmethod
    def failure_rates(analysis: Analysis, parts: Sequence[GroupAnalysis], columns: Sequence[int]) -> Figure:
        """Draw the share of failed runs over ranges of parameters, by controller, with 95 % intervals."""
        random = analysis.results.campaign.settings.sampling in INDEPENDENT

        def band(group: Group, rows: Rows) -> Array:
            failures = int(group.failed[rows].sum())
            low, high = failure_interval(failures, rows.size) if random else (np.nan, np.nan)
            return np.array([low, failures / rows.size, high])

        groups = [(part.group, part.group.has_run) for part in parts]
        figure = _over_parameters(analysis, groups, columns, RATES, "failure rate", band=band)
        figure.axes[0].set_ylim(-0.02, 1.02)  # of all, which share it
        return figure

    @staticmethod
    def sobol(parts: Sequence[GroupAnalysis], parameters: Sequence[str]) -> Figure:
        """Draw first-order and total indices of the largest error, a panel for each controller."""
        figure, panels = _rows_figure(len(parts), parameters)
        rows = np.arange(len(parameters))
        for axes, part in zip(panels, parts, strict=True):
            indices = part.sobol[MEASURE]
            for offset, role, label, values, interval in (
                (-0.2, Chart.SERIES[0], "first order", indices.first, indices.first_interval),
                (0.2, Chart.SERIES[1], "total", indices.total, indices.total_interval),
            ):
                shown = label if axes is panels[0] else ""
                axes.barh(
                    rows + offset, values, height=0.36, color=Chart.STAND_IN[role], alpha=0.75, label=shown
                )
                axes.hlines(rows + offset, *interval, color=Chart.STAND_IN["ink"], linewidth=0.9)
            axes.set_title(part.group.controller)
            axes.set_xlim(min(-0.02, float(indices.first_interval[0].min())), None)
            axes.set_xlabel(f"share of the variance, {MetricText.name(MEASURE)}")
        figure.legend(loc="outside upper center", ncols=2)
        return figure

    @staticmethod
    def tornado(parts: Sequence[GroupAnalysis], parameters: Sequence[str]) -> Figure:
        """Draw how much the ends of each parameter change the largest error of the nominal run."""
        figure, panels = _rows_figure(len(parts), parameters)
        for axes, part in zip(panels, parts, strict=True):
            nominal = float(part.group.metrics[MEASURE][0])
            for row, parameter in enumerate(parameters):
                CampaignPanel.bars(
                    axes,
                    row,
                    nominal,
                    [effect for effect in part.one_at_a_time if effect.parameter == parameter],
                )
            axes.axvline(0.0, color=Chart.STAND_IN["ink"], linewidth=0.8)
            axes.set_title(f"{part.group.controller}, nominal {CampaignTables.number(nominal)} m")
            axes.set_xlabel("change of the largest error [m]")
            axes.xaxis.set_major_locator(MaxNLocator(4))
        handles = [Patch(facecolor=Chart.STAND_IN[r], label=text) for r, text in _ENDS.items()]
        figure.legend(handles=handles, loc="outside upper center", ncols=3)
        return figure


_ENDS = {Chart.SERIES[0]: "lowest value", Chart.SERIES[1]: "highest value", "muted": "between"}


def _over_parameters(
    analysis: Analysis,
    groups: Sequence[tuple[Group, Mask]],
    columns: Sequence[int],
    max_bins: int,
    label: str,
    *,
    band: Callable[[Group, Rows], Array],
) -> Figure:
    """Draw a panel for each parameter: a band over up to `max_bins` ranges with equally many of its runs.

    `groups`: with the runs that count. `band`: low, middle, high of those in a range; `label` says of what.
    """
    campaign = analysis.results.campaign
    lines = -(-len(columns) // 2)
    figure, grid = Chart.canvas(Chart.WIDTH, 0.5 + 2.1 * lines, lines, 2, sharey=True, squeeze=False)
    panels = list(grid.flat)
    for axes, column in zip(panels, columns, strict=False):
        x = analysis.values[:, column]
        for k, (group, counted) in enumerate(groups):
            bins = equal_bins(np.where(counted, x, np.nan), max_bins)
            if not bins:
                continue
            places = [float(np.median(x[rows])) for rows in bins]
            low, middle, high = np.transpose([band(group, rows) for rows in bins])
            style = CampaignFigures.style(k)
            axes.fill_between(places, low, high, color=style["color"], alpha=0.16, linewidth=0.0)
            axes.plot(places, middle, marker=".", markersize=4, label=group.controller, **style)
        axes.set_xlabel(CampaignTables.parameter_label(campaign, campaign.names[column]))
        axes.margins(x=0.02)
        if isinstance(campaign.parameters[column].distribution, LogUniform):
            axes.set_xscale("log")
            Chart.label_log_axis(axes)
    for axes in panels[len(columns) :]:
        axes.set_visible(False)
    for axes in panels[::2]:
        axes.set_ylabel(label)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(Chart.SERIES))
    return figure


def _rows_figure(panels: int, parameters: Sequence[str]) -> tuple[Figure, list[Axes]]:
    """Return a figure and panels side by side, in which each parameter has a row."""
    names = [parameter.removeprefix("effects.") for parameter in parameters]
    figure, grid = Chart.canvas(
        1.2 * Chart.WIDTH, 1.2 + 0.34 * len(names), 1, panels, sharey=True, squeeze=False
    )
    Chart.make_room(figure, names)
    grid[0, 0].set_yticks(range(len(names)), names)
    grid[0, 0].set_ylim(len(names) - 0.5, -0.5)
    for axes in grid.flat:
        axes.grid(visible=False, axis="y")
        axes.set_axisbelow(True)
        axes.tick_params(axis="y", length=0)
    return figure, list(grid.flat)
