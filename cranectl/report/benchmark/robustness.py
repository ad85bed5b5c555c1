"""How much the laws of a division can take: wider spreads, one uncertainty alone, a second plant."""

from collections.abc import Iterator

import numpy as np

from cranectl.campaign.benchmark import scores
from cranectl.campaign.benchmark.pieces import RADIUS, SINGLE, radius_sets, single_sets
from cranectl.campaign.benchmark.table import Runs
from cranectl.report.benchmark.division import COMPARED, NAMED, Judged, finite, median
from cranectl.report.page import Section
from cranectl.report.table import Table, cells
from cranectl.support.arrays import Array, Mask

BEST = 5  # laws whose single effects are not folded


def radius_section(judged: Judged) -> Iterator[Section]:
    """How far out cranes may be."""
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
        f"the factors linear. Of {benchmark.radius.draws} cranes each these are few: a law that loses one "
        "crane more or less has another radius."
    )
    yield judged.section("radius", "radius", text, (Table("", headings, rows, labels=2),))


def singles_section(judged: Judged) -> Iterator[Section]:
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
    columns = {name: told for name, told in columns.items() if any(of[name] for of in there.values())}
    tables = []
    for some, folded in ((list(there)[:BEST], False), (list(there)[BEST:], True)):
        for told, cell in (("failed [%]", _failed_share), ("RMS error, 50 % [mm]", _error)):
            headings = (*NAMED, *(f"{told}\n{effect}" for effect in columns.values()))
            rows = [cells(*judged.named(law), *(cell(there[law][name]) for name in columns)) for law in some]
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
    return "" if runs is None else median(1e3 * runs.metrics[COMPARED], runs.failed)


def second_section(judged: Judged) -> Iterator[Section]:
    """Whether another plant says the same."""
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
            apart = np.concatenate([_apart(*pair) for pair in pairs])[~(here | there)]
            rows.append(
                cells(
                    *judged.named(law),
                    str(there.size),
                    *(f"{100.0 * each.mean():.1f}" for each in (here, there)),
                    str(int((here != there).sum())),
                    median(1e3 * apart, np.zeros(apart.size, dtype=bool)),
                )
            )
        if rows:
            tables.append(Table(f"Cranes: {name}", headings, tuple(rows), labels=2, folded=bool(tables)))
    if tables:
        text = (
            "The same cranes, by equations that know nothing of the first plant's. RMS errors of the two are "
            "apart by so much where neither run fails."
        )
        yield judged.section("second", f"on {benchmark.second_plant}", text, tables)


def _apart(first: Runs, second: Runs) -> Array:
    """RMS errors of the same cranes apart [m]."""
    return np.abs(second.metrics[COMPARED] - first.metrics[COMPARED][: second.failed.size])


def _failures(pair: tuple[Runs, Runs]) -> tuple[Mask, Mask]:
    """Of the same cranes on both plants."""
    first, second = pair
    return first.failed[: second.failed.size], second.failed
