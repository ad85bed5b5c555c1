"""Tables of pairs on the same samples: controllers against each other, one plant against the other."""

from collections.abc import Sequence

import numpy as np

from cranectl.campaign.evaluation import Analysis
from cranectl.campaign.groups import MAIN_METRICS, Pair
from cranectl.campaign.summary import CONFIDENCE, INDEPENDENT, MEASURE
from cranectl.report.campaign.labels import (
    LEVELS,
    METRIC_LABELS,
    number,
    percent,
    probability,
    replay_command,
)
from cranectl.report.table import Table, cells

LISTED = 12  # sample indices in a cell


def controller_differences(pairs: Sequence[Pair], sampling: str) -> Table:
    """One minus the other on the same samples, a row for each metric of each pair."""
    tests = len(pairs) * len(MAIN_METRICS)
    rows = []
    for pair in pairs:
        one, other = pair.second.controller, pair.first.controller
        for each in pair.differences:
            better = one if each.second_better > each.first_better else other
            found = (str(each.samples), *map(number, each.quantiles), percent(each.better_share))
            test = _tested(each.p, tests, sampling, better)
            rows.append(cells(f"{one} minus {other}", METRIC_LABELS[each.metric], *found, *test))
    headings = (
        "controllers", "metric", "samples", *(f"{100 * q:g} %" for q in LEVELS), "the first is better in %",
        "p", "better",
    )  # fmt: skip
    note = (
        "Over samples that both completed and that have the metric: the same crane, the same gusts. p: sign "
        f"test, corrected for {tests} rows; {_BETTER}"
    )
    return Table(f"Paired differences on {pairs[0].first.plant}", headings, tuple(rows), labels=2, note=note)


def failures_table(pairs: Sequence[Pair], sampling: str, title: str) -> Table:
    """On which samples only one of two groups fails, of which one plant or one controller differs."""
    rows = []
    for pair in pairs:
        found, a, b = pair.failures, pair.first, pair.second
        one, other = (a.controller, b.controller) if a.plant == b.plant else (a.name, b.name)
        only, only_other = len(found.first_only), len(found.second_only)
        lists = (_listed(found.first_only), _listed(found.second_only))
        counts = map(str, (found.neither, found.both, only, only_other))
        test = _tested(found.p, len(pairs), sampling, one if only < only_other else other)
        rows.append(cells(one, other, *lists, *counts, *test))
    headings = (
        "one", "other", "only one fails on samples", "only the other on samples", "neither", "both",
        "only one", "only the other", "p", "better",
    )  # fmt: skip
    return Table(title, headings, tuple(rows), labels=4, note=f"p: McNemar's exact test; {_BETTER}")


_BETTER = f"the better one is named where p is below {1 - CONFIDENCE:.2g}."


def plants_agreement(pairs: Sequence[Pair]) -> Table:
    """How far the plants' largest errors are apart."""
    rows = tuple(
        cells(
            pair.first.controller,
            str(pair.agreement.samples),
            "–" if np.isnan(pair.agreement.rho) else f"{pair.agreement.rho:.5f}",
            *map(number, pair.agreement.quantiles),
            number(abs(pair.agreement.largest[0][1]) if pair.agreement.largest else None),
        )
        for pair in pairs
    )
    levels = (f"|difference| {100 * q:g} %" for q in LEVELS)
    headings = ("controller", "samples", "rank correlation", *levels, "largest")
    note = "Of the largest error [m], over samples completed on both plants."
    return Table("How far the plants are apart", headings, rows, note=note)


def disagreements(analysis: Analysis, pairs: Sequence[Pair]) -> Table:
    """The samples on which the plants are farthest apart, with what replays both."""
    rows = tuple(
        cells(
            pair.first.controller,
            replay_command(analysis.results.directory, sample, pair.first.controller),
            str(sample),
            *(number(float(group.metrics[MEASURE][sample]), 4) for group in (pair.first, pair.second)),
            f"{difference:+.3g}",
        )
        for pair in pairs
        for sample, difference in pair.agreement.largest
    )
    one, other = pairs[0].first.plant, pairs[0].second.plant
    headings = ("controller", "replay", "sample", f"error on {one} [m]", f"on {other} [m]", "difference [m]")
    return Table("Where the plants are farthest apart", headings, rows, labels=2)


def _tested(p: float, tests: int, sampling: str, better: str) -> tuple[str, str]:
    """A p-value corrected for `tests`, and who is better if it says so; no test without a random sample."""
    if sampling not in INDEPENDENT:
        return "–", "–"
    corrected = min(1.0, p * tests)
    return probability(corrected), better if corrected < 1.0 - CONFIDENCE else "–"


def _listed(samples: Sequence[int]) -> str:
    shown = ", ".join(map(str, samples[:LISTED]))
    return f"{shown} and {len(samples) - LISTED} more" if len(samples) > LISTED else shown or "none"
