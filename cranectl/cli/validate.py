"""`cranectl validate`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli import exit_codes
from cranectl.cli.options import drive_option, json_option, scenario_options

if TYPE_CHECKING:
    from cranectl.cases import CaseResult


@click.command("validate")
@click.argument("scenarios", metavar="[SCENARIO]...", nargs=-1)
@click.option("--controller", "controllers", metavar="NAME", multiple=True, help="Default: all; repeatable.")
@drive_option
@scenario_options
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("logs"),
    show_default=True,
    help="Directory for the logs.",
)
@json_option
def validate_command(
    scenarios: tuple[str, ...],
    controllers: tuple[str, ...],
    drive: str,
    rig: Path | None,
    overrides: tuple[str, ...],
    out: Path,
    json_file: str | None,
) -> int:
    """Run scenarios with all controllers on both plants and judge the agreement.

    The limits and their reasons are in validation/tolerances.toml.

    \b
    cranectl validate
    cranectl validate fixed-position --controller lqr --json -
    """
    from cranectl.cases import default_log, make_case, run_case
    from cranectl.cli.output import progress_bar
    from cranectl.design import CONTROLLERS
    from cranectl.errors import unknown_name
    from cranectl.scenario import load_scenario, scenario_names
    from cranectl.simulate import checked_drive

    for name in controllers:
        if name not in CONTROLLERS:
            raise unknown_name("controller", name, CONTROLLERS)
    loaded = [
        load_scenario(name, rig=rig, overrides=overrides)
        for name in dict.fromkeys(scenarios) or scenario_names()
    ]
    kind = checked_drive(drive)
    cases = [
        make_case(
            scenario, controller=controller, drive=kind, log=default_log(out, scenario, controller, kind)
        )
        for scenario in loaded
        for controller in dict.fromkeys(controllers) or CONTROLLERS
    ]
    results = []
    with progress_bar(sum(case.simulated_seconds for case in cases)) as (advance, describe):
        for case in cases:
            describe(f"{case.scenario.name}, {case.controller}")
            results.append(run_case(case, progress=advance))
            if results[-1].interrupted:
                break
    return _report(results, out, json_file)


def _report(results: Sequence["CaseResult"], out: Path, json_file: str | None) -> int:
    from cranectl.cli.output import FAILED, PASSED, agreement_table, console, run_notes, run_table, write_json

    runs = [run for result in results for run in result.runs]
    agreements = [result.agreement for result in results if result.agreement is not None]
    code = exit_codes.of_results(results)
    passed = code == exit_codes.GOOD
    screen = console(json_file)
    screen.print(run_table(runs))
    for note in run_notes(runs):
        screen.print(f"  {note}", soft_wrap=True)
    screen.print(agreement_table(agreements))
    screen.print(f"logs: {out}", soft_wrap=True)
    screen.print(f"validation {PASSED if passed else FAILED}")
    write_json(
        json_file,
        {
            "passed": passed,
            "runs": [run.to_json() for run in runs],
            "agreements": [agreement.to_json() for agreement in agreements],
        },
    )
    return code
