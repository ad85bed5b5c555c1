"""Tables of runs and their logs, for the terminal and for pages."""

from collections.abc import Mapping, Sequence
from math import degrees

from cranectl.cases.case import RunSummary
from cranectl.compare.golden import RegressionVerdict
from cranectl.compare.runs import Comparison
from cranectl.log import LogDescription
from cranectl.metrics import Metric, RunMetrics, all_metrics
from cranectl.report.table import VERDICTS, Cell, Table, cells


def run_table(logs: Mapping[str, Sequence[RunSummary]], note: str = "") -> Table:
    """How the runs of each log went, by its label; what all runs have in common stands in the title."""
    runs = [run for log in logs.values() for run in log]
    facts = {
        "log": [label for label, log in logs.items() for _ in log],
        "scenario": [run.scenario for run in runs],
        "controller": [run.controller for run in runs],
        "drives": [f"{run.drive} drives" for run in runs],
    }
    differing = {name: texts for name, texts in facts.items() if len(set(texts)) > 1}
    shared = [facts[name][0] for name in ("scenario", "controller", "drives") if name not in differing]
    differing["plant"] = [run.plant for run in runs]
    rows = tuple(
        (*cells(*identity), *_outcome(run)) for *identity, run in zip(*differing.values(), runs, strict=True)
    )
    headings = (*differing, "ended", "at [s]", "max error [m]", "outside rig [m]")
    return Table(", ".join(["Runs", *shared]), headings, rows, labels=len(differing) + 1, note=note)


def _outcome(run: RunSummary) -> tuple[Cell, ...]:
    ended = (Cell(run.status.label, "bad" if run.status.stopped else "good"), f"{run.end_s:g}")
    if run.metrics is None:
        return cells(*ended, "–", "–")
    excess = max((violation.max_excess_m for violation in run.metrics.workspace_violations), default=0.0)
    outside = Cell(f"{excess:.4f}", "bad" if excess else "")
    return cells(*ended, f"{run.metrics.max_error_m:.4f}", outside)


def metrics_table(runs: Mapping[str, RunMetrics | None]) -> Table:
    """One row a metric, one column a run, by its label."""
    shown = sorted((metric for metric in all_metrics() if metric.row.label), key=lambda m: m.row.place)
    rows = tuple(
        cells(
            metric.row.label,
            "°" if metric.unit == "rad" else metric.unit,
            *(_text(metric, metrics) for metrics in runs.values()),
        )
        for metric in shown
    )
    note = "Settling, overshoot and what is residual count from when the reference has come to rest."
    return Table("Metrics", ("metric", "unit", *runs), rows, labels=2, note=note)


def _text(metric: Metric, metrics: RunMetrics | None) -> str:
    """A dash for what is not there."""
    value = None if metrics is None else metrics.values[metric.name]
    scale = degrees(1.0) if metric.unit == "rad" else 1.0
    numbers = value if isinstance(value, tuple) else (value,)
    return " ".join("-" if n is None else f"{scale * n:.{metric.row.digits}f}" for n in numbers)


def comparison_table(title: str, comparison: Comparison) -> Table:
    """How far two runs are apart, one row a signal."""
    rows = tuple(
        cells(
            row.signal,
            row.unit,
            f"{row.max_abs:.1e}",
            f"{row.at_s:.3f}",
            f"{row.rms:.1e}",
            f"{row.final:+.1e}",
        )
        for row in comparison.signals
    )
    return Table(title, ("signal", "unit", "max |diff|", "at [s]", "RMS", "final"), rows, labels=2)


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


def topic_table(description: LogDescription) -> Table:
    """What a log holds, one row a topic."""
    rows = tuple(
        cells(
            topic.topic,
            topic.schema,
            str(topic.messages),
            "-" if topic.rate_hz is None else f"{topic.rate_hz:g}",
        )
        for topic in description.topics
    )
    return Table("Topics", ("topic", "message", "messages", "rate [Hz]"), rows, labels=2)
