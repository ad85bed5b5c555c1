"""The page of a validation: what failed on top, with the command that shows it."""

from collections.abc import Sequence
from dataclasses import replace
from math import isnan

from cranectl.cases.pairwise import Pairwise, WorstPair
from cranectl.cases.validation import Validation
from cranectl.report.page import Page, Section
from cranectl.report.run.tables import agreement_table, limit_notes, limits_table, run_notes, run_table
from cranectl.report.table import ANSWERS, Cell, Table, cells

SHOWN = 10  # rows of what is wrong, the worst first, before the others are folded


def validation_page(
    validation: Validation, options: Sequence[str], remade_by: str, pairs: Pairwise | None = None
) -> Page:
    """Of `validation`; `options` are those of single runs, for the commands that run a case again."""
    verdicts, finished = validation.verdicts, validation.finished
    failed = sorted((each for each in verdicts if each.kind != "passed"), key=lambda each: -each.overrun)
    rows = tuple(
        cells(
            ", ".join(part for part in (each.scenario, each.controller, each.drive) if part),
            "; ".join(" ".join(fault.split()) for fault in each.faults),
            f"cranectl report {each.log}" if each.log else each.command(options),
        )
        for each in failed
    )
    tables = _in_parts(Table("", ("case", "what is wrong", "to see it"), rows, labels=3))
    lead = f"{len(verdicts) - len(failed)} of {len(verdicts)} cases passed."
    sections = [Section("failed", "What failed", () if failed else ("Nothing.",), tables)]
    if finished:
        agreements, runs = validation.agreements, validation.runs
        paragraphs, tables = (
            limit_notes(agreements),
            (agreement_table(agreements, validation.other_failures),),
        )
        worst, limits = limits_table(runs, worst=SHOWN), limits_table(runs)
        if worst is not None and limits is not None:
            folded = replace(limits, title=f"All limits: {len(limits.rows)}", folded=True)
            tables = (*((worst,) if worst.rows else ()), folded, *tables)
            paragraphs[:0] = [] if worst.rows else [limits.note]
        notes = Table("Notes", ("",), tuple(cells(note) for note in run_notes(finished)))
        sections.append(
            Section("judgement", "Plants and limits", tuple(paragraphs), (*tables, *_in_parts(notes)))
        )
        if pairs is not None and pairs.pairs:
            sections.append(Section("pairs", "Every plant against every other", (), pair_tables(pairs)))
        sections.append(Section("runs", "Runs", (), (run_table({"": runs}),)))
    return Page("Validation", lead, tuple(sections), remade_by)


def pair_tables(found: Pairwise) -> tuple[Table, Table]:
    """How far each plant is from each other at most, and what each does by itself."""
    rows = tuple(
        cells(
            pair.drive,
            f"{pair.plant}, {pair.reference}",
            f"{pair.cases}",
            *(f"{value:.1e}" for value in (pair.load_m, pair.angle_rad, pair.tension_n)),
            f"{pair.scenario}, {pair.controller}",
            _answer(pair),
        )
        for pair in found.pairs
    )
    headings = ("drives", "plants", "cases", "load [m]", "angle [rad]", "tension [N]", "load, where", "agree")
    apart = Table("Every plant against every other, at most", headings, rows, labels=2)
    alone = tuple(
        cells(
            each.drive,
            each.plant,
            f"{each.step_error_m:.1e}",
            "-" if isnan(each.order) else f"{each.order:.1f}",
            f"{each.energy_drift:.1e}",
            f"{each.scenario}, {each.controller}",
        )
        for each in found.plants
    )
    columns = ("drives", "plant", "step error\n[m]", "order", "energy drift\n[m g l]", "step error, where")
    note = (
        "Step error: how far the load moves when the plant's own steps are a quarter as long, and the order "
        "by which that falls; - where rounding is all there is. Energy drift: of a free swing of 20 s."
    )
    return apart, Table("Each plant by itself", columns, alone, labels=2, note=note)


def _answer(pair: WorstPair) -> Cell:
    if pair.failed:
        return Cell(f"NO ({pair.failed})", "bad")
    return ANSWERS[None if pair.not_judged == pair.cases else True]


def _in_parts(table: Table) -> tuple[Table, ...]:
    """The first rows, and folded the others, under how many they are."""
    rest = table.rows[SHOWN:]
    more = replace(table, title=f"{len(rest)} more", rows=rest, folded=True)
    return tuple(part for part in (replace(table, rows=table.rows[:SHOWN]), more) if part.rows)
