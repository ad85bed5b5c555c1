"""Everything about one rig on one page: advice, certificate, fidelity ladder, error budget."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure as Drawing

from cranectl.analysis.advice import Advice, Assessment
from cranectl.analysis.budget.error_budget import Budget, Entry
from cranectl.analysis.certificate.certify import Judge
from cranectl.analysis.certificate.loop import InnerLoop
from cranectl.analysis.ladder import Step
from cranectl.report.certificate_figure import certificate_figure
from cranectl.report.ladder_report import ladder_sections
from cranectl.report.page import Cell, Figure, Page, Section, Table
from cranectl.report.theme import SERIES, STAND_IN, inline_svg, styled

WIDTH = 6.4  # [in]
LEAST = 1e-9  # [m] that is drawn
MARKS = {"guaranteed": "good", "survived": "open", "failed": "bad"}


def rig_page(
    advice: Advice, judge: Judge, worst: InnerLoop, steps: Sequence[Step], budget: Budget, remade_by: str
) -> Page:
    """The page of a rig for which there is a recommendation; `judge` and `worst` are that controller's."""
    best = advice.best
    assert best is not None
    sections = (
        Section("advice", "Which controller", _words(advice), (_controllers(advice), _improvements(advice))),
        Section(
            "certificate",
            "Certificate",
            (
                "A nu-gap below the margin guarantees that the linear loop, frozen at that point, is stable. "
                "It says nothing of the motion from point to point; refused does not mean unstable.",
            ),
            (_certificates(advice.assessments),),
            (_certificate(best, judge, worst),),
        ),
        *ladder_sections(steps, first=2),
        Section("budget", "Error budget", (), (_budget_table(budget),), (_budget_figure(budget),)),
    )
    title = f"{advice.scenario.name}: the rig and its controllers"
    return Page(title, advice.scenario.title, sections, remade_by)


def _words(advice: Advice) -> tuple[str, ...]:
    best = advice.best
    assert best is not None
    words = [f"Take {best.controller}: {best.grade}, least margin {best.least_margin:+.3f}."]
    if advice.improvements and advice.improvements[0].gain > 0.0:
        first = advice.improvements[0]
        words.append(
            f"Improve first: {first.name}, {first.change}; takes {100 * first.gain:.0f} % of the cost."
        )
    return tuple(words)


def _controllers(advice: Advice) -> Table:
    headings = ("controller", "grade", "least margin", "RMS error [mm]", "max error [mm]", "RMS cost [mm]",
                "max cost [mm]")  # fmt: skip
    rows = tuple(
        (
            Cell(row.controller),
            Cell(row.grade if row.survived else row.status.label, MARKS[row.grade]),
            Cell(f"{row.least_margin:+.3f}"),
            *_numbers(row),
        )
        for row in advice.assessments
    )
    note = "Cost: distance of the load from where the continuous-time ideal of the same controller has it."
    return Table("Controllers, the best first", headings, rows, labels=2, note=note)


def _numbers(row: Assessment) -> tuple[Cell, ...]:
    if row.metrics is None or row.cost is None:
        return (Cell("–"),) * 4
    values = (row.metrics.rms_error_m, row.metrics.max_error_m, row.cost.rms, row.cost.max)
    return tuple(Cell(f"{1e3 * value:.3g}") for value in values)


def _improvements(advice: Advice) -> Table:
    rows = []
    for row in advice.improvements:
        after = row.assessment
        cost = f"{1e3 * after.cost.rms:.3g}" if after.cost else "–"
        saved = f"{100 * row.gain:+.0f} %" if after.survived else "–"
        rows.append(
            (Cell(row.name), Cell(row.change), Cell(cost), Cell(saved), Cell(f"{after.least_margin:+.3f}"))
        )
    headings = ("improve", "change", "RMS cost [mm]", "saved", "least margin")
    return Table("What would help, each alone", headings, tuple(rows), labels=2)


def _certificates(assessments: Sequence[Assessment]) -> Table:
    rows = []
    for row in assessments:
        found = row.certificate
        grades = [point.grade for point in found.points]
        rows.append(
            (
                Cell(row.controller),
                Cell(found.cut.name),
                Cell(str(found.worst.point)),
                Cell(f"{found.margin:.3f}"),
                Cell(f"{found.worst.gap:.3f}"),
                Cell(str(grades.count("gap"))),
                Cell(str(grades.count("by frequency"))),
                Cell(str(grades.count("refused")), "open" if "refused" in grades else ""),
                Cell(str(sum(not point.stable for point in found.points))),
            )
        )
    headings = ("controller", "cut at", "worst point", "margin b", "largest gap", "by the gap",
                "by frequency", "refused", "unstable")  # fmt: skip
    return Table("Certificates at the points that the scenario visits", headings, tuple(rows), labels=3)


def _certificate(best: Assessment, judge: Judge, worst: InnerLoop) -> Figure:
    with styled():
        drawing = certificate_figure(best.certificate, judge, worst, colours=STAND_IN)
        svg = inline_svg(drawing, "f1")
    return Figure("1", f"certificate of {best.controller}", svg, "", alone=True)


def _budget_table(budget: Budget) -> Table:
    headings = ("rung", "estimate RMS [mm]", "estimate max [mm]", "measured RMS [mm]",
                "measured max [mm]", "ratio of RMS", "bound of max [mm]", "bound over measured")  # fmt: skip
    rows = [_budget_row(entry) for entry in budget.entries]
    total, rest = (f"{1e3 * size.rms:.2g}" for size in (budget.total, budget.rest))
    note = f"All together {total} mm RMS, of which {rest} mm are unexplained."
    remarks = "".join(f" {entry.rung}: {entry.remark}." for entry in budget.entries if entry.remark)
    title = f"Predicted and measured deviations of the load, {budget.controller}"
    return Table(title, headings, tuple(rows), note=note + remarks)


def _budget_row(entry: Entry) -> tuple[Cell, ...]:
    values = (entry.estimate.rms, entry.estimate.max, entry.measured.rms, entry.measured.max)
    bound = f"{1e3 * entry.bound:.2g}" if math.isfinite(entry.bound) else "none"
    return (
        Cell(entry.rung),
        *(Cell(f"{1e3 * value:.2g}") for value in values),
        Cell(_ratio(entry.ratio)),
        Cell(bound, "" if entry.holds else "bad"),
        Cell(_ratio(entry.looseness)),
    )


def _ratio(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "–"


def _budget_figure(budget: Budget) -> Figure:
    """Estimate and measurement of the largest deviation as bars, the bound as a mark."""
    entries = budget.entries
    with styled():
        drawing = Drawing(figsize=(WIDTH, 0.9 + 0.32 * len(entries)), layout="constrained")
        axes, place = drawing.subplots(), np.arange(len(entries))
        for offset, role, label, values in (
            (-0.2, SERIES[0], "estimated", [entry.estimate.max for entry in entries]),
            (0.2, SERIES[1], "measured", [entry.measured.max for entry in entries]),
        ):
            lengths = np.maximum(values, LEAST)
            axes.barh(place + offset, lengths, height=0.36, color=STAND_IN[role], label=label)
        bounded = [(k, entry.bound) for k, entry in enumerate(entries) if 0.0 < entry.bound < np.inf]
        if bounded:
            where, bounds = zip(*bounded, strict=True)
            axes.plot(bounds, where, "|", color=STAND_IN["limit"], markersize=14, label="bound")
        axes.set_xscale("log")
        axes.set(xlim=(LEAST, None), xlabel="largest deviation of the load [m]")
        axes.set_yticks(place, [entry.rung for entry in entries])
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        drawing.legend(loc="outside upper center", ncols=3)
        svg = inline_svg(drawing, "f4")
    return Figure("4", "predicted, measured, bounded", svg, "")
