"""What `cranectl validate` says at its end: tables, failures, JSON, exit code."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import click

from cranectl.cases.case import Case, CaseResult, Failure
from cranectl.cases.workers import Outcome
from cranectl.cli import exit_codes
from cranectl.cli.output import FAILED, PASSED, console, write_json
from cranectl.cli.screen import styled
from cranectl.report.run.tables import agreement_table, limit_notes, run_notes

SHOWN = 10  # failures shown on the screen


class Failed(NamedTuple):
    """What could not be run, and why; without controller and drive it is the whole scenario."""

    scenario: str  # as it was asked for
    controller: str | None
    drive: str | None
    failure: Failure


def report_validation(
    cases: Sequence[Case],
    outcome: Outcome,
    unloaded: Mapping[str, Failure],
    out: Path,
    json_file: str | None,
) -> int:
    """Say what came of `cases`, and why scenarios could not be loaded; returns the exit code."""
    pairs = list(zip(cases, outcome.results, strict=True))
    failed = [Failed(name, None, None, failure) for name, failure in unloaded.items()]
    failed += [
        Failed(c.source, c.controller, c.drive, result) for c, result in pairs if isinstance(result, Failure)
    ]
    finished = [result for _, result in pairs if isinstance(result, CaseResult)]
    lost = [case for case, result in pairs if result is None]
    code = exit_codes.of_validation([*outcome.results, *unloaded.values()], interrupted=outcome.interrupted)
    if finished or lost:
        screen = console(json_file)
        pairs_found = [judged for each in finished for judged in each.judged]
        agreements = [agreement for agreement, _ in pairs_found]
        unjudged = sum(agreement.passed is None for agreement in agreements)
        screen.print(agreement_table(agreements, [good for _, good in pairs_found]))
        why = "interrupted before it ran" if outcome.interrupted else "its worker process died"
        for note in (*limit_notes(agreements), *run_notes(finished)):
            screen.print(f"  {note}")
        for case in lost:
            name = f"{case.source}, {case.controller}, {case.drive}"
            screen.print(" ", styled(f"{name}: no result, {why}", "bold red"))
        screen.print(f"{sum(len(each.runs) for each in finished)} runs, logs in {out}")
        aside = [f"({unjudged} of {len(agreements)} pairs not judged)"] if unjudged else []
        screen.print("validation", PASSED if code == exit_codes.GOOD else FAILED, *aside)
    _tell(failed)
    write_json(json_file, _json(finished, failed, lost, passed=code == exit_codes.GOOD))
    return code


def _tell(failed: Sequence[Failed]) -> None:
    """Say on standard error why cases could not be run, each reason once for a scenario."""
    screen = console("-")
    alike: dict[tuple[str, Failure], list[str]] = {}
    for each in failed:
        name = ", ".join(part for part in (each.scenario, each.controller, each.drive) if part is not None)
        alike.setdefault((each.scenario, each.failure), []).append(name)
    for (scenario, failure), names in list(alike.items())[:SHOWN]:
        name = names[0] if len(names) == 1 else f"{scenario}, {len(names)} cases"
        screen.print(f"{name}: could not be run" if failure.bad_input else f"{name}: unforeseen")
        full_traceback = click.get_current_context().obj
        for line in (*failure.reason.splitlines(), *(failure.trace.splitlines() if full_traceback else ())):
            screen.print(line)
    if len(alike) > SHOWN:
        screen.print(f"and {len(alike) - SHOWN} more")


def _json(
    finished: Sequence[CaseResult], failed: Sequence[Failed], lost: Sequence[Case], *, passed: bool
) -> dict[str, Any]:
    return {
        "passed": passed,
        "runs": [run.to_json() for result in finished for run in result.runs],
        "agreements": [agreement.to_json() for result in finished for agreement in result.agreements],
        "failed": [
            {
                "scenario": each.scenario,
                "controller": each.controller,
                "drive": each.drive,
                "reason": each.failure.reason,
                "bad_input": each.failure.bad_input,
            }
            for each in failed
        ],
        "lost": [
            {"scenario": case.scenario.name, "controller": case.controller, "drive": case.drive}
            for case in lost
        ],
    }
