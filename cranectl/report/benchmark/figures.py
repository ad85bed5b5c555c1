"""Figures of a benchmark: performance profiles, and effort against settling and failures."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from cranectl.campaign.benchmark.scores import profile
from cranectl.report.campaign.figures import WIDTH, series_style
from cranectl.report.theme import SERIES, STAND_IN
from cranectl.support.arrays import Array, Mask

MOST_RATIO = 10.0
NAMED = 8  # laws that have a line of their own in a profile
LEAST_EFFORT = 1e-2  # [m/s²] that is drawn, on a logarithmic scale


def profiles(laws: Sequence[str], ratios: Array) -> Figure:
    """Share of all runs that each law brings to rest within a ratio of the quickest law's time.

    `ratios` (laws, problems) are those of the laws that are drawn, the best of them by its line alone.
    """
    at = np.geomspace(1.0, MOST_RATIO, 200)
    shares = profile(ratios, at)
    figure = Figure(figsize=(1.2 * WIDTH, 3.6), layout="constrained")
    axes = figure.subplots()
    best = np.argsort(-shares.mean(axis=1), kind="stable")
    for k in best[NAMED:]:
        axes.step(at, 100.0 * shares[k], where="post", color=STAND_IN["muted"], linewidth=0.6)
    for rank, k in enumerate(best[:NAMED]):
        axes.step(at, 100.0 * shares[k], where="post", label=laws[k], **series_style(rank))
    axes.set(xscale="log", xlim=(1.0, MOST_RATIO), ylim=(0.0, 100.0))
    axes.set(xlabel="time to settle over that of the quickest law", ylabel="runs [%]")
    axes.set_xticks([1, 2, 5, 10], ["1", "2", "5", "10"])
    axes.minorticks_off()
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def fronts(laws: Sequence[str], points: Array, best: Mask) -> Figure:
    """Effort against the share of the rest that passes unsettled; points (n, 3) with the share of failures.

    Laws that no other dominates have their names and are full; the size tells the failures.
    """
    figure = Figure(figsize=(1.2 * WIDTH, max(3.8, 0.18 * np.count_nonzero(best))), layout="constrained")
    axes = figure.subplots()
    settling, effort = 100.0 * points[:, 0], np.maximum(points[:, 1], LEAST_EFFORT)
    colours = [STAND_IN[SERIES[0]] if full else STAND_IN["muted"] for full in best]
    axes.scatter(
        settling,
        effort,
        s=14.0 + 160.0 * points[:, 2],
        facecolors=[colour if full else "none" for colour, full in zip(colours, best, strict=True)],
        edgecolors=colours,
    )
    # Names beside the axes, in the order of their points: there they are apart.
    named = sorted(np.flatnonzero(best).tolist(), key=lambda k: points[k, 1])
    for place, k in enumerate(named):
        axes.annotate(
            laws[k],
            (settling[k], effort[k]),
            xytext=(1.04, (place + 0.5) / len(named)),
            textcoords="axes fraction",
            va="center",
            arrowprops={
                "arrowstyle": "-",
                "color": STAND_IN["muted"],
                "linewidth": 0.4,
                "relpos": (0.0, 0.5),
            },
        )
    axes.set(xlabel="time at rest that passes unsettled [%]", ylabel="RMS of commanded acceleration [m/s²]")
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_locator(NullLocator())
    return figure
