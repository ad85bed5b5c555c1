"""Figures of the reports on measured runs."""

import numpy as np
from matplotlib.figure import Figure as Drawing

from cranectl.report import Chart
from cranectl.tools.measured.comparison import ReadingsComparison
from cranectl.tools.measured.identification import Identification
from cranectl.tools.measured.uncertainty import BAND_DEVIATIONS

CHANNEL_LABELS = {
    "bridge_position": "bridge",
    "trolley_position": "trolley",
    "rope_length": "rope",
    "alpha": "α, at the load",
    "beta": "β, at the load",
}

MILLIMETRES = 1e3  # in a metre


class MeasuredFigures:
    """Figures of the reports on measured runs."""

    @staticmethod
    def comparison(comparison: ReadingsComparison, label: str, tolerance: float | None = None) -> Drawing:
        """Draw a run with its prediction, and the difference with its band; a row for each channel."""
        rows = len(comparison.channels)
        figure, grid = Chart.canvas(1.5 * Chart.WIDTH, 0.7 + 1.25 * rows, rows, 2, sharex=True, squeeze=False)
        band = BAND_DEVIATIONS * comparison.deviation * MILLIMETRES
        for k, (name, (run, difference)) in enumerate(zip(comparison.channels, grid, strict=True)):
            time, blue, orange = (
                comparison.time,
                Chart.STAND_IN[Chart.SERIES[0]],
                Chart.STAND_IN[Chart.SERIES[1]],
            )
            run.plot(time, comparison.measured[:, k], color=blue, label="measured")
            run.plot(time, comparison.predicted[:, k], color=orange, linestyle=(0, (4, 2)), label=label)
            run.set_ylabel(f"{CHANNEL_LABELS[name]} [m]")
            grey = Chart.STAND_IN["muted"]
            difference.fill_between(time, -band[:, k], band[:, k], color=grey, alpha=0.25, linewidth=0)
            shown = MILLIMETRES * comparison.difference[:, k]
            difference.plot(time, shown, color=blue, label=f"measured minus {label}")
            if (
                tolerance is not None
                and np.nanmax(np.abs([shown, band[:, k]])) > 0.3 * MILLIMETRES * tolerance
            ):
                for sign in (-1.0, 1.0):
                    difference.axhline(
                        sign * MILLIMETRES * tolerance, color=Chart.STAND_IN["limit"], linewidth=0.8
                    )
            difference.set_ylabel("difference [mm]")
            for axes in (run, difference):
                axes.margins(x=0.0, y=0.15)
        for axes in grid[-1]:
            axes.set_xlabel(Chart.TIME)
        figure.legend(*grid[0][0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        return figure

    @staticmethod
    def intervals(result: Identification) -> Drawing:
        """Draw the interval of each number over its value, those from the spread between runs darker."""
        known = [estimate for estimate in result.estimates if estimate.value != 0.0]
        figure, axes = Chart.canvas(Chart.WIDTH, 0.7 + 0.24 * len(known))
        for row, estimate in enumerate(known):
            percent = 100.0 / abs(estimate.value)
            for half, opacity, width in ((estimate.half_width, 0.35, 5.0), (estimate.spread, 1.0, 2.0)):
                ends, style = [-percent * half, percent * half], {"alpha": opacity, "linewidth": width}
                axes.plot(
                    ends, [row, row], color=Chart.STAND_IN[Chart.SERIES[0]], solid_capstyle="butt", **style
                )
        labels = [estimate.name.removeprefix("effects.") for estimate in known]
        axes.set_yticks(range(len(known)), labels)
        axes.invert_yaxis()
        axes.set_xscale("symlog", linthresh=0.1)
        axes.set_xlabel("deviation from the value [%]")
        Chart.make_room(figure, labels)
        return figure
