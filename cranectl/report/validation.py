"""The page of a validation: what failed on top, with the command that shows it."""

from collections.abc import Sequence

from cranectl.cases.validation import Validation
from cranectl.report.page import Page, Section
from cranectl.report.run.tables import agreement_table, limit_notes, limits_table, run_notes, run_table
from cranectl.report.table import Table, cells


def validation_page(validation: Validation, options: Sequence[str], remade_by: str) -> Page:
    """Of `validation`; `options` are those of single runs, for the commands that run a case again."""
    verdicts, finished = validation.verdicts, validation.finished
    failed = [verdict for verdict in verdicts if verdict.kind != "passed"]
    rows = tuple(
        cells(
            ", ".join(part for part in (each.scenario, each.controller, each.drive) if part),
            "; ".join(" ".join(fault.split()) for fault in each.faults),
            f"cranectl report {each.log}" if each.log else each.command(options),
        )
        for each in failed
    )
    tables = (Table("", ("case", "what is wrong", "to see it"), rows, labels=3),) if failed else ()
    lead = f"{len(verdicts) - len(failed)} of {len(verdicts)} cases passed."
    sections = [Section("failed", "What failed", () if failed else ("Nothing.",), tables)]
    if finished:
        agreements, runs = validation.agreements, validation.runs
        limits = limits_table(runs)
        notes = (*limit_notes(agreements), *run_notes(finished))
        judged = (
            agreement_table(agreements, validation.other_failures),
            *((limits,) if limits is not None else ()),
        )
        sections.append(Section("judgement", "Plants and limits", notes, judged))
        sections.append(Section("runs", "Runs", (), (run_table({"": runs}),)))
    return Page("Validation", lead, tuple(sections), remade_by)
