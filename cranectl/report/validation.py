"""The page of a validation: what failed on top, with the command that shows it."""

from collections.abc import Sequence
from dataclasses import replace

from cranectl.cases.validation import Validation
from cranectl.report.page import Page, Section
from cranectl.report.run.tables import agreement_table, limit_notes, limits_table, run_notes, run_table
from cranectl.report.table import Table, cells

SHOWN = 10  # rows of what is wrong, the worst first, before the others are folded


def validation_page(validation: Validation, options: Sequence[str], remade_by: str) -> Page:
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
        sections.append(Section("runs", "Runs", (), (run_table({"": runs}),)))
    return Page("Validation", lead, tuple(sections), remade_by)


def _in_parts(table: Table) -> tuple[Table, ...]:
    """The first rows, and folded the others, under how many they are."""
    rest = table.rows[SHOWN:]
    more = replace(table, title=f"{len(rest)} more", rows=rest, folded=True)
    return tuple(part for part in (replace(table, rows=table.rows[:SHOWN]), more) if part.rows)
