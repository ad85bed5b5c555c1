"""A set of cranes: how the laws of a division stand, figures of it, each scenario by itself."""

from collections.abc import Iterator, Sequence

import numpy as np

from cranectl.campaign.benchmark import scores
from cranectl.campaign.benchmark.standings import Standing, points_of, rest_time, shared_scenarios
from cranectl.campaign.benchmark.table import Runs, on_common_cranes
from cranectl.campaign.summary import failure_interval
from cranectl.report.benchmark import figures
from cranectl.report.benchmark.division import COMPARED, NAMED, Judged, finite, median
from cranectl.report.page import Figure, Section
from cranectl.report.table import ANSWERS, Table, cells
from cranectl.support.arrays import Array

DIFFERENCES = tuple(
    f"{what} less baseline\n{told}"
    for what, unit in (("RMS error", "mm"), ("unsettled", "s"))
    for told in (f"50 % [{unit}]", "95 % of it", "effect")
)
NOTHING = ("", "", "")  # where there is no difference
Texts = tuple[str, str, str]


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
        "Filled and named: no other law is as good in settling, effort and failures and better in one. "
        "Larger circles fail more often.",
        figures.fronts,
        [s.law for s, there in zip(found, drawable, strict=True) if there],
        points[drawable],
        best[drawable],
        alone=True,
    )
    shared = shared_scenarios(benchmark, table, division, name)
    laws = [s.law for s in found]
    tasks = np.hstack([_tasks(judged, name, scenario, laws) for scenario in shared])
    profiles = Figure.drawn(
        "performance profiles",
        "Share of all runs that a law has settled within so many times the time of the law that was "
        "quickest on that crane, both from the start of the run; failures never. The eight best have names.",
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
        f"Spread {cranes.spread:g}, {cranes.draws} cranes, the same in every scenario; the intervals treat "
        "runs as independent, so they are too narrow. Medians count a failure as worse than any result. "
        f"Differences to {benchmark.baseline} are crane by crane: of RMS errors where neither fails, of "
        "unsettled time on all cranes, where a failed run is unsettled to the end; none is shown of fewer "
        f"than {scores.FEWEST} cranes. Effect: share of cranes on which it is larger less that on which it "
        "is smaller. Laws of set points never see the path and have no error to it."
    )
    if all(judged.runs(name, scenario, benchmark.baseline) is None for scenario in benchmark.scenarios):
        text += f" No differences are shown: no runs of {benchmark.baseline} are here."
    if part := judged.unfinished(name):
        text += f" Not shown, since scenarios are missing: {', '.join(part)}."
    yield judged.section(name, name, text, tables, (drawn, profiles))


def _tasks(judged: Judged, name: str, scenario: str, laws: Sequence[str]) -> Array:
    """(laws, cranes) times of the task on one scenario, on the cranes that all `laws` have met there."""
    runs = [judged.table.pieces[judged.piece(name, scenario, law)] for law in laws]
    return np.stack([each.task for each in on_common_cranes(runs)])


def standing_table(judged: Judged, found: Sequence[Standing], title: str) -> Table:
    """How the laws stand; on the front are those that no other dominates in settling, effort and failures.

    Of the others it names the first law that does.
    """
    better = scores.dominates(points_of(found))
    headings = (*NAMED, "front,\nor behind", "runs", "failed\n%", "failed\n95 %", "settled\n%",
                "unsettled\ntime %", "RMS u\nm/s²", "variation\nm/s² in 1 s")  # fmt: skip
    rows = []
    for each, ahead in zip(found, better.T, strict=True):
        low, high = failure_interval(each.failures, each.runs)
        rows.append(
            cells(
                *judged.named(each.law),
                found[int(np.argmax(ahead))].law if ahead.any() else ANSWERS[True],
                str(each.runs),
                f"{100.0 * each.failed:.1f}",
                f"{100.0 * low:.1f} to {100.0 * high:.1f}",
                f"{100.0 * each.settled:.0f}",
                f"{100.0 * each.unsettled:.1f}",
                finite(each.effort, ".3f", "fails"),
                finite(each.variation, ".1f", "fails"),
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
    duration = float(judged.table.about["durations"].get(scenario, 0.0))
    headings = (*NAMED, "failed\n%", "settled\n%", "settling time\n50 % [s]", "settling time\n90 % [s]",
                "sway about lean\n50 % [°]", "RMS error\n50 % [mm]", *DIFFERENCES)  # fmt: skip
    rows = []
    for law in judged.best_first:
        runs = judged.runs(name, scenario, law)
        if runs is None:
            continue
        sees_path = judged.table.about["laws"][law]["follows"] != "set-point"
        other = theirs if law != judged.benchmark.baseline else None
        settling = runs.metrics["settling_time_s"]
        middle, late = (scores.settling_quantile(settling, runs.failed, at) for at in (0.5, 0.9))
        rows.append(
            cells(
                *judged.named(law),
                f"{100.0 * runs.failed.mean():.0f}",
                f"{100.0 * scores.settled_share(settling, runs.failed):.0f}",
                finite(middle, ".2f", "never"),
                finite(late, ".2f", "never"),
                median(np.degrees(runs.metrics["residual_sway_about_lean_rad"]), runs.failed),
                median(1e3 * runs.metrics[COMPARED], runs.failed) if sees_path else "",
                *(_errors_less(runs, other) if sees_path else NOTHING),
                *_unsettled_less(runs, other, duration),
            )
        )
    if rows:
        yield Table(f"On {scenario}", headings, tuple(rows), labels=2, folded=True)


def _errors_less(runs: Runs, baseline: Runs | None) -> Texts:
    """RMS errors [mm] less those of the baseline, where neither fails."""
    if baseline is None:
        return NOTHING
    both = on_common_cranes([runs, baseline])
    return _less(*(np.where(r.failed, np.nan, 1e3 * r.metrics[COMPARED]) for r in both), form=".1f")


def _unsettled_less(runs: Runs, baseline: Runs | None, duration: float) -> Texts:
    """Times that pass unsettled [s] less those of the baseline, failures so to the end."""
    if baseline is None or not np.isfinite([*runs.task, *baseline.task]).any():
        return NOTHING
    both = on_common_cranes([runs, baseline])
    horizon = min(rest_time(r, duration) for r in both)
    times = (scores.unsettled_time(r.metrics["settling_time_s"], r.failed, horizon) for r in both)
    return _less(*times, form=".2f")


def _less(own: Array, theirs: Array, *, form: str) -> Texts:
    """Values less those of the baseline: median, its interval, effect."""
    found = scores.paired_difference(own, theirs, seed=0)
    if found.cranes < scores.FEWEST:
        return NOTHING
    low, high = (format(each, form) for each in (found.low, found.high))
    return f"{found.median:{form}}", f"{low} to {high}", f"{found.effect:+.2f}"
