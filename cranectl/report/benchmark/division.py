"""Laws of one division side by side: sets of cranes, radius, single effects, the second plant."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cranectl.campaign.benchmark import scores
from cranectl.campaign.benchmark.information import information_class
from cranectl.campaign.benchmark.pieces import RADIUS, SINGLE, Division, Piece, radius_sets, single_sets
from cranectl.campaign.benchmark.settings import Benchmark
from cranectl.campaign.benchmark.standings import (
    Standing,
    laws_of,
    points_of,
    set_standings,
    shared_scenarios,
)
from cranectl.campaign.benchmark.table import BenchmarkTable, Runs
from cranectl.campaign.summary import failure_interval
from cranectl.report.benchmark import figures
from cranectl.report.page import Figure, Section
from cranectl.report.table import ANSWERS, Cell, Table, cells
from cranectl.support.arrays import Array, Mask

COMPARED = "rms_error_m"  # with the baseline, crane by crane
NAMED = ("law", "told")
BEST = 5  # laws whose single effects are not folded
TITLES: dict[Division, str] = {"tuned": "Tuned", "published": "As published"}


class Judged(NamedTuple):
    """The laws of one division."""

    benchmark: Benchmark
    table: BenchmarkTable
    division: Division

    def runs(self, crane_set: str, scenario: str, law: str, plant: str = "") -> Runs | None:
        """Those of one piece, by default on the first plant; None where it has not been run."""
        piece = Piece(self.division, plant or self.benchmark.plant, crane_set, scenario, law)
        return self.table.pieces.get(piece)

    def standings(self, crane_set: str) -> list[Standing]:
        """As `set_standings`."""
        return set_standings(self.benchmark, self.table, self.division, crane_set)

    @property
    def best_first(self) -> list[str]:
        """All laws, in the order of the standings on the set with the widest spread that has any."""
        widest = sorted(self.benchmark.sets, key=lambda name: -self.benchmark.sets[name].spread)
        found = next((s for s in map(self.standings, widest) if s), [])
        return list(dict.fromkeys([*(each.law for each in found), *laws_of(self.table)]))

    def named(self, law: str) -> tuple[Cell, ...]:
        """What its rows begin with, below NAMED."""
        head = "head" if law == self.benchmark.baseline else ""
        return cells(Cell(law, head), information_class(self.table.about["laws"][law]))

    def section(
        self, anchor: str, title: str, text: str, tables: Sequence[Table], figures: Sequence[Figure] = ()
    ) -> Section:
        """A section of this division."""
        title = f"{TITLES[self.division]}: {title}"
        return Section(f"{self.division}-{anchor}", title, (text,), tuple(tables), tuple(figures))


def division_sections(judged: Judged) -> Iterator[Section]:
    """All that there is of a division."""
    for name in judged.benchmark.sets:
        yield from _set(judged, name)
    yield from _radius(judged)
    yield from _singles(judged)
    yield from _second(judged)


def _set(judged: Judged, name: str) -> Iterator[Section]:
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
    places = [[Piece(division, benchmark.plant, name, n, law) for n in shared] for law in laws]
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
    tables += [each for scenario in benchmark.scenarios for each in _scenario(judged, name, scenario)]
    cranes = benchmark.sets[name]
    text = f"Spread {cranes.spread:g}, {cranes.draws} cranes in each scenario if all are there."
    yield judged.section(name, name, text, tables, (drawn, profiles))


def standing_table(judged: Judged, found: Sequence[Standing], title: str) -> Table:
    """How the laws stand; on the front are those that no other dominates in settling, effort and failures."""
    best = scores.undominated(points_of(found))
    headings = (*NAMED, "front", "failed\n%", "failed\n95 %", "settled\n%", "unsettled\ntime %",
                "RMS u\nm/s²", "variation\nm/s² in 1 s")  # fmt: skip
    rows = []
    for each, full in zip(found, best.tolist(), strict=True):
        low, high = failure_interval(each.failures, each.runs)
        rows.append(
            cells(
                *judged.named(each.law),
                ANSWERS[True] if full else "",
                f"{100.0 * each.failures / each.runs:.1f}",
                f"{100.0 * low:.1f} to {100.0 * high:.1f}",
                f"{100.0 * each.settled:.0f}",
                f"{100.0 * each.unsettled:.1f}",
                finite(each.effort, ".3f"),
                finite(each.variation, ".1f"),
            )
        )
    note = "Over the scenarios that suit laws of every kind; effort and variation are medians of the runs."
    return Table(title, headings, tuple(rows), labels=3, note=note)


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
                _median(np.degrees(runs.metrics["residual_sway_about_lean_rad"])),
                _median(1e3 * runs.metrics[COMPARED]),
                *_less(runs, theirs if law != judged.benchmark.baseline else None),
            )
        )
    note = (
        f"Differences to {judged.benchmark.baseline} crane by crane, where neither fails; effect: share of "
        "cranes on which the error is larger less that on which it is smaller. Set-point laws never see the "
        "path."
    )
    if rows:
        yield Table(f"On {scenario}", headings, tuple(rows), labels=2, note=note, folded=True)


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


def finite(value: float, form: str, other: str = "") -> str:
    """The number as text, `other` where there is none."""
    return format(value, form) if math.isfinite(value) else other


def _median(values: Array) -> str:
    return f"{np.nanmedian(values):.3g}" if np.isfinite(values).any() else ""


def _radius(judged: Judged) -> Iterator[Section]:
    benchmark = judged.benchmark
    ladder = radius_sets(benchmark)
    spreads = np.array([each.spread for each in ladder.values()])
    found = []
    for law in judged.best_first:
        runs = [judged.runs(name, benchmark.radius.scenario, law) for name in ladder]
        there = [each for each in runs if each is not None]
        if len(there) == len(ladder):
            shares = np.array([each.failed.mean() for each in there])
            found.append((scores.radius(spreads, shares), law, shares))
    if not found:
        return
    rows = tuple(
        cells(
            *judged.named(law),
            finite(factor, ".2f", f"above {spreads[-1]:g}") if factor else f"below {spreads[0]:g}",
            *(f"{100.0 * share:.0f}" for share in shares),
        )
        for factor, law, shares in sorted(found, key=lambda each: -each[0])
    )
    headings = (*NAMED, "radius", *(f"failed [%] at\n{spread:g}" for spread in spreads))
    text = (
        f"The factor on all spreads at which 5 % of the runs of {benchmark.radius.scenario} fail, between "
        "the factors linear."
    )
    yield judged.section("radius", "radius", text, (Table("", headings, rows, labels=2),))


def _singles(judged: Judged) -> Iterator[Section]:
    """What one uncertainty does by itself, beside none of them and all together on the same scenario."""
    benchmark, singles = judged.benchmark, judged.benchmark.singles
    if singles is None:
        return
    exact = [name for name, cranes in benchmark.sets.items() if not cranes.spread]
    together = f"{RADIUS}{singles.spread:g}"
    columns = {name: name.removeprefix(SINGLE) for name in single_sets(benchmark)}
    columns = {**dict.fromkeys(exact[:1], "none"), **columns, together: "all"}
    found = {
        law: {name: judged.runs(name, singles.scenario, law) for name in columns} for law in judged.best_first
    }
    there = {law: of for law, of in found.items() if any(of[name] for name in single_sets(benchmark))}
    if not there:
        return
    tables = []
    for some, folded in ((list(there)[:BEST], False), (list(there)[BEST:], True)):
        for told, cell in (("failed [%]", _failed_share), ("RMS error, 50 % [mm]", _error)):
            headings = (*NAMED, *(f"{told}\n{effect}" for effect in columns.values()))
            rows = [cells(*judged.named(law), *map(cell, there[law].values())) for law in some]
            title = f"{'The others' if folded else 'The best'}: {told}"
            tables += [Table(title, headings, tuple(rows), labels=2, folded=folded)] if rows else []
    text = (
        f"On {singles.scenario} one uncertainty alone, {singles.spread:g} times as wide as at spread 1; for "
        f"comparison none, but noise and gusts, and all of them. The cranes are the same. The {BEST} laws "
        "that stand best on the widest set are shown, the others folded. A run that fails counts as worse "
        "than any error."
    )
    yield judged.section("single", "single effects", text, tables)


def _failed_share(runs: Runs | None) -> str:
    return "" if runs is None else f"{100.0 * runs.failed.mean():.0f}"


def _error(runs: Runs | None) -> str:
    if runs is None:
        return ""
    errors = np.where(runs.failed, np.inf, runs.metrics[COMPARED])
    return finite(1e3 * float(np.median(errors)), ".1f", "fails")


def _second(judged: Judged) -> Iterator[Section]:
    benchmark = judged.benchmark
    plants = (benchmark.plant, benchmark.second_plant)
    headings = (*NAMED, "runs", *(f"failed [%]\n{plant}" for plant in plants), "one fails\nonly",
                "RMS errors apart\n50 % [mm]")  # fmt: skip
    tables: list[Table] = []
    for name in benchmark.sets:
        rows = []
        for law in judged.best_first:
            pairs = [
                (first, second)
                for scenario in benchmark.scenarios
                if (first := judged.runs(name, scenario, law)) is not None
                and (second := judged.runs(name, scenario, law, benchmark.second_plant)) is not None
            ]
            if not pairs:
                continue
            here, there = (np.concatenate(each) for each in zip(*map(_failures, pairs), strict=True))
            apart = [b.metrics[COMPARED] - a.metrics[COMPARED][: b.failed.size] for a, b in pairs]
            rows.append(
                cells(
                    *judged.named(law),
                    str(there.size),
                    *(f"{100.0 * each.mean():.1f}" for each in (here, there)),
                    str(int((here != there).sum())),
                    _median(1e3 * np.abs(np.concatenate(apart))),
                )
            )
        if rows:
            tables.append(Table(f"Cranes: {name}", headings, tuple(rows), labels=2, folded=bool(tables)))
    if tables:
        text = "The same cranes, by equations that know nothing of the first plant's."
        yield judged.section("second", f"on {benchmark.second_plant}", text, tables)


def _failures(pair: tuple[Runs, Runs]) -> tuple[Mask, Mask]:
    """Of the same cranes on both plants."""
    first, second = pair
    return first.failed[: second.failed.size], second.failed
