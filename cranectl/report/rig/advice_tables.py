"""The tables and words of an advice, for the terminal and for the page of the rig."""

from cranectl.analysis.advice import Advice, Assessment
from cranectl.report.table import Cell, Table, cells

MARKS = {"guaranteed": "good", "survived": "open", "failed": "bad"}
MISSING = "–"


def controllers_table(advice: Advice) -> Table:
    """One row a controller."""
    headings = ("controller", "grade", "least\nmargin", "error RMS\n[mm]", "error max\n[mm]",
                "cost RMS\n[mm]", "cost max\n[mm]")  # fmt: skip
    rows = tuple(
        cells(
            row.controller,
            Cell(row.grade if row.survived else row.status.label, MARKS[row.grade]),
            f"{row.least_margin:+.3f}",
            *_errors_and_costs(row),
        )
        for row in advice.assessments
    )
    note = "Cost: distance of the load from where the continuous-time ideal of the same controller has it."
    title = f"{advice.scenario.name}: controllers, the best first"
    return Table(title, headings, rows, labels=2, note=note)


def _errors_and_costs(row: Assessment) -> list[str]:
    if row.metrics is None or row.cost is None:
        return [MISSING] * 4
    values = (row.metrics.rms_error_m, row.metrics.max_error_m, row.cost.rms, row.cost.max)
    return [_millimetres(value) for value in values]


def improvements_table(advice: Advice) -> Table:
    """One row a change of the rig, for an advice that recommends a controller."""
    assert advice.best is not None
    headings = ("improve", "change", "cost RMS\n[mm]", "saved", "least\nmargin", "grade")
    rows = []
    for row in advice.improvements:
        after = row.assessment
        rows.append(
            cells(
                row.name,
                row.change,
                _millimetres(after.cost.rms) if after.cost else MISSING,
                f"{100 * row.gain:+.0f} %" if after.survived else MISSING,
                f"{after.least_margin:+.3f}",
                Cell(after.grade, MARKS[after.grade]),
            )
        )
    return Table(f"What would help {advice.best.controller}, each alone", headings, tuple(rows), labels=2)


def recommendation(advice: Advice) -> tuple[str, ...]:
    """What to take and what to improve first, a sentence each."""
    best = advice.best
    if best is None:
        return ("No controller survives: improve drives, delay or sensors, or ask for less.",)
    worst = best.certificate.worst.point
    words = [f"Take {best.controller}: {best.grade}, least margin {best.least_margin:+.3f} with the {worst}."]
    if advice.improvements and advice.improvements[0].gain > 0.0:
        first = advice.improvements[0]
        words.append(
            f"Improve first: {first.name}, {first.change}; takes {100 * first.gain:.0f} % of the cost."
        )
    words.append(
        f"{len(advice.points)} operating points; a statement on linear loops frozen there, not on the motion."
    )
    return tuple(words)


def _millimetres(metres: float) -> str:
    return f"{1e3 * metres:.3g}"
