"""A set of cranes: how the controllers of a division stand, figures of it, each scenario by itself."""

import math
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import LogLocator, NullLocator

from cranectl.campaign import CampaignFigures, failure_interval
from cranectl.report import Cell, Chart, Figure, Section, Table
from cranectl.support import Array, Mask
from cranectl.tools.benchmark import scores
from cranectl.tools.benchmark.declared import information_class
from cranectl.tools.benchmark.ranking import Judged, Standing, points_of, rest_time
from cranectl.tools.benchmark.table import Runs
from cranectl.tools.benchmark.trials import Division

OUR_CONTROLLER = "lqr-offset-free"
COMPARED = "rms_error_m"  # with the baseline, crane by crane
NAMED = ("controller", "knows")
TITLES: dict[Division, str] = {"tuned": "Tuned", "published": "As published (defaults)"}
# How runs fail: by the label of their status.
WAYS = {"completed": "off goal", "slack-rope": "slack", "workspace-left": "left rig"}
MAX_RATIO = 10.0
NAMED_PROFILES = 8  # controllers that have a line of their own in a profile
MIN_EFFORT = 1e-2  # [m/s²] that is drawn, on a logarithmic scale
DIFFERENCES = tuple(
    f"{what} less baseline\n{heading}"
    for what, unit in (("RMS error", "mm"), ("unsettled", "s"))
    for heading in (f"50 % [{unit}]", "95 % of it", "effect")
)
NOTHING = ("", "", "")  # where there is no difference


def shown_name(judged: Judged, controller: str) -> str:
    """Return the name of a controller; it tells if the controller is the reader's or ours."""
    if controller in judged.yours:
        return f"{controller} (yours)"
    return f"{controller} (ours)" if controller == OUR_CONTROLLER else controller


def named(judged: Judged, controller: str, mark: str = "") -> tuple[Cell, ...]:
    """Return what the rows of a controller begin with, below NAMED; the baseline is bold without a `mark`."""
    mark = mark or ("head" if controller == judged.benchmark.baseline else "")
    information = information_class(judged.table.about["laws"][controller])
    return Cell.row(Cell(shown_name(judged, controller), mark), information)


def section_of(
    judged: Judged, anchor: str, title: str, text: str, tables: Sequence[Table], *figures: Figure
) -> Section:
    """Return a section of a division."""
    title = f"{TITLES[judged.division]}: {title}"
    return Section(f"{judged.division}-{anchor}", title, (text,), tuple(tables), figures)


def finite(value: float, form: str, other: str = "") -> str:
    """Return the number as text, or `other` if it is not finite."""
    return format(value, form) if math.isfinite(value) else other


def median(values: Array, failed: Mask) -> str:
    """Return the median to three digits, with failures worse than any value; empty without runs."""
    value = scores.median_with_failures(values, failed)
    return "" if math.isnan(value) else finite(float(f"{value:.3g}"), "g", "fails")


def set_section(judged: Judged, name: str) -> Iterator[Section]:
    """Tell how the controllers stand on one of the sets that are judged."""
    if not judged.ranking(name) and not judged.unfinished(name):
        return
    benchmark = judged.benchmark
    title = f"All controllers on {benchmark.plant}"
    tables = [ranking_table(judged, name, title), _failures(judged, name)]
    tables += [table for scenario in benchmark.scenarios for table in _scenario(judged, name, scenario)]
    cranes = benchmark.sets[name]
    text = (
        f"Spread {cranes.spread:g}, {cranes.draws} cranes, the same in every scenario; the intervals treat "
        "runs as independent, so they are too narrow. Medians count a failure as worse than any result. "
        f"Differences to {benchmark.baseline} are crane by crane: of RMS errors where neither fails, of "
        "unsettled time on all cranes, where a failed run is unsettled to the end; none is shown of fewer "
        f"than {scores.MIN_INTERVAL_VALUES} cranes. Effect: share of cranes on which it is larger less that "
        "on which it is smaller. Controllers of set points never see the path and have no error to it."
    )
    if all(judged.runs(name, scenario, benchmark.baseline) is None for scenario in benchmark.scenarios):
        text += f" No differences are shown: no runs of {benchmark.baseline} are here."
    yield section_of(judged, name, name, text, tables, *_figures(judged, name))


def _figures(judged: Judged, name: str) -> Iterator[Figure]:
    """Yield effort against settling, and the performance profiles, of all ranked controllers."""
    if not (standings := judged.ranking(name)):
        return
    points = points_of(standings)
    best, drawable = scores.undominated(points), np.asarray(np.isfinite(points).all(axis=1))
    yield Figure.drawn(
        "effort against settling",
        "Filled and named: no other is as good in settling, effort and failures and better in one. "
        "Larger circles fail more often.",
        _draw_fronts,
        [s.controller for s, there in zip(standings, drawable, strict=True) if there],
        points[drawable],
        best[drawable],
        alone=True,
    )
    controllers, tasks = [s.controller for s in standings], []
    for scenario in judged.shared_scenarios(name):
        runs = Runs.in_common(
            [judged.table.trials[judged.trial(name, scenario, controller)] for controller in controllers]
        )
        tasks.append(np.stack([run.task for run in runs]))  # (controllers, cranes that all of them have met)
    yield Figure.drawn(
        "performance profiles",
        "Share of all runs that a controller has settled within so many times the time of the one that was "
        "quickest on that crane, both from the start of the run; failures never. The eight best have names.",
        _draw_profiles,
        controllers,
        scores.performance_ratios(np.hstack(tasks)),
        alone=True,
    )


def ranking_table(judged: Judged, name: str, title: str, shown: Collection[str] = ()) -> Table:
    """Return the ranking of a set, of all controllers or of those `shown`; the unfinished ones come last."""
    standings, number = judged.ranking(name), len(judged.shared_scenarios(name))
    better = scores.dominates(points_of(standings)) if standings else np.zeros((0, 0))
    headings = (*NAMED, "dominated\nby", "runs", "failed\n%", "failed\n95 %", "fails by", "settled\n%",
                "unsettled\ntime %", "RMS u\nm/s²", "variation\nm/s² in 1 s")  # fmt: skip
    found: list[tuple[str, str, Cell | str, Standing | None]] = []  # controller, mark, place, numbers
    for standing, ahead in zip(standings, better.T, strict=True):
        place = standings[int(np.argmax(ahead))].controller if ahead.any() else "none"
        found.append((standing.controller, "" if ahead.any() else "best", place, standing))
    for controller, (part, done) in judged.unfinished(name).items():
        found.append((controller, "", Cell(f"ran {done} of {number} scenarios", "open"), part))
    if judged.division == "published":  # what compares first guesses is no ranking
        found.sort(key=lambda row: row[0])
    rows = [
        Cell.row(*named(judged, controller, mark), place, *_numbers(numbers, _ways(judged, name, controller)))
        for controller, mark, place, numbers in found
        if not shown or controller in shown
    ]
    note = (
        "Over scenarios that suit every kind of controller; effort and variation are medians of the runs. "
        "Variation: by how much the commanded accelerations change in a second, up and down. Dominated by: "
        "the first one as good in unsettled time, effort and failures, and better in one of them."
    )
    if judged.division == "published":
        note += " In the order of the alphabet, since most defaults are first guesses."
    if judged.unfinished(name):
        note += " A controller that lacks scenarios is not ranked: its numbers are over those that it has."
    return Table(title, headings, tuple(rows), labels=3, note=note)


def _ways(judged: Judged, name: str, controller: str) -> str:
    """Return in which ways runs of a controller fail, on the scenarios that all controllers share."""
    ways: Counter[str] = Counter()
    for scenario in judged.shared_scenarios(name):
        if (runs := judged.runs(name, scenario, controller)) is not None:
            for row in np.flatnonzero(runs.failed).tolist():
                status = runs.status[row]
                ways[WAYS.get(status, status)] += 1
    return ", ".join(f"{way} {count}" for way, count in ways.most_common()) or "–"


def _numbers(standing: Standing | None, ways: str) -> Sequence[str]:
    """Return the columns of a standing from `runs` on; empty if it has none."""
    if standing is None:
        return [""] * 8
    low, high = failure_interval(standing.failures, standing.runs)
    return (
        str(standing.runs),
        f"{100.0 * standing.failed:.1f}",
        f"{100.0 * low:.1f} to {100.0 * high:.1f}",
        ways,
        f"{100.0 * standing.settled:.0f}",
        f"{100.0 * standing.unsettled:.1f}",
        finite(standing.effort, ".3f", "fails"),
        finite(standing.variation, ".1f", "fails"),
    )


def _failures(judged: Judged, name: str) -> Table:
    """Share of failures by scenario, folded."""
    rows, scenarios = [], judged.benchmark.scenarios
    for controller in judged.best_first:
        runs = [judged.runs(name, scenario, controller) for scenario in scenarios]
        if any(runs):
            shares = ("" if of is None else f"{100.0 * of.failed.mean():.0f}" for of in runs)
            rows.append(Cell.row(*named(judged, controller), *shares))
    headings = (*NAMED, *(f"failed [%]\n{scenario}" for scenario in scenarios))
    return Table("Failures by scenario", headings, tuple(rows), labels=2, folded=True)


def _scenario(judged: Judged, name: str, scenario: str) -> Iterator[Table]:
    """Yield the controllers on one scenario, folded."""
    theirs = judged.runs(name, scenario, judged.benchmark.baseline)
    duration = float(judged.table.about["durations"].get(scenario, 0.0))
    headings = (*NAMED, "failed\n%", "settled\n%", "settling time\n50 % [s]", "settling time\n90 % [s]",
                "sway about lean\n50 % [°]", "RMS error\n50 % [mm]", *DIFFERENCES)  # fmt: skip
    rows = []
    for controller in judged.best_first:
        runs = judged.runs(name, scenario, controller)
        if runs is None:
            continue
        sees_path = judged.table.about["laws"][controller]["follows"] != "set-point"
        other = theirs if controller != judged.benchmark.baseline else None
        settling, failed = runs.settling, runs.failed
        shares = (failed.mean(), scores.settled_share(settling, failed))
        times = (finite(scores.settling_quantile(settling, failed, at), ".2f", "never") for at in (0.5, 0.9))
        sway = median(np.degrees(runs.metrics["residual_sway_about_lean_rad"]), failed)
        error = median(1e3 * runs.metrics[COMPARED], failed) if sees_path else ""
        less = _less(runs, other, duration, sees_path=sees_path)
        texts = (*(f"{100.0 * share:.0f}" for share in shares), *times, sway, error)
        rows.append(Cell.row(*named(judged, controller), *texts, *less))
    if rows:
        yield Table(f"On {scenario}", headings, tuple(rows), labels=2, folded=True)


def _less(runs: Runs, baseline: Runs | None, duration: float, *, sees_path: bool) -> tuple[str, ...]:
    """Return RMS errors [mm] and unsettled times [s] less those of the baseline, as DIFFERENCES."""
    if baseline is None:
        return NOTHING * 2
    both = Runs.in_common([runs, baseline])
    errors = times = NOTHING
    if sees_path:
        values = (np.where(r.failed, np.nan, 1e3 * r.metrics[COMPARED]) for r in both)
        errors = _difference(*values, form=".1f")
    if np.isfinite([*runs.task, *baseline.task]).any():
        horizon = min(rest_time(r, duration) for r in both)
        values = (scores.unsettled_time(r.settling, r.failed, horizon) for r in both)
        times = _difference(*values, form=".2f")
    return errors + times


def _difference(own: Array, theirs: Array, *, form: str) -> tuple[str, str, str]:
    """Return values less those of the baseline: median, its interval, effect."""
    difference = scores.paired_difference(own, theirs, seed=0)
    if difference.cranes < scores.MIN_INTERVAL_VALUES:
        return NOTHING
    low, high = (format(bound, form) for bound in (difference.low, difference.high))
    return f"{difference.median:{form}}", f"{low} to {high}", f"{difference.larger_less_smaller:+.2f}"


def _draw_profiles(controllers: Sequence[str], ratios: Array) -> Drawing:
    """Draw the share of runs that each controller brings to rest within a ratio of the quickest time."""
    at = np.geomspace(1.0, MAX_RATIO, 200)
    shares = scores.performance_profile(ratios, at)
    figure, axes = Chart.canvas(1.2 * Chart.WIDTH, 3.6)
    best = np.argsort(-shares.mean(axis=1), kind="stable")
    for k in best[NAMED_PROFILES:]:
        axes.step(at, 100.0 * shares[k], where="post", color=Chart.STAND_IN["muted"], linewidth=0.6)
    for rank, k in enumerate(best[:NAMED_PROFILES]):
        axes.step(at, 100.0 * shares[k], where="post", label=controllers[k], **CampaignFigures.style(rank))
    axes.set(xscale="log", xlim=(1.0, MAX_RATIO), ylim=(0.0, 100.0))
    axes.set(xlabel="time to settle over that of the quickest controller", ylabel="runs [%]")
    axes.set_xticks([1, 2, 5, 10], ["1", "2", "5", "10"])
    axes.minorticks_off()
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _draw_fronts(controllers: Sequence[str], points: Array, best: Mask) -> Drawing:
    """Draw effort against the unsettled share of the rest; the third column of `points` is the size."""
    figure, axes = Chart.canvas(1.2 * Chart.WIDTH, max(3.8, 0.18 * np.count_nonzero(best)))
    settling, effort = 100.0 * points[:, 0], np.maximum(points[:, 1], MIN_EFFORT)
    colours = [Chart.STAND_IN[Chart.SERIES[0]] if full else Chart.STAND_IN["muted"] for full in best]
    faces = [colour if full else "none" for colour, full in zip(colours, best, strict=True)]
    axes.scatter(settling, effort, 14.0 + 160.0 * points[:, 2], facecolors=faces, edgecolors=colours)
    # Names beside the axes, in the order of their points: there they are apart.
    named = sorted(np.flatnonzero(best).tolist(), key=lambda k: points[k, 1])
    line = {"arrowstyle": "-", "color": Chart.STAND_IN["muted"], "linewidth": 0.4, "relpos": (0.0, 0.5)}
    style: dict[str, Any] = {"textcoords": "axes fraction", "arrowprops": line, "va": "center"}
    for row, k in enumerate(named):
        beside = (1.04, (row + 0.5) / len(named))
        axes.annotate(controllers[k], (settling[k], effort[k]), beside, **style)
    axes.set(xlabel="time at rest that passes unsettled [%]", ylabel="RMS of commanded acceleration [m/s²]")
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_locator(NullLocator())
    return figure
