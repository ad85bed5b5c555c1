"""Parts of the figures of a campaign: clouds of runs, logarithmic axes, bars."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes

from cranectl.campaign.sensitivity import OneAtATimeEffect
from cranectl.campaign.summary import MAIN_METRICS, MEASURE
from cranectl.report import Chart
from cranectl.support import Array


class CampaignPanel:
    """Parts of the figures of a campaign, drawn on given axes."""

    MAX_POINTS = 600  # of a scatter, all series together

    @staticmethod
    def cloud(axes: Axes, x: Array, y: Array, colour: str) -> None:
        """Draw points, or of many points hexagons that are darker the more points they hold."""
        both = ~np.isnan(x) & ~np.isnan(y)
        x, y = x[both], y[both]
        if not x.size:
            axes.text(0.5, 0.5, "no sample completed on both", ha="center", transform=axes.transAxes)
            return
        ends = [min(x.min(), y.min()), max(x.max(), y.max())]
        scale: Literal["log", "linear"] = "log" if 0.0 < ends[0] * 5.0 < ends[1] else "linear"
        if x.size <= CampaignPanel.MAX_POINTS:
            axes.plot(x, y, ".", markersize=4, alpha=0.6, color=colour)
        else:
            cells = axes.hexbin(x, y, gridsize=40, xscale=scale, yscale=scale, mincnt=1, linewidths=0.0)
            counts = np.log1p(np.asarray(cells.get_array()))
            cells.set_array(None)
            cells.set_facecolor(colour)
            cells.set_alpha(0.15 + 0.85 * counts / counts.max())
        axes.set_axisbelow(True)
        axes.plot(
            ends, ends, color=Chart.STAND_IN["reference"], linewidth=0.8, linestyle=(0, (5, 3)), zorder=0
        )
        axes.set(xscale=scale, yscale=scale)

    @staticmethod
    def spread(axes: Axes, which: str, values: Sequence[Array]) -> None:
        """Return "log" if the finite values span decades and none is 0, else "linear"."""
        finite = np.concatenate(values)
        finite = finite[np.isfinite(finite)]
        if finite.size and finite.min() > 0.0 and finite.max() > DECADES * finite.min():
            getattr(axes, f"set_{which}scale")("log")

    @staticmethod
    def bars(axes: Axes, row: int, nominal: float, effects: Sequence[OneAtATimeEffect]) -> None:
        """Draw how the error changes at both ends of a parameter, and its values between as marks."""
        values = [effect.value for effect in effects]
        for effect in effects:
            change = float(effect.metrics[MAIN_METRICS.index(MEASURE)]) - nominal
            if np.isnan(change):
                continue
            if min(values) < effect.value < max(values):
                axes.plot(change, row, "|", color=Chart.STAND_IN["muted"], markersize=10)
                continue
            low = effect.value == min(values)
            colour = Chart.STAND_IN[Chart.SERIES[0] if low else Chart.SERIES[1]]
            axes.barh(row + (-0.2 if low else 0.2), change, height=0.38, color=colour)


DECADES = 30.0  # ratio of quantiles from which an axis is logarithmic
