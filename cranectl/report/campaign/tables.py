"""Tables of a campaign's page."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cranectl.campaign.evaluation import Analysis, GroupAnalysis
from cranectl.campaign.groups import EFFORT, MAIN_METRICS
from cranectl.campaign.parameters import Parameter
from cranectl.campaign.statistics import quantiles
from cranectl.campaign.summary import CONFIDENCE
from cranectl.campaign.table import FAILED, describe
from cranectl.report.campaign.labels import LEVELS, METRIC_LABELS, metric_name, number, replay_command
from cranectl.report.table import Cell, Table

SEPARATING = 6  # parameters of a controller in the table of failures


def metrics_quantiles(parts: Sequence[GroupAnalysis]) -> Table:
    """Quantiles of every metric over completed runs, a row for each metric and controller."""
    rows = []
    for metric in (*MAIN_METRICS, EFFORT):
        for part in parts:
            values = part.group.metrics[metric]
            found = quantiles(values, LEVELS)
            have = np.isfinite(values)
            ends = (values[have].min(), values[have].max()) if have.any() else (None, None)
            cells = (int(have.sum()), number(ends[0]), *map(number, found), number(ends[1]))
            rows.append(
                (Cell(METRIC_LABELS[metric]), Cell(part.group.controller), *(Cell(str(c)) for c in cells))
            )
    headings = ("metric", "controller", "runs", "least", *(f"{100 * q:g} %" for q in LEVELS), "largest")
    note = "Over completed runs that have the metric: without settling time are those that do not settle."
    return Table(f"Metrics on {parts[0].group.plant}", headings, tuple(rows), labels=2, note=note)


def separation_table(parts: Sequence[GroupAnalysis]) -> Table:
    """How parameters differ between failed runs and the others."""
    rows = tuple(
        (
            Cell(part.group.controller),
            Cell(each.parameter),
            Cell(number(each.distance), "bad" if each.significant else ""),
            Cell(number(each.failed_median)),
            Cell(number(each.other_median)),
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
            cells = []
            for metric in MAIN_METRICS:
                found = part.sobol.get(metric)
                if found is None:
                    cells.append(Cell("–"))
                    continue
                low, high = found.total_interval[:, k]
                text = f"{found.total[k]:.2f} ({low:.2f}–{high:.2f})"
                cells.append(Cell(text, "good" if found.important[k] else ""))
            rows.append((Cell(part.group.controller), Cell(parameter), *cells))
    headings = ("controller", "parameter", *map(metric_name, MAIN_METRICS))
    note = "Total index and its 95 % interval. Green: all of it above 0.05, the parameter matters."
    return Table(f"Total Sobol indices on {parts[0].group.plant}", headings, tuple(rows), labels=2, note=note)


def swings_table(part: GroupAnalysis) -> Table:
    """Every step of a one-at-a-time design."""
    nominal = (part.group.metrics[metric][0] for metric in MAIN_METRICS)
    rows = [(Cell("nominal"), Cell(""), Cell("0"), *(Cell(number(float(value), 4)) for value in nominal))]
    rows += [
        (
            Cell(swing.parameter),
            Cell(number(swing.value, 4)),
            Cell(str(swing.sample)),
            *(Cell(number(float(value), 4)) for value in swing.metrics),
        )
        for swing in part.swings
    ]
    headings = ("parameter", "value", "sample", *(METRIC_LABELS[metric] for metric in MAIN_METRICS))
    note = "A dash: the run did not complete, or has no such metric."
    return Table(f"{part.group.name}, step by step", headings, tuple(rows), note=note)


def worst_table(analysis: Analysis) -> Table:
    """Runs to look at, with what replays them."""
    rows = tuple(
        (
            Cell(run.plant),
            Cell(run.controller),
            Cell(run.why),
            Cell(
                "cannot be replayed"
                if run.status == FAILED
                else replay_command(analysis.results.directory, run.sample, run.controller, run.plant)
            ),
            Cell(str(run.sample)),
            Cell(run.status, "" if run.status == "completed" else "bad"),
            Cell(f"{run.end_s:g}"),
            Cell(number(run.max_error_m, 4)),
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
        rows.append((*map(Cell, texts), *(Cell(number(value, 4)) for value in numbers)))
    headings = ("parameter", "unit", "distribution of what the plant has", "nominal", "sampled from", "to")
    pairs = [f"{' and '.join(pair.between)}: {pair.value:g}" for pair in campaign.settings.correlation]
    note = "The controller and its reference know the nominal values only."
    if pairs:
        note += f" Rank correlations: {'; '.join(pairs)}."
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
