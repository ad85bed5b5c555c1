"""Pictures of the sets of cranes: failures and settling of all controllers, with the names of some."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from cranectl.report import Chart, Figure
from cranectl.support import Array
from cranectl.tools.benchmark.ranking import Judged, points_of
from cranectl.tools.benchmark.report.sets import OUR_CONTROLLER, shown_name

PANEL = (4.2, 3.8)  # width and height of a picture [in]
AXES = tuple(0.82 * 72.0 * inches for inches in PANEL)  # about the size of its axes [pt]
LETTERING = 1.3  # factor on all letters where a page is narrow
LINE = 10.0 * LETTERING  # height of a line of names [pt]
MARK = 4.0  # half the size of a mark [pt]
Box = tuple[float, float, float, float]  # left, right, bottom and top [pt]
KEY = (
    "Each mark is a controller, and the lower left corner is best. Filled: no other controller is as good in "
    "failures, unsettled time and effort and better in one. Orange: ours, and yours if it ran. The spread is "
    "a factor on how far the cranes differ from the one that controllers know."
)


def set_pictures(judged: Judged) -> Iterator[Figure]:
    """Yield a picture of each set that is ranked."""
    for name in judged.ranked_sets:
        spread, runs = judged.benchmark.sets[name].spread, judged.ranking(name)[0].runs
        title = f"{name}: spread {spread:g}, {runs} runs of each controller"
        yield Figure.drawn(title, "", draw_set, judged, name)


def draw_set(judged: Judged, name: str) -> Drawing:
    """Draw failures against unsettled time, with the names of the front, the baseline, ours and yours."""
    front, unfinished = judged.front(name), judged.unfinished(name).values()
    standings = [*judged.ranking(name), *(standing for standing, _ in unfinished if standing)]
    figure, axes = Chart.canvas(*PANEL)
    axes.set_title(f"{name}: spread {judged.benchmark.sets[name].spread:g}")
    labels = []
    points = 100.0 * points_of(standings)[:, [0, 2]]
    for standing, point in zip(standings, points, strict=True):
        is_yours, is_best = standing.controller in judged.yours, standing.controller in front
        is_ours = is_yours or standing.controller == OUR_CONTROLLER
        colour = Chart.STAND_IN[Chart.SERIES[1] if is_ours else Chart.SERIES[0] if is_best else "muted"]
        look: dict[str, Any] = {"color": colour, "markerfacecolor": colour if is_best else "none"}
        look |= {"markersize": 6.0 if is_ours or is_best else 4.5, "zorder": 4 if is_ours else 3}
        axes.plot(*point, "D" if is_yours else "o", clip_on=False, **look)
        if is_ours or is_best or standing.controller == judged.benchmark.baseline:
            labels.append((shown_name(judged, standing.controller), float(point[0]), float(point[1])))
    axes.set(xlim=(0.0, 100.0), ylim=(0.0, 100.0))
    axes.set(xlabel="time at rest that passes unsettled [%]", ylabel="runs that fail [%]")
    _place_labels(axes, labels, points)
    return figure


def _place_labels(axes: Axes, labels: Sequence[tuple[str, float, float]], points: Array) -> None:
    """Write each name near its point (x, y) in percent of the axes, above all names and points (n, 2)."""
    scale = 0.01 * np.array(AXES)
    covered = [(x - MARK, x + MARK, y - MARK, y + MARK) for x, y in points * scale]
    for text, *place in sorted(labels, key=lambda label: (label[2], label[1])):
        x, y = np.array(place) * scale
        length = LETTERING * Chart.LETTER * len(text)
        starts = (x - MARK, x - 0.5 * length, x + MARK - length)
        free = [_lowest_place(min(max(0.0, left), AXES[0] - length), y, length, covered) for left in starts]
        left, bottom = min(free, key=lambda corner: corner[1])
        covered.append((left, left + length, bottom, bottom + LINE))
        arrow: dict[str, Any] = {"arrowstyle": "-", "color": Chart.STAND_IN["muted"], "linewidth": 0.5}
        arrow |= {"shrinkA": 0.0, "shrinkB": MARK, "relpos": (min((x - left) / length, 1.0), 0.0)}
        style: dict[str, Any] = {"textcoords": "offset points", "arrowprops": arrow}
        axes.annotate(text, (place[0], place[1]), (left - x, bottom - y + 2.0), **style)


def _lowest_place(left: float, y: float, length: float, covered: Sequence[Box]) -> tuple[float, float]:
    """Return `left` and the lowest bottom above y [pt] at which a name of this length covers nothing."""
    bottom = y + 1.5 * MARK
    while any(
        left < end and start < left + length and bottom < top and low < bottom + LINE
        for start, end, low, top in covered
    ):
        bottom += 1.0
    return left, bottom
