"""A benchmark as one page: caveats, who is undominated, rules, tuning, both divisions apart, failures."""

import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from cranectl.campaign.benchmark import scores
from cranectl.campaign.benchmark.declared import information_class
from cranectl.campaign.benchmark.ranking import Judged, Standing, points_of
from cranectl.campaign.benchmark.settings import Benchmark
from cranectl.campaign.benchmark.table import BenchmarkTable
from cranectl.campaign.benchmark.trials import DIVISIONS
from cranectl.campaign.manifest import controller_from
from cranectl.campaign.results import read_manifest
from cranectl.report.benchmark.robustness import radius_section, second_section, singles_section
from cranectl.report.benchmark.sets import NAMED, TITLES, finite, named, set_section
from cranectl.report.page import Page, Section
from cranectl.report.table import Cell, Table, cells
from cranectl.status import RunStatus

FILE = "FILE"  # of a controller, where it is not known
NOT_DECLARED = "not declared"
SHOWN = ("failed %", "unsettled %", "RMS u")  # of each set in the summary
OUR_CONTROLLER = "lqr-offset-free"
CAVEATS = (
    f"Read this first: we wrote {OUR_CONTROLLER} ourselves, after the rules were fixed. The judged cranes "
    "are drawn by the hash of the commit that holds it and its numbers. That hash was not known before. Our "
    "controller had advantages all the same:",
    "1. Its structure, defaults and bounds were chosen by people who knew the scenarios. They looked at "
    "cranes of the tuning's seed, beyond the budget of the search.",
    "2. As published it runs with defaults made in this way. Most others run with first guesses.",
    "3. It knows the limits of the drives.",
    "4. A constant disturbance leaves an offset with controllers that do not observe it. It is one of the "
    "ranked scenarios and a part of the tuning set. This favours controllers that observe or integrate.",
    "Readers who disagree with the last point should look at the scenarios one by one.",
)


def benchmark_page(
    benchmark: Benchmark, table: BenchmarkTable, remade_by: str, result: Path | None = None
) -> Page:
    """Return the page; `result` is the directory of the results, if they are there."""
    divisions = judged_divisions(benchmark, table)
    sections = [*_caveats(table), *_summary(divisions), _rules(benchmark, table), *_tuning(benchmark, table)]
    for judged in divisions:
        sections += [section for name in benchmark.sets for section in set_section(judged, name)]
        sections += [*radius_section(judged), *singles_section(judged), *second_section(judged)]
    sections += [*_failures(divisions, result), _provenance(table)]
    return Page(f"Benchmark {benchmark.name}", benchmark.title, tuple(sections), remade_by)


def judged_divisions(benchmark: Benchmark, table: BenchmarkTable) -> list[Judged]:
    """Return those of the divisions that the table has."""
    there = {trial.division for trial in table.trials}
    return [Judged(benchmark, table, division) for division in DIVISIONS if division in there]


def _caveats(table: BenchmarkTable) -> Iterator[Section]:
    """Yield what a reader should know of our own controller, if it takes part."""
    if OUR_CONTROLLER in table.about["laws"]:
        yield Section("caveats", "Our own controller", CAVEATS)


def _provenance(table: BenchmarkTable) -> Section:
    """Return the digests and versions from which the table can be made again."""
    texts = (
        f"Digest of the rules: {table.about['rules']}. Seed of the cranes: {table.about['seed']}.",
        f"Made by {'; some with '.join(_software(table.about['made_by']))}.",
    )
    return Section("versions", "Digests and versions", texts)


def _summary(divisions: list[Judged]) -> Iterator[Section]:
    """Tell which controllers are undominated on any set, by division."""
    text = (
        "These controllers are undominated on at least one set: no other of the division is as good in "
        "unsettled time, effort and share of failures, and better in one. One may be here only because it "
        "asks for little effort, or because it fails least: read all three columns. Differences within the "
        "intervals may be chance. What each one knows of crane and path is part of the comparison, and "
        "stands beside its name."
    )
    texts, tables = [text], []
    for judged in divisions:
        sets = {name: standings for name in judged.benchmark.sets if (standings := judged.ranking(name))}
        if not sets:
            continue
        fronts = {}
        for name, standings in sets.items():
            full = scores.undominated(points_of(standings))
            fronts[name] = {
                standing.controller for standing, best in zip(standings, full, strict=True) if best
            }
        everywhere = [
            controller
            for controller in judged.best_first
            if all(controller in front for front in fronts.values())
        ]
        title = TITLES[judged.division]
        texts.append(f"{title}, on {', '.join(sets)} alike: {', '.join(everywhere) or 'none'}.")
        tables.append(_undominated(judged, sets, fronts))
    if tables:
        yield Section("summary", "Summary", tuple(texts), tuple(tables))


def _undominated(
    judged: Judged, sets: Mapping[str, Sequence[Standing]], fronts: Mapping[str, set[str]]
) -> Table:
    """Return the controllers on any of the fronts, those on most of them first."""
    by_set = {
        name: {standing.controller: standing for standing in standings_of_set}
        for name, standings_of_set in sets.items()
    }
    count = {
        controller: sum(controller in front for front in fronts.values()) for controller in judged.best_first
    }
    controllers = sorted(
        (controller for controller, times in count.items() if times),
        key=lambda controller: -count[controller],
    )
    rows = []
    for controller in controllers:
        row: list[Cell | str] = []
        for name, standings in by_set.items():
            if controller not in standings:
                row += [""] * len(SHOWN)
                continue
            own_standing = standings[controller]
            share, unsettled = 100.0 * own_standing.failed, 100.0 * own_standing.unsettled
            failed = Cell(f"{share:.1f}", "best" if controller in fronts[name] else "")
            row += [failed, f"{unsettled:.1f}", finite(own_standing.effort, ".2f", "fails")]
        rows.append(cells(*named(judged, controller), *row))
    headings = (*NAMED, *(f"{name}\n{column}" for name in sets for column in SHOWN))
    every = set().union(*by_set.values())
    title = f"{TITLES[judged.division]}: {len(controllers)} of {len(every)} controllers"
    note = "A star: undominated on that set. RMS u in m/s²."
    return Table(title, headings, tuple(rows), labels=2, note=note)


def _rules(benchmark: Benchmark, table: BenchmarkTable) -> Section:
    sets = [f"{n}: spread {s.spread:g}, {s.draws} cranes" for n, s in benchmark.sets.items()]
    texts = (
        f"All cranes run on {benchmark.plant}, and a share of {benchmark.second_share:g} of them also on "
        f"{benchmark.second_plant}, with {benchmark.drive} drives. Sets: {'; '.join(sets)}. Every controller "
        "meets the same cranes. A run fails if it ends early or is too far off at its end. A failure counts "
        "as worse than any result, so that no controller gains by one. We wrote the controllers of the "
        "literature; their authors may do better.",
        "There are two divisions, which are never in one table: controllers as published, that is with their "
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
        rows.append(cells(controller, follows, facts["measures"], ahead, facts["commands"], known))
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
        costs = (f"{facts['cost'][stage]:.3f}" for stage in stages)
        failed = (f"{100.0 * facts['failed'][stage]:.0f}" for stage in stages)
        information = information_class(table.about["laws"][controller])
        rows.append(cells(controller, information, str(facts["runs"]), *costs, *failed))
        changed = [
            f"{key.removeprefix('design.').removeprefix(f'controller.{controller}.')} {before:g} → {after:g}"
            for key, (before, after) in sorted(facts["numbers"].items())
        ]
        if changed:
            numbers.append(cells(controller, information, ", ".join(changed)))
    settings = benchmark.tuning
    text = (
        f"Every controller by CMA-ES within {settings.runs} runs, from its defaults, on cranes that are "
        f"never judged on: {settings.draws} each of {', '.join(settings.scenarios)}, spread "
        f"{settings.spread:g}. The cost is the mean over them, the lower the better; a run that fails costs "
        "more than 5. Where the second half of the budget gained little, a larger one may not help. The "
        "search is local, and some numbers end at a bound. A controller with nothing to tune is run as it is."
    )
    headings = (*NAMED, "runs", *(f"{what}\n{stage}" for what in ("cost", "failed %") for stage in stages))
    tables = [Table("", headings, tuple(rows), labels=2)]
    if numbers:
        note = "On the laboratory rig; on a similar crane they go by its size, as defaults do."
        headings = (*NAMED, "untuned → found")
        tables.append(Table("Numbers found", headings, tuple(numbers), labels=3, note=note, folded=True))
    yield Section("tuning", "Tuning", (text,), tuple(tables))


def _failures(divisions: list[Judged], result: Path | None) -> Iterator[Section]:
    """Tell the first failure of each controller on each set that is judged, and how to look at it."""
    command = "to see it" if result else "to see it, in the result's directory"
    headings = (*NAMED, "set", "scenario", "crane", "ended", command)
    tables = []
    for judged in divisions:
        rows = [
            cells(*named(judged, controller), name, *failure)
            for controller in judged.best_first
            for name in judged.benchmark.sets
            if (failure := _first_failure(judged, controller, name, result))
        ]
        if rows:
            tables.append(Table(TITLES[judged.division], headings, tuple(rows), labels=7, folded=True))
    if tables:
        unknown = any(row[-1].text.endswith(FILE) for table in tables for row in table.rows)
        file = f" {FILE} is that of the controller." if unknown else ""
        text = (
            f"The first failure of each on each set.{file} Without the results, the trial runs again "
            "by 'cranectl benchmark run' with --division, --controller, --set-of-cranes, --scenario, and "
            "--draws for the cranes up to that one."
        )
        yield Section("failures", "Failures to look at", (text,), tuple(tables))


def _first_failure(judged: Judged, controller: str, crane_set: str, result: Path | None) -> tuple[str, ...]:
    """Return scenario, crane, status and replay command of the first failure; empty if none failed."""
    for scenario in judged.benchmark.scenarios:
        trial = judged.trial(crane_set, scenario, controller)
        runs = judged.table.trials.get(trial)
        if runs is not None and runs.failed.any():
            sample = int(np.flatnonzero(runs.failed)[0])
            status = runs.status[sample]
            ended = "beyond a limit" if status == RunStatus.COMPLETED.label else status
            folder = result / trial.folder if result else trial.folder
            command = ["cranectl", "campaign", "replay", str(folder), "--run", str(sample)]
            if judged.table.about["laws"][controller]["file"]:
                named = controller_from(read_manifest(folder), folder, controller) if result else controller
                command += ["--controller", FILE if named == controller else named]
            return scenario, str(sample), ended, shlex.join(command)
    return ()
