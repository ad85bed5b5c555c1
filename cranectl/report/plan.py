"""Tables and a figure of a plan: times, limits that act, proof and path."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from cranectl.planning import ACTIVE_SHARE, AXES, Review
from cranectl.report.table import Cell, Table
from cranectl.scenario import Scenario

LIMIT_COLOUR = "C1"
PANELS = {  # title: quantities, each with its label
    "set-points": {f"{axis} set-point": axis for axis in AXES},
    "their rates": {f"{axis} set-point's rate": axis for axis in AXES},
    "forces": {f"{axis} force": axis for axis in AXES},
    "rope": {"lean of the rope": "lean", "tension of the rope": "tension"},
}


class PlanReport:
    """A plan in minimum time as tables, plain data and a figure."""

    @staticmethod
    def tables(scenario: Scenario, reviewed: Sequence[Review], least: Sequence[float] = ()) -> list[Table]:
        """Return a table of all segments, with `least` durations [s], and one of the limits that act."""
        reviews = {review.segment: review for review in reviewed}
        rows, begins = [], 0.0
        for index, segment in enumerate(scenario.reference.segments):
            review, duration = reviews.get(index), segment.seconds
            what, more = f"a {segment.kind}, as given", [""] * (4 if least else 3)
            if review is not None:
                name, slack = review.tightest
                alone = f"{review.least:.3f}" if review.least else ""
                what, more = review.description, [alone, str(review.proof.pieces), f"{slack:.2g} of {name}"]
                more += [f"{least[index]:.3f}, {duration / least[index] - 1.0:.1%}"] if least else []
            rows.append(Cell.row(str(index), what, f"{begins:.3f}", f"{duration:.3f}", *more))
            begins += duration
        headings = ["segment", "", "from\n[s]", "lasts\n[s]", "drives alone\n[s]", "pieces\nproven"]
        headings.append("smallest slack")
        note = (
            "Drives alone: the time that the drives need without a load; no motion can be faster. Pieces "
            "proven: on each of so many pieces every limit holds at every moment. Slack: the unused part of "
            "a limit."
        )
        if least:
            headings.append("least with any knots\n[s], gap")
            note += " Least with any knots: an estimate from this plan and one with twice as many knots."
        tables = [Table("", tuple(headings), tuple(rows), labels=2, note=note if reviewed else "")]
        active = []
        for review in reviewed:
            for name, times in review.active_by_limit.items():
                when = ", ".join(f"{time.start:.2f}–{time.end:.2f}" for time in times)
                active.append(Cell.row(str(review.segment), name, when))
        if active:
            title = f"Limits that act, at {100 * ACTIVE_SHARE:g} % or more of what may be used"
            limits = "segment", "limit", "when, from the segment's start [s]"
            tables.append(Table(title, limits, tuple(active), labels=3, folded=True))  # the figure shows them
        return tables

    @staticmethod
    def json(scenario: Scenario, reviewed: Sequence[Review], least: Sequence[float] = ()) -> dict[str, Any]:
        """Return the review of a plan as plain data."""
        return {
            "scenario": scenario.name,
            "duration_s": sum(segment.seconds for segment in scenario.reference.segments),
            "segments": [
                {
                    "segment": review.segment,
                    "planned": review.description,
                    "start_s": review.start,
                    "duration_s": review.duration,
                    "drives_alone_s": review.least,
                    **({"least_with_any_knots_s": least[review.segment]} if least else {}),
                    "proven": review.proof.is_valid,
                    "pieces": review.proof.pieces,
                    "slack": review.proof.slack,
                    "acting": [stretch._asdict() for stretch in review.active],
                }
                for review in reviewed
            ],
        }

    @staticmethod
    def figure(reviewed: Sequence[Review], scenario: Scenario) -> Figure:
        """Draw which limits act when, the use of each limit over time, and small the load's path."""
        acting = list(dict.fromkeys(name for review in reviewed for name in review.active_by_limit))
        bars = 0.6 + 0.2 * len(acting)  # [in] high
        figure = Figure(figsize=(10.0, 5.0 + bars), layout="constrained")
        left, right = figure.subfigures(1, 2, width_ratios=(2.1, 1.0), squeeze=False)[0]
        ratios = (bars, *[1.2] * len(PANELS))
        limits, *stack = left.subplots(1 + len(PANELS), 1, sharex=True, height_ratios=ratios)
        _draw_acting(limits, reviewed, acting)
        for axes, (title, names) in zip(stack, PANELS.items(), strict=True):
            for (colour, (name, label)), (k, review) in product(
                enumerate(names.items()), enumerate(reviewed)
            ):
                if len(share := 100.0 * np.abs(review.shares.get(name, ()))):
                    shown = label if k == 0 else "_nolegend_"
                    axes.plot(review.start + review.time, share, color=f"C{colour}", label=shown)
            axes.axhline(100.0, color=LIMIT_COLOUR, linewidth=1.0, linestyle=(0, (2, 2)))
            axes.set(ylabel=f"{title} [%]", ylim=(0.0, 112.0))
            axes.margins(x=0.0)
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        stack[0].set_title("use of each limit", loc="left", fontsize=9)
        stack[-1].set_xlabel("time [s]")
        above, side = right.subplots(2, 1)
        _draw_path(above, reviewed, scenario, 1, "y [m]")
        _draw_path(side, reviewed, scenario, 2, "z [m]")
        above.set_title("path of the load from above", loc="left", fontsize=9)
        side.set_title("from a side", loc="left", fontsize=9)
        return figure


def _draw_acting(axes: Axes, reviewed: Sequence[Review], acting: Sequence[str]) -> None:
    """Draw a bar for each stretch of time in which a limit acts, a row for each limit."""
    for review in reviewed:
        for stretch in review.active:
            length = max(stretch.end - stretch.start, review.duration / len(review.time))
            place = review.start + stretch.start, acting.index(stretch.name)
            axes.barh(place[1], length, left=place[0], height=0.6, color=LIMIT_COLOUR)
    axes.set_yticks(range(len(acting)), acting)
    axes.set_ylim(len(acting) - 0.4, -0.6)
    axes.set_title(f"limits that act: {100 * ACTIVE_SHARE:g} % or more is used", loc="left", fontsize=9)
    axes.grid(visible=False, axis="y")
    axes.margins(x=0.0)


def _draw_path(axes: Axes, reviewed: Sequence[Review], scenario: Scenario, vertical: int, label: str) -> None:
    edge = matplotlib.rcParams["axes.edgecolor"]
    for k, review in enumerate(reviewed):
        line = review.path[:, [0, vertical]].T
        axes.plot(*line, color=f"C{k}")
        axes.plot(*line[:, [0, -1]], ".", color=f"C{k}")
        axes.plot(*review.marked_points[:, [0, vertical]].T, "x", color=edge, markersize=4)
    for box in scenario.obstacles:
        low, high = np.array(box.low)[[0, vertical]], np.array(box.high)[[0, vertical]]
        axes.add_patch(Rectangle(tuple(low), *(high - low), color=edge, alpha=0.4))
    axes.set(xlabel="x [m]", ylabel=label, aspect="equal")
    axes.set_adjustable("datalim")
