"""`cranectl validate`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli import exit_codes
from cranectl.cli.options import drive_option, json_option, scenario_options

if TYPE_CHECKING:
    from cranectl.cases import Case
    from cranectl.parallel import Outcome


@click.command("validate")
@click.argument("scenarios", metavar="[SCENARIO]...", nargs=-1)
@click.option("--controller", "controllers", metavar="NAME", multiple=True, help="Default: all; repeatable.")
@drive_option(default="both")
@scenario_options
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("logs"),
    show_default=True,
    help="Directory for the logs.",
)
@click.option(
    "--jobs", metavar="N", type=click.IntRange(min=1), help="Worker processes. Default: one for each core."
)
@json_option
def validate_command(
    scenarios: tuple[str, ...],
    controllers: tuple[str, ...],
    drive: str,
    rig: Path | None,
    overrides: tuple[str, ...],
    out: Path,
    jobs: int | None,
    json_file: str | None,
) -> int:
    """Run scenarios with all controllers and drives on both plants and judge the agreement.

    The limits and their reasons are in validation/tolerances.toml.

    \b
    cranectl validate
    cranectl validate fixed-position --controller lqr --drive ideal --json -
    cranectl validate --jobs 1 --set rig.load_mass=2.5
    """
    from cranectl.cases import default_log, make_case
    from cranectl.cli.output import progress_bar
    from cranectl.design import CONTROLLERS, checked_controller
    from cranectl.parallel import available_cores, run_cases
    from cranectl.plants.interface import DRIVES
    from cranectl.scenario import load_scenario, scenario_names
    from cranectl.simulate import checked_drive

    names = [checked_controller(name) for name in dict.fromkeys(controllers)] or CONTROLLERS
    drives = DRIVES if drive == "both" else (checked_drive(drive),)
    loaded = [
        load_scenario(name, rig=rig, overrides=overrides)
        for name in dict.fromkeys(scenarios) or scenario_names()
    ]
    cases = [
        make_case(scenario, controller=name, drive=kind, log=default_log(out, scenario, name, kind))
        for scenario in loaded
        for name in names
        for kind in drives
    ]
    with progress_bar(sum(case.simulated_seconds for case in cases)) as (advance, describe):

        def done(case: "Case") -> None:
            describe(f"{case.scenario.name}, {case.controller}")
            advance(case.simulated_seconds)

        outcome = run_cases(cases, jobs=jobs or available_cores(), done=done)
    return _report(cases, outcome, out, json_file)


def _report(cases: Sequence["Case"], outcome: "Outcome", out: Path, json_file: str | None) -> int:
    from cranectl.cli.output import FAILED, PASSED, agreement_table, console, run_notes, write_json

    results = outcome.results
    finished = [result for result in results if result is not None]
    runs = [run for result in finished for run in result.runs]
    judged = [(result.agreement, result.passed) for result in finished if result.agreement is not None]
    agreements = [agreement for agreement, _ in judged]
    lost = [case for case, result in zip(cases, results, strict=True) if result is None]
    code = exit_codes.of_validation(results, interrupted=outcome.interrupted)
    passed = code == exit_codes.GOOD
    screen = console(json_file)
    screen.print(agreement_table(agreements, [good for _, good in judged]))
    for note in run_notes(finished):
        screen.print(f"  {note}", soft_wrap=True)
    for case in lost:
        why = "interrupted before it ran" if outcome.interrupted else "its worker process died"
        name = f"{case.scenario.name}, {case.controller}, {case.drive}"
        screen.print(f"  [bold red]{name}: no result, {why}[/]", soft_wrap=True)
    screen.print(f"{len(runs)} runs, logs in {out}", soft_wrap=True)
    screen.print(f"validation {PASSED if passed else FAILED}")
    write_json(
        json_file,
        {
            "passed": passed,
            "runs": [run.to_json() for run in runs],
            "agreements": [agreement.to_json() for agreement in agreements],
            "lost": [
                {"scenario": case.scenario.name, "controller": case.controller, "drive": case.drive}
                for case in lost
            ],
        },
    )
    return code
