"""Pictures of the sets of cranes: failures and settling of all controllers, with the names of some."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from cranectl.report import Chart, Figure
from cranectl.support import Array
from cranectl.tools.benchmark.ranking import Judged, Standing, points_of
from cranectl.tools.benchmark.report.sets import OUR_CONTROLLER, shown_name

PANEL = (4.2, 3.8)  # width and height of a picture [in]
AXES = tuple(0.82 * 72.0 * inches for inches in PANEL)  # about the size of its axes [pt]
LETTERING = 1.3  # factor on all letters where a page is narrow
LINE = 10.0 * LETTERING  # height of a line of names [pt]
MARK = 4.0  # half the size of a mark [pt]
Box = tuple[float, float, float, float]  # left, right, bottom and top [pt]
LEAST_TICKS = (1.0, 2.0, 5.0, 10.0)  # [%] at which the axis of unsettled time may begin
KEY = (
    "Each mark is a controller, and the lower left corner is best. Filled: no other one is as good in "
    "failures, unsettled time and effort, which the tables have, and better in one of them. Orange: ours, "
    "and yours if it ran. The baseline is named as well. The spread is a factor on how far the cranes "
    "differ from the one that controllers know."
)


def set_pictures(judged: Judged) -> Iterator[Figure]:
    """Yield a picture of each set that is ranked."""
    for name in judged.ranked_sets:
        spread, runs = judged.benchmark.sets[name].spread, judged.ranking(name)[0].runs
        title = f"{name}: spread {spread:g}, {runs} runs of each controller"
        yield Figure.drawn(title, "", draw_set, judged, name)


def draw_set(judged: Judged, name: str) -> Drawing:
    """Draw failures against unsettled time, with the names of the front, the baseline, ours and yours."""
    front, standings = judged.front(name), _standings(judged, name)
    figure, axes = Chart.canvas(*PANEL)
    axes.set_title(f"{name}: spread {judged.benchmark.sets[name].spread:g}")
    least, most = _ranges(judged)
    # Before any mark is drawn: no range fits marks at a single place.
    axes.set(xscale="log", xlim=(least, 100.0), ylim=(0.0, most))
    Chart.label_log_axis(axes)
    labels = []
    points = 100.0 * points_of(standings)[:, [0, 2]]
    points[:, 0] = np.maximum(points[:, 0], least)
    shares = np.stack([np.log(points[:, 0] / least) / np.log(100.0 / least), points[:, 1] / most], axis=1)
    for standing, point, share in zip(standings, points, shares, strict=True):
        is_yours, is_best = standing.controller in judged.yours, standing.controller in front
        is_ours = is_yours or standing.controller == OUR_CONTROLLER
        colour = Chart.STAND_IN[Chart.SERIES[1] if is_ours else Chart.SERIES[0] if is_best else "muted"]
        look: dict[str, Any] = {"color": colour, "markerfacecolor": colour if is_best else "none"}
        look |= {"markersize": 6.0 if is_ours or is_best else 4.5, "zorder": 4 if is_ours else 3}
        axes.plot(*point, "D" if is_yours else "o", clip_on=False, **look)
        if is_ours or is_best or standing.controller == judged.benchmark.baseline:
            labels.append((shown_name(judged, standing.controller), point, share))
    axes.set(xlabel="time at rest that passes unsettled [%]", ylabel="runs that fail [%]")
    _place_labels(axes, labels, shares)
    return figure


def _standings(judged: Judged, name: str) -> list[Standing]:
    """Return all controllers on a set, also those whose runs are not complete."""
    unfinished = judged.unfinished(name).values()
    return [*judged.ranking(name), *(standing for standing, _ in unfinished if standing)]


def _ranges(judged: Judged) -> tuple[float, float]:
    """Return the least unsettled time and the most failures [%] that the panels of all sets show."""
    points = points_of([of for name in judged.ranked_sets for of in _standings(judged, name)])
    unsettled, failures = 100.0 * points[:, 0].min(), 100.0 * points[:, 2].max()
    least = max((tick for tick in LEAST_TICKS if tick <= unsettled), default=LEAST_TICKS[0])
    return least, max(10.0 * np.ceil(0.1 * failures), 10.0)


def _place_labels(axes: Axes, labels: Sequence[tuple[str, Array, Array]], shares: Array) -> None:
    """Write each name near its point, above all names and points; `shares` (n, 2) are these in the axes."""
    covered = [(x - MARK, x + MARK, y - MARK, y + MARK) for x, y in shares * AXES]
    for text, place, share in sorted(labels, key=lambda label: (label[2][1], label[2][0])):
        x, y = share * AXES
        length = LETTERING * Chart.LETTER * len(text)
        starts = (x - MARK, x - 0.5 * length, x + MARK - length)
        free = [_lowest_place(min(max(0.0, left), AXES[0] - length), y, length, covered) for left in starts]
        left, bottom = min(free, key=lambda corner: corner[1])
        covered.append((left, left + length, bottom, bottom + LINE))
        arrow: dict[str, Any] = {"arrowstyle": "-", "color": Chart.STAND_IN["muted"], "linewidth": 0.5}
        arrow |= {"shrinkA": 0.0, "shrinkB": MARK, "relpos": (min((x - left) / length, 1.0), 0.0)}
        style: dict[str, Any] = {"textcoords": "offset points", "arrowprops": arrow}
        axes.annotate(text, (float(place[0]), float(place[1])), (left - x, bottom - y + 2.0), **style)


def _lowest_place(left: float, y: float, length: float, covered: Sequence[Box]) -> tuple[float, float]:
    """Return `left` and the lowest bottom above y [pt] at which a name of this length covers nothing."""
    bottom = y + 1.5 * MARK
    while any(
        left < end and start < left + length and bottom < top and low < bottom + LINE
        for start, end, low, top in covered
    ):
        bottom += 1.0
    return left, bottom
