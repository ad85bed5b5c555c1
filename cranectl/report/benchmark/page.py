"""A benchmark as one page: rules, every set of cranes, the radius, the second plant, failures to look at."""

import math
import shlex
from collections.abc import Iterator, Sequence

import numpy as np

from cranectl.campaign.benchmark import scores
from cranectl.campaign.benchmark.pieces import Division, Piece, sets_of
from cranectl.campaign.benchmark.settings import Benchmark
from cranectl.campaign.benchmark.standings import (
    Standing,
    laws_of,
    points_of,
    set_standings,
    shared_scenarios,
)
from cranectl.campaign.benchmark.table import BenchmarkTable
from cranectl.campaign.summary import failure_interval
from cranectl.report.benchmark import figures
from cranectl.report.page import Figure, Page, Section
from cranectl.report.table import Cell, Table, cells
from cranectl.support.arrays import Array

COMPARED = "rms_error_m"  # with the baseline, crane by crane


def benchmark_page(benchmark: Benchmark, table: BenchmarkTable, division: Division, remade_by: str) -> Page:
    """The page."""
    sections = [_rules(benchmark, table)]
    for name in benchmark.sets:
        section = _set(benchmark, table, division, name)
        if section is not None:
            sections.append(section)
    sections += [
        *_radius(benchmark, table, division),
        *_second(benchmark, table, division),
        *_failures(table),
    ]
    title = {"published": "laws as published", "tuned": "laws tuned"}[division]
    return Page(f"Benchmark {benchmark.name}: {title}", benchmark.title, tuple(sections), remade_by)


def _rules(benchmark: Benchmark, table: BenchmarkTable) -> Section:
    sets = [f"{n}: spread {s.spread:g}, {s.draws} cranes" for n, s in benchmark.sets.items()]
    texts = (
        f"Rules {table.about['rules']}, cranes of seed {table.about['seed']}; on {benchmark.plant}, and a "
        f"share of {benchmark.second_share:g} of the cranes on {benchmark.second_plant}, {benchmark.drive} "
        f"drives. Sets: {'; '.join(sets)}. Every law meets the same cranes, sample by sample. A run fails "
        "that ends early or is too far off at its end; no law gains by what it loses, since failures are "
        "worse than any result. All laws are written here from the literature: their authors may do better.",
    )
    rows = tuple(
        cells(
            law,
            "set points" if facts["follows"] == "set-point" else "path",
            facts["measures"],
            str(facts["preview"] or "none"),
            facts["commands"],
            ", ".join(facts["rig"]) or "nothing",
        )
        for law, facts in table.about["laws"].items()
    )
    headings = ("law", "follows", "measures", "preview", "commands", "knows of the rig")
    note = "What is measured as state comes from encoders and an observer that is common to all laws."
    return Section("rules", "Rules and information", texts, (Table("", headings, rows, labels=6, note=note),))


def _set(benchmark: Benchmark, table: BenchmarkTable, division: Division, name: str) -> Section | None:
    found = set_standings(benchmark, table, division, name)
    if not found:
        return None
    points = points_of(found)
    best = scores.undominated(points)
    drawn = [
        Figure.drawn(
            "effort against settling",
            "Full, with names: no other law is as good in settling, effort and failures and better in one. "
            "The larger, the more failures.",
            figures.fronts,
            [s.law for s in found],
            points,
            best,
            alone=True,
        )
    ]
    shared = shared_scenarios(benchmark, table, division, name)
    laws = [s.law for s in found]
    times = np.stack(
        [
            np.concatenate(
                [table.pieces[Piece(division, benchmark.plant, name, n, law)].task for n in shared]
            )
            for law in laws
        ]
    )
    drawn.append(
        Figure.drawn(
            "performance profiles",
            "Share of all runs that a law brings to rest within so many times the time of the law that was "
            "quickest on that crane; failures never. The eight best have names.",
            figures.profiles,
            laws,
            scores.performance_ratios(times),
            alone=True,
        )
    )
    tables = [standing_table(benchmark, found, f"All laws on {benchmark.plant}")]
    tables += [
        _scenario_table(benchmark, table, division, name, scenario) for scenario in benchmark.scenarios
    ]
    return Section(name, f"Cranes: {name}", (), tuple(tables), tuple(drawn))


def standing_table(benchmark: Benchmark, found: Sequence[Standing], title: str) -> Table:
    """How the laws stand; on the front are those that no other dominates in settling, effort and failures."""
    best = scores.undominated(points_of(found))
    headings = ("law", "front", "failed\n%", "failed\n95 %", "settled\n%", "unsettled\ntime %", "RMS u\nm/s²",
                "variation\nm/s² in 1 s")  # fmt: skip
    rows = []
    for each, full in zip(found, best.tolist(), strict=True):
        low, high = failure_interval(each.failures, each.runs)
        rows.append(
            cells(
                Cell(each.law, "head" if each.law == benchmark.baseline else ""),
                Cell("yes", "good") if full else "",
                f"{100.0 * each.failures / each.runs:.1f}",
                f"{100.0 * low:.1f} to {100.0 * high:.1f}",
                f"{100.0 * each.settled:.0f}",
                f"{100.0 * each.unsettled:.1f}",
                f"{each.effort:.3f}",
                f"{each.variation:.1f}",
            )
        )
    note = "Over the scenarios that suit laws of every kind; effort and variation are medians of the runs."
    return Table(title, headings, tuple(rows), labels=2, note=note)


def _scenario_table(
    benchmark: Benchmark, table: BenchmarkTable, division: Division, name: str, scenario: str
) -> Table:
    baseline = table.pieces.get(Piece(division, benchmark.plant, name, scenario, benchmark.baseline))
    headings = ("law", "failed\n%", "settled\n%", "settling time\n50 % [s]", "settling time\n90 % [s]",
                "sway about lean\n50 % [°]", "RMS error\n50 % [mm]", "less baseline\n50 % [mm]",
                "less baseline\n95 % of it", "less baseline\neffect")  # fmt: skip
    rows = []
    for law in laws_of(table):
        runs = table.pieces.get(Piece(division, benchmark.plant, name, scenario, law))
        if runs is None:
            continue
        settling = runs.metrics["settling_time_s"]
        middle, late = (scores.settling_quantile(settling, runs.failed, at) for at in (0.5, 0.9))
        apart = ("", "", "")
        if baseline is not None and law != benchmark.baseline and baseline.failed.size == runs.failed.size:
            own, theirs = (np.where(r.failed, np.nan, r.metrics[COMPARED]) for r in (runs, baseline))
            found = scores.paired_difference(own, theirs, seed=0)
            if found.cranes:
                apart = (
                    f"{1e3 * found.median:.1f}",
                    f"{1e3 * found.low:.1f} to {1e3 * found.high:.1f}",
                    f"{found.effect:+.2f}",
                )
        rows.append(
            cells(
                law,
                f"{100.0 * runs.failed.mean():.0f}",
                f"{100.0 * scores.settled_share(settling, runs.failed):.0f}",
                _time(middle),
                _time(late),
                _median(np.degrees(runs.metrics["residual_sway_about_lean_rad"])),
                _median(1e3 * runs.metrics[COMPARED]),
                *apart,
            )
        )
    note = (
        f"Differences to {benchmark.baseline} crane by crane, where neither fails; effect: share of cranes "
        "on which the error is larger less that on which it is smaller. Set-point laws never see the path."
    )
    return Table(scenario, headings, tuple(rows), note=note, folded=True)


def _time(seconds: float) -> str:
    return f"{seconds:.2f}" if math.isfinite(seconds) else "never"


def _median(values: Array) -> str:
    return f"{np.nanmedian(values):.3g}" if np.isfinite(values).any() else ""


def _radius(benchmark: Benchmark, table: BenchmarkTable, division: Division) -> Iterator[Section]:
    ladder = [(n, s.spread) for n, s in sets_of(benchmark).items() if n not in benchmark.sets]
    found = []
    for law in laws_of(table):
        runs = [
            table.pieces.get(Piece(division, benchmark.plant, n, benchmark.radius.scenario, law))
            for n, _ in ladder
        ]
        there = [each for each in runs if each is not None]
        if len(there) == len(ladder):
            shares = np.array([each.failed.mean() for each in there])
            found.append((scores.radius(np.array([s for _, s in ladder]), shares), law, shares))
    if not found:
        return
    rows = tuple(
        cells(
            law,
            f"{factor:.2f}" if math.isfinite(factor) else f"above {ladder[-1][1]:g}",
            *(f"{100.0 * share:.0f}" for share in shares),
        )
        for factor, law, shares in sorted(found, key=lambda each: -each[0])
    )
    headings = ("law", "radius", *(f"failed [%] at\n{spread:g}" for _, spread in ladder))
    text = (
        f"The factor on all spreads at which 5 % of the runs of {benchmark.radius.scenario} fail, between "
        "the factors linear; 0 where they do at the smallest."
    )
    yield Section("radius", "Robustness radius", (text,), (Table("", headings, rows),))


def _second(benchmark: Benchmark, table: BenchmarkTable, division: Division) -> Iterator[Section]:
    rows = []
    for name in benchmark.sets:
        for law in laws_of(table):
            pairs = [
                (runs, table.pieces[first])
                for piece, runs in table.pieces.items()
                if piece._replace(scenario="") == Piece(division, benchmark.second_plant, name, "", law)
                and (first := piece._replace(plant=benchmark.plant)) in table.pieces
            ]
            if not pairs:
                continue
            both = [(b.failed[: a.failed.size], a.failed) for a, b in pairs]
            differ = sum(int((x != y).sum()) for x, y in both)
            apart = [b.metrics[COMPARED][: a.failed.size] - a.metrics[COMPARED] for a, b in pairs]
            n = sum(y.size for _, y in both)
            shares = [f"{100.0 * sum(int(each[k].sum()) for each in both) / n:.1f}" for k in (0, 1)]
            rows.append(
                cells(name, law, str(n), *shares, str(differ), _median(1e3 * np.abs(np.concatenate(apart))))
            )
    if rows:
        plants = [f"failed [%]\n{plant}" for plant in (benchmark.plant, benchmark.second_plant)]
        headings = ("set", "law", "runs", *plants, "one fails\nonly", "RMS errors apart\n50 % [mm]")
        text = "The same cranes, by equations that know nothing of the first plant's."
        yield Section(
            "second", f"On {benchmark.second_plant}", (text,), (Table("", headings, tuple(rows), labels=2),)
        )


def _failures(table: BenchmarkTable) -> Iterator[Section]:
    """The first failure of each law on each set, and how to look at it."""
    rows, seen = [], set()
    for piece, runs in table.pieces.items():
        if not runs.failed.any() or (piece.law, piece.crane_set) in seen:
            continue
        seen.add((piece.law, piece.crane_set))
        sample = int(np.flatnonzero(runs.failed)[0])
        command = f"cranectl campaign replay {shlex.quote(str(piece.place))} --run {sample}"
        rows.append(
            cells(piece.law, piece.crane_set, piece.scenario, str(sample), runs.status[sample], command)
        )
    if rows:
        headings = ("law", "set", "scenario", "crane", "ended", "to see it, in the result's directory")
        yield Section(
            "failures", "Failures to look at", (), (Table("", headings, tuple(rows), labels=6, folded=True),)
        )
