"""What `cranectl validate` prints of its cases."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl import report
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.output import Screen

if TYPE_CHECKING:
    from cranectl.cases import Failure, Validation
    from cranectl.compare import Agreement
    from cranectl.report import Table

SHOWN_FAILURES = 10  # failures, broken limits and notes shown on the screen


def print_results(validation: "Validation", code: int, out: Path, screen: Screen, *, details: bool) -> None:
    """Print the results of the cases, and on standard error why some could not be run."""
    finished, missing = validation.finished, validation.without_result
    if finished or missing:
        agreements, runs = validation.agreements, validation.runs
        unjudged = sum(agreement.passed is None for agreement in agreements)
        if details:
            screen.print(report.RunTables.agreement(agreements, validation.other_failures))
        else:
            screen.print_each(agreement_lines(agreements, validation.other_failures))
        judged = [result.runs for result in validation.judged]
        if (limits := report.RunTables.limits(judged, worst=SHOWN_FAILURES)) is not None:
            screen.print(limits if limits.rows else limits.note)
        notes = [*report.RunTables.limit_notes(agreements), *report.RunTables.run_notes(finished)]
        screen.print_each(notes[:SHOWN_FAILURES], indent="  ")
        if len(notes) > SHOWN_FAILURES:
            screen.print(f"  and {len(notes) - SHOWN_FAILURES} more notes, in --report FILE")
        for case in () if validation.interruption else missing:
            name = f"{case.source}, {case.controller}, {case.drive}"
            screen.print(" ", Screen.styled(f"{name}: no result, {validation.missing_reason}", "bold red"))
        logs = sum(result.log is not None for result in finished)
        logs_text = "logs" if logs == len(finished) else f"{logs} of {len(finished)} logs"
        screen.print(f"{len(runs)} runs, {logs_text} in {out}" if logs else f"{len(runs)} runs, no log kept")
        aside = [f"({unjudged} of {len(agreements)} pairs not judged)"] if unjudged else []
        if len(validation.plants) == 1:
            aside.append(f"(agreement not judged: {validation.plants[0]} is the only plant)")
        if validation.interruption:
            screen.print(Screen.styled(validation.interruption, "yellow"))
        else:
            screen.print("validation", Screen.PASSED if code == ExitCode.GOOD else Screen.FAILED, *aside)
    _print_failures(validation)


def agreement_lines(agreements: "Sequence[Agreement]", others: Sequence[str] = ()) -> "Iterator[Table | str]":
    """Yield a table with one row for each scenario, and one of the plants that disagree."""
    if agreements:  # a single plant has none
        yield report.RunTables.agreement_summary(agreements, others)
    if failed := [agreement for agreement in agreements if agreement.passed is False]:
        table = report.RunTables.agreement(failed[:SHOWN_FAILURES])
        yield replace(table, title=f"Plants that disagree: {len(failed)}")
        if len(failed) > SHOWN_FAILURES:
            yield f"  and {len(failed) - SHOWN_FAILURES} more, with --details"


def _print_failures(validation: "Validation") -> None:
    """Print why cases could not be run, each reason once for a scenario."""
    screen = Screen(stderr=True)
    alike: dict[tuple[str, Failure], list[str]] = {}
    for scenario, case, failure in validation.failures:
        name = scenario if case is None else f"{scenario}, {case.controller}, {case.drive}"
        alike.setdefault((scenario, failure), []).append(name)
    for (scenario, failure), names in list(alike.items())[:SHOWN_FAILURES]:
        name = names[0] if len(names) == 1 else f"{scenario}, {len(names)} cases"
        screen.print(f"{name}: could not be run" if failure.bad_input else f"{name}: unforeseen")
        full_traceback = click.get_current_context().obj.full_traceback
        screen.print_each(
            (*failure.reason.splitlines(), *(failure.trace.splitlines() if full_traceback else ()))
        )
    if len(alike) > SHOWN_FAILURES:
        screen.print(f"and {len(alike) - SHOWN_FAILURES} more")
