"""Tables of runs against each other: plants, logs, golden logs, the runs of an overlay."""

from collections.abc import Mapping, Sequence

from cranectl.compare.golden import RegressionVerdict, worst_first
from cranectl.compare.runs import Comparison
from cranectl.report.table import VERDICTS, Table, cells
from cranectl.support.units import quantity


def comparison_table(title: str, comparison: Comparison, *, folded: bool = False) -> Table:
    """How far two runs are apart, one row a signal."""
    rows = tuple(
        cells(
            row.signal,
            quantity(row.max_abs, row.unit),
            f"{row.at_s:.3f}",
            quantity(row.rms, row.unit),
            quantity(row.final, row.unit),
        )
        for row in comparison.signals
    )
    return Table(title, ("signal", "max |diff|", "at [s]", "RMS", "final"), rows, folded=folded)


def distances_table(first: str, comparisons: Mapping[str, Comparison]) -> Table:
    """How far runs are from the one labelled `first`, by label."""
    rows = tuple(
        cells(
            label,
            quantity(each.max_load_error_m, "m"),
            f"{each.max_load_error_at_s:.3f}",
            quantity(each.max_angle_error_rad, "rad"),
        )
        for label, each in comparisons.items()
    )
    return Table(f"Farthest from {first}", ("", "load", "at [s]", "angles"), rows)


def regression_table(verdict: RegressionVerdict) -> Table:
    """A run beside its golden one: one row a signal, then how they ended."""
    rows = [
        cells(
            row.signal,
            row.unit,
            f"{row.max_abs:.1e}",
            f"{row.at_s:.3f}",
            f"{row.limit:.1e}",
            VERDICTS[row.passed],
        )
        for row in verdict.signals
    ]
    difference, limit = f"{verdict.end_difference_s:.1e}", f"{verdict.end_difference_limit_s:.1e}"
    rows.append(cells("ends", "s", difference, "", limit, VERDICTS[verdict.ends_passed]))
    status = f"{verdict.status}, was {verdict.golden_status}"
    how = f"both {verdict.status}" if verdict.same_status else status
    rows.append(cells(how, "", "", "", "", VERDICTS[verdict.same_status]))
    headings = ("signal", "unit", "max |diff|", "at [s]", "limit", "verdict")
    title = f"{verdict.plant}, {verdict.samples} samples: new minus golden"
    return Table(title, headings, tuple(rows), labels=2)


def regressions_table(outcomes: Mapping[str, Sequence[RegressionVerdict] | str]) -> Table:
    """Logs beside their golden ones, by path: the signal that is worst off, or why there is none."""
    rows = []
    for path, verdicts in outcomes.items():
        if isinstance(verdicts, str):
            rows.append(cells(path, "", verdicts, "", "", VERDICTS[False]))
            continue
        for verdict in verdicts:
            worst = worst_first(verdict.signals)[0]
            said = "ends otherwise" if not (verdict.same_status and verdict.ends_passed) else worst.signal
            limit = f"{worst.limit:.1e}"
            rows.append(
                cells(path, verdict.plant, said, f"{worst.max_abs:.1e}", limit, VERDICTS[verdict.passed])
            )
    headings = ("log", "plant", "worst", "max |diff|", "limit", "verdict")
    return Table("New minus golden", headings, tuple(rows), labels=3)
