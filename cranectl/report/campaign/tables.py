"""Tables of a campaign's page."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cranectl.campaign.definition import Parameter
from cranectl.campaign.evaluation import Analysis, GroupAnalysis
from cranectl.campaign.groups import EFFORT, MAIN_METRICS
from cranectl.campaign.sensitivity import SobolIndices
from cranectl.campaign.statistics import quantiles
from cranectl.campaign.summary import CONFIDENCE, GroupSummary
from cranectl.campaign.table import FAILED, describe
from cranectl.report.campaign.labels import (
    LEVELS,
    METRIC_LABELS,
    metric_name,
    number,
    percent,
    replay_command,
)
from cranectl.report.table import Cell, Table, cells

REASONS = 3  # why runs could not be run
SEPARATING = 6  # parameters of a controller in the table of failures


def summary_table(groups: Sequence[GroupSummary], title: str) -> Table:
    """One row a controller; line breaks are for the terminal."""
    rows = []
    for group in groups:
        ends = group.failure_rate_interval
        errors = (group.median_max_error_m, group.q95_max_error_m)
        row = cells(
            group.controller.replace("+", "\n+"),
            str(group.runs),
            str(group.failures),
            percent(group.failure_rate),
            "–" if ends is None else "-".join(map(percent, ends)),
            *("–" if error is None else f"{error:.4f}" for error in errors),
            "–" if group.worst_sample is None else str(group.worst_sample),
        )
        rows.append(row)
    headings = (
        "controller", "runs", "failed", "failure\nrate %", "95 %\ninterval", "error [m]\nmedian",
        "error [m]\n95 %", "worst\nrun",
    )  # fmt: skip
    note = "Error: the largest of a run, over completed runs. Worst: the run with the largest of all."
    return Table(title, headings, tuple(rows), note=note)


def failure_notes(groups: Sequence[GroupSummary]) -> list[str]:
    """How runs failed, a line for each controller that has failures; then why some could not be run."""
    lines = []
    for group in groups:
        how = [f"{count} {status}" for status, count in group.stopped.items()]
        how += [f"{count} beyond {metric}" for metric, count in group.broken.items()]
        if how:
            lines.append(f"{group.controller}: {', '.join(how)}")
        lines += [f"{count} could not be run: {why}" for why, count in list(group.not_run.items())[:REASONS]]
    return lines


def metrics_quantiles(parts: Sequence[GroupAnalysis]) -> Table:
    """Quantiles of every metric over completed runs, a row for each metric and controller."""
    rows = []
    for metric in (*MAIN_METRICS, EFFORT):
        for part in parts:
            values = part.group.metrics[metric]
            found = quantiles(values, LEVELS)
            have = np.isfinite(values)
            ends = (values[have].min(), values[have].max()) if have.any() else (None, None)
            spread = (number(ends[0]), *map(number, found), number(ends[1]))
            rows.append(cells(METRIC_LABELS[metric], part.group.controller, str(have.sum()), *spread))
    headings = ("metric", "controller", "runs", "least", *(f"{100 * q:g} %" for q in LEVELS), "largest")
    note = "Over completed runs that have the metric: without settling time are those that do not settle."
    return Table(f"Metrics on {parts[0].group.plant}", headings, tuple(rows), labels=2, note=note)


def separation_table(parts: Sequence[GroupAnalysis]) -> Table:
    """How parameters differ between failed runs and the others."""
    rows = tuple(
        cells(
            part.group.controller,
            each.parameter,
            Cell(number(each.distance), "bad" if each.significant else ""),
            number(each.failed_median),
            number(each.other_median),
        )
        for part in parts
        for each in part.separations[:SEPARATING]
    )
    headings = ("controller", "parameter", "distance", "median of failed", "of the others")
    note = (
        "Distance: Kolmogorov-Smirnov, 0 for the same distribution, 1 for values apart, largest first. Red: "
        f"more than chance explains, at {100 * CONFIDENCE:g} % for all parameters of a controller together."
    )
    return Table(f"Failed and other runs on {parts[0].group.plant}", headings, rows, labels=2, note=note)


def sobol_table(parts: Sequence[GroupAnalysis], parameters: Sequence[str]) -> Table:
    """Total indices with intervals, for all metrics."""
    rows = []
    for part in parts:
        for k, parameter in enumerate(parameters):
            indices = (_sobol_cell(part.sobol.get(metric), k) for metric in MAIN_METRICS)
            rows.append(cells(part.group.controller, parameter, *indices))
    headings = ("controller", "parameter", *map(metric_name, MAIN_METRICS))
    note = "Total index and its 95 % interval. Green: all of it above 0.05, the parameter matters."
    return Table(f"Total Sobol indices on {parts[0].group.plant}", headings, tuple(rows), labels=2, note=note)


def _sobol_cell(found: SobolIndices | None, k: int) -> Cell:
    if found is None:
        return Cell("–")
    low, high = found.total_interval[:, k]
    return Cell(f"{found.total[k]:.2f} ({low:.2f}–{high:.2f})", "good" if found.important[k] else "")


def one_at_a_time_table(part: GroupAnalysis) -> Table:
    """Every step of a one-at-a-time design."""
    nominal = [part.group.metrics[metric][0] for metric in MAIN_METRICS]
    steps: list[tuple[Any, ...]] = [("nominal", "", "0", nominal)]
    steps += [(s.parameter, number(s.value, 4), str(s.sample), s.metrics) for s in part.one_at_a_time]
    rows = [cells(*texts, *(number(float(value), 4) for value in values)) for *texts, values in steps]
    headings = ("parameter", "value", "sample", *(METRIC_LABELS[metric] for metric in MAIN_METRICS))
    note = "A dash: the run did not complete, or has no such metric."
    return Table(f"{part.group.name}, step by step", headings, tuple(rows), note=note)


def worst_table(analysis: Analysis) -> Table:
    """Runs to look at, with what replays them."""
    rows = tuple(
        cells(
            run.plant,
            run.controller,
            run.why,
            "cannot be replayed"
            if run.status == FAILED
            else replay_command(analysis.results.directory, run.sample, run.controller, run.plant),
            str(run.sample),
            Cell(run.status, "" if run.status == "completed" else "bad"),
            f"{run.end_s:g}",
            number(run.max_error_m, 4),
        )
        for run in analysis.worst
    )
    headings = ("plant", "controller", "why", "replay", "sample", "ended", "at [s]", "largest error [m]")
    note = "The largest errors, of stopped runs until they stopped; then one of each other way to stop."
    return Table("Runs worth a look", headings, rows, labels=4, note=note)


def uncertainty_table(analysis: Analysis) -> Table:
    """What is uncertain, and which values the runs had."""
    campaign = analysis.results.campaign
    rows = []
    for parameter, values in zip(campaign.parameters, analysis.values.T, strict=True):
        had = values[np.isfinite(values)]
        sampled = (had.min(), had.max()) if had.size else (None, None)
        numbers = (parameter.nominal, *sampled)
        texts = (parameter.name, describe(campaign, parameter.name).unit, _distribution(parameter))
        rows.append(cells(*texts, *(number(value, 4) for value in numbers)))
    headings = ("parameter", "unit", "distribution of what the plant has", "nominal", "sampled from", "to")
    note = "The controller and its reference know the nominal values only."
    if campaign.settings.correlation:
        note += f" Rank correlations: {'; '.join(map(str, campaign.settings.correlation))}."
    return Table("What is uncertain", headings, tuple(rows), labels=3, note=note)


def _distribution(parameter: Parameter) -> str:
    facts: dict[str, Any] = parameter.distribution.model_dump(exclude_none=True)
    kind, relative = facts.pop("distribution"), facts.pop("relative")
    text = ", ".join(f"{key} {_short(value)}" for key, value in facts.items() if value != ())
    return f"{kind}: {text}{', times the nominal value' if relative else ''}".rstrip(": ")


def _short(value: Any) -> str:
    if isinstance(value, tuple | list):
        return " ".join(map(_short, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
