"""Tables of a campaign's page: outcome, influence, pairs on the same samples, uncertain parameters.

Labels of parameters and the format of numbers are here too.
"""

import shlex
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cranectl.campaign.definition import Campaign
from cranectl.campaign.evaluation import Analysis, GroupAnalysis, Pair
from cranectl.campaign.manifest import Manifest
from cranectl.campaign.report.cells import CellText
from cranectl.campaign.report.metric_text import METRIC_LABELS, MetricText
from cranectl.campaign.results import Results
from cranectl.campaign.sensitivity import SobolIndices
from cranectl.campaign.statistics import LEVELS, quantiles
from cranectl.campaign.summary import CONFIDENCE, MAIN_METRICS, MEASURE, GroupSummary
from cranectl.campaign.table import FAILED, describe
from cranectl.report import Cell, Table

REASONS = 3  # that are listed for runs that could not start
SEPARATING = 6  # parameters for each controller in the table of failures
_BETTER = f"the better one is named where p is below {1 - CONFIDENCE:.2g}."


class CampaignTables:
    """Tables of a campaign, and how they name metrics, parameters and numbers."""

    @staticmethod
    def parameter_label(campaign: Campaign, name: str) -> str:
        """Return name and unit of a parameter, the name without `effects.`."""
        unit = describe(campaign, name).unit
        short = name.removeprefix("effects.")
        return f"{short} [{unit}]" if unit else short

    @staticmethod
    def number(value: float | None, digits: int = 3, form: str = "") -> str:
        """Return a number as text, with `digits` digits or in `form`; a dash without a number.

        Numbers below a million have no exponent, so that tensions and masses of large cranes are readable.
        """
        if value is None or value != value:
            return "–"
        return format(value, form) if form else f"{float(f'{value:.{digits}g}'):g}"

    @staticmethod
    def percent(share: float | None) -> str:
        """Return a share in percent; a dash without one."""
        return CampaignTables.number(share and 100.0 * share, form=".1f")

    @staticmethod
    def replay_command(results: Results, sample: int, controller: str, plant: str = "") -> str:
        """Return the command that runs a sample again, by default on all plants."""
        named = Manifest.controller(results.manifest, results.directory, controller)
        options = ["--run", str(sample), "--controller", named, *(["--plant", plant] if plant else [])]
        return shlex.join(["cranectl", "campaign", "replay", str(results.directory), *options])

    @staticmethod
    def summary(groups: Sequence[GroupSummary], title: str) -> Table:
        """Return a table with one row for each controller."""
        columns: dict[str, Callable[[GroupSummary], str]] = {
            "controller": lambda group: group.controller,
            "runs": lambda group: str(group.runs),
            "failed": lambda group: str(group.failures),
            "failure\nrate %": lambda group: CampaignTables.percent(group.failure_rate),
            "95 %\ninterval": lambda group: "-".join(
                map(CampaignTables.percent, group.failure_rate_interval or (None,))
            ),
            "error [m]\nmedian": lambda group: CampaignTables.number(group.median_max_error_m, form=".4f"),
            "error [m]\n95 %": lambda group: CampaignTables.number(group.q95_max_error_m, form=".4f"),
            "worst\nrun": lambda group: "–" if group.worst_sample is None else str(group.worst_sample),
        }
        note = "Error: the largest of a run, over completed runs. Worst: the run with the largest of all."
        return Table.of(title, groups, columns, note=note)

    @staticmethod
    def failure_notes(groups: Sequence[GroupSummary]) -> list[str]:
        """Return a line on the failures of each controller, then why some runs could not be run."""
        lines = []
        for group in groups:
            how = [f"{count} {status}" for status, count in group.stopped.items()]
            how += [f"{count} beyond {metric}" for metric, count in group.broken.items()]
            if how:
                lines.append(f"{group.controller}: {', '.join(how)}")
            lines += [
                f"{count} could not be run: {why}" for why, count in list(group.not_run.items())[:REASONS]
            ]
        return lines

    @staticmethod
    def quantiles(parts: Sequence[GroupAnalysis]) -> Table:
        """Return the quantiles of every metric over completed runs, by metric and controller."""
        rows = []
        for metric in parts[0].group.metrics:
            for part in parts:
                values = MetricText.shown(metric, part.group.metrics[metric])
                least, largest = CellText.ends(values)
                spread, runs = (
                    map(CampaignTables.number, (least, *quantiles(values), largest)),
                    np.isfinite(values).sum(),
                )
                rows.append(Cell.row(METRIC_LABELS[metric], part.group.controller, str(runs), *spread))
        headings = ("metric", "controller", "runs", "least", *(f"{100 * q:g} %" for q in LEVELS), "largest")
        note = "Over completed runs that have the metric; runs that do not settle have no settling time."
        return Table(f"Metrics on {parts[0].group.plant}", headings, tuple(rows), labels=2, note=note)

    @staticmethod
    def separation(parts: Sequence[GroupAnalysis]) -> Table:
        """Return a table that compares the parameters of failed runs with those of the others."""
        rows = []
        for part in parts:
            for parameter in part.separations[:SEPARATING]:
                distance = Cell(
                    CampaignTables.number(parameter.distance), "bad" if parameter.significant else ""
                )
                medians = (
                    CampaignTables.number(parameter.failed_median),
                    CampaignTables.number(parameter.other_median),
                )
                rows.append(Cell.row(part.group.controller, parameter.parameter, distance, *medians))
        headings = ("controller", "parameter", "distance", "median of failed", "of the others")
        note = (
            "Distance: Kolmogorov-Smirnov, 0 for equal distributions, 1 for separate values, largest first. "
            "Red: "
            f"more than chance explains, at {100 * CONFIDENCE:g} % for all parameters of a controller "
            "together."
        )
        title = f"Failed and other runs on {parts[0].group.plant}"
        return Table(title, headings, tuple(rows), labels=2, note=note)

    @staticmethod
    def sobol(parts: Sequence[GroupAnalysis], parameters: Sequence[str]) -> Table:
        """Return a table of the total indices of all metrics, with intervals."""
        rows = tuple(
            Cell.row(part.group.controller, name, *(_sobol_cell(part.sobol.get(m), k) for m in MAIN_METRICS))
            for part in parts
            for k, name in enumerate(parameters)
        )
        headings = ("controller", "parameter", *map(MetricText.name, MAIN_METRICS))
        note = (
            "Total index and its 95 % interval. "
            "Green: the whole interval is above 0.05, the parameter matters."
        )
        return Table(f"Total Sobol indices on {parts[0].group.plant}", headings, rows, labels=2, note=note)

    @staticmethod
    def one_at_a_time(part: GroupAnalysis) -> Table:
        """Return a table with every step of a one-at-a-time design."""
        nominal = np.array([part.group.metrics[metric][0] for metric in MAIN_METRICS])
        steps: list[tuple[Any, ...]] = [("nominal", "", "0", nominal)]
        steps += [
            (s.parameter, CampaignTables.number(s.value, 4), str(s.sample), s.metrics)
            for s in part.one_at_a_time
        ]
        rows = [
            Cell.row(
                *texts,
                *(
                    CampaignTables.number(float(MetricText.shown(metric, value)), 4)
                    for metric, value in zip(MAIN_METRICS, values, strict=True)
                ),
            )
            for *texts, values in steps
        ]
        headings = ("parameter", "value", "sample", *(METRIC_LABELS[metric] for metric in MAIN_METRICS))
        note = "A dash: the run did not complete, or has no such metric."
        return Table(f"{part.group.name}, step by step", headings, tuple(rows), note=note)

    @staticmethod
    def worst(analysis: Analysis) -> Table:
        """Return a table of runs to look at, with the commands that replay them."""
        rows = []
        for run in analysis.worst:
            replay = Cell("cannot be replayed")
            if run.status != FAILED:
                replay = Cell(
                    CampaignTables.replay_command(analysis.results, run.sample, run.controller, run.plant),
                    "code",
                )
            ended = Cell(run.status, "" if run.status == "completed" else "bad")
            numbers = f"{run.end_s:g}", CampaignTables.number(run.max_error_m, 4)
            rows.append(
                Cell.row(run.plant, run.controller, run.why, replay, str(run.sample), ended, *numbers)
            )
        headings = ("plant", "controller", "why", "replay", "sample", "ended", "at [s]", "largest error [m]")
        note = (
            "The runs farthest beyond each limit that is broken, or else the largest errors. The error of a "
            "stopped run is that until it stopped. Then comes one run for each other way to stop."
        )
        return Table("Runs worth a look", headings, tuple(rows), labels=4, note=note)

    @staticmethod
    def uncertainty(analysis: Analysis) -> Table:
        """Return a table of the uncertain parameters and the values of the runs."""
        campaign = analysis.results.campaign
        rows = []
        for parameter, values in zip(campaign.parameters, analysis.values.T, strict=True):
            numbers = (parameter.nominal, *CellText.ends(values))
            texts = (
                parameter.name,
                describe(campaign, parameter.name).unit,
                CellText.distribution(parameter),
            )
            rows.append(Cell.row(*texts, *(CampaignTables.number(value, 4) for value in numbers)))
        headings = ("parameter", "unit", "distribution in the plant", "nominal", "sampled from", "to")
        note = "The controller and its reference know the nominal values only."
        if campaign.settings.correlation:
            note += f" Rank correlations: {'; '.join(map(str, campaign.settings.correlation))}."
        return Table("What is uncertain", headings, tuple(rows), labels=3, note=note)

    @staticmethod
    def controllers(pairs: Sequence[Pair], sampling: str) -> Table:
        """Return a table of differences on the same samples, a row for each metric of each pair."""
        tests = len(pairs) * len(MAIN_METRICS)
        rows = []
        for pair in pairs:
            one, other = pair.second.controller, pair.first.controller
            for difference in pair.differences:
                better = one if difference.second_better > difference.first_better else other
                spread, share = (
                    map(CampaignTables.number, MetricText.shown(difference.metric, difference.quantiles)),
                    CampaignTables.percent(difference.better_share),
                )
                texts = (METRIC_LABELS[difference.metric], str(difference.samples), *spread, share)
                test = CellText.tested(difference.p, tests, sampling, better)
                rows.append(Cell.row(f"{one} minus {other}", *texts, *test))
        headings = (
            "controllers", "metric", "samples", *(f"{100 * q:g} %" for q in LEVELS),
            "the first is better in %",
            "p", "better",
        )  # fmt: skip
        note = (
            "Over samples that both completed and that have the metric: the same crane, the same gusts. p: "
            "sign "
            f"test, corrected for {tests} rows; {_BETTER}"
        )
        return Table(
            f"Paired differences on {pairs[0].first.plant}", headings, tuple(rows), labels=2, note=note
        )

    @staticmethod
    def failures(pairs: Sequence[Pair], sampling: str, title: str) -> Table:
        """Return a table of the samples on which only one of two groups fails."""
        rows = []
        for pair in pairs:
            failures, a, b = pair.failures, pair.first, pair.second
            one, other = (a.controller, b.controller) if a.plant == b.plant else (a.name, b.name)
            only, only_other = len(failures.first_only), len(failures.second_only)
            lists = (CellText.samples(failures.first_only), CellText.samples(failures.second_only))
            counts = map(str, (failures.neither, failures.both, only, only_other))
            test = CellText.tested(failures.p, len(pairs), sampling, one if only < only_other else other)
            rows.append(Cell.row(one, other, *lists, *counts, *test))
        headings = (
            "one", "other", "only one fails on samples", "only the other on samples", "neither", "both",
            "only one", "only the other", "p", "better",
        )  # fmt: skip
        return Table(title, headings, tuple(rows), labels=4, note=f"p: McNemar's exact test; {_BETTER}")

    @staticmethod
    def plants(pairs: Sequence[Pair]) -> Table:
        """Return a table that compares the largest errors on two plants."""
        rows = []
        for pair in pairs:
            agreement = pair.agreement
            largest = abs(agreement.largest[0][1]) if agreement.largest else None
            texts = (
                pair.first.controller,
                str(agreement.samples),
                CampaignTables.number(agreement.rho, form=".5f"),
            )
            rows.append(Cell.row(*texts, *map(CampaignTables.number, (*agreement.quantiles, largest))))
        levels = (f"|difference| {100 * q:g} %" for q in LEVELS)
        headings = ("controller", "samples", "rank correlation", *levels, "largest")
        note = "Differences of the largest error [m], over samples that completed on both plants."
        return Table("Differences between the plants", headings, tuple(rows), note=note)

    @staticmethod
    def disagreements(analysis: Analysis, pairs: Sequence[Pair]) -> Table:
        """Return a table of the samples on which the plants differ most, with commands that replay them."""
        rows = []
        for pair in pairs:
            for sample, difference in pair.agreement.largest:
                replay = Cell(
                    CampaignTables.replay_command(analysis.results, sample, pair.first.controller), "code"
                )
                errors = (
                    CampaignTables.number(group.metrics[MEASURE][sample], 4)
                    for group in (pair.first, pair.second)
                )
                rows.append(
                    Cell.row(pair.first.controller, replay, str(sample), *errors, f"{difference:+.3g}")
                )
        one, other = pairs[0].first.plant, pairs[0].second.plant
        headings = (
            "controller",
            "replay",
            "sample",
            f"error on {one} [m]",
            f"on {other} [m]",
            "difference [m]",
        )
        return Table("Largest differences between the plants", headings, tuple(rows), labels=2)


def _sobol_cell(indices: SobolIndices | None, k: int) -> Cell:
    if indices is None:
        return Cell("–")
    low, high = indices.total_interval[:, k]
    return Cell(f"{indices.total[k]:.2f} ({low:.2f}–{high:.2f})", "good" if indices.important[k] else "")
