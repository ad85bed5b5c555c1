"""The page of a validation: what failed on top, with the command that shows it."""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import isnan

from cranectl.cases.pairwise import Pairwise, WorstPair
from cranectl.cases.validation import Validation
from cranectl.report.page import Page, Section
from cranectl.report.run.tables import agreement_table, limit_notes, limits_table, run_notes, run_table
from cranectl.report.table import ANSWERS, Cell, Table, cells, tabulate
from cranectl.support.units import difference_text

SHOWN = 10  # rows of what is wrong, the worst first, before the others are folded


def validation_page(
    validation: Validation, options: Sequence[str], remade_by: str, pairs: Pairwise | None = None
) -> Page:
    """Return the page of `validation`; `options` belong to the commands that run a case again."""
    verdicts, finished = validation.verdicts, validation.finished
    failed = sorted(
        (verdict for verdict in verdicts if verdict.kind != "passed"), key=lambda verdict: -verdict.overrun
    )
    rows = []
    for verdict in failed:
        case = ", ".join(filter(None, (verdict.scenario, verdict.controller, verdict.drive)))
        faults = "; ".join(" ".join(fault.split()) for fault in verdict.faults)
        report = shlex.join(["cranectl", "report", verdict.log]) if verdict.log else verdict.command(options)
        rows.append(cells(case, faults, report))
    tables = _in_parts(Table("", ("case", "what is wrong", "to see it"), tuple(rows), labels=3))
    lead = f"{len(verdicts) - len(failed)} of {len(verdicts)} cases passed."
    sections = [Section("failed", "What failed", () if failed else ("Nothing.",), tables)]
    if finished:
        agreements, runs = validation.agreements, validation.runs
        paragraphs = limit_notes(agreements)
        tables = (agreement_table(agreements, validation.other_failures),)
        worst, limits = limits_table(runs, worst=SHOWN), limits_table(runs)
        if worst is not None and limits is not None:
            folded = replace(limits, title=f"All limits: {len(limits.rows)}", folded=True)
            tables = (*((worst,) if worst.rows else ()), folded, *tables)
            paragraphs[:0] = [] if worst.rows else [limits.note]
        notes = Table("Notes", ("",), tuple(cells(note) for note in run_notes(finished)))
        tables = (*tables, *_in_parts(notes))
        sections.append(Section("judgement", "Plants and limits", tuple(paragraphs), tables))
        if pairs is not None and pairs.pairs:
            sections.append(Section("pairs", "Every plant against every other", (), pair_tables(pairs)))
        sections.append(Section("runs", "Runs", (), (run_table({"": runs}),)))
    return Page("Validation", lead, tuple(sections), remade_by)


def pair_tables(pairwise: Pairwise) -> tuple[Table, Table]:
    """Return how far each plant is from each other at most, and what each does by itself."""
    columns: dict[str, Callable[[WorstPair], Cell | str]] = {
        "drives": lambda pair: pair.drive,
        "plants": lambda pair: f"{pair.plant}, {pair.reference}",
        "cases": lambda pair: f"{pair.cases}",
        "load [m]": lambda pair: difference_text(pair.load_m),
        "angle [rad]": lambda pair: difference_text(pair.angle_rad),
        "tension [N]": lambda pair: difference_text(pair.tension_n),
        "load, where": lambda pair: f"{pair.scenario}, {pair.controller}",
        "agree": _answer,
    }
    apart = tabulate("Every plant against every other, at most", pairwise.pairs, columns, labels=2)
    rows = []
    for plant in pairwise.plants:
        order = "-" if isnan(plant.order) else f"{plant.order:.1f}"
        where, drift = f"{plant.scenario}, {plant.controller}", difference_text(plant.energy_drift)
        rows.append(cells(plant.drive, plant.plant, difference_text(plant.step_error_m), order, drift, where))
    headings = ("drives", "plant", "step error\n[m]", "order", "energy drift\n[m g l]", "step error, where")
    note = (
        "Step error: how far the load moves when the plant's own steps are a quarter as long, and the order "
        "by which that falls; - where rounding is all there is. Energy drift: of a free swing of 20 s."
    )
    return apart, Table("Each plant by itself", headings, tuple(rows), labels=2, note=note)


def _answer(pair: WorstPair) -> Cell:
    if pair.failed:
        return Cell(f"NO ({pair.failed})", "bad")
    return ANSWERS[None if pair.not_judged == pair.cases else True]


def _in_parts(table: Table) -> tuple[Table, ...]:
    """Return the first rows, and the others folded, under their number."""
    rest = table.rows[SHOWN:]
    more = replace(table, title=f"{len(rest)} more", rows=rest, folded=True)
    return tuple(part for part in (replace(table, rows=table.rows[:SHOWN]), more) if part.rows)
