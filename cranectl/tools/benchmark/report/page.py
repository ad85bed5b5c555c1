"""A benchmark as one page: pictures, caveats, undominated controllers, rules, tuning, divisions, failures."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

from cranectl.report import Cell, Page, Section, Table
from cranectl.tools.benchmark.declared import information_class
from cranectl.tools.benchmark.ranking import Judged
from cranectl.tools.benchmark.report.failures import failures_section
from cranectl.tools.benchmark.report.opening import EFFORT_UNIT, opening_sections
from cranectl.tools.benchmark.report.robustness import radius_section, second_section, singles_section
from cranectl.tools.benchmark.report.sets import NAMED, TITLES, finite, named, set_section
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.table import BenchmarkTable
from cranectl.tools.benchmark.trials import DIVISIONS

NOT_DECLARED = "not declared"
SHOWN = ("failed %", "unsettled %", "RMS u")  # of each set in the summary


def benchmark_page(
    benchmark: Benchmark,
    table: BenchmarkTable,
    remade_by: str,
    result: Path | None = None,
    yours: Collection[str] = (),
) -> Page:
    """Return the page; `result` is the directory of the results if they are there, `yours` the reader's."""
    divisions = judged_divisions(benchmark, table, yours)
    sections = [*opening_sections(divisions), *_summary(divisions)]
    sections += [_rules(benchmark, table), *_tuning(benchmark, table)]
    for judged in divisions:
        sections += [section for name in benchmark.sets for section in set_section(judged, name)]
        sections += [*radius_section(judged), *singles_section(judged), *second_section(judged)]
    texts = (
        f"Digest of the rules: {table.about['rules']}. Seed of the cranes: {table.about['seed']}.",
        f"Made by {'; some with '.join(_software(table.about['made_by']))}.",
    )
    sections += failures_section(divisions, result)
    sections.append(Section("versions", "Digests and versions", texts))
    return Page(f"Benchmark {benchmark.name}", benchmark.title, tuple(sections), remade_by)


def judged_divisions(
    benchmark: Benchmark, table: BenchmarkTable, yours: Collection[str] = ()
) -> list[Judged]:
    """Return those of the divisions that the table has."""
    there = {trial.division for trial in table.trials}
    return [Judged(benchmark, table, division, yours) for division in DIVISIONS if division in there]


def _summary(divisions: list[Judged]) -> Iterator[Section]:
    """Tell which controllers are undominated on any set, by division."""
    text = (
        "These controllers are undominated on at least one set: no other of the division is as good in "
        "unsettled time, effort and share of failures, and better in one. By effort alone: another fails no "
        "more and settles no later, but needs more effort. Differences within the intervals may be chance. "
        "What each one knows of crane and path is part of the comparison, and stands beside its name."
    )
    tables = [_undominated(judged) for judged in divisions if judged.ranked_sets]
    if tables:
        yield Section("summary", "Undominated controllers", (text,), tuple(tables))


def _undominated(judged: Judged) -> Table:
    """Return the controllers on any of the fronts, those on most of them first, and the reader's."""
    sets = [name for name in judged.benchmark.sets if judged.ranking(name)]
    by_set = {name: {standing.controller: standing for standing in judged.ranking(name)} for name in sets}
    places = {controller: judged.fronts_with(controller) for controller in judged.best_first}
    rows = []
    for controller, place in sorted(places.items(), key=lambda item: not item[1].startswith("all sets")):
        if not place and controller not in judged.yours:
            continue
        row: list[Cell | str] = [place or "none"]
        for standings in by_set.values():
            if (own := standings.get(controller)) is None:
                row += [""] * len(SHOWN)
            else:
                row += [f"{100.0 * own.failed:.1f}", f"{100.0 * own.unsettled:.1f}"]
                row += [finite(own.effort, ".2f", "fails")]
        rows.append(
            Cell.row(*named(judged, controller, "best" if place.startswith("all sets") else ""), *row)
        )
    headings = (*NAMED, "undominated on", *(f"{name}\n{column}" for name in sets for column in SHOWN))
    every = set().union(*by_set.values())
    title = f"{TITLES[judged.division]}: {sum(map(bool, places.values()))} of {len(every)} controllers"
    note = f"A star: undominated on every set. {EFFORT_UNIT}"
    return Table(title, headings, tuple(rows), labels=3, note=note)


def _rules(benchmark: Benchmark, table: BenchmarkTable) -> Section:
    sets = [f"{n}: spread {s.spread:g}, {s.draws} cranes" for n, s in benchmark.sets.items()]
    texts = (
        f"All cranes run on {benchmark.plant}, and a share of {benchmark.second_share:g} of them also on "
        f"{benchmark.second_plant}, with {benchmark.drive} drives. Sets: {'; '.join(sets)}. Every controller "
        "meets the same cranes. A run fails if it ends early or is too far off at its end. A failure counts "
        "as worse than any result, so that no controller gains by one.",
        "There are two divisions, and a controller is ranked within one only: as published, that is with "
        "defaults, for most of them first guesses and no paper's numbers, and tuned, all by the same budget.",
    )
    rows = []
    for controller, facts in sorted(table.about["laws"].items()):
        follows = "set points" if facts["follows"] == "set-point" else "path"
        ahead, known = facts["preview"] or NOT_DECLARED, NOT_DECLARED
        if (rig := facts["rig"]) is not None:
            ahead = facts["preview"] or "none"
            known = ", ".join(name.replace("_", " ") for name in rig) or "nothing"
        ahead = "all of the path" if facts["reads_path"] else str(ahead)
        rows.append(Cell.row(controller, follows, facts["measures"], ahead, facts["commands"], known))
    headings = ("controller", "follows", "measures", "preview", "commands", "knows of the rig")
    note = (
        "What is measured as state comes from encoders and an observer that all controllers share. Preview: "
        "control periods of the path ahead, or all of it before a run. Of masses and drives, those by "
        "which its numbers go. The column 'knows' of the other tables sums this up."
    )
    table_of_controllers = Table("", headings, tuple(rows), labels=6, note=note)
    return Section("rules", "Rules and information", texts, (table_of_controllers,))


def _software(made_by: Sequence[Mapping[str, str]]) -> Iterator[str]:
    """Yield the first software in full, and of others what differs from it."""
    first: Mapping[str, str] = {}
    for versions in made_by:
        other = {name: version for name, version in versions.items() if first.get(name) != version}
        yield ", ".join(f"{name} {version}" for name, version in other.items())
        first = made_by[0]


def _tuning(benchmark: Benchmark, table: BenchmarkTable) -> Iterator[Section]:
    """Yield a section with what tuning found for each controller."""
    tuned = table.about["tuned"]
    if not tuned:
        return
    stages = ("untuned", "half", "full")
    rows, numbers = [], []
    for controller, facts in sorted(tuned.items(), key=lambda item: item[1]["cost"]["full"]):
        found = (facts["cost"], facts["validation"].get("cost", {}))  # of search and validation
        costs = (f"{cost[stage]:.3f}" if cost else "" for cost in found for stage in stages)
        information = information_class(table.about["laws"][controller])
        rows.append(Cell.row(controller, information, str(facts["runs"]), *costs, facts["chosen"]))
        changed = [
            f"{key.removeprefix('design.').removeprefix(f'controller.{controller}.')} {before:g} → {after:g}"
            for key, (before, after) in sorted(facts["numbers"].items())
            if before != after
        ]
        if changed:
            numbers.append(Cell.row(controller, information, ", ".join(changed)))
    settings, validation = benchmark.tuning, benchmark.tuning.validation
    text = (
        f"Every controller by CMA-ES within {settings.runs} runs, from its defaults, on the plant "
        f"{benchmark.tuning_plant} and on cranes that are never judged: {settings.draws} for each "
        f"of {', '.join(settings.scenarios)} with each of the spreads "
        f"{', '.join(f'{spread:g}' for spread in settings.spreads)}. The cost is the mean over all runs, the "
        "lower the better; a run that fails costs more than 5."
    )
    if validation is not None:
        text += (
            f" Then {validation.draws} other cranes for each, on the plant {benchmark.plant}, choose between "
            "the untuned numbers, the best with half the budget, and the best with all of it."
        )
    kinds = ("search cost", "validation cost")
    headings = (*NAMED, "runs", *(f"{kind}\n{stage}" for kind in kinds for stage in stages), "chosen")
    tables = [Table("", headings, tuple(rows), labels=2)]
    if numbers:
        note = "On the laboratory rig; on a similar crane they go by its size, as defaults do."
        headings = (*NAMED, "untuned → found")
        tables.append(Table("Numbers found", headings, tuple(numbers), labels=3, note=note, folded=True))
    yield Section("tuning", "Tuning", (text,), tuple(tables))
