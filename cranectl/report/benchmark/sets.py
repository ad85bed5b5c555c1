"""A set of cranes: how the laws of a division stand, figures of it, each scenario by itself."""

from collections.abc import Iterator, Sequence

import numpy as np

from cranectl.campaign.benchmark import scores
from cranectl.campaign.benchmark.standings import Standing, points_of, shared_scenarios
from cranectl.campaign.benchmark.table import Runs
from cranectl.campaign.summary import failure_interval
from cranectl.report.benchmark import figures
from cranectl.report.benchmark.division import COMPARED, NAMED, Judged, finite, median
from cranectl.report.page import Figure, Section
from cranectl.report.table import ANSWERS, Table, cells


def set_section(judged: Judged, name: str) -> Iterator[Section]:
    """One of the sets that are judged."""
    found = judged.standings(name)
    if not found:
        return
    benchmark, table, division = judged
    points = points_of(found)
    best, drawable = scores.undominated(points), np.asarray(np.isfinite(points).all(axis=1))
    drawn = Figure.drawn(
        "effort against settling",
        "Full, with names: no other law is as good in settling, effort and failures and better in one. "
        "The larger, the more failures.",
        figures.fronts,
        [s.law for s, there in zip(found, drawable, strict=True) if there],
        points[drawable],
        best[drawable],
        alone=True,
    )
    shared = shared_scenarios(benchmark, table, division, name)
    laws = [s.law for s in found]
    places = [[judged.piece(name, scenario, law) for scenario in shared] for law in laws]
    tasks = np.stack([np.concatenate([table.pieces[p].task for p in of_law]) for of_law in places])
    profiles = Figure.drawn(
        "performance profiles",
        "Share of all runs that a law brings to rest within so many times the time of the law that was "
        "quickest on that crane; failures never. The eight best have names.",
        figures.profiles,
        laws,
        scores.performance_ratios(tasks),
        alone=True,
    )
    tables = [standing_table(judged, found, f"All laws on {benchmark.plant}")]
    tables.append(_failures(judged, name))
    tables += [each for scenario in benchmark.scenarios for each in _scenario(judged, name, scenario)]
    cranes = benchmark.sets[name]
    text = (
        f"Spread {cranes.spread:g}, {cranes.draws} cranes in each scenario if all are there. Differences to "
        f"{benchmark.baseline} are crane by crane, where neither fails; effect: share of cranes on which the "
        "error is larger less that on which it is smaller. Laws of set points never see the path."
    )
    yield judged.section(name, name, text, tables, (drawn, profiles))


def standing_table(judged: Judged, found: Sequence[Standing], title: str) -> Table:
    """How the laws stand; on the front are those that no other dominates in settling, effort and failures.

    Of the others it names the first law that does.
    """
    better = scores.dominates(points_of(found))
    headings = (*NAMED, "front,\nor behind", "failed\n%", "failed\n95 %", "settled\n%", "unsettled\ntime %",
                "RMS u\nm/s²", "variation\nm/s² in 1 s")  # fmt: skip
    rows = []
    for each, ahead in zip(found, better.T, strict=True):
        low, high = failure_interval(each.failures, each.runs)
        rows.append(
            cells(
                *judged.named(each.law),
                found[int(np.argmax(ahead))].law if ahead.any() else ANSWERS[True],
                f"{100.0 * each.failures / each.runs:.1f}",
                f"{100.0 * low:.1f} to {100.0 * high:.1f}",
                f"{100.0 * each.settled:.0f}",
                f"{100.0 * each.unsettled:.1f}",
                finite(each.effort, ".3f"),
                finite(each.variation, ".1f"),
            )
        )
    note = (
        "Over the scenarios that suit laws of every kind; effort and variation are medians of the runs. "
        "Behind: the first law as good in unsettled time, effort and failures, and better in one of them."
    )
    return Table(title, headings, tuple(rows), labels=3, note=note)


def _failures(judged: Judged, name: str) -> Table:
    """Share of failures by scenario, folded."""
    rows = []
    for law in judged.best_first:
        found = [judged.runs(name, scenario, law) for scenario in judged.benchmark.scenarios]
        if any(found):
            shares = ("" if runs is None else f"{100.0 * runs.failed.mean():.0f}" for runs in found)
            rows.append(cells(*judged.named(law), *shares))
    headings = (*NAMED, *(f"failed [%]\n{scenario}" for scenario in judged.benchmark.scenarios))
    return Table("Failures by scenario", headings, tuple(rows), labels=2, folded=True)


def _scenario(judged: Judged, name: str, scenario: str) -> Iterator[Table]:
    """The laws on one scenario, folded."""
    theirs = judged.runs(name, scenario, judged.benchmark.baseline)
    headings = (*NAMED, "failed\n%", "settled\n%", "settling time\n50 % [s]", "settling time\n90 % [s]",
                "sway about lean\n50 % [°]", "RMS error\n50 % [mm]", "less baseline\n50 % [mm]",
                "less baseline\n95 % of it", "less baseline\neffect")  # fmt: skip
    rows = []
    for law in judged.best_first:
        runs = judged.runs(name, scenario, law)
        if runs is None:
            continue
        settling = runs.metrics["settling_time_s"]
        middle, late = (scores.settling_quantile(settling, runs.failed, at) for at in (0.5, 0.9))
        rows.append(
            cells(
                *judged.named(law),
                f"{100.0 * runs.failed.mean():.0f}",
                f"{100.0 * scores.settled_share(settling, runs.failed):.0f}",
                finite(middle, ".2f", "never"),
                finite(late, ".2f", "never"),
                median(np.degrees(runs.metrics["residual_sway_about_lean_rad"])),
                median(1e3 * runs.metrics[COMPARED]),
                *_less(runs, theirs if law != judged.benchmark.baseline else None),
            )
        )
    if rows:
        yield Table(f"On {scenario}", headings, tuple(rows), labels=2, folded=True)


def _less(runs: Runs, baseline: Runs | None) -> tuple[str, str, str]:
    """Errors less those of the baseline on the same cranes: median, its interval, effect."""
    if baseline is None or baseline.failed.size != runs.failed.size:
        return "", "", ""
    own, theirs = (np.where(r.failed, np.nan, r.metrics[COMPARED]) for r in (runs, baseline))
    found = scores.paired_difference(own, theirs, seed=0)
    if not found.cranes:
        return "", "", ""
    median, low, high = (1e3 * each for each in (found.median, found.low, found.high))
    return f"{median:.1f}", f"{low:.1f} to {high:.1f}", f"{found.effect:+.2f}"
