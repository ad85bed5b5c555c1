"""How much the controllers of a division can take: wider spreads, one uncertainty alone, a second plant."""

from collections.abc import Iterator

import numpy as np

from cranectl.campaign import FAILED
from cranectl.report import Cell, Section, Table
from cranectl.support import Mask
from cranectl.tools.benchmark import scores
from cranectl.tools.benchmark.ranking import Judged
from cranectl.tools.benchmark.report.sets import COMPARED, NAMED, finite, median, named, section_of
from cranectl.tools.benchmark.settings import RADIUS_PREFIX, SINGLE_PREFIX
from cranectl.tools.benchmark.table import Runs
from cranectl.tools.benchmark.trials import radius_sets, single_sets

BEST = 5  # controllers whose single effects are not folded


def radius_section(judged: Judged) -> Iterator[Section]:
    """Yield a section on how far cranes may deviate."""
    benchmark = judged.benchmark
    ladder = radius_sets(benchmark)
    spreads = np.array([cranes.spread for cranes in ladder.values()])
    scenario = benchmark.radius.scenario
    cranes = [_possible(judged, name, scenario) for name in ladder]
    radii = []
    for controller in judged.best_first:
        runs = [judged.runs(name, scenario, controller) for name in ladder]
        there = [_failed_share(run, of) for run, of in zip(runs, cranes, strict=True) if run is not None]
        if len(there) == len(ladder):
            shares = np.array(there)
            radii.append((scores.robustness_radius(spreads, shares), controller, shares))
    if not radii:
        return
    rows = tuple(
        Cell.row(
            *named(judged, controller),
            finite(factor, ".2f", f"above {spreads[-1]:g}") if factor else f"below {spreads[0]:g}",
            *(f"{100.0 * share:.0f}" for share in shares),
        )
        for factor, controller, shares in sorted(radii, key=lambda row: -row[0])
    )
    headings = (*NAMED, "radius", *(f"failed [%] at\n{spread:g}" for spread in spreads))
    text = (
        f"The factor on all spreads at which 5 % of the runs of {scenario} fail, interpolated linearly. With "
        f"{benchmark.radius.draws} cranes at each factor, one crane more or less changes it."
    )
    left_out = {spread: int((~of).sum()) for spread, of in zip(spreads, cranes, strict=True) if not of.all()}
    if left_out:
        missing = ", ".join(f"{count} at {spread:g}" for spread, count in left_out.items())
        text += f" Left out are cranes that could not be simulated with any controller: {missing}."
    yield section_of(judged, "radius", "radius", text, (Table("", headings, rows, labels=2),))


def singles_section(judged: Judged) -> Iterator[Section]:
    """Tell what one uncertainty does by itself, beside none and all of them on the same scenario."""
    benchmark, singles = judged.benchmark, judged.benchmark.singles
    if singles is None:
        return
    exact = [name for name, cranes in benchmark.sets.items() if not cranes.spread]
    together = f"{RADIUS_PREFIX}{singles.spread:g}"
    columns = {name: name.removeprefix(SINGLE_PREFIX) for name in single_sets(benchmark)}
    columns = {**{name: name for name in exact[:1]}, **columns, together: "all"}
    there = {}
    for controller in judged.best_first:
        of = {name: judged.runs(name, singles.scenario, controller) for name in columns}
        if any(of[name] for name in single_sets(benchmark)):
            there[controller] = of
    if not there:
        return
    columns = {name: heading for name, heading in columns.items() if any(of[name] for of in there.values())}
    cranes = {name: _possible(judged, name, singles.scenario) for name in columns}
    tables = []
    for some, folded in ((list(there)[:BEST], False), (list(there)[BEST:], True)):
        for heading, cell in (("failed [%]", _failures), ("RMS error, 50 % [mm]", _error)):
            headings = (*NAMED, *(f"{heading}\n{effect}" for effect in columns.values()))
            rows = []
            for controller in some:
                runs = [(there[controller][name], cranes[name]) for name in columns]
                texts = ("" if own is None else cell(own, possible) for own, possible in runs)
                rows.append(Cell.row(*named(judged, controller), *texts))
            title = f"{'The others' if folded else 'The best'}: {heading}"
            tables += [Table(title, headings, tuple(rows), labels=2, folded=folded)] if rows else []
    text = (
        f"On {singles.scenario} one uncertainty alone, {singles.spread:g} times as wide as at spread 1, on a "
        "crane that has nothing else of what is uncertain, such as friction, delay, noise and wind; for "
        f"comparison all of it at nominal values, {', '.join(exact[:1])}, and all of it uncertain. Shown are "
        f"the {BEST} best controllers on the widest set, the others are folded. A run that fails counts "
        "as worse than any error."
    )
    yield section_of(judged, "single", "single effects", text, tables)


def _possible(judged: Judged, name: str, scenario: str) -> Mask:
    """Return which cranes of a set could be simulated with some controller, by sample."""
    found = (judged.runs(name, scenario, controller) for controller in judged.best_first)
    of_controllers = [runs for runs in found if runs is not None]
    some = np.zeros(max((runs.failed.size for runs in of_controllers), default=0), dtype=bool)
    for runs in of_controllers:
        some[: runs.failed.size] |= np.array(runs.status) != FAILED
    return some if len(of_controllers) > 1 else np.ones_like(some)


def _failed_share(runs: Runs, cranes: Mask) -> float:
    return float(runs.failed[cranes[: runs.failed.size]].mean())


def _failures(runs: Runs, cranes: Mask) -> str:
    return f"{100.0 * _failed_share(runs, cranes):.0f}"


def _error(runs: Runs, cranes: Mask) -> str:
    some = cranes[: runs.failed.size]
    return median(1e3 * runs.metrics[COMPARED][some], runs.failed[some])


def second_section(judged: Judged) -> Iterator[Section]:
    """Compare the results with those of the second plant."""
    benchmark = judged.benchmark
    plants = (benchmark.plant, benchmark.second_plant)
    headings = (*NAMED, "runs", *(f"failed [%]\n{plant}" for plant in plants), "one fails\nonly",
                "RMS errors apart\n50 % [mm]")  # fmt: skip
    tables: list[Table] = []
    for name in benchmark.sets:
        rows = []
        for controller in judged.best_first:
            pairs = [
                Runs.in_common([first, second])
                for scenario in benchmark.scenarios
                if (first := judged.runs(name, scenario, controller)) is not None
                and (second := judged.runs(name, scenario, controller, benchmark.second_plant)) is not None
            ]
            if not pairs:
                continue
            by_plant = list(zip(*pairs, strict=True))
            here, there = (np.concatenate([r.failed for r in runs]) for runs in by_plant)
            errors = (np.concatenate([r.metrics[COMPARED] for r in runs]) for runs in by_plant)
            apart = np.abs(np.subtract(*errors))[~(here | there)]
            shares = (f"{100.0 * failed.mean():.1f}" for failed in (here, there))
            texts = str((here != there).sum()), median(1e3 * apart, np.zeros(apart.size, dtype=bool))
            rows.append(Cell.row(*named(judged, controller), str(there.size), *shares, *texts))
        if rows:
            tables.append(Table(f"Cranes: {name}", headings, tuple(rows), labels=2, folded=bool(tables)))
    if tables:
        text = (
            "The same cranes, by equations that know nothing of the first plant's. The last column is the "
            "median of how far the RMS errors of the same crane are apart, where neither run fails."
        )
        yield section_of(judged, "second", f"on {benchmark.second_plant}", text, tables)
