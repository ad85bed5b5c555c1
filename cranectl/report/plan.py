"""The plan of a reference, for the terminal and for pages: times, limits that act, proof, path."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from cranectl.planning.limits import AXES
from cranectl.planning.review import ACTS, Review
from cranectl.report.table import Table, cells
from cranectl.report.theme import WIDTH, canvas
from cranectl.scenario import Scenario
from cranectl.scenario.segments import seconds

PANELS = {  # title: quantities, each with its label
    "set-points": {f"{axis} set-point": axis for axis in AXES},
    "their rates": {f"{axis} set-point's rate": axis for axis in AXES},
    "forces": {f"{axis} force": axis for axis in AXES},
    "rope": {"lean of the rope": "lean", "tension of the rope": "tension"},
}


def plan_tables(scenario: Scenario, reviewed: Sequence[Review], least: Sequence[float] = ()) -> list[Table]:
    """Tell when which segment is driven; of planned ones what proves them, and the limits that act.

    `least` [s] is how long each would last at best, or nothing if that was not asked for.
    """
    reviews = {review.segment: review for review in reviewed}
    rows, begins = [], 0.0
    for index, segment in enumerate(scenario.reference.segments):
        review, duration = reviews.get(index), seconds(segment)
        what, more = f"a {segment.kind}, as given", [""] * (4 if least else 3)
        if review is not None:
            name, slack = review.tightest
            alone = f"{review.least:.3f}" if review.least else ""
            what, more = review.planned, [alone, str(review.proof.pieces), f"{slack:.2g} of {name}"]
            more += [f"{least[index]:.3f}, {duration / least[index] - 1.0:.1%}"] if least else []
        rows.append(cells(str(index), what, f"{begins:.3f}", f"{duration:.3f}", *more))
        begins += duration
    headings = ["segment", "", "from\n[s]", "lasts\n[s]", "drives alone\n[s]"]
    headings += ["pieces\nproven", "smallest slack"]
    note = (
        "Drives alone: what they would need without a load, which nothing can be under. Proven: every limit "
        "holds at every moment, on each of so many pieces of the motion. Slack: what is left of a limit."
    )
    if least:
        headings.append("least with any knots\n[s], gap")
        note += " Least with any knots: extrapolated from this plan and one with twice as many, an estimate."
    tables = [Table("", tuple(headings), tuple(rows), labels=2, note=note if reviewed else "")]
    acting = [
        cells(
            str(review.segment),
            name,
            ", ".join(f"{stretch.start:.2f}–{stretch.end:.2f}" for stretch in stretches),
        )
        for review in reviewed
        for name, stretches in review.by_limit.items()
    ]
    if acting:
        title = f"Limits that act, at {100 * ACTS:g} % or more of what may be used"
        limits = "segment", "limit", "when, from the segment's start [s]"
        tables.append(Table(title, limits, tuple(acting), labels=3))
    return tables


def plan_json(scenario: Scenario, reviewed: Sequence[Review], least: Sequence[float] = ()) -> dict[str, Any]:
    """Return the review of a plan as plain data."""
    return {
        "scenario": scenario.name,
        "duration_s": sum(map(seconds, scenario.reference.segments)),
        "segments": [
            {
                "segment": review.segment,
                "planned": review.planned,
                "start_s": review.start,
                "duration_s": review.duration,
                "drives_alone_s": review.least,
                **({"least_with_any_knots_s": least[review.segment]} if least else {}),
                "proven": review.proof.is_valid,
                "pieces": review.proof.pieces,
                "slack": review.proof.slack,
                "acting": [stretch._asdict() for stretch in review.acting],
            }
            for review in reviewed
        ],
    }


def plan_figure(reviewed: Sequence[Review], scenario: Scenario) -> Figure:
    """Draw the load's path from above and from a side, and what its limits leave over time."""
    figure, panels = canvas(WIDTH, 9.6, 6, 1, height_ratios=(2.4, 2.0, 1.0, 1.0, 1.0, 1.0))
    above, side, *stack = panels
    _draw_path(above, reviewed, scenario, 1, "y [m]")
    _draw_path(side, reviewed, scenario, 2, "z [m]")
    for axes, (title, names) in zip(stack, PANELS.items(), strict=True):
        for (colour, (name, label)), (k, review) in product(enumerate(names.items()), enumerate(reviewed)):
            if len(share := np.abs(review.shares.get(name, ()))):
                shown = label if k == 0 else "_nolegend_"
                axes.plot(review.start + review.time, share, color=f"C{colour}", label=shown)
        axes.axhline(1.0, color="0.6", linewidth=0.8, linestyle=(0, (2, 2)))
        axes.set(ylabel=title, ylim=(0.0, 1.12))
        axes.margins(x=0.0)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    for axes in stack[:-1]:
        axes.tick_params(labelbottom=False)
    stack[0].set_title("shares of what the plan may use", fontsize=8.5)
    stack[-1].set_xlabel("time [s]")
    return figure


def _draw_path(axes: Axes, reviewed: Sequence[Review], scenario: Scenario, vertical: int, label: str) -> None:
    for k, review in enumerate(reviewed):
        line = review.path[:, [0, vertical]].T
        axes.plot(*line, color=f"C{k}")
        axes.plot(*line[:, [0, -1]], ".", color=f"C{k}")
        axes.plot(*review.marked[:, [0, vertical]].T, "x", color="0.4", markersize=4)
    for box in scenario.obstacles:
        low, high = np.array(box.low)[[0, vertical]], np.array(box.high)[[0, vertical]]
        axes.add_patch(Rectangle(tuple(low), *(high - low), color="0.6", alpha=0.4))
    axes.set(xlabel="x [m]", ylabel=label, aspect="equal")
    axes.set_adjustable("datalim")
