"""Tables and notes about runs, agreements and logs, for the terminal and for pages."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import isnan
from typing import TYPE_CHECKING

from cranectl.cases import CaseResult, RunSummary
from cranectl.compare import Agreement
from cranectl.metrics import Metric, RunMetrics
from cranectl.report.table import Cell, Table
from cranectl.support import Quantity

if TYPE_CHECKING:
    from cranectl.log import LogDescription

MISSING = "-"
MAX_NAMED_SCENARIOS = 3  # scenarios that a note names
Judged = tuple[Agreement, str]  # with what else is wrong with its case
SharedLimits = dict[str, tuple[float | None, float | None]]  # by drive; None where limits differ


class RunTables:
    """Tables and notes about runs, their agreement and their logs."""

    @staticmethod
    def runs(logs: Mapping[str, Sequence[RunSummary]]) -> Table:
        """Return a table of how each run ended; facts that all runs share stand in its title."""
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
        rows = []
        for *identity, run in zip(*differing.values(), runs, strict=True):
            ended = Cell(run.status.label, "bad" if run.status.stopped else "good")
            error, outside = "–", Cell("–")
            if run.metrics is not None:
                excess = max((left.max_excess_m for left in run.metrics.workspace_violations), default=0.0)
                error = f"{run.metrics.max_error_m:.4f}"
                outside = Cell(f"{excess:.4f}", "bad" if excess else "")
            rows.append(Cell.row(*identity, ended, f"{run.end_s:g}", error, outside))
        headings = (*differing, "ended", "at [s]", "max error [m]", "outside rig [m]")
        return Table(", ".join(["Runs", *shared]), headings, tuple(rows), labels=len(differing) + 1)

    @staticmethod
    def metrics(logs: Mapping[str, Sequence[RunSummary]]) -> Table:
        """Return a row for each metric and a column for each run; runs of a log with equal texts share one.

        With several logs the best value of a metric is marked, unless all are equal.
        """
        measured = [run.metrics for runs in logs.values() for run in runs]
        shown = [
            metric
            for metric in sorted(Metric.all(), key=lambda metric: metric.row.place)
            if metric.row.label
            and (
                metric.row.always or any(n is not None for run in measured for n in _numbers_of(metric, run))
            )
        ]
        units = [_shown_unit(metric, measured) for metric in shown]
        columns: dict[tuple[str, tuple[str, ...]], list[RunSummary]] = {}
        for label, runs in logs.items():
            for run in runs:
                texts = tuple(
                    _text(metric, run.metrics, factor)
                    for metric, (factor, _) in zip(shown, units, strict=True)
                )
                columns.setdefault((label, texts), []).append(run)
        headings = []
        for (label, _), runs in columns.items():
            headings.append("\n".join(filter(None, (label, ", ".join(run.plant for run in runs)))))
        whole = [not runs[0].status.stopped and len(logs) > 1 for runs in columns.values()]
        rows = tuple(
            Cell.row(metric.row.label, unit, *_best_marked(metric, texts, whole))
            for metric, (_, unit), *texts in zip(shown, units, *(texts for _, texts in columns), strict=True)
        )
        note = "Settling, overshoot and residual values count from the moment when the reference rests."
        if len(logs) > 1:
            note += " ★ is the best of the runs that did not stop."
        return Table("Metrics", ("metric", "unit", *headings), rows, labels=2, note=note)

    @staticmethod
    def limits(cases: Iterable[Sequence[RunSummary]], *, worst: int | None = None) -> Table | None:
        """Return limits and values, a row for each case and metric; None without limits.

        A case has the runs of one scenario, controller and drive on its plants; `judged_limits` chooses among
        them. `worst` restricts the table to that many broken limits, the worst first.
        """
        verdicts = shown = [pair for runs in cases for pair in RunSummary.judged_limits(runs)]
        broken = sorted((pair for pair in verdicts if not pair[1].kept), key=lambda pair: -pair[1].overrun)
        if worst is not None:
            shown = broken[:worst]
        metrics = {metric.name: metric for metric in Metric.all()}
        several = len({(run.scenario, run.controller, run.drive) for run, _ in verdicts}) > 1
        rows = []
        for run, verdict in shown:
            metric = metrics[verdict.metric]
            case = (f"{run.scenario}, {run.controller}, {run.drive}",) if several else ()
            value, limit = verdict.texts
            sign = "≥" if metric.better == "higher" else "≤"
            texts = (metric.name, value or "–", f"{sign} {limit}", metric.shown[1], Cell.answer(verdict.kept))
            rows.append(Cell.row(*case, run.plant, *texts))
        if not verdicts:
            return None
        headings = (*(("case",) if several else ()), "plant", "metric", "value", "limit", "unit", "kept")
        note = f"{len(verdicts) - len(broken)} of {len(verdicts)} limits kept."
        if worst is not None and len(broken) > worst:
            note += f" Shown are the {worst} that are broken most, of {len(broken)}."
        return Table("Limits", headings, tuple(rows), labels=2 + several, note=note)

    @staticmethod
    def topics(description: "LogDescription") -> Table:
        """Return a table of the topics of a log."""
        rows = []
        for topic in description.topics:
            rate = "-" if topic.rate_hz is None else f"{topic.rate_hz:g}"
            rows.append(Cell.row(topic.topic, topic.schema, str(topic.messages), rate))
        return Table("Topics", ("topic", "message", "messages", "rate [Hz]"), tuple(rows), labels=2)

    @staticmethod
    def agreement_summary(agreements: Sequence[Agreement], others: Sequence[str] = ()) -> Table:
        """Return one row for each scenario: the largest differences over its controllers and plants.

        A plant that is not judged has a row of its own beside those that are. `others` holds for each
        agreement what else is wrong with its case, or an empty text.
        """
        headings, shared = _difference_headings(agreements, others)
        judged = [agreement for agreement in agreements if agreement.passed is not None]
        judged_plants = {(agreement.scenario, agreement.plant) for agreement in judged}
        judged_scenarios = {agreement.scenario for agreement in judged}
        parts: dict[str, list[Judged]] = {}
        for agreement, other in zip(agreements, others or [""] * len(agreements), strict=True):
            scenario, plant = agreement.scenario, agreement.plant
            beside = scenario in judged_scenarios and (scenario, plant) not in judged_plants
            parts.setdefault(f"{scenario}, {plant}" if beside else scenario, []).append((agreement, other))
        rows = []
        for name, part in parts.items():
            *texts, answer = _agreement_cells(part, shared)
            failed = sum(agreement.passed is False for agreement, _ in part)
            if failed and len(part) > 1:
                answer = Cell(f"{answer.text} ({failed} of {len(part)})", answer.mark)
            rows.append(Cell.row(name, *texts, answer, *_faults(part, others)))
        return Table("Largest differences between plants", ("scenario", *headings), tuple(rows))

    @staticmethod
    def agreement(agreements: Sequence[Agreement], others: Sequence[str] = ()) -> Table:
        """Return one row for each scenario, controller and plant, its drives side by side.

        `others` is as in `agreement_summary`. A limit that all scenarios share stands above its column,
        others beside the numbers.
        """
        headings, shared = _difference_headings(agreements, others)
        several = len({agreement.plant for agreement in agreements}) > 1
        scenarios: dict[str, dict[str, dict[str, Judged]]] = {}  # by scenario, by row, by drive
        for agreement, other in zip(agreements, others or [""] * len(agreements), strict=True):
            name = f" {agreement.controller}, {agreement.plant}" if several else f" {agreement.controller}"
            of_scenario = scenarios.setdefault(agreement.scenario, {})
            of_scenario.setdefault(name, {})[agreement.drive] = (agreement, other)
        rows: list[tuple[Cell, ...]] = []
        for scenario, of_scenario in scenarios.items():
            rows.append(Cell.row(Cell(scenario, "head"), *[""] * len(headings)))
            for name, drives in of_scenario.items():
                part = [*drives.values()]
                rows.append(Cell.row(name, *_agreement_cells(part, shared), *_faults(part, others)))
        return Table("Agreement of the plants", ("controller", *headings), tuple(rows))

    @staticmethod
    def limit_notes(agreements: Sequence[Agreement]) -> list[str]:
        """Return which scenarios are not judged, and why, a line for each reason."""
        where: dict[tuple[str, str], dict[str, None]] = {}
        for agreement in agreements:
            if agreement.passed is None:
                where.setdefault((agreement.drive, agreement.limits), {})[agreement.scenario] = None
        notes = []
        for (drive, why), names in where.items():
            more = f" and {len(names) - MAX_NAMED_SCENARIOS} more" if len(names) > MAX_NAMED_SCENARIOS else ""
            notes.append(
                f"{', '.join([*names][:MAX_NAMED_SCENARIOS])}{more}, {drive} drives: not judged: {why}"
            )
        return notes

    @staticmethod
    def run_notes(results: Sequence[CaseResult]) -> list[str]:
        """Return a line for each stop, workspace violation and step that is too long."""
        where: dict[tuple[str, str], list[str]] = {}
        expected_stops: dict[tuple[str, str], list[float]] = {}
        for result, run in ((case, run) for case in results for run in case.runs):
            if run.status.stopped and result.as_expected:
                expected_stops.setdefault((run.scenario, run.status.label), []).append(run.end_s)
            notes = []
            if run.status.label != result.expected:
                notes.append(f"{run.status.label} at {run.end_s:g} s: {run.status.explanation}")
                notes += [f"expected to end with {result.expected}"] * (result.expected != "completed")
            for left in run.metrics.workspace_violations if run.metrics is not None else ():
                notes.append(f"{left.signal} leaves the workspace by up to {left.max_excess_m:.2f} m")
            for note in notes:
                name = f"{run.scenario}, {run.controller}"
                where.setdefault((name, note), []).append(f"{run.plant}/{run.drive}")
        stops = [
            f"{scenario}: {len(times)} runs stop with {status} at {min(times):g} to {max(times):g} s, "
            "as expected"
            for (scenario, status), times in expected_stops.items()
        ]
        steps = [
            f"{agreement.scenario}, {agreement.controller}: the steps are too long for the plants to agree; "
            f"with control.physics_step = {Quantity(agreement.curing_step_s).setting()} they do"
            for result in results
            for agreement in result.agreements
            if agreement.curing_step_s is not None
        ]
        return (
            [f"{name}: {note} ({', '.join(places)})" for (name, note), places in where.items()]
            + stops
            + steps
        )


def _best_marked(metric: Metric, texts: Sequence[str], whole: Sequence[bool]) -> list[Cell]:
    """Return the cells of a row; the best of the columns that are `whole` is marked, if they differ."""
    columns = list(zip(texts, whole, strict=True))
    compared = metric.better and not metric.parts
    values = {text: float(text) for text, counts in columns if counts and compared and text != MISSING}
    best = (max if metric.better == "higher" else min)(values, key=values.__getitem__, default="")
    marked = best if len(values) > 1 else None
    return [Cell(text, "best" if text == marked and counts else "") for text, counts in columns]


def _numbers_of(metric: Metric, metrics: RunMetrics | None) -> tuple[float | None, ...]:
    value = None if metrics is None else metrics.values[metric.name]
    return value if isinstance(value, tuple) else (value,)


def _shown_unit(metric: Metric, runs: Sequence[RunMetrics | None]) -> tuple[float, str]:
    """Return the factor to the unit in which a metric is shown, and that unit (degrees, kN)."""
    if metric.shown[1] != metric.unit:
        return metric.shown
    largest = max((abs(n) for run in runs for n in _numbers_of(metric, run) if n is not None), default=0.0)
    largest = max(largest, Quantity.PROCESSOR_ROUNDING) if largest else 0.0  # picometres would be rounding
    factor, unit = Quantity(largest, metric.unit).scale()
    return (factor, unit) if factor < 1.0 else (1.0, metric.unit)


def _text(metric: Metric, metrics: RunMetrics | None, factor: float) -> str:
    """Return a metric as text, with a dash for missing numbers."""
    numbers = _numbers_of(metric, metrics)
    return " ".join(MISSING if n is None else f"{factor * n:z.{metric.row.digits}f}" for n in numbers)


def _difference_headings(
    agreements: Sequence[Agreement], others: Sequence[str]
) -> tuple[list[str], SharedLimits]:
    """Return the headings of `_agreement_cells` and `_faults`, and the limits that drives share."""
    shared: SharedLimits = {}
    for drive in dict.fromkeys(agreement.drive for agreement in agreements):
        judged = [a for a in agreements if a.drive == drive and None not in (a.limit_m, a.limit_rad)]
        limits = {(agreement.limit_m, agreement.limit_rad) for agreement in judged}
        shared[drive] = limits.pop() if len(limits) == 1 else (None, None)
    headings = [
        f"{drive}\n{what}" + ("" if limit is None else f"\n< {limit:.3g}")
        for drive, limits_of_drive in shared.items()
        for what, limit in zip(("load [m]", "angle [rad]"), limits_of_drive, strict=True)
    ]
    return [*headings, "plants\nagree", *(("other\nfaults",) if any(others) else ())], shared


def _agreement_cells(part: Sequence[Judged], shared: SharedLimits) -> Iterator[Cell]:
    """Yield the largest differences for each kind of drive, then whether the plants agree."""
    for drive, limits in shared.items():
        of_drive = [agreement for agreement, _ in part if agreement.drive == drive]
        loads = [(agreement.max_load_error_m, agreement.limit_m) for agreement in of_drive]
        angles = [(agreement.max_angle_error_rad, agreement.limit_rad) for agreement in of_drive]
        for differences, common in zip((loads, angles), limits, strict=True):
            value, limit = max(differences, key=lambda pair: (isnan(pair[0]), pair[0]), default=(0.0, None))
            beside = "" if limit is None or common is not None else f" < {limit:.1e}"
            mark = "" if limit is None or value <= limit else "bad"  # NaN is above every limit
            yield Cell(f"{Quantity(value).si_difference()}{beside}" if differences else "-", mark)
    judged = [agreement for agreement, _ in part if agreement.passed is not None]
    answer = Cell.answer(all(agreement.passed for agreement in judged) if judged else None)
    drives = dict.fromkeys(agreement.drive for agreement in judged)
    if answer.mark == "good" and len(drives) < len({agreement.drive for agreement, _ in part}):
        answer = Cell(f"{answer.text} ({', '.join(drives)})", answer.mark)  # the others are not judged
    yield answer


def _faults(part: Sequence[Judged], others: Sequence[str]) -> list[Cell]:
    """Return what else is wrong with the cases of a row; nothing if no case has another fault."""
    faults = "; ".join(dict.fromkeys(other for _, other in part if other))
    return [Cell(faults, "bad" if faults else "")] if any(others) else []
