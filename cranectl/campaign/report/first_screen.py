"""The first screen of a campaign's page: how many runs fail, at which limit, and with which parameters."""

from collections.abc import Iterator, Sequence

import numpy as np

from cranectl.campaign.evaluation import Analysis, GroupAnalysis
from cranectl.campaign.failures import FailureVerdict, percent
from cranectl.campaign.report.figures import CampaignFigures
from cranectl.campaign.report.metric_text import MetricText
from cranectl.campaign.report.tables import CampaignTables
from cranectl.campaign.summary import GroupSummary, compared_parameters, worst_first
from cranectl.metrics import Metric
from cranectl.report import Cell, Fact, Figure, FirstScreen, Table

MAX_FACTS = 6  # controllers on plants with a number of their own
MAX_PANELS = 4  # controllers in the picture


def first_screen_of(analysis: Analysis, verdicts: Sequence[FailureVerdict] = ()) -> FirstScreen:
    """Return the first screen; `verdicts` say whether too many runs fail, if a number was allowed."""
    summaries = [part.summary for part in analysis.groups]
    figure = _picture(analysis)
    return FirstScreen(
        _badge(analysis, summaries, verdicts),
        " ".join(_reason(analysis, summaries, verdicts)),
        tuple(_facts(analysis, summaries[:MAX_FACTS])),
        tuple(_limits(analysis)),
        (figure,) if figure else (),
    )


def _badge(analysis: Analysis, summaries: Sequence[GroupSummary], verdicts: Sequence[FailureVerdict]) -> Cell:
    failures, runs = (sum(getattr(group, name) for group in summaries) for name in ("failures", "runs"))
    if verdicts:
        return Cell("PASS", "good") if all(verdict.kept for verdict in verdicts) else Cell("FAIL", "bad")
    if failures:
        return Cell(f"{failures} OF {runs} FAIL", "bad")
    if not analysis.results.campaign.settings.limits.given:
        return Cell("NO LIMITS SET", "open")
    return Cell(f"ALL {runs} PASS", "good") if not analysis.results.missing else Cell("INCOMPLETE", "open")


def _reason(
    analysis: Analysis, summaries: Sequence[GroupSummary], verdicts: Sequence[FailureVerdict]
) -> Iterator[str]:
    """Yield the verdict in sentences."""
    results = analysis.results
    yield from (f"{verdict.name}: {verdict.text}." for verdict in verdicts if not verdict.kept)
    if results.missing:
        yield f"{results.missing_runs} of {results.campaign.all_runs} runs are missing."
    limits = results.campaign.settings.limits.given
    for metric, limit in limits.items():
        if broken := sum(group.broken.get(metric, 0) for group in summaries):
            yield f"{_runs(broken, 'break')} the limit {_limit_text(metric, limit)}."
    if limits and not any(group.broken for group in summaries):
        yield f"No run that completes breaks {'the limit' if len(limits) == 1 else 'a limit'}."
    stopped = sum(sum(group.stopped.values()) for group in summaries)
    if stopped:
        yield f"{_runs(stopped, 'stop')} early."
    elif not limits:
        yield "No run stops early; the table [limits] of the campaign's file would judge them."


def _runs(count: int, verb: str) -> str:
    return f"1 run {verb}s" if count == 1 else f"{count} runs {verb}"


def _limit_text(metric: str, limit: float) -> str:
    sign = "≥" if Metric.low_is_bad(metric) else "≤"
    return f"{MetricText.name(metric)} {sign} {MetricText.quantity(metric, limit)}"


def _facts(analysis: Analysis, summaries: Sequence[GroupSummary]) -> Iterator[Fact]:
    several = len({group.plant for group in summaries}) > 1
    for group in summaries:
        remark = "of the samples"
        if group.failure_rate_interval:
            low, high = map(percent, group.failure_rate_interval)
            remark = f"{low} to {high} % of all such cranes fail, at 95 %"
        name = f"{group.controller} on {group.plant}" if several else group.controller
        mark = "bad" if group.failures else ""
        yield Fact(name, f"{group.failures} of {group.runs} fail", remark, mark)
    if analysis.results.missing:
        share = f"{len(analysis.results)} of {analysis.results.campaign.all_runs}"
        yield Fact("Runs in the result", share, "the page describes these")


def _limits(analysis: Analysis) -> Iterator[Table]:
    """Yield a table with the worst value of each limited metric, for each controller and plant."""
    results, rows = analysis.results, []
    for metric, limit in results.campaign.settings.limits.given.items():
        for part in analysis.groups:
            group, broken = part.group, part.summary.broken.get(metric, 0)
            of_group = results.rows(group.plant, group.controller)
            worst = next(iter(worst_first(results, metric, of_group)), None)
            value = None if worst is None else float(results.column(metric)[worst])
            sample = "–" if worst is None else str(results.column("sample")[worst])
            shown = Cell(MetricText.quantity(metric, value), "bad" if broken else "")
            who = group.name if len(analysis.by_plant) > 1 else group.controller
            rows.append(Cell.row(_limit_text(metric, limit), who, str(broken), shown, sample))
    if rows:
        headings = ("limit", "controller", "runs that break it", "worst", "in run")
        yield Table("", headings, tuple(rows), labels=2)


def _picture(analysis: Analysis) -> Figure | None:
    """Return the failed and the other runs over what separates them most; None without parameters."""
    parts = max(analysis.by_plant, key=lambda parts: sum(part.summary.failures for part in parts))
    columns = _columns(analysis, parts)
    if not columns:
        return None
    shown = parts[:MAX_PANELS]
    title = f"where runs fail, on {parts[0].group.plant}"
    caption = " ".join(_where(analysis, part) for part in shown)
    return Figure.drawn(title, caption, CampaignFigures.failed_runs, analysis, shown, columns)


def _columns(analysis: Analysis, parts: Sequence[GroupAnalysis]) -> list[int]:
    """Return the two parameters that separate failed runs most, or go most with the metrics."""
    campaign, compared = analysis.results.campaign, compared_parameters(analysis.results)
    weights = np.zeros(len(campaign.names))
    for part in parts:
        for separation in part.separations:
            column = campaign.names.index(separation.parameter)
            weights[column] = max(weights[column], 1.0 + np.nan_to_num(separation.distance))
        if part.correlations is not None:  # where all runs fail, or none
            columns = [campaign.names.index(name) for name in part.correlations.parameters]
            strongest = np.nan_to_num(np.abs(part.correlations.rho)).max(axis=1)
            weights[columns] = np.maximum(weights[columns], strongest)
    return sorted(compared, key=lambda column: -weights[column])[:2]


def _where(analysis: Analysis, part: GroupAnalysis) -> str:
    """Return in a sentence what the failed runs of a controller have in common."""
    summary, name = part.summary, part.group.controller
    if summary.failures in (0, summary.runs):
        return f"{name}: {'no run fails' if not summary.failures else 'every run fails'}."
    telling = [separation for separation in part.separations if separation.significant]
    if not telling:
        return f"{name}: no parameter tells failed runs from the others beyond chance."
    most = telling[0]
    label = CampaignTables.parameter_label(analysis.results.campaign, most.parameter)
    failed, others = map(CampaignTables.number, (most.failed_median, most.other_median))
    return f"{name}: the median of {label} is {failed} where runs fail, and {others} else."
