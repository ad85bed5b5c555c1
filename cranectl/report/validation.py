"""The page of a validation: the verdict, then each scenario with its limits, reason, picture and command."""

import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf, isnan
from pathlib import Path
from typing import NamedTuple

from PIL.Image import Image

from cranectl.cases import JudgedValue, Pairwise, Validation, Verdict
from cranectl.plants import PLANTS
from cranectl.report.page import Fact, Figure, FirstScreen, Page, Section
from cranectl.report.run.differences import DifferenceTables
from cranectl.report.run.first_screen import BADGES
from cranectl.report.run.tables import RunTables
from cranectl.report.table import Cell, Table
from cranectl.report.validation_input import facts_of_masses, made_with, masses_of, motion_text
from cranectl.scenario import Drawing, Scenario
from cranectl.support import Quantity

SHOWN = 10  # rows, the worst first, before the others are folded
SHOWN_SCENARIOS = 12  # that have sections and pictures, the worst first

Moment = tuple[float, Image]  # time [s] and picture


class ScenarioVerdict(NamedTuple):
    """A scenario with all its cases, the worst first."""

    source: str
    scenario: Scenario | None
    cases: tuple[Verdict, ...]

    @property
    def failed(self) -> list[Verdict]:
        """The cases that did not pass."""
        return [case for case in self.cases if case.kind != "passed"]

    @property
    def name(self) -> str:
        """The scenario's name; where it cannot be loaded, its file."""
        return self.scenario.name if self.scenario else self.source

    @property
    def title(self) -> str:
        """The scenario's title, or its name."""
        return (self.scenario.title if self.scenario else "") or self.name

    @property
    def motion(self) -> str:
        """Crane and motion in words."""
        if self.scenario is None:
            return ""
        kind = Drawing(self.scenario.rig).kind
        return f"{kind[0].upper()}{kind[1:]}: {motion_text(self.scenario)}"


class ValidationPage:
    """The page of a validation."""

    @staticmethod
    def of(
        validation: Validation,
        options: Sequence[str],
        remade_by: str,
        pairs: Pairwise | None = None,
        moments: Mapping[str, Moment] | None = None,
    ) -> Page:
        """Return the page of a validation; `options` are those of the commands that run a case again.

        `moments` holds the worst moment of each scenario, by how it was asked for.
        """
        scenarios, moments, sections = scenario_verdicts(validation), moments or {}, []
        single, failed = len(scenarios) == 1, [scenario for scenario in scenarios if scenario.failed]
        first = next((scenario for scenario in scenarios if scenario.source in moments), scenarios[0])
        shown = _tables_of(first, options) if single else (_scenario_table(scenarios),)
        facts, pictures = tuple(_facts(validation, scenarios)), _figures(first, moments)
        badge, reason = BADGES[not failed], _reason(scenarios, failed)
        if validation.interruption:
            badge, reason = BADGES[None], f"The validation was {validation.interruption}."
        screen = FirstScreen(badge, reason, facts, shown, pictures)
        others = {source: moment for source, moment in moments.items() if source != first.source}
        for number, scenario in enumerate(() if single else scenarios[:SHOWN_SCENARIOS], 1):
            sections.append(_scenario_section(f"scenario-{number}", scenario, options, others))
        if sum(len(scenario.cases) for scenario in scenarios) > len(scenarios):
            sections.append(_cases_section(scenarios, options))
        if finished := validation.finished:
            agreements = validation.agreements
            notes = Table("Notes", ("",), tuple(Cell.row(note) for note in RunTables.run_notes(finished)))
            tables = (RunTables.agreement(agreements, validation.other_failures), *_in_parts(notes))
            sections.append(Section("judgement", "Plants", tuple(RunTables.limit_notes(agreements)), tables))
            if pairs is not None and pairs.pairs:
                sections.append(
                    Section("pairs", "Every plant against every other", (), DifferenceTables.pairs(pairs))
                )
            runs = replace(RunTables.runs({"": validation.runs}), folded=True)
            sections.append(Section("runs", "Runs", (), (runs,)))
        sections.append(Section("made", "Made with", (), (made_with(validation),)))
        title, lead = (scenarios[0].title, scenarios[0].motion) if single else ("Validation", "")
        return Page(title, lead or _what_was_run(validation), tuple(sections), remade_by, screen)

    @staticmethod
    def worst_logs(validation: Validation) -> dict[str, Path]:
        """Return the log of the worst case of the scenarios that are shown, where it is kept."""
        shown = scenario_verdicts(validation)[:SHOWN_SCENARIOS]
        logs = {scenario.source: scenario.cases[0].log for scenario in shown}
        return {source: Path(log) for source, log in logs.items() if log}


def scenario_verdicts(validation: Validation) -> list[ScenarioVerdict]:
    """Return the scenarios of a validation, the worst first, each with its cases, the worst first."""
    by_source: dict[str, list[Verdict]] = {}
    for verdict in validation.verdicts:
        by_source.setdefault(verdict.scenario, []).append(verdict)
    scenarios = []
    for source, cases in by_source.items():
        cases.sort(key=lambda case: case.sort_key, reverse=True)
        scenario = cases[0].case.scenario if cases[0].case else None
        scenarios.append(ScenarioVerdict(source, scenario, tuple(cases)))
    return sorted(scenarios, key=lambda scenario: scenario.cases[0].sort_key, reverse=True)


def causes(case: Verdict) -> list[str]:
    """Return why a case does not pass, a sentence each.

    A run that ends too early explains its limits and differences, which are left out then.
    """
    result = case.result
    if result is None:
        return [_refusal(fault) for fault in case.faults]
    ends: dict[str, list[str]] = {}
    for run in result.runs:
        if run.status.label != result.expected:
            how = f"at {run.end_s:g} s with {run.status.label}: {run.status.explanation}"
            ends.setdefault(how, []).append(run.plant)
    if ends:
        expectation = "" if result.expected == "completed" else f" Expected was {result.expected}."
        return [f"The run on {', '.join(plants)} ended {how}.{expectation}" for how, plants in ends.items()]
    faults = [value.fault for value in JudgedValue.of_case(result) if not value.kept]
    steps = sorted({agreement.curing_step_s for agreement in result.agreements if agreement.curing_step_s})
    faults += [f"With control.physics_step = {Quantity(step).setting()} the plants agree." for step in steps]
    if not result.limits_kept:
        beyond = [run.beyond_drives for run in result.runs if run.beyond_drives]
        faults += [f"The controller {text}." for text in beyond[:1]]
    return faults


def _refusal(text: str) -> str:
    """Return a sentence from an error of several lines: what is found, and the remedy."""
    parts = dict(line.split(":", 1) for line in text.splitlines() if ":" in line)
    if not {"found", "remedy"} <= parts.keys():
        return " ".join(text.split())
    return f"It could not be run: {parts['found'].strip()}. Remedy: {parts['remedy'].strip()}."


def _reason(scenarios: Sequence[ScenarioVerdict], failed: Sequence[ScenarioVerdict]) -> str:
    """Return the verdict in words; of several scenarios that fail, the reason of the worst."""
    if not failed:
        results = [case.result for scenario in scenarios for case in scenario.cases if case.result]
        keys = {value.key for result in results for value in JudgedValue.of_case(result)}
        good = ["runs end as expected"]
        good += ["the plants agree"] if JudgedValue.BETWEEN_PLANTS in keys else []
        good += ["all limits are kept"] if keys - {JudgedValue.BETWEEN_PLANTS} else []
        passed = f"All {len(scenarios)} scenarios pass" if len(scenarios) > 1 else "The scenario passes"
        return f"{passed}: {', '.join(good)}."
    reason = " ".join(causes(failed[0].cases[0]))
    if len(scenarios) == 1:
        cases = failed[0].cases
        several = f"{len(failed[0].failed)} of {len(cases)} cases fail; the worst is {cases[0].name}. "
        return f"{several if len(cases) > 1 else ''}{reason}"
    verb = "fails" if len(failed) == 1 else "fail"
    which = "" if len(failed) == 1 else "The worst: "
    return f"{len(failed)} of {len(scenarios)} scenarios {verb}. {which}{failed[0].name}: {reason}"


def _facts(validation: Validation, scenarios: Sequence[ScenarioVerdict]) -> Iterator[Fact]:
    """Yield the numbers of the first screen."""
    if len(scenarios) == 1:
        yield Fact("Runs", f"{len(validation.runs)}", _what_was_run(validation))
    else:
        passed = sum(not scenario.failed for scenario in scenarios)
        mark = "bad" if passed < len(scenarios) else ""
        yield Fact("Scenarios that pass", f"{passed} of {len(scenarios)}", _what_was_run(validation), mark)
    values = [value for result in validation.finished for value in JudgedValue.of_case(result)]
    limits = [value for value in values if value.key != JudgedValue.BETWEEN_PLANTS]
    if limits:
        kept, reference = sum(value.kept for value in limits), PLANTS.reference(validation.plants)
        mark = "bad" if kept < len(limits) else ""
        yield Fact("Limits kept", f"{kept} of {len(limits)}", f"judged on {reference}", mark)
    errors = {
        f"{run.scenario}, {run.controller}, {run.drive} drives": run.metrics.max_error_m
        for run in validation.runs
        if run.metrics is not None
    }
    if errors:
        name, largest = max(errors.items(), key=lambda pair: (isnan(pair[1]), pair[1]))
        yield Fact("Largest tracking error", Quantity(largest, "m").text(), name if len(errors) > 1 else "")
    if judged := [agreement for agreement in validation.agreements if agreement.limit_m is not None]:
        apart = max(judged, key=lambda agreement: agreement.max_load_error_m / (agreement.limit_m or inf))
        allowed = f"allowed: {Quantity(apart.limit_m or 0.0, 'm')}"
        mark = "bad" if any(agreement.passed is False for agreement in judged) else ""
        yield Fact(
            "Difference between plants", Quantity(apart.max_load_error_m, "m").difference(), allowed, mark
        )
    yield from facts_of_masses([verdict.scenario for verdict in scenarios if verdict.scenario])


def _what_was_run(validation: Validation) -> str:
    """Return controllers, drives and plants in words."""
    controllers = list(dict.fromkeys(case.controller for case in validation.cases))
    drives = " and ".join(dict.fromkeys(case.drive for case in validation.cases))
    what = controllers[0] if len(controllers) == 1 else f"{len(controllers)} controllers"
    return f"{what} with {drives} drives, on {', '.join(validation.plants)}" if controllers else ""


def _scenario_table(scenarios: Sequence[ScenarioVerdict]) -> Table:
    columns: dict[str, Callable[[ScenarioVerdict], Cell | str]] = {
        "scenario": lambda scenario: scenario.title,
        "motion": lambda scenario: motion_text(scenario.scenario) if scenario.scenario else "",
        "result": lambda scenario: BADGES[not scenario.failed],
    }
    return Table.of("", scenarios, columns, labels=3)


def _tables_of(scenario: ScenarioVerdict, options: Sequence[str]) -> tuple[Table, ...]:
    """Return each limit of a scenario once, of the case that is farthest from keeping it, and commands."""
    worst: dict[str, tuple[JudgedValue, str]] = {}
    for case in scenario.cases:
        for value in JudgedValue.of_case(case.result) if case.result else ():
            if value.key not in worst or value.overrun > worst[value.key][0].overrun:
                worst[value.key] = (value, case.name)
    columns: dict[str, Callable[[tuple[JudgedValue, str]], Cell | str]] = {
        "limit": lambda row: row[0].name,
        "allowed": lambda row: f"{row[0].sign} {row[0].limit}",
        "measured": lambda row: row[0].measured or "–",
        "kept": lambda row: Cell.answer(row[0].kept),
        "worst case": lambda row: row[1],
    }
    if len(scenario.cases) == 1:
        del columns["worst case"]
    limits = Table.of("", worst.values(), columns)
    return (*((limits,) if worst else ()), _command_table(scenario.cases[0], options))


def _figures(scenario: ScenarioVerdict, moments: Mapping[str, Moment]) -> tuple[Figure, ...]:
    if scenario.source not in moments:
        return ()
    (time, picture), case = moments[scenario.source], scenario.cases[0]
    caption = f"{case.name}: at {time:.2f} s the load is farthest from its reference."
    return (Figure.pictured(f"{scenario.name} at its worst moment", caption, picture),)


def _scenario_section(
    anchor: str, scenario: ScenarioVerdict, options: Sequence[str], moments: Mapping[str, Moment]
) -> Section:
    """Return title, motion, reason, limits, commands and picture of a scenario."""
    failed, worst = scenario.failed, scenario.cases[0]
    paragraphs = [scenario.title] if scenario.title != scenario.name else []
    paragraphs += [f"{scenario.motion}."] if scenario.motion else []
    paragraphs += [f"Load {', '.join(masses_of(scenario.scenario))}."] if scenario.scenario else []
    if failed:
        paragraphs += [f"{f'{worst.name}: ' if worst.case else ''}{' '.join(causes(worst))}"]
        if len(scenario.cases) > 1:
            paragraphs += [f"{len(failed)} of {len(scenario.cases)} cases fail."]
    title = f"{BADGES[not failed].text}: {scenario.name}"
    tables = _tables_of(scenario, options)
    return Section(anchor, title, tuple(paragraphs), tables, _figures(scenario, moments))


def _command_table(case: Verdict, options: Sequence[str]) -> Table:
    """Return the commands that show a case, as they are typed."""
    commands = {"the run again": case.command(options)}
    if case.log:
        commands = {"all figures": shlex.join(["cranectl", "report", case.log]), **commands}
    rows = tuple(Cell.row(what, Cell(text, "code")) for what, text in commands.items())
    return Table("", ("to see", "type"), rows, labels=2)


def _cases_section(scenarios: Sequence[ScenarioVerdict], options: Sequence[str]) -> Section:
    """Return all cases that do not pass with their reasons and commands, and how many pass."""
    rows = []
    for scenario in scenarios:
        for case in scenario.failed:
            name = ", ".join(filter(None, (scenario.name, case.controller, case.drive)))
            rows.append(Cell.row(name, " ".join(causes(case)), _command_table(case, options).rows[0][1]))
    total = sum(len(scenario.cases) for scenario in scenarios)
    summary = f"{len(rows)} of {total} cases fail." if rows else f"All {total} cases pass."
    tables = _in_parts(Table("", ("case", "reason", "to see it"), tuple(rows), labels=3))
    return Section("cases", "Cases", (summary,), tables)


def _in_parts(table: Table) -> tuple[Table, ...]:
    """Return the first rows, and the others folded, under their number."""
    rest = table.rows[SHOWN:]
    more = replace(table, title=f"{len(rest)} more", rows=rest, folded=True)
    return tuple(part for part in (replace(table, rows=table.rows[:SHOWN]), more) if part.rows)
